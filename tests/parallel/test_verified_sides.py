"""Cells under displacements or tractions on the sides: certificates, free bodies, layers, voids and derivatives."""

import json

import numpy as np
import pytest
from parallel.test_uniform_sides import (
    ARCS,
    BONDS,
    BOUNDARIES,
    CARBON,
    RADIUS,
    SEVERAL,
    SPRINGS,
    discs,
    document,
    reference,
    solved,
)
from support.layered_meshes import layers
from support.ranks import assert_certified, parallel_assert
from support.unmatched_meshes import write_discs

from feti_homog import run
from feti_homog.analysis.runner import compute
from feti_homog.case.cases import Case
from feti_homog.errors import MeshError, NotCarriedError
from feti_homog.homogenization import unit_cell
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress
from feti_homog.verify.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


@pytest.mark.parametrize(
    ("boundary", "bonds"),
    [("traction", "both"), ("displacement", "arcs"), ("traction", "rigid"), ("displacement", "springs")],
)
def test_verified(comm, shared_path, boundary, bonds):
    """`verify` recomputes states, with the conditions on the sides, and the mesh error."""
    mesh = discs(comm, shared_path / "cell.msh", 3)
    case = document(mesh, boundary, BONDS[bonds], decomposition={"subdomains": 14}, output={"pictures": False})
    result = run(Case.parse(case), comm, out=shared_path / "out")
    parallel_assert(comm, result.status == "done", str(result.warnings))
    assert_certified(comm, shared_path / "out")


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_verified_on_refined_curves_in_contact(comm, shared_path, boundary):
    """Errors from the coarser mesh; faces that touch under one sign of the load, each by its own tractions."""
    mesh = discs(comm, shared_path / "cell.msh", 3, count=3, order=2)
    options = {"cell": {"order": 2, "refine": 1}, "output": {"pictures": False}, "decomposition": {"subdomains": 9}}
    case = document(mesh, boundary, ARCS | {"contact": True}, fibre=CARBON, **options)
    result = run(Case.parse(case), comm, out=shared_path / "out")
    C, other = result.effective_stiffness, result.effective_stiffness_compression
    assert np.abs(C - other).max() > 0.01 * np.abs(C).max()
    assert_certified(comm, shared_path / "out")


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_a_free_body_on_the_sides(comm, shared_path, boundary):
    """Given displacements hold it, tractions nothing."""
    mesh, loose = discs(comm, shared_path / "cell.msh", 3), {"debonded": [{"fibre": "all", "angle": 360.0}]}
    case = Case.parse(document(mesh, boundary, loose | {"contact": False}))
    if boundary == "traction":
        with pytest.raises(NotCarriedError, match=r'^\[cell\] boundary = "traction": .* no bonds'):
            compute(case, comm)
        with case_options(case.petsc):
            solver = unit_cell.tear(case, comm, Progress(comm, quiet=True)).solver
            active = np.ones(solver.rows)
            active[(solver.jump_operator.nodes.row[:, None] + np.arange(2)).ravel()] = 0.0
            solver.set_state(active, solver.intact_compliance)
            for _ in range(2):  # a refused load leaves nothing behind
                with pytest.raises(NotCarriedError):
                    _ = solver.closure
    else:
        C = compute(case, comm).effective_stiffness
        assert pytest.approx(reference(comm, case)[0], rel=0, abs=1e-9 * np.abs(C).max()) == C


def layered(comm, path, phases="MFFM"):
    if comm.rank == 0:
        layers(phases, 0).write(path)
    comm.barrier()
    return path


def test_layers_in_series_under_tractions_in_parallel_under_displacements(comm, shared_path):
    """Layers normal to axis 1 without Poisson's effect: uniform stresses across, uniform strains along, are exact."""
    mesh, (E, F) = layered(comm, shared_path / "layers.msh"), (2.0, 30.0)
    phases = {"matrix": {"young": E, "poisson": 0.0}, "fibre": {"young": F, "poisson": 0.0}}
    low, high = (solved(comm, mesh, boundary, **phases) for boundary in BOUNDARIES)
    series, parallel = 2 / (1 / E + 1 / F), (E + F) / 2
    compliance = np.linalg.inv(low)
    assert 1 / np.diag(compliance)[[0, 4]] == pytest.approx([series, series / 2], rel=1e-9)  # E1 and G13
    assert np.diag(high)[[1, 2, 3]] == pytest.approx([parallel, parallel, parallel / 2], rel=1e-9)
    assert low[2, 2] == pytest.approx(parallel, rel=1e-9)
    assert low[1, 1] < 0.99 * parallel and high[0, 0] > 1.01 * series


