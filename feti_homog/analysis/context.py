"""One run of an analysis: the cell under its loads, checks, records of states and points, progress."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from feti_homog.analysis.checks import Checks
from feti_homog.analysis.state_recorder import StateRecorder
from feti_homog.case.case import Case
from feti_homog.homogenization import phase_laws, process_zone
from feti_homog.homogenization.averaging import Homogenization, Response
from feti_homog.homogenization.fibre_debonding import FibreInterfaces
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.load_scales import ABSURD
from feti_homog.interface.contact.states import OPEN, BondState, Equilibrium
from feti_homog.interface.loads import Load
from feti_homog.materials.voigt import SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS
from feti_homog.results.checkpoint import NoCheckpoint
from feti_homog.system.runtime.progress import Progress
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.analysis.tip_records import TipRateRecorder


class CellLoads:
    """Loads of a cell, and its averages under them.

    Attributes:
        problems: that of the plane, in which faces may touch, then the axial one where there is one.
        interfaces: those of all problems together.
        names: of the unit loads of all problems.
    """

    def __init__(self, cell: TornCell, contact: bool) -> None:
        self.problems = tuple(Homogenization(each, contact and each is cell) for each in cell.problems)
        self.interfaces = CoupledInterfaces(*(problem.interface for problem in self.problems))
        self.names = tuple(name for problem in self.problems for name in problem.loads)

    @property
    def plane(self) -> Homogenization:
        """The problem of the plane."""
        return self.problems[0]

    def load(self, target: Mapping[str, float]) -> Load:
        """Return the load that a waypoint names, of all problems."""
        stress = dict(zip(SPATIAL_STRAINS, SPATIAL_STRESSES, strict=True)) | {"temperature": "temperature"}
        values = [target.get(name, target.get(stress[name], 0.0)) for name in self.names]
        return Load(np.array(values), np.array([name not in target for name in self.names]))

    def zero_multipliers(self) -> list[Float]:
        """First multipliers of each unit load when there are no better ones."""
        return [np.zeros(problem.cell.solver.rows) for problem in self.problems for _ in problem.loads]

    def responses(self, state: Equilibrium, scale: float, brief: bool = False) -> list[Response]:
        """Return the averages of `scale` times the equilibrium of all problems.

        Collective; arguments and errors as of `Homogenization.response`.
        """
        return [problem.response(own, scale, brief) for problem, own in zip(self.problems, state.problems, strict=True)]

    def undetermined(self, responses: Sequence[Response]) -> list[str]:
        """Return the strains under a load that nothing determines. Collective."""
        pairs = zip(self.problems, responses, strict=True)
        masks = np.concatenate([problem.interface.undetermined(own.state) for problem, own in pairs])
        return [name for name, found in zip(self.names, masks, strict=True) if found]

    def excess(self, responses: Sequence[Response]) -> float:
        """Return how many times as large as those of the bonded cell strains under a load are.  Collective."""
        states = [(problem.interface.scales, own.state) for problem, own in zip(self.problems, responses, strict=True)]
        return max(scales.excess(state.solution.strain, state.asked) for scales, state in states)

    def secants(self, responses: Sequence[Response], sign: float) -> dict[str, Float]:
        """Return the secant stiffness (39), and the thermal stress if a temperature is a load.

        `stiffness`, (3, 3) or (6, 6), and `thermal_stress` (6,) follow from the responses to plus or minus each unit
        load.
        """
        matrices, first = list[Float](), 0
        for problem in self.problems:
            end = first + len(problem.loads)
            matrices.append(np.stack([sign * r.stress for r in responses[first:end]], axis=1))
            first = end
        return phase_laws.secants(*matrices)

    def means(self, responses: Sequence[Response]) -> dict[str, Float | float]:
        """Macroscopic `strain` and `stress` of the responses of all problems, and `temperature` if it is a load."""
        strain = phase_laws.components(*(response.strain for response in responses))
        stress = phase_laws.components(*(response.stress for response in responses))
        heat = {"temperature": float(responses[0].strain[-1])} if "temperature" in self.names else {}
        return {"strain": strain, "stress": stress} | heat


@dataclass
class AnalysisContext:
    """One run of an analysis.

    Attributes:
        loads: the cell under its loads.
        checks: those of all responses so far.
        states: where the states that are kept go.
        checkpoint: where the events of a path go; `resume` goes on from it.
        log: called with a line about each event of a path; `events` is where all of them are.
        undetermined: of every point under one load, the strains that nothing determines.
        excess: the largest strain under one load, relative to that of the bonded cell.
        notes: remarks on the result.
    """

    loads: CellLoads
    checks: Checks
    states: StateRecorder
    progress: Progress
    checkpoint: NoCheckpoint
    resume: bool = False
    log: Callable[[str], object] = lambda line: None
    events: str = "result.path"
    undetermined: list[list[str]] = field(default_factory=list)
    excess: float = 0.0
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, cell: TornCell, progress: Progress, states: StateRecorder | None = None) -> AnalysisContext:
        """Make the context of a cell without a checkpoint; by default no states are recorded."""
        contact = cell.case.interface is not None and cell.case.interface.contact
        recorder = StateRecorder(cell, None, False, progress.say) if states is None else states
        return cls(CellLoads(cell, contact), Checks(cell.solver.rtol), recorder, progress, NoCheckpoint(cell.comm))

    @property
    def plane(self) -> Homogenization:
        """The problem of the plane."""
        return self.loads.plane

    @property
    def cell(self) -> TornCell:
        """The cell in the problem of the plane."""
        return self.plane.cell

    @property
    def case(self) -> Case:
        """The case that is analysed."""
        return self.cell.case

    @property
    def recovers_again(self) -> bool:
        """True if displacements inside bodies are asked for more than once, so that factors of interiors pay."""
        return self.states.has_place or self.needs_sensitivities or self.case.analysis.type == "angle"

    @property
    def needs_sensitivities(self) -> bool:
        """True if the case asks for derivatives."""
        return self.case.output.sensitivities

    def bonds(self, opening: float | None) -> BondState:
        """State of the interfaces before any load: prescribed debonded nodes are open."""
        return self.plane.intact.with_status(np.where(self.cell.debonded(opening), OPEN, 0).astype(np.int8))

    def unit_responses(
        self, label: str, bonds: BondState, starts: Sequence[Float], sign: float
    ) -> tuple[dict[str, Float], list[Response]]:
        """Return the secants, see `CellLoads.secants`, and the responses to plus or minus each unit load.

        Collective.
        """
        responses = list[Response]()
        for problem in self.loads.problems:
            own = starts[len(responses) : len(responses) + len(problem.loads)]
            found = problem.respond(sign * np.eye(len(problem.loads)), bonds, own)
            for name, response in zip(problem.loads, found, strict=True):
                self.progress.say(self.checks.record(f"{label}{'-' if sign < 0 else ''}{name}", response))
            responses += found
        return self.loads.secants(responses, sign), responses

    def record_unit_states(self, responses: Sequence[Response], load_factor: float, label: str, point: int) -> None:
        """Keep the states of all unit loads.  Collective."""
        in_plane = len(self.plane.loads)
        for number, (name, response) in enumerate(zip(self.loads.names, responses, strict=True)):
            plane, axial = (response, None) if number < in_plane else (None, response)
            self.states.record(plane, axial, load_factor, f"{label}{name}", point)

    def record_state(self, responses: Sequence[Response], load_factor: float, label: str, point: int) -> None:
        """Keep the state that these are the responses of.  Collective."""
        plane, *others = responses
        self.states.record(plane, others[0] if others else None, load_factor, label, point)

    @cached_property
    def tips(self) -> TipRateRecorder:
        """Records of the tips of debonded arcs."""
        from feti_homog.analysis.tip_records import TipRateRecorder  # perfectly bonded cells have no tips

        return TipRateRecorder(self.plane)

    @cached_property
    def fibre_interfaces(self) -> FibreInterfaces:
        """Interfaces of the fibres of the cell.  Collective."""
        return FibreInterfaces(self.cell)

    def point(self, responses: Sequence[Response]) -> dict[str, Any]:
        """Debonding at a point of result.json: that of its last strain of the plane; all iterations.  Collective."""
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

    def loaded_point(self, responses: Sequence[Response]) -> dict[str, Any]:
        """Means, energies and debonding at a point of result.json under one load.  Collective."""
        self.undetermined.append(self.loads.undetermined(responses))
        self.excess = max(self.excess, self.loads.excess(responses))
        energies = {
            "stored": sum(response.stored for response in responses),
            "stored_in_springs": sum(response.in_springs for response in responses),
        }
        iterations = sum(response.state.iterations for response in responses)
        return self.loads.means(responses) | energies | self.point(responses[:1]) | {"iterations": iterations}

    def remarks(self) -> list[str]:
        """List the notes, and a line each on strains that nothing determines or that are absurd."""
        found, points, label = [*self.notes], sum(map(bool, self.undetermined)), f"[{self.case.analysis.type}]"
        if names := [name for name in SPATIAL_STRAINS if any(name in each for each in self.undetermined)]:
            where = f" at {points} of {len(self.undetermined)} points" if self.case.section.is_followed else ""
            words = "with a given stress nothing resists them, and the result has one value of many"
            found.append(f"{label} {', '.join(names)}: undetermined{where}: {words}")
        if self.excess > ABSURD:
            words = "hardly anything carries the stresses"
            found.append(f"{label} strains {self.excess:.1e} times those of the bonded cell: {words}")
        return found

    def warnings(self) -> list[str]:
        """List the warnings about settings that a user may not have intended."""
        summary = self.cell.summary
        return [*process_zone.warnings(self.case, summary.width, summary.interface_edge), *self.checks.warnings()]
