"""Convergence of the dual solves of a run, and the errors of the laws that its responses obey."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from feti_homog.homogenization.averaging import Response

# Largest relative error of a check that passes, in relative tolerances of the Krylov method: sums over the cell and
# jumps of stiffness make so much of the solver's error.
CHECK_ERROR_PER_RTOL = 1e3
# And whatever the tolerance: what is wrong by more than this is no result.
MAX_CHECK_ERROR = 1e-4
# Largest error of the KKT conditions that passes, relative to the scales of `interface.contact.states.kkt_errors`.
CONTACT_TOLERANCE = 1e-6


@dataclass
class Checks:
    """Checks of all responses of a run.

    Attributes:
        rtol: relative tolerance of the Krylov method.
        iterations, reasons: of every dual solve so far.
        errors: largest error of each law so far.
        faults: solves that did not converge and checks that failed, in words.
    """

    rtol: float
    iterations: list[int] = field(default_factory=list)
    reasons: list[int] = field(default_factory=list)
    errors: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)

    def record(self, name: str, response: Response) -> str:
        """Keep the numbers of a response, with a fault if it breaks a law; returns a line about it."""
        state = response.state
        self.iterations.append(state.iterations)
        self.reasons.append(state.solution.reason)
        confirmed = response.checks.get("jump")
        without = "by the factor of the cell" if response.checks.keys() & {"hill"} else "by influence columns"
        jump = without if confirmed is None else f"relative jump {confirmed:.1e}"
        words = f"{state.iterations or 'no'} iterations, {jump}"
        if response.debonded:
            words += f", {response.debonded} debonded ({response.counts['closed']} closed), {state.solves} solves"
        if state.free_motions:
            words += f", {state.free_motions} free motions"
        if state.solution.reason < 0:
            self.faults.append(
                f"{name}: no convergence after {state.iterations} iterations, {jump} "
                f"(KSPConvergedReason {state.solution.reason}); result marked"
            )
        self.require(name, response.checks)
        return f"  {name}: {words}"

    def require(self, name: str, errors: Mapping[str, float]) -> None:
        """Keep the largest errors; a fault for each that is not within its tolerance: NaN is not."""
        for law, error in errors.items():
            self.errors[law] = max(error, self.errors.get(law, 0.0))
            if not error <= (tolerance := self.tolerance(law)):
                self.faults.append(f"{name}: check {law}: {error:.1e}, expected at most {tolerance:.1e}; result marked")

    def tolerance(self, law: str) -> float:
        """Largest error of a check that passes."""
        if law.startswith("kkt_"):
            return CONTACT_TOLERANCE
        return min(CHECK_ERROR_PER_RTOL * self.rtol, MAX_CHECK_ERROR)

    def warnings(self) -> list[str]:
        """Return a line if the solver's tolerance is looser than that of the checks."""
        if CHECK_ERROR_PER_RTOL * self.rtol <= MAX_CHECK_ERROR:
            return []
        return [
            f"-feti_ksp_rtol {self.rtol:g} asks for less than the checks do: the result is marked unless their errors "
            f"are at most {MAX_CHECK_ERROR:g}"
        ]
