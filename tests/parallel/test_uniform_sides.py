"""Uniform displacements and tractions on the sides: direct solves, bounds of the periodic cell, closed forms, laws."""

from dataclasses import replace

import gmsh
import numpy as np
import pytest
from mpi4py import MPI
from reference.uniform_sides import stiffness
from support.pixel_images import pixel_mesh, random_image
from support.unmatched_meshes import discs_in, write_discs

from feti_homog.analysis.runner import compute
from feti_homog.case.cases import Case
from feti_homog.homogenization import unit_cell
from feti_homog.materials import laws
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

BOUNDARIES = ["traction", "displacement"]
RADIUS, SEVERAL = 0.17, (5, 7, 6, 9)
SOFT = {"young": 1.0, "poisson": 0.35, "expansion": 3e-5}
CARBON = {"E_axial": 30.0, "E_transverse": 12.0, "nu_axial": 0.25, "nu_transverse": 0.3, "G_axial": 9.0}
CARBON |= {"expansion_axial": -1e-6, "expansion_transverse": 8e-6}
GLASS = {"young": 20.0, "poisson": 0.2, "expansion": 5e-6}
TURNED = {"E1": 1.3, "E2": 1.0, "E3": 2.0, "nu12": 0.3, "nu13": 0.2, "nu23": 0.25, "G12": 0.5, "G13": 0.6, "G23": 0.4}
TURNED |= {"angle": 30.0}
SPRINGS = {"normal_stiffness": 8.0, "tangential_stiffness": 3.0, "axial_stiffness": 5.0, "contact": False}
ARCS = {"debonded": [{"fibre": "all", "centre": 40.0, "angle": 130.0}], "contact": False}
BONDS = {"rigid": None, "springs": SPRINGS, "arcs": ARCS, "both": SPRINGS | ARCS}


def discs(comm, path, seed, count=9, **options):
    """Write a mesh with unmatched sides, at which fibres are cut.  Collective."""
    if comm.rank == 0:
        options = {"size": 0.15, "several": SEVERAL, "origin": (2.0, -3.0)} | options
        write_discs(path, discs_in(1.0, 1.0, count, RADIUS, seed), RADIUS, **options)
    comm.barrier()
    return path


def document(mesh, boundary, interface=None, matrix=SOFT, fibre=GLASS, plane="generalized", cell=(), **sections):
    """Return a case as a document."""
    case = {
        "cell": {"geometry": "mesh", "file": str(mesh), "boundary": boundary} | dict(cell),
        "material": {"matrix": matrix} | ({} if fibre is None else {"fibre": fibre}),
        "analysis": {"type": "stiffness", "plane": plane},
        "petsc": {"feti_ksp_rtol": 1e-12},
        "output": {"pictures": False, "mesh_error": False},
    }
    return case | ({} if interface is None else {"interface": interface}) | sections


def solved(comm, *given, **case):
    """Return the apparent stiffness of a case.  Collective."""
    return np.asarray(compute(Case.parse(document(*given, **case)), comm).effective_stiffness)


def reference(comm, case):
    """Return the stiffness and the thermal stress by the direct solve, on every rank.  Collective."""
    with case_options(case.petsc):
        cell = unit_cell.tear(case, comm, Progress(comm, quiet=True))
    parts = []
    for s in cell.subdomains:
        body = np.repeat(s.submesh.constituent, len(s.mesh.lattice.triangles))
        parts.append((s.mesh.points, s.mesh.triangles, body))
    nodes, open_nodes = cell.solver.jump_operator.nodes, cell.debonded(None)
    bonds = []
    for k in range(len(nodes.row) if case.interface is not None else 0):
        n1, n2 = nodes.normal[k]
        axes = np.array([[n1, n2, 0.0], [-n2, n1, 0.0], [0.0, 0.0, 1.0]])
        values = [getattr(case.interface, f"{name}_stiffness") for name in ("normal", "tangential", "axial")]
        K = None if open_nodes[k] else axes.T @ np.diag(np.array(values, float)) @ axes * nodes.length[k]
        if open_nodes[k] or values[0] is not None:
            bonds.append((nodes.points[k], K, *nodes.bodies[k].tolist()))
    parts, bonds = comm.allgather(parts), comm.allgather(bonds)
    parts = [part for rank in parts for part in rank]
    first = np.cumsum([0, *(len(points) for points, *_ in parts)])
    points = np.concatenate([points for points, *_ in parts])
    triangles = np.concatenate([nodes + k for (_, nodes, _), k in zip(parts, first, strict=False)])
    body = np.concatenate([body for *_, body in parts])
    phases = [cell.summary.phases[k] for k in cell.summary.constituent_phase[body]]
    stiffnesses = {name: laws.spatial_stiffness(m) for name, m in case.materials.items()}
    free = {name: laws.expansion(m) for name, m in case.materials.items()}
    free = {name: np.zeros(6) if alpha is None else alpha for name, alpha in free.items()}
    columns = (np.array([table[phase] for phase in phases]) for table in (stiffnesses, free))
    torn = bool(bonds and any(bonds))
    bonds = [bond for rank in bonds for bond in rank]
    answer = None
    if comm.rank == 0:
        answer = stiffness(points, triangles, *columns, case.cell.boundary, body if torn else None, bonds)
    cell.destroy()
    return comm.bcast(answer)


