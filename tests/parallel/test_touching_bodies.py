"""Bodies that touch themselves or another twice at a node, where they never part.

Images of pixels are compared with other solvers, with nodes moved a little, and turned.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from reference.condensed_cell import CondensedCell, MixedLoad
from reference.dense_feti import DenseDual, gathered, matrix
from reference.touching_bodies import TouchingBodies
from scipy.linalg import null_space
from support import torn_cells
from support.cases import FIBRE, MATRIX, case_of, make_case, monolithic_stiffness, relative_error, solve
from support.pixel_images import SYMMETRIES, pixel_mesh, random_image, turned
from unit.mesh.faulty_meshes import MshFile

from feti_homog import run
from feti_homog.errors import MeshError
from feti_homog.feti.decomposition.shared_entities import share_entities
from feti_homog.materials.laws import plane_stiffness
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.refinement import ReferenceLattice
from feti_homog.mesh.submeshes import SubdomainTable, cut_for_ranks, pinned_classes
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.verify.certificate import verify

pytestmark = pytest.mark.parallel
# Of random_image(8, seed): the nodes where three bodies meet, and where two touch.
TRIPLE, TOUCHING = {1: 1, 2: 2, 3: 1}, {1: 1, 2: 2, 3: 2}
STRAIN = np.array([0.02, -0.01, 0.015])
SPRINGS = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0}
INFLUENCE = {"feti_pc_type": "influence"}
STRENGTHS = {"normal_strength": 5.0, "tangential_strength": 5.0}
KINDS: dict[str, dict[str, Any]] = {
    "path": {"interface": STRENGTHS, "path": {"strain": [0.06, 0.0, 0.02]}},
    "envelope": {
        "cell": {"bodies": "plane"},
        "interface": SPRINGS | {"criterion": "energy", "toughness": 0.02},
        "envelope": {"plane": ["S11", "S12"], "directions": 4},
    },
    "load": {
        "cell": {"refine": 1},
        "interface": SPRINGS,
        "load": {"to": {"E11": 0.02, "S13": 0.1, "temperature": -50.0}},
        "plane": "generalized",
    },
    "stiffness": {"cell": {"order": 2}, "interface": {}},
}


def cell_of(comm: Any, path: Any, mesh: MshFile, **cell: Any) -> dict[str, Any]:
    """Return the section of a cell with that mesh in a file. Collective."""
    on_root(comm, mesh.write, path / "pixels.msh")
    return {"geometry": "mesh", "file": str(path / "pixels.msh")} | cell


@pytest.mark.parametrize("size, refine, order", [(8, 1, 1), (8, 0, 2), (32, 0, 1)])
def test_bonded_bodies_that_touch_are_one_solid(comm: Any, shared_path: Any, size: int, refine: int, order: int):
    """Against one solve without tearing, with nodes on the pixels and off them."""
    stiffness = []
    for jitter in (0.0, 1e-9, 1e-3) if size == 8 else (0.0,):
        mesh = pixel_mesh(random_image(size, 1), jitter)
        torn, L, _ = solve(make_case(**cell_of(comm, shared_path, mesh, refine=refine, order=order)), comm)
        assert Torus.of(read(shared_path / "pixels.msh")).touching.any()
        assert relative_error(L, monolithic_stiffness(torn)) < 1e-9
        torn.destroy()
        stiffness.append(L)
    assert all(relative_error(L, stiffness[0]) < 1e-8 for L in stiffness[1:2])


@pytest.mark.one_rank
@pytest.mark.parametrize("debonded", [False, True])
def test_symmetries_of_the_square_turn_the_response(comm: Any, shared_path: Any, debonded: bool):
    image, found = random_image(8, 2), []
    for symmetry in (SYMMETRIES[0], SYMMETRIES[1], SYMMETRIES[4], SYMMETRIES[7]):  # as is, turned and mirrored
        mesh, T = pixel_mesh(image, symmetry=symmetry), turned(symmetry)
        if debonded:
            stress, _ = loaded(comm, shared_path, mesh, turned(symmetry, of_strain=True) @ STRAIN, {})
            found.append(np.linalg.solve(T, stress))
        else:
            torn, L, _ = solve(make_case(**cell_of(comm, shared_path, mesh)), comm)
            torn.destroy()
            found.append(np.linalg.solve(T, np.linalg.solve(T, L).T))
    assert all(relative_error(own, found[0]) < 1e-8 for own in found[1:])


def debonded_lines(mesh: MshFile, share: float = 0.6) -> list[tuple[int, int]]:
    """Return a random share of the edges between fibre and matrix within the cell."""
    sides: dict[tuple[int, int], list[int]] = {}
    for _, phase, _, (a, b, c) in mesh.elements.values():
        for p, q in ((a, b), (b, c), (c, a)):
            sides.setdefault((min(p, q), max(p, q)), []).append(phase)
    between = [ends for ends, phases in sides.items() if len(set(phases)) == 2]
    chosen = np.random.default_rng(0).random(len(between)) < share
    return [ends for ends, own in zip(between, chosen, strict=True) if own]


def loaded(comm: Any, path: Any, mesh: MshFile, strain: np.ndarray, springs: dict[str, float]) -> tuple[Any, Any]:
    """Sigma under a strain, with debonded lines that touch or not, and the result.  Collective."""
    load = dict(zip(("E11", "E22", "gamma12"), strain.tolist(), strict=True))
    cell = cell_of(comm, path, mesh.with_curve(debonded_lines(mesh)))
    case = case_of(cell, load={"to": load}, interface=springs, petsc={"feti_ksp_rtol": 1e-10})
    result = run(case, comm, out=path / "out")
    return np.array(result.load.stress), result


def reference_stress(mesh: MshFile, springs: dict[str, float]) -> tuple[np.ndarray, int]:
    """Sigma by the quadratic programme, and in how many nodes bodies meet that never part."""
    case = make_case()
    L = np.array([plane_stiffness(case.materials[name], "strain") for name in ("matrix", "fibre")])
    tags, places = list(mesh.nodes), np.array(list(mesh.nodes.values()))[:, :2]
    triangles = np.searchsorted(tags, [nodes for *_, nodes in mesh.elements.values()])
    bodies = TouchingBodies(places, triangles, [phase - 1 for _, phase, *_ in mesh.elements.values()], L)
    lines = [places[np.searchsorted(tags, ends)] for ends in debonded_lines(mesh)]
    state = CondensedCell(bodies, True, tuple(springs.values()) or None).equilibrium(
        MixedLoad(STRAIN, np.zeros(3, bool)), bodies.bonded(lines)
    )
    return state.stress, len(bodies.held)


@pytest.mark.one_rank
@pytest.mark.parametrize("seed, springs", [(1, {}), (3, SPRINGS)], ids=str)
def test_debonded_bodies_that_touch_are_in_equilibrium(comm: Any, shared_path: Any, seed: int, springs: Any):
    """Against a quadratic programme that counts the sectors of each body by itself; by as much as nodes move."""
    stresses = []
    for jitter in (0.0, 1e-9, 1e-3):
        mesh = pixel_mesh(random_image(8, seed), jitter)
        stress, result = loaded(comm, shared_path, mesh, STRAIN, springs)
        expected, held = on_root(comm, reference_stress, mesh, springs)
        assert held == TRIPLE[seed] + TOUCHING[seed]
        assert result.remarks[0] == (
            f"[interface] nodes that never part: at {TRIPLE[seed]} three bodies meet, "
            f"at {TOUCHING[seed]} two bodies meet more than once"
        )
        assert relative_error(stress, expected) < 1e-8
        certificate = on_root(comm, verify, shared_path / "out")
        assert certificate.holds, certificate.text
        stresses.append(stress)
    assert relative_error(stresses[1], stresses[0]) < 1e-7 and relative_error(stresses[2], stresses[0]) < 1e-1


@pytest.mark.few_ranks
@pytest.mark.parametrize("kind", KINDS)
def test_results_of_every_kind_obey_their_laws(comm: Any, shared_path: Any, kind: str):
    sections = dict(KINDS[kind])
    cell = cell_of(comm, shared_path, pixel_mesh(random_image(8, 2)), **sections.pop("cell", {}))
    materials = {"matrix": MATRIX | {"expansion": 2e-5}, "fibre": FIBRE | {"expansion": 5e-6}}
    result = run(case_of(cell, material=materials, petsc={}, **sections), comm, out=shared_path / "out")
    certificate = on_root(comm, verify, shared_path / "out")
    assert result.status == "done" and certificate.holds, certificate.text


@pytest.mark.one_rank
def test_tips_do_not_cross_voids(comm: Any, shared_path: Any):
    """A fibre's side at a void ends at interface nodes, and is no interface."""
    image = random_image(8, 208, 0.5, 2, 0.1)
    cell = cell_of(comm, shared_path, pixel_mesh(image), voids=True)
    bonds = SPRINGS | {"criterion": "energy", "toughness": 0.02}
    path = {"strain": [0.06, 0.0, 0.02], "method": "increments", "increments": 2}
    run(case_of(cell, interface=bonds, path=path, petsc={}), comm, out=shared_path / "out")
    certificate = on_root(comm, verify, shared_path / "out")
    assert certificate.holds, certificate.text


