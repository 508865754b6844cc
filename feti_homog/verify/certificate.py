"""Check all laws on the files of a result folder, in a separate process; write the certificate as text or JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.system.runtime import input_files
from feti_homog.verify.check_constants import check_conductivity, check_constants, check_reciprocity, check_status
from feti_homog.verify.check_loads import StateNumbers, States, check_loads, check_tables, rows_of
from feti_homog.verify.check_mesh import check_arcs, check_interface, check_mesh, check_mesh_error, check_rates
from feti_homog.verify.check_path import check_breaks, check_envelope, check_strength
from feti_homog.verify.check_sensitivities import check_sensitivities
from feti_homog.verify.check_state import check_bonds, check_gluing, check_phases, check_state
from feti_homog.verify.constitutive_law import rounding
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Finding, Findings, checks, unchecked
from feti_homog.verify.path_energies import check_heat, check_losses, check_stored
from feti_homog.verify.reading import FIELDS, JSON, opened

# Exceptions that numbers of an unexpected kind or shape raise.
DAMAGE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, MemoryError, RuntimeError)


@dataclass(frozen=True)
class Certificate:
    """The findings of all laws that apply.  `title` names case, mesh and states.

    `status` quotes the status and faults from the run; `unchecked` maps reasons to the numbers that no law reads.
    """

    findings: tuple[Finding, ...]
    title: str
    status: str
    unchecked: Mapping[str, Sequence[str]]

    @property
    def holds(self) -> bool:
        """Return whether every law holds."""
        return all(finding.holds for finding in self.findings)

    @property
    def text(self) -> str:
        """Write the certificate as text, with one line per law."""
        broken = sum(not finding.holds for finding in self.findings)
        verdict = f"{broken} of {len(self.findings)} laws are broken" if broken else "every law holds"
        names = [f"  {', '.join(names)}: {reason}" for reason, names in self.unchecked.items()]
        lines = [finding.line() for finding in self.findings]
        return "\n".join([self.title, self.status, *lines, verdict, "not checked:", *names])

    @property
    def document(self) -> dict[str, Any]:
        """Return the certificate as a table of JSON values."""
        laws = [dict(finding.document) for finding in self.findings]
        about = {"title": self.title, "status": self.status, "holds": self.holds}
        return about | {"laws": laws, "not_checked": self.unchecked}


def verify(directory: Path) -> Certificate:
    """Certify a result folder.  Raises CaseError for faulty files, FetiHomogError or PermissionError without access."""
    # Damaged numbers may demand any memory and time: the limits are five times the needs of results of 3 to 5 MB.
    size = sum(path.stat().st_size for path in (directory / JSON, directory / FIELDS) if path.is_file())
    seconds = input_files.LEAST_SECONDS + size / input_files.BYTES_A_SECOND
    return input_files.in_own_process(directory, _verified, (1 << 30) + 32 * size, seconds)


def _verified(directory: Path) -> Certificate:
    """Return the certificate, computed in this process; see `verify`."""
    reason = "numbers are missing, or of another kind or shape"
    try:
        with opened(directory) as files, np.errstate(all="ignore"):  # numbers that are not finite break their laws
            if files.altered:
                reason = f"{' and '.join(files.altered)} changed since the run, or is of another: the files do not fit"
            cell, document = DiscreteCell.of(files), files.document
            findings = Findings(checks_of(cell))
            findings.record("files", len(files.altered), ", ".join(files.altered))
            for name in ("schema", "checksum", "result_h5"):  # `opened` has checked these entries
                document.get(name)
            states, faults = laws_of_fields(findings, cell), document.hint("faults", [])
            laws_of_numbers(findings, cell, states)
            kind, n, m = files.case["analysis"]["type"], len(files.mesh.points), len(files.mesh.triangles)
            title = f"{files.case['name']}: {kind}, {m} elements, {n} nodes, {len(states)} states"
            status = "run: " + document.hint("status") + (f"; fault 1 of {len(faults)}: {faults[0]}" if faults else "")
            return Certificate(findings.worst(), title, status, unchecked(document))
    except OSError as error:
        raise input_files.unreadable(directory / FIELDS, error) from error
    except DAMAGE as error:
        entry = f" (without {error})" if isinstance(error, KeyError) else ""
        raise CaseError(f"{directory}: {reason}{entry}") from error


def checks_of(cell: DiscreteCell) -> list[Finding]:
    """List the laws with their limits for a result."""
    case, rtol = cell.files.case, float(cell.files.document["solver"].hint("rtol"))
    phases = *cell.elements.contrasts, *rounding(case, cell.files.phases, cell.stiffnesses)
    return checks(rtol, case["cell"]["geometry"] == "mesh", phases)


def laws_of_fields(findings: Findings, cell: DiscreteCell) -> list[StateNumbers]:
    """Check mesh, interface and the fields of all states.  Returns the states as `StateNumbers`."""
    files = cell.files
    check_mesh(findings, cell)
    check_interface(findings, cell)
    states = list[StateNumbers]()
    for state in files.states():
        arrays = (state.displacement, state.fluctuation, state.stress, state.traction, state.jump, state.strain)
        findings.record("numbers", [np.count_nonzero(~np.isfinite(array)) for array in arrays], state.name)
        terms = np.abs(state.displacement) + np.abs(state.fluctuation)
        fields = cell.elements.fields(state.displacement, terms, state.along, state.temperature * cell.expansions)
        check_state(findings, cell, state, fields)
        check_gluing(findings, cell, state, fields)
        check_bonds(findings, cell, state)
        check_mesh_error(findings, cell, state)
        check_phases(findings, cell, state, len(states))
        states.append(StateNumbers.of(cell, state, fields))
    return states


def laws_of_numbers(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check the numbers in result.json against the states."""
    document = cell.files.document
    pairs = check_loads(findings, cell, states, rows_of(cell))
    check_tables(findings, cell, states, pairs)
    check_arcs(findings, cell, states)
    if "path" in document:
        points = document["path"]
        if all(0 <= state.point < len(points) for state in states):  # else `check_loads` reports the state
            check_work = check_heat if "friction_heat" in points[0] else check_losses
            for check in (check_breaks, check_strength, check_stored, check_work):
                check(findings, cell, states)
    else:
        for number, table in enumerate([document, *cell.files.points], start=-1):
            if (tips := table.get("tips")) is not None:
                check_rates(findings, cell, tips, f"point {number}")
    if "envelope" in document:
        check_envelope(findings, cell, states)
    check_status(findings, cell)
    check_reciprocity(findings, cell, states)
    if "effective_stiffness" in document:
        check_constants(findings, cell)
    if "conductivity_estimates" in document:
        check_conductivity(findings, cell)
    check_sensitivities(findings, cell)
