"""One case from its file to its result: tear, solve, homogenize, check, write."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from feti_homog import __version__, bounds
from feti_homog.case import Case
from feti_homog.errors import ConvergenceError
from feti_homog.fem.assembly import element_strain
from feti_homog.homogenization import Response, asymmetry, displacement, effective_stiffness, fluctuation
from feti_homog.material import plane_stiffness
from feti_homog.output import folder, plots, results, xdmf
from feti_homog.output.fields import FieldFile, Header, InterfacePart, MeshPart, StatePart
from feti_homog.output.summary import summary
from feti_homog.parallel import on_root, on_root_only
from feti_homog.petsc_options import case_options, refuse_unused
from feti_homog.progress import Progress
from feti_homog.torn import TornCell, tear

Float = NDArray[np.float64]

# A check may exceed the solver's tolerance by what sums over the cell and jumps of stiffness make of it.
CHECK_MARGIN = 1e3


def run(case: Case, directory: Path, comm: MPI.Intracomm, quiet: bool) -> None:
    """Run the case and write its results to `directory`.  Collective.

    Raises:
        CaseError, MeshError: before anything is written.
        ConvergenceError: after what was computed has been written, marked as such.
    """
    progress = Progress(comm, quiet)
    for warning in case.warnings():
        progress.say(f"warning: {warning}")
    with case_options(case.petsc):
        cell = tear(case, comm, progress)
        try:
            refuse_unused()
            document, responses = _solve(cell, progress)
            _write(cell, directory, document, responses, progress)
        finally:
            cell.solver.destroy()
    faults = document["faults"]
    if faults:
        raise ConvergenceError(*faults)


def _solve(cell: TornCell, progress: Progress) -> tuple[dict[str, Any], list[Response]]:
    with progress.stage("solve") as words:
        L, responses = effective_stiffness(cell, progress)
        iterations = [r.solution.iterations for r in responses]
        words.append(f"{len(responses)} load cases, {sum(iterations)} iterations")
    checks = {name: max(r.checks[name] for r in responses) for name in ("strain", "hill", "jump")}
    checks["symmetry"] = asymmetry(L)
    faults = [
        f"{name}: no convergence after {r.solution.iterations} iterations, relative jump {r.solution.residual:.1e} "
        f"(KSPConvergedReason {r.solution.reason}); result marked"
        for name, r in zip(("E11", "E22", "G12"), responses, strict=True)
        if r.solution.reason < 0
    ]
    tolerance = CHECK_MARGIN * cell.solver.rtol
    faults += [
        f"check {name}: {error:.1e}, expected at most {tolerance:.1e}; result marked"
        for name, error in checks.items()
        if error > tolerance
    ]
    return _document(cell, L, responses, checks, tolerance, faults), responses


def _document(
    cell: TornCell,
    L: Float,
    responses: Sequence[Response],
    checks: dict[str, float],
    tolerance: float,
    faults: list[str],
) -> dict[str, Any]:
    """result.json; collective."""
    plan, solver, areas = cell.plan, cell.solver, cell.areas()
    fractions = {phase: area / sum(areas.values()) for phase, area in areas.items()}
    phases = [
        plane_stiffness(cell.case.material_of(phase), cell.case.analysis.plane) for phase in plan.phases
    ]
    shares = list(fractions.values())
    isotropic = all(bounds.is_isotropic(stiffness) for stiffness in phases)
    return {
        "version": __version__,
        "case": cell.case.resolved(),
        "cell": {
            "width": plan.width,
            "height": plan.height,
            "area": plan.area,
            "fibre_fraction": sum(f for phase, f in fractions.items() if phase != "matrix"),
            "fractions": fractions,
            "elements": cell.total(sum(len(s.mesh.triangles) for s in cell.subdomains)),
            "nodes": cell.total(sum(len(s.mesh.points) for s in cell.subdomains)),
        },
        "solver": {
            "ranks": cell.comm.size,
            "bodies": plan.bodies,
            "subdomains": plan.subdomains,
            "dofs": cell.total(len(cell.solver.Q)),
            "multipliers": solver.constraints.total,
            "kernel_dim": solver.coarse.dimension,
            "coarse_dim": solver.coarse.dimension,
            "factorizations": cell.total(solver.local.factorizations),
            "rtol": solver.rtol,
            "iterations": [r.solution.iterations for r in responses],
            "converged_reason": [r.solution.reason for r in responses],
        },
        "effective_stiffness": L,
        "moduli": asdict(bounds.engineering_moduli(L)),
        "bounds": {
            "voigt": bounds.voigt(shares, phases),
            "reuss": bounds.reuss(shares, phases),
            "hashin_shtrikman": asdict(bounds.hashin_shtrikman(shares, phases)) if isotropic else None,
        },
        "checks": checks,
        "check_tolerance": tolerance,
        "warnings": list(cell.case.warnings()),
        "faults": faults,
        "status": "not converged" if faults else "done",
    }


def _write(
    cell: TornCell,
    directory: Path,
    document: dict[str, Any],
    responses: Sequence[Response],
    progress: Progress,
) -> None:
    comm, output = cell.comm, cell.case.output
    with progress.stage("output") as words:
        on_root(comm, folder.make, directory)
        if output.fields:
            with FieldFile(directory, comm, _header(cell), _mesh_part(cell), _interface_part(cell)) as file:
                for number, response in enumerate(responses):
                    file.write_state(number, _state_part(cell, response))
            on_root_only(comm, xdmf.write, directory)
        words.append(str(directory))
    document["timings"], document["memory"] = progress.timings(), progress.memory()
    on_root_only(comm, results.write, directory, document)
    if output.fields and output.pictures:
        with progress.stage("pictures") as words:
            words.append(", ".join(p.name for p in on_root_only(comm, plots.plot, directory) or []))
    if progress.telling:
        progress.say("\n" + summary(document))


def _header(cell: TornCell) -> Header:
    case, plan = cell.case, cell.plan
    return Header(
        title=case.name,
        version=__version__,
        width=plan.width,
        height=plan.height,
        order=case.cell.order,
        refine=case.cell.refine,
        phases=plan.phases,
        length_unit=case.output.length_unit,
        stress_unit=case.output.stress_unit,
    )


def _mesh_part(cell: TornCell) -> MeshPart:
    subdomains = cell.subdomains
    nodes = np.cumsum([0, *(len(s.mesh.points) for s in subdomains)])
    columns = 3 * cell.case.cell.order
    sizes = [len(s.mesh.triangles) for s in subdomains]
    triangles = [s.mesh.triangles + n for s, n in zip(subdomains, nodes, strict=False)]
    phase = [cell.plan.phases.index(s.piece.phase) for s in subdomains]
    return MeshPart(
        points=np.concatenate([s.mesh.points for s in subdomains] or [np.zeros((0, 2))]),
        triangles=np.concatenate(triangles or [np.zeros((0, columns), np.int64)]),
        body=np.repeat([s.piece.body for s in subdomains], sizes).astype(np.int32),
        subdomain=np.repeat([s.piece.index for s in subdomains], sizes).astype(np.int32),
        phase=np.repeat(phase, sizes).astype(np.int32),
    )


def _interface_part(cell: TornCell) -> InterfacePart:
    nodes = cell.solver.constraints.nodes
    return InterfacePart(nodes.points, nodes.normal, nodes.length, nodes.fibre.astype(np.int32))


def _state_part(cell: TornCell, response: Response) -> StatePart:
    u, nodes = response.u, cell.solver.constraints.nodes
    pair = nodes.row[:, None] + np.arange(2)
    return StatePart(
        strain=response.strain,
        stress_mean=response.stress,
        load_factor=1.0,
        displacement=displacement(cell, response.strain, u),
        fluctuation=fluctuation(cell, u),
        stress=_element_stress(cell, response),
        traction=response.solution.lam[pair] / nodes.length[:, None],
        jump=response.solution.jump[pair],
        status=np.zeros(len(nodes.row), np.int8),
    )


def _element_stress(cell: TornCell, response: Response) -> Float:
    """(elements, 3) mean stresses."""
    stresses = [np.zeros((0, 3))]
    for s, offset in zip(cell.subdomains, cell.offsets, strict=False):
        own = response.u[offset : offset + len(s.Q)].reshape(-1, 2)
        strain, _ = element_strain(s.mesh.points, s.mesh.triangles, s.mesh.node_class, own)
        stresses.append((strain + response.strain) @ s.L)
    return np.concatenate(stresses)
