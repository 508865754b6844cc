"""Refinement and assembly of one subdomain against element loops of the monolithic solve."""

import numpy as np
import pytest
from reference import monolithic
from support.generated_meshes import generate
from support.subdomains import cut

from feti_homog.case.cell_section import Cell
from feti_homog.fem.assembly import assemble, element_strain
from feti_homog.fem.problem import PLANE
from feti_homog.mesh.mesh_fibres import unwrap
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.refinement import ReferenceLattice, refine

STIFFNESS = np.array([[5.0, 1.5, 0.4], [1.5, 3.0, -0.2], [0.4, -0.2, 1.2]])
ISOTROPIC = {nu: np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, 0.5 - nu]]) / (1 - 2 * nu) for nu in (0.3, 0.4999)}
LATTICES = [(0, 1), (2, 1), (0, 2), (1, 2)]


@pytest.fixture(scope="module")
def torus():
    cell = Cell(geometry="hexagonal", fibre_fraction=0.5, mesh_size=0.25)
    return Torus.of(generate(cell))


@pytest.fixture(params=LATTICES, ids=lambda p: f"refine{p[0]}-order{p[1]}")
def lattice(request):
    return ReferenceLattice.of(*request.param)


@pytest.fixture(params=range(3), ids=["matrix", "fibre", "cut-fibre"])
def mesh(torus, lattice, request):
    return refine(list(cut(torus, torus.constituent))[request.param], lattice)


@pytest.mark.parametrize("poisson", [None, *ISOTROPIC])
def test_stiffness_and_loads_are_those_of_element_loops(mesh, poisson):
    """Mixed elements are held against the saddle point problem of each."""
    n, L, is_mixed = mesh.n_classes, ISOTROPIC.get(poisson, STIFFNESS), poisson is not None
    if is_mixed and mesh.lattice.order == 1:
        pytest.skip("linear elements are not mixed")
    K, Q, area = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 3)), 0.0
    for triangle in mesh.triangles:
        k, q, own = monolithic.element(mesh.points[triangle], L, is_mixed)
        dofs = (2 * mesh.node_class[triangle][:, None] + [0, 1]).ravel()
        np.add.at(K, (dofs[:, None], dofs), k)
        np.add.at(Q, dofs, q)
        area += own
    body = assemble(mesh, L, mixed=is_mixed)
    assert mesh.curved.any() and (~mesh.curved).any()
    assert np.abs(body.K - K).max() < 1e-12 * np.abs(K).max()
    assert np.abs(body.Q - Q).max() < 1e-12 * np.abs(Q).max()
    assert body.areas.sum() == pytest.approx(area, rel=1e-12)


def test_changes_of_one_stiffness_leave_later_ones_alone(mesh):
    """Meshes with equal classes share the order of their sums, not the arrays of K."""
    first = assemble(mesh, STIFFNESS).K
    expected = first.toarray()
    for array in (first.data, first.indices, first.indptr):
        array[:] = 0
    assert (assemble(mesh, STIFFNESS).K.toarray() == expected).all()


def test_stiffness_is_symmetric_and_narrow(mesh):
    K = assemble(mesh, STIFFNESS).K
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()
    assert K.has_canonical_format
    assert K.indices.dtype == K.indptr.dtype == np.int32
    assert {a.dtype for a in (mesh.nodes, mesh.triangles, mesh.node_class)} == {np.dtype(np.int32)}


def test_only_triangles_off_the_circles_are_affine(mesh):
    corners = mesh.points[mesh.nodes[:, :3]]
    straight = np.einsum("qk,tkd->tqd", mesh.lattice.nodes / mesh.lattice.intervals, corners)
    bent = np.abs(mesh.points[mesh.nodes] - straight).max(axis=(1, 2)) > 1e-12
    assert not (bent & ~mesh.curved).any()
    assert np.array_equal(bent, mesh.curved) or mesh.lattice.intervals == 1


def test_uniform_strain_is_that_of_every_element(mesh):
    gradient = np.array([[0.3, -0.1], [0.4, 0.2]])
    inner = np.flatnonzero(np.bincount(mesh.node_class) == 1)
    u = np.zeros((mesh.n_classes, 2))
    u[mesh.node_class] = mesh.points @ gradient.T
    whole = np.isin(mesh.node_class[mesh.triangles], inner).all(axis=1)
    strain = element_strain(mesh.points, mesh.triangles, u[mesh.node_class], PLANE)
    assert whole.any()
    assert strain[whole] == pytest.approx(np.tile([0.3, 0.2, 0.3], (whole.sum(), 1)))


def test_fibres_close_when_unwrapped_and_the_matrix_winds_around(torus):
    """The matrix winds around the torus; a fibre that the boundary cuts closes once its parts are shifted."""
    matrix, *fibres = cut(torus, torus.constituent)
    assert not unwrap(matrix)[1]
    for fibre in fibres:
        shift, closes = unwrap(fibre)
        corners = fibre.points[fibre.triangles] + shift[:, None]
        assert closes
        assert np.ptp(corners.reshape(-1, 2), axis=0) == pytest.approx(2 * fibre.circles[:, 2].max(), rel=0.05)
        assert bool(shift.any()) == (len(fibre.points) > len(fibre.class_keys))