@pytest.mark.parametrize("springs", [{}, SPRINGS], ids=["rigid", "springs"])
def test_influence_columns_are_the_inverse_where_three_bodies_meet(comm: Any, shared_path: Any, springs: Any):
    section = cell_of(comm, shared_path, pixel_mesh(random_image(8, 2)))
    cell = torn_cells.tear(comm, springs=tuple(springs.values()) or (None, None), petsc=INFLUENCE, **section)
    dense = DenseDual(cell)
    F, N = dense.F + np.diag(gathered(cell, cell.solver.operator.compliance)), null_space(dense.G.T)
    expected = N @ np.linalg.solve(N.T @ F @ N, N.T)
    assert relative_error(matrix(cell, cell.solver.preconditioner.apply), expected) < 1e-10
    assert np.linalg.norm(expected, 2) <= cell.solver.preconditioner.norm


@pytest.mark.parametrize("apart", [0.0, 1e-12])
def test_sides_folded_onto_each_other_are_refused(comm: Any, shared_path: Any, apart: float):
    """Their normals cancel, exactly or nearly: on all ranks, though one has the node, where the user's mesh has it."""

    def folded() -> Torus:
        mesh = pixel_mesh(np.pad(np.ones((2, 2), int), ((1, 5), (1, 5))))
        mesh = mesh.moved(**{f"n{tag}": (x + 2.0, y - 1.0) for tag, (x, y, _) in mesh.nodes.items()})
        mesh.write(shared_path / "square.msh")
        torus = Torus.of(read(shared_path / "square.msh"))
        points = torus.mesh.points.copy()
        ends = [np.flatnonzero((8 * points == place).all(axis=1))[0] for place in ((1, 2), (2, 1))]
        points[ends[1]] = points[ends[0]] + [apart, 0.0]
        return replace(torus, mesh=replace(torus.mesh, points=points))

    torus = on_root(comm, folded)
    subdomain = torus.constituent
    table = SubdomainTable.of(torus, subdomain, np.arange(2) % comm.size)
    own = list(cut_for_ranks(torus, subdomain, table, comm.size, pinned_classes(torus)))[comm.rank]
    with pytest.raises(MeshError, match=r"no normal at \(2.125, -0.875\)"):
        share_entities(comm, own, table, np.array([[-1, 0], [0, -1]]), ReferenceLattice.of(0, 1))
