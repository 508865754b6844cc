"""What the analyses share: the cell, its interfaces, to whom progress is reported and where states go."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from feti_homog.analysis.result_records import TipRates
from feti_homog.case.case import Case
from feti_homog.homogenization import phase_laws, process_zone
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.energy_release import EnergyReleaseRates
from feti_homog.homogenization.fibre_debonding import FibreInterfaces
from feti_homog.interface.contact.contact_problem import OPEN, Equilibrium, Status
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.loads.load import Load
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS
from feti_homog.runtime.progress import Progress
from feti_homog.typing import Float

EMPTY = np.zeros(0)
# Loads under which energy release rates are known; "strain" is a given one.
IN_PLANE_LOADS = (*STRAINS, "strain")

# Largest relative error of a check that passes, in relative tolerances of the Krylov method: sums over the cell and
# jumps of stiffness make so much of the solver's error.
CHECK_ERROR_PER_RTOL = 1e3
# And whatever the tolerance: what is wrong by more than this is no result.
MAX_CHECK_ERROR = 1e-4
# Largest error of the KKT conditions that passes, relative to the scales of `contact_certificate.kkt_errors`.
CONTACT_TOLERANCE = 1e-6


@dataclass
class AnalysisContext:
    """One run of an analysis.

    Attributes:
        homogenization: the cell and its interfaces.
        axial: the same with the displacement along the fibres, of generalized plane strain.
        debonded: opening angle (or None for the arcs' own) -> (k,) prescribed debonded nodes of this rank.
        record: called with each response that is to be kept as a state, that along the fibres, one of them None, its
            load factor, its name and the number of its point; collective.
        iterations, reasons: of every dual solve so far.
        checks: largest error of each law so far.
        faults: what did not converge or hold, in words.
        undetermined: of every point under one load, the strains that nothing determines.
        states: which points of a path to keep, `kept_points.kept`.
        keeps_fields: whether states are to be recorded.
        log: called with a line about each event of a path.
    """

    homogenization: Homogenization
    debonded: Callable[[float | None], NDArray[np.bool_]]
    progress: Progress
    record: Callable[[Response | None, Response | None, float, str, int], None]
    iterations: list[int] = field(default_factory=list)
    reasons: list[int] = field(default_factory=list)
    checks: dict[str, float] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    undetermined: list[list[str]] = field(default_factory=list)
    states: int | str = "all"
    axial: Homogenization | None = None
    keeps_fields: bool = False
    log: Callable[[str], object] = lambda line: None

    def status(self, opening: float | None) -> Status:
        """Interface states before any load: prescribed debonded nodes are open."""
        return np.where(self.debonded(opening), OPEN, 0).astype(np.int8)

    @property
    def _problems(self) -> tuple[Homogenization, ...]:
        return (self.homogenization,) if self.axial is None else (self.homogenization, self.axial)

    @property
    def loaded_cell(self) -> CoupledInterfaces:
        """The interfaces of all problems."""
        return CoupledInterfaces(*(problem.interface for problem in self._problems))

    @property
    def case(self) -> Case:
        """What is analysed."""
        return self.homogenization.cell.case

    def load(self, target: Mapping[str, float]) -> Load:
        """The load that a waypoint names, of all problems."""
        strains = self.loaded_cell.loads
        stress = dict(zip((*SPATIAL_STRAINS, "temperature"), (*SPATIAL_STRESSES, "temperature"), strict=True))
        values = [target.get(name, target.get(stress[name], 0.0)) for name in strains]
        return Load(np.array(values), np.array([name not in target for name in strains]))

    def responses(self, state: Equilibrium, scale: float) -> list[Response]:
        """The averages of `scale` times the equilibrium of all problems.  Collective; raises as
        `Homogenization.response`."""
        states = [state] if state.axial is None else [state, state.axial]
        return [problem.response(own, scale) for problem, own in zip(self._problems, states, strict=True)]

    def loaded_point(self, responses: Sequence[Response]) -> dict[str, Any]:
        """What result.json says of a state under one load, whose responses these are.  Collective."""
        plane, *others = responses
        pairs = zip(self._problems, responses, strict=True)
        masks = np.concatenate([problem.interface.undetermined(own.state) for problem, own in pairs])
        self.undetermined.append([name for name, found in zip(self.unit_loads, masks, strict=True) if found])
        strain, stress = plane.strain, plane.stress
        spatial = {}
        if others:
            strain = phase_laws.spatial_vector(plane.strain, others[0].strain)
            stress = phase_laws.spatial_vector(plane.stress, others[0].stress)
            if "temperature" in self.homogenization.loads:
                spatial = {"temperature": float(plane.strain[-1])}
        numbers = {"strain": strain, "stress": stress} | spatial
        energies = {
            "stored": sum(response.stored for response in responses),
            "stored_in_springs": sum(response.in_springs for response in responses),
        }
        iterations = sum(response.state.iterations for response in responses)
        return numbers | energies | self.point([plane]) | {"iterations": iterations}

    def record_state(self, responses: Sequence[Response], load_factor: float, label: str, point: int) -> None:
        """Keep the state that these are the responses of."""
        plane, *others = responses
        self.record(plane, others[0] if others else None, load_factor, label, point)

    @property
    def unit_loads(self) -> list[str]:
        """Names of the unit loads of all problems."""
        return [name for problem in self._problems for name in problem.loads]

    def zero_multipliers(self) -> list[Float]:
        """First multipliers of each unit load when there are no better ones."""
        return [np.zeros(problem.cell.solver.rows) for problem in self._problems for _ in problem.loads]

    def record_checks(self, name: str, response: Response) -> str:
        """Keep the numbers of a response, with a fault if it breaks a law; returns a line that tells of it."""
        state = response.state
        self.iterations.append(state.iterations)
        self.reasons.append(state.solution.reason)
        jump = f"relative jump {response.checks['jump']:.1e}"
        words = f"{state.iterations} iterations, {jump}"
        debonded = response.counts["open"] + response.counts["closed"]
        if debonded:
            words += f", {debonded} debonded ({response.counts['closed']} closed), {state.solves} solves"
        if state.free_motions:
            words += f", {state.free_motions} free motions"
        if state.solution.reason < 0:
            self.faults.append(
                f"{name}: no convergence after {state.iterations} iterations, {jump} "
                f"(KSPConvergedReason {state.solution.reason}); result marked"
            )
        self.check(name, response.checks)
        return f"  {name}: {words}"

    def check(self, name: str, errors: Mapping[str, float]) -> None:
        """Keep the largest errors; a fault for each that is not within its tolerance: NaN is not."""
        for law, error in errors.items():
            self.checks[law] = max(error, self.checks.get(law, 0.0))
            if not error <= (tolerance := self.tolerance(law)):
                self.faults.append(f"{name}: check {law}: {error:.1e}, expected at most {tolerance:.1e}; result marked")

    def tolerance(self, law: str) -> float:
        """Largest error of a check that passes."""
        if law.startswith("kkt_"):
            return CONTACT_TOLERANCE
        return min(CHECK_ERROR_PER_RTOL * self.homogenization.cell.solver.rtol, MAX_CHECK_ERROR)

    def remarks(self) -> list[str]:
        """Name the strains that nothing determines, in one line."""
        points = sum(map(bool, self.undetermined))
        names = [name for name in SPATIAL_STRAINS if any(name in each for each in self.undetermined)]
        if not names:
            return []
        where = "" if self.case.path is None else f" at {points} of {len(self.undetermined)} points"
        return [
            f"[{self.case.analysis.type}] {', '.join(names)}: undetermined{where}: with a given stress nothing resists "
            "them, and the result has one value of many"
        ]

    def warnings(self) -> list[str]:
        """What a user may have meant otherwise, in words."""
        cell = self.homogenization.cell
        lines = process_zone.warnings(cell.case, cell.summary.width, cell.summary.interface_edge)
        rtol = cell.solver.rtol
        if CHECK_ERROR_PER_RTOL * rtol <= MAX_CHECK_ERROR:
            return lines
        return [
            *lines,
            f"-feti_ksp_rtol {rtol:g} asks for less than the checks do: the result is marked unless their errors are "
            f"at most {MAX_CHECK_ERROR:g}",
        ]

    def unit_responses(
        self, label: str, status: Status, starts: Sequence[Float], sign: float
    ) -> tuple[dict[str, Float], list[Response]]:
        """Under plus or minus each unit load (39): the secant stiffness as `stiffness`, (3, 3) or (6, 6), and if a
        temperature is a load `thermal_stress` (6,); and the responses."""
        responses, matrices = list[Response](), list[Float]()
        for problem in self._problems:
            own = starts[len(responses) : len(responses) + len(problem.loads)]
            found = problem.respond(sign * np.eye(len(problem.loads)), status, own)
            for name, response in zip(problem.loads, found, strict=True):
                self.progress.say(self.record_checks(f"{label}{'-' if sign < 0 else ''}{name}", response))
            responses += found
            matrices.append(np.stack([sign * r.stress for r in found], axis=1))
        if len(matrices) == 1:
            return {"stiffness": matrices[0]}, responses
        C, thermal = phase_laws.spatial(*matrices)
        return {"stiffness": C} | ({} if thermal is None else {"thermal_stress": thermal}), responses

    def record_unit_states(self, responses: Sequence[Response], load_factor: float, label: str, point: int) -> None:
        """Keep the states of all unit loads."""
        plane = len(self.homogenization.loads)
        for number, (name, response) in enumerate(zip(self.unit_loads, responses, strict=True)):
            in_plane, axial = (response, None) if number < plane else (None, response)
            self.record(in_plane, axial, load_factor, f"{label}{name}", point)

    @cached_property
    def _release_rates(self) -> EnergyReleaseRates:
        """Collective when first used."""
        return EnergyReleaseRates(self.homogenization.cell, self.homogenization.interface)

    def tips(self, responses: Sequence[Response], loads: Sequence[str]) -> TipRates:
        """Energy release rates at all tips under each load that has them; none while all is bonded.  Collective."""
        pairs = [(r, load) for r, load in zip(responses, loads, strict=True) if load.lstrip("-") in IN_PLANE_LOADS]
        debonded = [(r, load) for r, load in pairs if r.counts["open"] + r.counts["closed"]]
        found = [(self._release_rates.of(response), load) for response, load in debonded]
        columns = [
            (at.fibre, at.pair, at.direction, at.total, *at.modes.T, at.mode_angle, at.length) for at, _ in found
        ]
        fibre, pair, angle, G, G_I, G_II, psi, length = (
            map(np.concatenate, zip(*columns, strict=True)) if found else [EMPTY] * 8
        )
        sections = tuple((pair + 1).astype(int).tolist()) if len(self.case.interfaces) > 1 else None
        return TipRates(
            load=tuple(load for at, load in found for _ in at.fibre),
            fibre=tuple(fibre.astype(int).tolist()),
            angle=angle,
            G=G,
            G_I=G_I,
            G_II=G_II,
            psi=psi,
            length=length,
            interface=sections,
        )

    def point(self, responses: Sequence[Response]) -> dict[str, Any]:
        """The numbers of a point of a list in result.json: states under its last strain of the plane, all iterations.
        Collective."""
        last = responses[: len(STRAINS)][-1]
        length = self.fibre_interfaces.debonded_length(last.state.status)
        debonding = {
            "debonded_share": self.fibre_interfaces.share(length),
            "debonded_length": length,
            "debonding_angle": self.fibre_interfaces.angle(length),
        }
        if len(self.case.interfaces) > 1:
            debonding["debonded_shares"] = self.fibre_interfaces.shares(last.state.status)
        return debonding | last.counts | {"iterations": sum(r.state.iterations for r in responses)}

    @cached_property
    def fibre_interfaces(self) -> FibreInterfaces:
        """Those of the cell.  Collective."""
        return FibreInterfaces(self.homogenization.cell)
