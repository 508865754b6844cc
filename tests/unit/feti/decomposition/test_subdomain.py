"""Subdomains that no factorization should see."""

import re
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.sparse import diags
from support import torn_cells

from feti_homog.errors import MeshError
from feti_homog.feti.decomposition.subdomain import Subdomain
from feti_homog.feti.operators import interface_operators


@pytest.fixture(scope="module")
def subdomain():
    cell = torn_cells.tear(MPI.COMM_SELF, geometry="square", mesh_size=0.3)
    yield next(s for s in cell.subdomains if s.R.shape[1])
    cell.solver.destroy()


@pytest.mark.parametrize("component", [(0, 0), (2, 2)])
def test_a_stiffness_that_is_no_number_is_refused(subdomain, component):
    L = subdomain.L.copy()
    L[component] = np.nan
    with pytest.raises(MeshError, match=r"\|K R\| / \|K\| = nan, expected at most"):
        Subdomain.on(subdomain.submesh, subdomain.mesh, L, subdomain.problem)


def test_a_corner_that_is_nowhere_is_refused(subdomain):
    submesh = subdomain.submesh
    points = submesh.points.copy()
    points[submesh.triangles[0, 0]] = np.nan
    with pytest.raises(MeshError, match=r"refined elements of .* are inverted"):
        Subdomain.build(replace(submesh, points=points), subdomain.mesh.lattice, subdomain.L, subdomain.problem)


def test_inverted_elements_are_named_at_their_place_in_the_coordinates_of_the_user(subdomain):
    submesh = replace(subdomain.submesh, origin=np.array([20.0, -10.0]))
    triangle, side = np.argwhere(submesh.turns[submesh.triangle_edges])[0]  # an arc
    b, c, a = np.roll(submesh.triangles[triangle], -side)
    points = submesh.points.copy()
    points[a] = points[b] + points[c] - points[a]  # across the opposite side
    with pytest.raises(MeshError, match="are inverted") as error:
        Subdomain.build(replace(submesh, points=points), subdomain.mesh.lattice, subdomain.L, subdomain.problem)
    place = np.array([float(word) for word in re.findall(r"near \((\S+), (\S+)\)", str(error.value))[0]])
    low, high = points.min(axis=0), points.max(axis=0)
    assert (low < place - submesh.origin).all() and (place - submesh.origin < high).all()


@pytest.mark.parametrize("explicit", [True, False])
@pytest.mark.parametrize("inside", [True, False])
def test_a_stiffness_without_a_factor_is_one_line_that_names_its_subdomain(subdomain, explicit, inside):
    K, dofs = subdomain.assemble_stiffness(), np.arange(subdomain.n_dofs // 2)
    inner = np.isin(np.arange(subdomain.n_dofs), dofs) != inside
    submesh = replace(subdomain.submesh, origin=np.array([20.0, -10.0]))
    spoilt = replace(subdomain, submesh=submesh, _built_stiffness=(K - 1e9 * diags(1.0 * inner)).tocsr())
    x, y = submesh.points[0] + [20.0, -10.0]
    place = re.escape(f"near ({x:.6g}, {y:.6g}): ")
    with pytest.raises(MeshError, match=rf"subdomain \d+ \(fibre\) {place}.*not positive definite.*are degenerate$"):
        interface_operators._factor(spoilt, dofs, explicit, keep_factor=False)
