"""Laws of what a run says of itself: status, checks, tolerances, sizes of elements, and remarks with numbers."""

from __future__ import annotations

import numpy as np

from feti_homog.verify.bonds import COATING
from feti_homog.verify.check_loads import linear_stiffnesses
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import KKT, Check, Findings, checks, relative, solver_limit
from feti_homog.verify.leaves import Section

# Of the dual problems, unless the case has another one.
RTOL = 1e-8
# The longest side over `mesh_size`: 1.3 at most was measured.
LONGEST = 2.0
# Share of their area that fibres may lose without a remark, and the rounding of its percent.
REMARKABLE, PERCENT = 0.005, 0.0006


def checks_of(cell: DiscreteCell) -> tuple[Check, ...]:
    """List the checks of a result, with their limits."""
    case, rtol = cell.files.case, float(cell.files.document["solver"].hint("rtol"))
    return checks(rtol, case["cell"]["geometry"] == "mesh", COATING in case["material"], cell.elements.contrasts)


def check_record(findings: Findings, cell: DiscreteCell) -> None:
    """Check status, faults and tolerances against the checks, `mesh_size`, `refine` and order against the mesh."""
    _check_sizes(findings, cell)
    _check_remarks(findings, cell)
    document, solver = cell.files.document, cell.files.document["solver"]
    asked = float(cell.files.case.get("petsc", {}).get("feti_ksp_rtol", RTOL))
    # Options of the command line are in no file.
    rtol = float(solver["rtol"] if solver.hint("rtol") == asked else solver.hint("rtol"))
    tolerance, of_contact = document["check_tolerance"], document["kkt_tolerance"]
    findings.record("status", abs(tolerance / solver_limit(rtol) - 1.0), "check_tolerance")
    findings.record("status", abs(of_contact / KKT - 1.0), "kkt_tolerance")
    findings.record("status", abs(solver["interface_nodes"] - len(cell.files.interface.points)), "interface_nodes")
    own = [np.abs(C - C.T).max() / np.abs(C).max() for _, C in linear_stiffnesses(document, cell.files.contact)]
    if "effective_stiffness" in document and own:
        off = relative(np.array(document["checks"]["symmetry"] - own[0]), own[0])
        findings.record("status", off, "checks.symmetry")
    findings.require("status", document["status"] == ("not converged" if document.hint("faults") else "done"), "status")
    _check_faults(findings, document, tolerance, of_contact)


def _check_faults(findings: Findings, document: Section, tolerance: float, of_contact: float) -> None:
    """Check that a run is done if all checks are within their tolerances and all solves converged, else has faults."""
    checks, faults = document["checks"], document.hint("faults", [])
    broken = {name for name in checks if not checks.hint(name) <= (of_contact if "kkt_" in name else tolerance)}
    told = {name for name in checks if any(f"check {name}:" in fault for fault in faults)}
    findings.record("status", float(len(broken ^ told)), f"checks and faults, {', '.join(sorted(broken ^ told))}")
    diverged = any(reason < 0 for reason in document["solver"].hint("converged_reason"))
    findings.record("status", float(diverged != any("no convergence" in fault for fault in faults)), "converged_reason")
    if all("check " in fault or "no convergence" in fault for fault in faults):
        document.get("faults")  # which the checks explain


def _check_sizes(findings: Findings, cell: DiscreteCell) -> None:
    """Check that `refine` is how often elements come in fours, and `mesh_size` that of the case."""
    given, asked, mesh = cell.files.document["cell"], cell.files.case["cell"], cell.files.mesh
    refine, size, users, halvings = given["refine"], given.hint("mesh_size"), asked["geometry"] == "mesh", 0
    while len(mesh.triangles) % 4 ** (halvings + 1) == 0:  # elements of one that was split have its nodes
        own = np.sort(mesh.triangles[:, :3].reshape(-1, 3 * 4 ** (halvings + 1)), axis=1)
        n = 2 ** (halvings + 1)
        if (1 + (np.diff(own, axis=1) > 0).sum(axis=1) != (n + 1) * (n + 2) // 2).any():
            break
        halvings += 1
    findings.record("cell", abs(refine - halvings) if not users else max(refine - halvings, 0), "cell.refine")
    findings.record("cell", abs(refine - asked["refine"]) if asked.get("refine") is not None else 0.0, "cell.refine")
    order = 1 + mesh.triangles.shape[1] // 6
    findings.record("cell", abs(asked.get("order", order) - order), "case.cell.order")
    findings.record("cell", float((size is None) != users), "cell.mesh_size")
    if size is None:
        return
    corners = mesh.points[mesh.triangles[:, :3]]
    longest = 2**refine * float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max())
    findings.record("cell", max(longest / (LONGEST * size * given["width"]) - 1.0, 0.0), "cell.mesh_size")
    if asked.get("mesh_size") is not None:
        findings.record("cell", abs(given["mesh_size"] / asked["mesh_size"] - 1.0), "cell.mesh_size")


def _check_remarks(findings: Findings, cell: DiscreteCell) -> None:
    """Check that the remark on the area that polygons lose is there, with its number, or not."""
    document, asked = cell.files.document, cell.files.case["cell"]
    begin, words = "[cell] order = 1: polygons have ", "less area than the fibres asked for; refine, or order = 2"
    told = [text for text in document.hint("remarks", []) if text.startswith(begin)]
    if (wanted := asked.get("fibre_fraction")) and asked["geometry"] != "mesh":
        lost = 1.0 - document["cell"]["fibre_fraction"] / wanted
        texts = {f"{begin}{lost + off:.1%} {words}" for off in (-PERCENT, 0.0, PERCENT)}
        is_due = cell.files.mesh.triangles.shape[1] == 3 and lost > REMARKABLE
        if abs(lost - REMARKABLE) > PERCENT:  # or rounding decides
            findings.require("status", len(told) == is_due and {*told} <= texts, f"remarks, {begin}")
    if told == document.hint("remarks"):
        document.covers("remarks")