@pytest.mark.parametrize(("order", "refine", "fibre", "pieces"), [(1, 1, GLASS, 11), (2, 0, CARBON, None)])
@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_direct_solve_of_the_same_mesh(comm, shared_path, boundary, order, refine, fibre, pieces):
    matrix = SOFT if order == 1 else TURNED
    more = {} if pieces is None else {"decomposition": {"subdomains": pieces}}
    mesh = discs(comm, shared_path / "cell.msh", 1, order=order)
    case = Case.parse(
        document(mesh, boundary, matrix=matrix, fibre=fibre, cell={"order": order, "refine": refine}, **more)
    )
    result, (C, heat) = compute(case, comm), reference(comm, case)
    assert result.effective_stiffness == pytest.approx(C, rel=0, abs=1e-9 * np.abs(C).max())
    if "expansion" in matrix:
        assert result.thermal_stress == pytest.approx(heat, rel=0, abs=1e-9 * np.abs(heat).max())


@pytest.mark.parametrize("bonds", ["arcs", "both"])
@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_bonds_inside(comm, shared_path, boundary, bonds):
    mesh = discs(comm, shared_path / "cell.msh", 2)
    case = Case.parse(document(mesh, boundary, BONDS[bonds], decomposition={"subdomains": 14}))
    result, (C, heat) = compute(case, comm), reference(comm, case)
    assert result.effective_stiffness == pytest.approx(C, rel=0, abs=1e-9 * np.abs(C).max())
    assert result.thermal_stress == pytest.approx(heat, rel=0, abs=1e-9 * np.abs(heat).max())


def test_stresses_without_amplitudes_are_complete(comm, shared_path):
    """The sides are pulled in a mean strain: rigid motions of the bodies take part in it."""
    mesh = discs(comm, shared_path / "cell.msh", 2)
    case = Case.parse(document(mesh, "traction", SPRINGS, decomposition={"subdomains": 14}))
    with case_options(case.petsc):
        cell = unit_cell.tear(case, comm, Progress(comm, quiet=True))
    v, n = len(cell.solver.problem.loads), cell.solver.condensed.boundary.shape[1]
    (state,) = cell.solver.solve_many(np.eye(n)[v : v + 1], np.zeros((cell.solver.rows, 1)))
    expected, found = (cell.solver.stress_integral(s) for s in (state, replace(state, alpha=None)))
    assert found == pytest.approx(expected, rel=0, abs=1e-10 * np.abs(expected).max())
    assert np.abs(expected[v:]).max() > 1e-3
    cell.destroy()


@pytest.mark.parametrize(("bonds", "seed"), [("rigid", 1), ("springs", 2), ("arcs", 3), ("both", 1)])
def test_periodic_cells_lie_between(comm, shared_path, bonds, seed):
    """Energies rise with fewer admissible displacements, in every load: differences are positive semidefinite."""
    mesh, random = shared_path / "cell.msh", np.random.default_rng(seed)
    if comm.rank == 0 and bonds in ("rigid", "springs"):
        pixel_mesh(random_image(10, seed), jitter=0.2, seed=seed).write(mesh)
    elif comm.rank == 0:  # arcs need fibres with one centre in all three cells
        places = np.array([[0.25, 0.3], [0.7, 0.3], [0.5, 0.75]]) + random.uniform(-0.03, 0.03, (3, 2))
        write_discs(mesh, places, RADIUS, size=0.15, several=(6, 6, 6, 6))
    comm.barrier()
    given = [(mesh, boundary, BONDS[bonds]) for boundary in ("traction", "periodic", "displacement")]
    low, middle, high = (solved(comm, *case) for case in given)
    for lower, upper in ((low, middle), (middle, high)):
        rise = np.linalg.eigvalsh(upper - lower)
        assert rise[0] > -1e-10 * np.abs(high).max() and rise[-1] > 1e-4 * np.abs(high).max()


@pytest.mark.parametrize("boundary", ["traction", "periodic", "displacement"])
def test_one_material(comm, shared_path, boundary):
    """Of any fibres, its stiffness and thermal stress, exactly."""
    if comm.rank == 0:
        pixel_mesh(random_image(8, 4), jitter=0.2).write(shared_path / "pixels.msh")
    comm.barrier()
    more = {"decomposition": {"subdomains": 7}, "petsc": {"feti_ksp_rtol": 1e-13}}
    case = document(shared_path / "pixels.msh", boundary, matrix=TURNED, fibre=TURNED, **more)
    material = Case.parse(case).materials["matrix"]
    C = laws.spatial_stiffness(material)
    assert compute(Case.parse(case), comm).effective_stiffness == pytest.approx(C, rel=0, abs=1e-12 * C.max())


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_ranks_and_units(comm, shared_path, boundary):
    mesh, other = discs(comm, shared_path / "cell.msh", 2), shared_path / "in_millimetres.msh"
    if comm.rank == 0:
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(mesh))
        gmsh.model.mesh.affineTransform([1e3, 0, 0, 0, 0, 1e3, 0, 0, 0, 0, 1e3, 0])
        gmsh.write(str(other))
        gmsh.finalize()
    comm.barrier()
    C, pieces = solved(comm, mesh, boundary, SPRINGS), {"subdomains": 13}
    alone = on_root(comm, lambda: solved(MPI.COMM_SELF, mesh, boundary, SPRINGS, decomposition=pieces))
    assert pytest.approx(alone, rel=0, abs=1e-10 * np.abs(C).max()) == C
    grown = {name: value * 1e-3 / 1e-3 for name, value in SPRINGS.items() if name != "contact"}
    pascals = {name: value * 1e6 / 1e3 for name, value in grown.items()} | {"contact": False}
    phases = {"matrix": SOFT | {"young": 1e6 * SOFT["young"]}, "fibre": GLASS | {"young": 1e6 * GLASS["young"]}}
    assert solved(comm, other, boundary, pascals, **phases) == pytest.approx(1e6 * C, rel=0, abs=1e-4 * np.abs(C).max())
