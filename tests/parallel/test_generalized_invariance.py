"""Generalized plane strain does not depend on axes, ranks, cuts, operators and coarse spaces."""

import numpy as np
import pytest
from mpi4py import MPI
from reference.spatial_forms import IN_PLANE, rotated, rotated_strain
from support.cases import make_case, solve
from support.generalized_phases import CRYSTAL, WOOD
from support.ranks import parallel_assert, write_once
from support.spatial_cells import EPOXY, GLASS, error, solved
from unit.mesh.faulty_meshes import MshFile, grid

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

EXACT = 1e-9
PHASES = {"matrix": WOOD, "fibre": CRYSTAL}
SWAPPED = [1, 0, 2, 4, 3, 5]
ARC = {"interface": {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 80.0}]}}


def hook(x, y):
    """Return a fibre without any symmetry, in a 4 x 4 grid."""
    return (int(4 * x), int(4 * y)) in {(1, 1), (2, 1), (2, 2)}


def moved(mesh: MshFile, place) -> MshFile:
    """Return the mesh with its nodes at place(x, y), its triangles counterclockwise."""
    nodes = {tag: (*place(x, y), 0.0) for tag, (x, y, _) in mesh.nodes.items()}
    a, b, c = (np.array(nodes[tag][:2]) for tag in next(iter(mesh.elements.values()))[3])
    way = 1 if np.linalg.det([b - a, c - a]) > 0 else -1
    return MshFile(nodes, {tag: (*e[:3], e[3][::way]) for tag, e in mesh.elements.items()})


@pytest.fixture
def result_of(comm, shared_path):
    """result_of(place, phases): that of the cell with the fibre `hook` whose nodes are moved.  Collective."""

    def made(place, phases):
        write_once(comm, moved(grid(hook), place), shared_path / "cell.msh")
        result = solved(comm, geometry="mesh", file="cell.msh", folder=shared_path, **phases)
        comm.barrier()
        return result

    return made


def same(found, expected, tolerance=EXACT):
    """Return whether two results have the same secants and thermal stress, under loads of either sign."""
    names = ("effective_stiffness", "thermal_stress", "effective_stiffness_compression", "thermal_stress_compression")
    pairs = [(getattr(found, name), getattr(expected, name)) for name in names]
    return all(one is other is None or error(one, other) < tolerance for one, other in pairs)


def swapped(phase):
    """Return an orthotropic phase with x1 and x2 exchanged."""
    names = {"E1": "E2", "E2": "E1", "nu13": "nu23", "nu23": "nu13", "G13": "G23", "G23": "G13"}
    a, b, c = phase["expansion"]
    nu21 = phase["nu12"] * phase["E2"] / phase["E1"]
    return {names.get(k, k): v for k, v in phase.items()} | {
        "nu12": nu21, "angle": -phase["angle"], "expansion": [b, a, c],
    }  # fmt: skip


def test_x1_and_x2_exchange(result_of):
    before = result_of(lambda x, y: (x, y), PHASES)
    after = result_of(lambda x, y: (y, x), {name: swapped(phase) for name, phase in PHASES.items()})
    C = before.effective_stiffness
    assert error(after.effective_stiffness, C[np.ix_(SWAPPED, SWAPPED)]) < EXACT
    assert error(after.thermal_expansion, before.thermal_expansion[SWAPPED]) < EXACT
    # And the cell is not one that would not notice.
    assert error(C, C[np.ix_(SWAPPED, SWAPPED)]) > 1e-2 and abs(C[0, 5]) > 1e-2 and abs(C[3, 4]) > 1e-2


def test_cell_turns_with_its_phases(result_of):
    before = result_of(lambda x, y: (x, y), PHASES)
    turned = {name: phase | {"angle": phase["angle"] + 90.0} for name, phase in PHASES.items()}
    after = result_of(lambda x, y: (1.0 - y, x), turned)
    assert error(after.effective_stiffness, rotated(before.effective_stiffness, np.pi / 2)) < EXACT
    assert error(after.thermal_expansion, rotated_strain(before.thermal_expansion, np.pi / 2)) < EXACT