def conducting(mesh, boundary, phases, interface=None):
    case = document(mesh, boundary, interface) | {"analysis": {"type": "conductivity"}}
    return case | {"material": {name: {"conductivity": k} for name, k in phases.items()}}


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_conduction_is_axial_shear(comm, shared_path, boundary):
    """With resistant bonds and debonded arcs too; its fields obey the laws of `verify`."""
    mesh, phases = discs(comm, shared_path / "cell.msh", 5), {"matrix": 0.2, "fibre": 1.7}
    arcs = {"debonded": ARCS["debonded"]}
    case = conducting(mesh, boundary, phases, {"conductance": 5.0} | arcs) | {"output": {"pictures": False}}
    k = run(Case.parse(case), comm, out=shared_path / "out").effective_conductivity
    assert_certified(comm, shared_path / "out")
    phases = {name: {"young": 2.5 * value, "poisson": 0.25} for name, value in phases.items()}
    C = solved(comm, mesh, boundary, {"axial_stiffness": 5.0, "contact": False} | arcs, **phases)
    assert k[:2, :2] == pytest.approx(C[np.ix_([4, 3], [4, 3])], rel=1e-11, abs=1e-12)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_voids(comm, shared_path, boundary):
    """Inside, with the direct solve; at the sides, given displacements alone know the strain."""
    mesh = shared_path / "voids.msh"
    options = {"cell": {"voids": True}, "fibre": None, "decomposition": {"subdomains": 5}}
    if comm.rank == 0:
        write_discs(mesh, np.array([[0.35, 0.4], [0.7, 0.65]]), RADIUS, size=0.15, several=SEVERAL, voids=True)
    comm.barrier()
    case = document(mesh, boundary, output={"pictures": False}, **options)
    result = run(Case.parse(case), comm, out=shared_path / "out")
    assert_certified(comm, shared_path / "out")
    C = reference(comm, Case.parse(case))[0]
    assert result.effective_stiffness == pytest.approx(C, rel=0, abs=1e-9 * np.abs(C).max())
    discs(comm, mesh, 3, voids=True)
    if boundary == "traction":
        with pytest.raises(MeshError, match='voids at the sides, where boundary = "traction"'):
            compute(Case.parse(case), comm)
    else:
        run(Case.parse(case), comm, out=shared_path / "sides")
        assert_certified(comm, shared_path / "sides")


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_sensitivities_are_derivatives(comm, shared_path, boundary):
    mesh = discs(comm, shared_path / "cell.msh", 2)
    case = document(mesh, boundary, SPRINGS, output={"pictures": False, "mesh_error": False, "sensitivities": True})
    found = compute(Case.parse(case), comm).sensitivities
    for section, key in ((("material", "fibre"), "young"), (("interface",), "normal_stiffness")):
        changed = []
        for factor in (1.0 + 1e-4, 1.0 - 1e-4):
            other = json.loads(json.dumps(case))
            table = other
            for name in section:
                table = table[name]
            table[key] *= factor
            changed.append(np.asarray(compute(Case.parse(other), comm).effective_stiffness))
            value = table[key] / factor
        slope = (changed[0] - changed[1])[0, 0] / (2e-4 * value)
        row, column = found.parameters.index(".".join([*section, key])), found.constants.index("C11")
        assert np.array(found.derivatives)[column, row] == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("boundary", BOUNDARIES)
def test_falsified_sides(comm, shared_path, boundary):
    """A result is no result of the other condition: `verify` finds it at the sides."""
    mesh, folder = discs(comm, shared_path / "cell.msh", 3), shared_path / "out"
    run(Case.parse(document(mesh, boundary, output={"pictures": False})), comm, out=folder)
    if comm.rank == 0:
        other = "displacement" if boundary == "traction" else "traction"
        path = folder / "result.json"
        path.write_text(path.read_text().replace(f'"boundary": "{boundary}"', f'"boundary": "{other}"'))
        broken = {finding.name for finding in verify(folder).findings if not finding.holds}
        assert ("sides" if boundary == "traction" else "equilibrium") in broken
    comm.barrier()
