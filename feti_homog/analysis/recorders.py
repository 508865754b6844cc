"""Record the checks of all responses in a run (convergence, errors of laws), and its states with fields."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from petsc4py import PETSc

from feti_homog.analysis.cell_records import PhaseStresses
from feti_homog.analysis.result import Fields
from feti_homog.errors import FetiHomogError
from feti_homog.homogenization import averaging, recovered_fields, unit_cell
from feti_homog.materials import material_forms
from feti_homog.results import field_file, field_layout, field_parts, result_json
from feti_homog.system.parallel import mpi_errors

# Largest error of a passed check / relative tolerance of the Krylov method: sums over the cell and jumps of stiffness
# amplify the error of the solver by up to this factor.
CHECK_ERROR_PER_RTOL = 1e3
# Largest error of a passed check at any tolerance.
MAX_CHECK_ERROR = 1e-4
# Largest error of the KKT conditions that passes, relative to the scales of `contact.states.kkt_errors`.
CONTACT_TOLERANCE = 1e-6
CURES = {True: "; raise -feti_ksp_max_it", False: "; -feti_coarse_space adaptive may converge"}  # at the limit or not


@dataclass
class CheckRecorder:
    """A recorder of the checks of all responses.

    Attributes:
        rtol: relative tolerance of the Krylov method.
        iterations: Krylov iterations of each state so far.
        reasons: KSPConvergedReason of each state so far.
        errors: largest error of each law so far.
        faults: lines about solves that did not converge and checks that failed.
    """

    rtol: float
    iterations: list[int] = field(default_factory=list)
    reasons: list[int] = field(default_factory=list)
    errors: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def record(self, name: str, response: averaging.Response) -> str:
        """Record the checks of a response under the name of its state; return a line about the response.

        A solve without convergence and a failed check add lines to `faults`.
        """
        state, error = response.state, response.checks.get("jump")
        reason = state.solution.reason
        self.iterations.append(state.iterations)
        self.reasons.append(reason)
        without = "by the factor of the cell" if "hill" in response.checks else "by influence columns"
        jump = without if error is None else f"relative jump {error:.1e}"
        line = f"{state.iterations or 'no'} iterations, {jump}"
        if response.debonded:
            line += f", {response.debonded} debonded ({response.counts['closed']} closed), solves: {state.solves}"
        if state.free_motions:
            line += f", {state.free_motions} free motions"
        if reason < 0:
            is_limit = reason == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
            cure = "" if any(CURES[is_limit] in fault for fault in self.faults) else CURES[is_limit]
            fault = f"no convergence after {state.iterations} iterations, {jump} (KSPConvergedReason {reason})"
            self.faults.append(f"{name}: {fault}; result marked{cure}")
        self.require(name, response.checks)
        return f"  {name}: {line}"

    def require(self, name: str, errors: Mapping[str, float]) -> None:
        """Record errors by law; NaN and errors above the tolerance add lines, which begin with `name`, to `faults`."""
        for law, error in errors.items():
            self.errors[law] = float(np.maximum(error, self.errors.get(law, 0.0)))  # NaN stays
            tolerance = self.tolerance(law)
            if not error <= tolerance:
                self.faults.append(f"{name}: check {law}: {error:.1e}, expected at most {tolerance:.1e}; result marked")

    def tolerance(self, law: str) -> float:
        """Return the largest error with which the check of a law passes."""
        if law.startswith("kkt_"):
            return CONTACT_TOLERANCE
        return min(CHECK_ERROR_PER_RTOL * self.rtol, MAX_CHECK_ERROR)

    def warnings(self) -> list[str]:
        """Return [a warning] if the solver tolerance is looser than the checks, else []."""
        if CHECK_ERROR_PER_RTOL * self.rtol <= MAX_CHECK_ERROR:
            return []
        end = f"the result is marked unless their errors are at most {MAX_CHECK_ERROR:g}"
        return [f"-feti_ksp_rtol {self.rtol:g} asks for less than the checks do: {end}"]


class StateRecorder:
    """A recorder of states and of the largest phase stresses.  Fields go to `file`, if any, and to memory if `keep`.

    Attributes:
        is_recording: whether states are recorded, for fields or for the utilisation of strengths.
        singularities: descriptions of points near which the largest stresses have no limit.
        error: the error of the first failed write, after which the run continues without the file; else None.
    """

    def __init__(
        self, cell: unit_cell.TornCell, file: field_file.FieldFile | None, keep: bool, say: Callable[[str], object]
    ) -> None:
        self._cell, self._file, self._keep = cell, file, keep
        self._number, self._states, self._say = 0, list[field_layout.StatePart](), say
        self._largest, self._labels = list[dict[str, recovered_fields.Largest]](), list[str]()
        has_strength = any(material.strength for material in cell.case.materials.values())
        self.is_recording = keep or file is not None or has_strength
        self.error: FetiHomogError | None = None
        self.singularities = set[str]()

    def record(self, states: Mapping[str, Sequence[averaging.Response | None]], load_factor: float, point: int) -> None:
        """Record labelled states, each with a response or None for each problem, if `is_recording`.  Collective."""
        if not self.is_recording:
            return
        fields = recovered_fields.recover(self._cell, [*states.values()])
        if any(fields.largest):
            self._largest += fields.largest
            self._labels += states
            self.singularities |= recovered_fields.singularities(self._cell, [plane for plane, *_ in states.values()])
        if self._file is None and not self._keep:
            return
        for state in field_parts.state_parts(self._cell, states, load_factor, point, fields):
            self._write(field_file.FieldFile.write_state, self._number, state)
            self._number += 1
            if self._keep:
                self._states.append(state)

    def seal(self) -> result_json.FileSeal | None:
        """Complete result.h5 and return its seal; None without a file or after a write error.  Collective."""
        self._write(field_file.FieldFile.close)
        return None if self._file is None else mpi_errors.on_root(self._cell.comm, result_json.seal, self._file.path)

    def _write(self, write: Callable[..., object], *arguments: object) -> None:
        """Call `write(file, *arguments)` if there is a file; after a FetiHomogError warn, and drop the file."""
        if self._file is not None:
            try:
                write(self._file, *arguments)
            except FetiHomogError as error:
                self._file, self.error = None, error
                self._say(f"warning: {error}; the remaining results are computed without it")

    def phase_stresses(self) -> tuple[PhaseStresses, ...] | None:
        """Return the largest stresses of each phase in all recorded states; None without stresses."""
        phases = dict.fromkeys(phase for state in self._largest for phase in state)
        return tuple(map(self._of_phase, phases)) or None

    def _of_phase(self, phase: str) -> PhaseStresses:
        cell, columns = self._cell, dict[str, Any]()
        strength, origin = cell.case.material_of(phase).strength, cell.summary.origin
        values, positions = (np.stack(rows) for rows in zip(*(state[phase] for state in self._largest), strict=True))
        # Each measure has one column; the utilisation, the last measure, has a column for each mode, or none.
        by_measure = np.split(values, (1, 2, 3), axis=1), np.split(positions, (1, 2, 3), axis=1)
        for name, of_modes, places in zip(recovered_fields.MEASURES, *by_measure, strict=True):
            if of_modes.size:
                modes, states = of_modes.argmax(axis=1), np.arange(len(of_modes))
                columns |= {name: of_modes[states, modes], f"{name}_at": places[states, modes] + origin}
        if strength is not None:
            columns["criterion"] = material_forms.criterion(strength)
            columns["mode"] = tuple(material_forms.MODES[k] for k in modes) if of_modes.shape[1] > 1 else None
        return PhaseStresses(phase=phase, state=tuple(self._labels), **columns)

    def fields(self) -> Fields | None:
        """Return this rank's fields; None unless the run keeps fields in memory.  Collective."""
        if not self._keep:
            return None
        cell = self._cell
        parts = field_parts.mesh_part(cell), field_parts.fibre_part(cell), field_parts.interface_part(cell)
        return Fields(cell.comm, field_parts.header(cell), *parts, tuple(self._states))
