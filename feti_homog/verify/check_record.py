"""Laws of what a run says of itself: status, tolerances, order of the elements."""

from __future__ import annotations

from feti_homog.verify.bonds import COATING
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import KKT, Check, Findings, checks, solver_limit

# Of the dual problems, unless the case has another one.
RTOL = 1e-8


def checks_of(cell: DiscreteCell) -> tuple[Check, ...]:
    """List the checks of a result, with their limits."""
    case, rtol = cell.files.case, float(cell.files.document["solver"].hint("rtol"))
    return checks(rtol, case["cell"]["geometry"] == "mesh", COATING in case["material"], cell.elements.contrasts)


def check_record(findings: Findings, cell: DiscreteCell) -> None:
    """Check the status by checks, faults and convergence, tolerances by rtol, the order of elements by the mesh."""
    document, solver = cell.files.document, cell.files.document["solver"]
    asked = float(cell.files.case.get("petsc", {}).get("feti_ksp_rtol", RTOL))
    # Options of the command line are in no file.
    rtol = float(solver["rtol"] if solver.hint("rtol") == asked else solver.hint("rtol"))
    tolerance, of_contact = document["check_tolerance"], document["kkt_tolerance"]
    findings.record("status", abs(tolerance / solver_limit(rtol) - 1.0), "check_tolerance")
    findings.record("status", abs(of_contact / KKT - 1.0), "kkt_tolerance")
    findings.record("status", abs(solver["interface_nodes"] - len(cell.files.interface.points)), "interface_nodes")
    checks, faults = document["checks"], document.hint("faults", [])
    failed = [name for name in checks if not checks.hint(name) <= (of_contact if "kkt_" in name else tolerance)]
    failed += [reason for reason in solver.hint("converged_reason") if reason < 0]
    failed += [fault for fault in faults if "check " not in fault and "no convergence" not in fault]
    findings.require("status", document["status"] == ("not converged" if failed else "done"), "status")
    order = 1 + cell.files.mesh.triangles.shape[1] // 6
    findings.record("cell", abs(cell.files.case["cell"].get("order", order) - order), "case.cell.order")