def test_plane_strain_is_a_block(comm):
    cell = {"geometry": "hexagonal", "mesh_size": 0.2, "fibre_fraction": 0.4}
    phases = {name: {k: v for k, v in phase.items() if k != "expansion"} for name, phase in PHASES.items()}
    _, L, _ = solve(make_case(**phases, **cell), comm)
    C = solved(comm, **PHASES, **cell).effective_stiffness
    assert error(C[np.ix_(IN_PLANE, IN_PLANE)], L) < EXACT


@pytest.mark.parametrize("keys", [{"width": 3.0}, {"fibre_radius": 5e-6}], ids=str)
def test_glued_cell_has_no_length(comm, keys):
    cell = {"geometry": "random", "fibres": 3, "min_gap": 0.15}
    assert same(solved(comm, **PHASES, **cell, **keys), solved(comm, **PHASES, **cell))


@pytest.mark.parametrize("sections", [{}, ARC | {"decomposition": {"subdomains": 6}}], ids=["bonded", "contact"])
def test_each_rank_alone_finds_what_all_find(comm, sections):
    case = {"geometry": "hexagonal", "mesh_size": 0.25, "sections": sections} | PHASES
    parallel_assert(comm, same(solved(MPI.COMM_SELF, **case), solved(comm, **case)))


WAYS = {
    "cut": {"sections": {"decomposition": {"subdomains": 9}}},
    "small": {"sections": {"decomposition": {"max_dofs": 120}}},
    "bodies cut by the cell": {"bodies": "plane"},
    "implicit": {"petsc": {"feti_dual_operator": "implicit"}},
    "explicit": {"petsc": {"feti_dual_operator": "explicit"}},
    "adaptive": {
        "petsc": {"feti_coarse_space": "adaptive", "feti_pc_type": "dirichlet"},
        "sections": {"decomposition": {"subdomains": 9}},
    },
    "natural": {"petsc": {"feti_coarse_space": "natural"}, "sections": {"decomposition": {"subdomains": 9}}},
    "influence": {"petsc": {"feti_pc_type": "influence"}},
    "lumped, mumps": {"petsc": {"feti_pc_type": "lumped", "feti_sub_pc_factor_mat_solver_type": "mumps"}},
}


@pytest.mark.quick
@pytest.mark.parametrize("way", WAYS.values(), ids=WAYS)
def test_every_way_to_solve_gives_the_same(comm, way):
    cell = {"geometry": "hexagonal", "mesh_size": 0.12} | PHASES
    assert same(solved(comm, **cell, **way), solved(comm, **cell))


@pytest.mark.parametrize("contrast", [1e-3, 1e3])
@pytest.mark.parametrize("pieces", [{}, {"subdomains": 16}], ids=["whole", "cut"])
def test_axial_shear_takes_few_iterations(comm, contrast, pieces):
    fibre = {"young": contrast, "poisson": 0.2}
    cell = {"geometry": "hexagonal", "mesh_size": 0.08, "refine": 1, "order": 2}
    petsc = {"feti_ksp_rtol": 1e-10}
    result = solved(comm, matrix=EPOXY, fibre=fibre, **cell, petsc=petsc, sections={"decomposition": pieces})
    plane, axial = result.solver.iterations[:4], result.solver.iterations[4:]
    print(f"contrast {contrast:g}, {result.solver.subdomains} subdomains: {plane} and {axial} iterations")
    assert len(axial) == 2 and max(axial) < 30


@pytest.mark.parametrize("name", ["matrix", "fibre"])
def test_a_phase_without_expansion_leaves_it_unknown(comm, name):
    phases = {"matrix": dict(EPOXY), "fibre": dict(GLASS)}
    del phases[name]["expansion"]
    result = solved(comm, **phases)
    assert result.thermal_stress is None and result.thermal_expansion is None
    assert error(result.effective_stiffness, solved(comm).effective_stiffness) < EXACT
