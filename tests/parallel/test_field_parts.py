"""Fields of torn cells: the numbers of fibres and of the nodes on their faces, at any number of ranks and pieces."""

import json
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.ranks import parallel_assert

from feti_homog import Case, run
from feti_homog.analysis.result import Result
from feti_homog.mesh.arrange import arrange

pytestmark = pytest.mark.parallel

CELL = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.2}
CELLS = {
    "torn by the cell": CELL | {"bodies": "plane"},
    "quadratic": CELL | {"order": 2},
    "refined": CELL | {"geometry": "square", "refine": 1},
    "random": CELL | {"geometry": "random", "fibres": 4, "seed": 2, "min_gap": 0.1},
}


@pytest.fixture(scope="module", params=CELLS)
def computed(request: Any) -> Result:
    """Provide a cell in 7 pieces, half of each fibre debonded and in contact."""
    sections = {"interface": {"debonded": [{"fibre": "all"}]}, "decomposition": {"subdomains": 7}}
    case = case_of(CELLS[request.param], angle={"values": [180.0], "strain": [0.1, -0.05, 0.02]}, **sections)
    return run(case, MPI.COMM_WORLD, fields=True)


def test_both_faces_of_an_interface_node_are_nodes_of_the_mesh(comm: Any, computed: Result) -> None:
    """At its place, in its fibre and in the matrix; and their displacements are apart by the jump."""
    whole = computed.fields.gathered()
    parallel_assert(comm, whole is None or _faces_fit(whole))


def _faces_fit(whole: Any) -> bool:
    mesh, interface, (state,) = whole.mesh, whole.interface, whole.states
    body = np.full(len(mesh.points), -1)
    body[mesh.triangles] = mesh.body[:, None]
    np.testing.assert_array_equal(body[interface.fibre_node], interface.fibre)
    np.testing.assert_array_equal(body[interface.matrix_node], 0)
    np.testing.assert_array_equal(mesh.points[interface.fibre_node], interface.points)
    period = np.array([whole.header.width, whole.header.height])
    away = mesh.points[interface.matrix_node] - interface.points
    np.testing.assert_allclose(away, np.round(away / period) * period, atol=1e-12)
    tangent = np.column_stack([-interface.normal[:, 1], interface.normal[:, 0]])
    E11, E22, gamma12 = state.strain
    fluctuation = state.displacement - mesh.points @ [[E11, gamma12 / 2], [gamma12 / 2, E22]]
    apart = fluctuation[interface.matrix_node] - fluctuation[interface.fibre_node]
    jump = np.column_stack([(frame * apart).sum(axis=1) for frame in (interface.normal, tangent)])
    size = np.abs(state.displacement).max()
    np.testing.assert_allclose(jump, state.jump, atol=1e-7 * size)
    return bool(np.abs(jump).max() > 1e-3 * size)


def test_fibres_have_the_numbers_of_case_files(comm: Any, computed: Result) -> None:
    """That is the order in which they were arranged; on every rank, and in the fields."""
    result = computed
    arrangement = arrange(Case.parse(result.case).cell)
    size = np.array([result.cell.width, result.cell.height])
    assert [fibre.number for fibre in result.fibres] == list(range(1, len(arrangement.radii) + 1))
    for fibre, centre, radius in zip(result.fibres, arrangement.centres, arrangement.radii, strict=True):
        assert fibre.centre is not None and (fibre.centre >= 0).all() and (fibre.centre < size).all()
        away = fibre.centre - centre
        np.testing.assert_allclose(away, np.round(away / size) * size, atol=1e-9)
        assert fibre.radius == pytest.approx(radius, rel=1e-9) and fibre.phase == "fibre"
    whole = result.fields.gathered()
    parallel_assert(comm, whole is None or _same_fibres(result, whole))


def _same_fibres(result: Result, whole: Any) -> bool:
    fibres, interface = whole.fibres, whole.interface
    number = dict(zip(fibres.body.tolist(), fibres.number.tolist(), strict=True))
    assert [number[body] for body in interface.fibre.tolist()] == interface.fibre_number.tolist()
    assert json.loads(whole.header.case) == result.case
    np.testing.assert_array_equal(fibres.centre, np.array([fibre.centre for fibre in result.fibres]))
    np.testing.assert_array_equal(fibres.radius, [fibre.radius for fibre in result.fibres])
    return fibres.number.tolist() == [fibre.number for fibre in result.fibres]
