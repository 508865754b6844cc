"""Nodes debonded from the start, at any number of ranks, bodies and pieces."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from support import cases
from support.cases import FIBRE, MATRIX
from support.ranks import parallel_assert, write_once
from support.whole_meshes import coarse_mesh
from unit.mesh.faulty_meshes import ALL_SIDES, RIGHT_SIDE, grid

from feti_homog import Case
from feti_homog.errors import CaseError
from feti_homog.homogenization.unit_cell import tear
from feti_homog.mesh.arrange import arrange
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.parallel

CIRCULAR = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.2}
SQUARE = CIRCULAR | {"geometry": "square"}
RANDOM = CIRCULAR | {"geometry": "random", "fibres": 5, "fibre_fraction": 0.45, "min_gap": 0.15, "seed": 3}
ARC = {"fibre": "all", "angle": 60.0}


def case_of(cell, debonded, folder=".", subdomains=None, **sections):
    cut = {"subdomains": subdomains} if subdomains else {}
    sections = {"interface": {"debonded": debonded}, "decomposition": cut} | sections
    return cases.case_of(cell, folder, petsc={}, **sections)


def torn(case, comm):
    """Return the torn cell; number, direction and state of all interface nodes by the opening, on every rank."""
    PETSc.garbage_cleanup(comm)
    cell = tear(case, comm, Progress(comm, quiet=True))
    number = cell.summary.numbers[cell.solver.jump_operator.nodes.fibre]

    def nodes(opening=None):
        parts = comm.allgather((number, cell.directions, cell.debonded(opening)))
        return [np.concatenate(p) for p in zip(*parts, strict=True)]

    return cell, nodes


def edges_inside(case, arcs):
    """For each fibre with arcs (centre, angle): its coarse edges on the torus whose middle is within one of them."""
    mesh, arrangement = coarse_mesh(case, MPI.COMM_SELF), arrange(case.cell)
    size = np.array([mesh.width, mesh.height])
    middle = mesh.points[mesh.arc_edges].mean(axis=1)
    found = {}
    for fibre, own in arcs.items():
        offset = middle - arrangement.centres[fibre - 1]
        offset -= np.round(offset / size) * size
        on_fibre = np.linalg.norm(offset, axis=1) < arrangement.radii[fibre - 1]
        angle = np.degrees(np.arctan2(offset[:, 1], offset[:, 0]))
        away = [np.abs((angle - centre + 180) % 360 - 180) < opening / 2 for centre, opening in own]
        found[fibre] = [np.count_nonzero(on_fibre & within) for within in away]
    return found


def check(comm, case, nodes, cell, arcs, opening=None):
    """Tips are bonded nodes, and a chain of e edges of M intervals has e M - 1 debonded nodes."""
    number, direction, state = nodes(opening)
    edges = comm.bcast(edges_inside(case, arcs) if comm.rank == 0 else None)
    for fibre in range(1, cell.summary.fibres + 1):
        own = number == fibre
        for centre, angle in arcs.get(fibre, []):
            for tip in (centre - angle / 2, centre + angle / 2):
                away = np.abs((direction[own] - tip + 180) % 360 - 180)
                parallel_assert(comm, away.min() < 1e-9 and not state[own][np.argmin(away)], f"{fibre}, {tip}")
        chains = edges.get(fibre, [])
        expected = sum(e * cell.lattice.intervals - 1 for e in chains)
        parallel_assert(comm, np.count_nonzero(state[own]) == expected, f"fibre {fibre}")
        parallel_assert(comm, min(chains, default=1) > 0, f"fibre {fibre}")


@pytest.mark.parametrize(
    "cell",
    [RANDOM | {"order": 2}, RANDOM | {"bodies": "plane", "refine": 1}, SQUARE | {"refine": 1}, CIRCULAR | {"order": 2}],
    ids=str,
)
def test_tips_are_nodes_and_stay_bonded(comm, cell):
    case = case_of({"order": 1} | cell, [ARC])
    cell, nodes = torn(case, comm)
    fibres = cell.summary.fibres
    check(comm, case, nodes, cell, {fibre: [(0.0, 60.0)] for fibre in range(1, fibres + 1)})


def test_several_arcs_debond_the_chosen_fibres_only(comm):
    arcs = [
        {"fibre": [1, 4], "angle": 40.0, "centre": 200.0},
        {"fibre": 4, "angle": 30.0},
        {"fibre": 2, "angle": 100.0, "centre": -170.0},
    ]
    case = case_of(RANDOM, arcs, subdomains=9)
    cell, nodes = torn(case, comm)
    check(comm, case, nodes, cell, {1: [(200.0, 40.0)], 2: [(-170.0, 100.0)], 4: [(200.0, 40.0), (0.0, 30.0)]})
    number, _, state = nodes()
    parallel_assert(comm, not state[np.isin(number, [3, 5])].any())


def test_a_tip_beside_a_crossing_is_the_crossing(comm):
    """The side of the cell crosses the fibre at its corner at 90 degrees, which becomes the tip."""
    case = case_of(CIRCULAR, [{"fibre": 1, "centre": 60.0, "angle": 60.04}])
    _, nodes = torn(case, comm)
    number, direction, state = nodes()
    near = (number == 1) & (np.abs(direction - 90.0) < 1e-9)
    parallel_assert(comm, near.sum() == 1 and not state[near].any())
    inside = (number == 1) & (direction > 29.99) & (direction < 89.9)
    parallel_assert(comm, np.array_equal(np.flatnonzero(state), np.flatnonzero(inside)))


@pytest.mark.parametrize(("order", "refine", "bodies"), [(1, 0, "plane"), (2, 0, "torus"), (2, 1, "torus")])
def test_the_debonded_curve_of_a_mesh_is_debonded(comm, shared_path, order, refine, bodies):
    cell = {"geometry": "mesh", "file": "grid.msh", "order": order, "refine": refine, "bodies": bodies}
    for lines, vertices in ((RIGHT_SIDE, 1), (ALL_SIDES, 8)):
        write_once(comm, grid().with_curve(lines), shared_path / "grid.msh")
        torn_cell, nodes = torn(case_of(cell, [], shared_path, 3), comm)
        _, direction, state = nodes()
        inner = len(lines) * (torn_cell.lattice.intervals - 1)
        parallel_assert(comm, np.count_nonzero(state) == inner + vertices)
        if lines == RIGHT_SIDE:
            parallel_assert(comm, bool(np.all(np.abs(direction[state]) < 44.99)))
        comm.barrier()


def test_a_debonded_curve_and_arcs_add_up(comm, shared_path):
    write_once(comm, grid().with_curve(RIGHT_SIDE), shared_path / "grid.msh")
    cell = {"geometry": "mesh", "file": "grid.msh"}
    _, nodes = torn(case_of(cell, [{"fibre": 1, "centre": 180.0, "angle": 10.0}], shared_path), comm)
    _, direction, state = nodes()
    found = np.round(np.abs(np.sort(direction[state])), 9).tolist()
    parallel_assert(comm, found in ([0.0, 180.0], [180.0, 0.0]))
    comm.barrier()


def test_without_an_interface_section_all_is_bonded(comm, shared_path):
    write_once(comm, grid().with_curve(RIGHT_SIDE), shared_path / "grid.msh")
    case = case_of({"geometry": "mesh", "file": "grid.msh"}, [], shared_path)
    document = {name: section for name, section in case.resolved().items() if name != "interface"}
    _, nodes = torn(Case.parse(document, shared_path), comm)
    parallel_assert(comm, not nodes()[2].any())
    comm.barrier()


def test_arcs_of_fibres_that_are_not_there_are_refused(comm):
    arcs = [{"fibre": [1, 7], "angle": 60.0}, {"fibre": 6, "angle": 60.0}, {"fibre": 5, "angle": 60.0}]
    with pytest.raises(CaseError) as caught:
        tear(case_of(RANDOM, arcs), comm, Progress(comm, quiet=True))
    first, second = caught.value.faults
    expected = "expected at most 5; the cell has 5 fibres, counted from 1"
    assert first == f"[interface] debonded[0].fibre = [1, 7]: {expected}"
    assert second == f"[interface] debonded[1].fibre = 6: {expected}"


def test_arcs_of_fibres_without_an_interface_between_the_pair_are_refused(comm):
    cell = RANDOM | {"mix": {"glass": 0.25, "carbon": 0.2}, "min_gap": 0.05}
    del cell["fibre_fraction"]
    arcs = [{"fibre": [1, 5], "centre": 0.0, "angle": 60.0}]
    interfaces = [{"between": ["matrix", "glass"]}, {"between": ["matrix", "carbon"], "debonded": arcs}]
    case = case_of(
        cell, [], interface=interfaces, material={"matrix": MATRIX, "glass": FIBRE, "carbon": FIBRE}
    )  # fibres of carbon come first
    with pytest.raises(CaseError) as caught:
        tear(case, comm, Progress(comm, quiet=True))
    words = "[interface 2] debonded[0].fibre: fibre 5 has no interface between matrix and carbon"
    assert caught.value.faults == (f"{words}; the first with one: 1, 2",)


def test_arcs_of_a_fibre_without_centre_are_refused(comm, shared_path):
    write_once(comm, grid(lambda x, y: abs(y - 0.5) < 0.25), shared_path / "grid.msh")
    cell = {"geometry": "mesh", "file": "grid.msh"}
    with pytest.raises(CaseError, match=r'^\[interface\] debonded\[0\].fibre = "all": fibre 1 has no centre, for it'):
        tear(case_of(cell, [ARC], shared_path), comm, Progress(comm, quiet=True))
    _, nodes = torn(case_of(cell, [ARC | {"angle": 360.0}], shared_path), comm)
    parallel_assert(comm, len(nodes()[2]) == 8 and bool(nodes()[2].all()))
    comm.barrier()
