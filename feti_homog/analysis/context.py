"""Hold the state of an analysis run: the cell under its loads, checks, recorders, progress and notes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feti_homog.analysis.recorders import CheckRecorder, StateRecorder
from feti_homog.case import Case
from feti_homog.homogenization import averaging, cell_remarks, phase_laws, recovered_fields, unit_cell
from feti_homog.interface import ABSURD, Load
from feti_homog.interface.contact import BONDED, OPEN, BondState, Equilibrium, coupled_interfaces
from feti_homog.materials import voigt
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Float

if TYPE_CHECKING:
    from feti_homog.homogenization import energy_release, mesh_estimate
    from feti_homog.results import checkpoints


class CellLoads:
    """The loads of a cell, and averages over the cell under each load.

    Attributes:
        problems: the plane problem, in which faces may touch, and in generalized plane strain the axial problem; in
            conduction, only the conduction problem.
        interfaces: the interfaces, coupled in all problems.
        names: names of the unit loads of all problems.
    """

    def __init__(self, cell: unit_cell.TornCell, contact: bool) -> None:
        self.problems = tuple(
            averaging.Homogenization(problem, contact and problem.solver.problem.turns) for problem in cell.problems
        )
        self.interfaces = coupled_interfaces.CoupledInterfaces(*(problem.interface for problem in self.problems))
        self.names = tuple(name for problem in self.problems for name in problem.loads)

    def load(self, target: Mapping[str, float]) -> Load:
        """Convert a waypoint, a mapping of strain and stress names to values, to a load.  Unnamed stresses are 0."""
        stress = dict(zip(voigt.SPATIAL_STRAINS, voigt.SPATIAL_STRESSES, strict=True)) | {"temperature": "temperature"}
        values = [target.get(name, target.get(stress[name], 0.0)) for name in self.names]
        return Load(np.array(values), np.array([name not in target for name in self.names]))

    def zero_multipliers(self) -> list[Float]:
        """Return zero multipliers (owned rows,) for each unit load, as first iterates."""
        return [np.zeros(problem.cell.solver.rows) for problem in self.problems for _ in problem.loads]

    def by_problem(self, responses: Sequence[averaging.Response]) -> list[list[averaging.Response]]:
        """Split a list of responses, one for each unit load, into a list for each problem."""
        rest = iter(responses)
        return [[next(rest) for _ in problem.loads] for problem in self.problems]

    def responses(self, state: Equilibrium, scale: float, brief: bool = False) -> list[averaging.Response]:
        """Return each problem's response to `scale` times an equilibrium (`Homogenization.response`).  Collective."""
        pairs = zip(self.problems, state.problems, strict=True)
        return [problem.response(part, scale, brief) for problem, part in pairs]

    def secants(self, responses: Sequence[averaging.Response], sign: float) -> dict[str, Float]:
        """Assemble the secant `stiffness`, Eq. (39), and the `thermal_stress` (6,).

        `responses` belong to `sign` times each unit load.  The stiffness is (3, 3) or (6, 6), in conduction the
        conductivity (3, 3); the thermal stress is left out unless a temperature is a load.
        """
        groups = self.by_problem(responses)
        return phase_laws.secants(*(np.stack([sign * r.stress for r in group], axis=1) for group in groups))

    def means(self, responses: Sequence[averaging.Response]) -> dict[str, Float | float]:
        """Return macroscopic `strain` and `stress`, and `temperature` if it is a load, by name.

        `responses` are the responses of all problems to the same load.
        """
        strain = phase_laws.components(*(response.strain for response in responses))
        stress = phase_laws.components(*(response.stress for response in responses))
        heat = {"temperature": float(responses[0].strain[-1])} if "temperature" in self.names else {}
        return {"strain": strain, "stress": stress} | heat


@dataclass
class AnalysisContext:
    """The cell, loads, checks and recorders that an analysis run shares.

    Attributes:
        loads: the cell under its loads.
        checks: checks of all responses so far.
        states: recorder of states.
        progress: printed lines and bars.
        directory: folder of the result, where path events are stored; None without files.
        resume: whether a path continues from the checkpoint.
        log: function that receives a line about each path event.
        opening: returns, as text, the entries of result.json that are known before the analysis.  Collective.
        undetermined: names of undetermined strains; `loaded_point` adds a list for each point.
        excess: largest ratio of strains under one load to strains of the bonded cell, over all loaded points.
        notes: remarks on the result, which analyses append.
    """

    loads: CellLoads
    checks: CheckRecorder
    states: StateRecorder
    progress: standard_streams.Progress
    directory: Path | None = None
    resume: bool = False
    log: Callable[[str], object] = lambda line: None
    opening: Callable[[AnalysisContext], str] = lambda context: "{}"
    undetermined: list[list[str]] = field(default_factory=list)
    excess: float = 0.0
    notes: list[str] = field(default_factory=list)

    @classmethod
    def of(
        cls, cell: unit_cell.TornCell, progress: standard_streams.Progress, states: StateRecorder | None = None
    ) -> AnalysisContext:
        """Return a context without a folder.  Without a recorder `states`, no fields are kept."""
        contact = cell.case.interface is not None and cell.case.interface.contact
        recorder = StateRecorder(cell, None, False, progress.say) if states is None else states
        return cls(CellLoads(cell, contact), CheckRecorder(cell.solver.rtol), recorder, progress)

    @property
    def plane(self) -> averaging.Homogenization:
        """Return the first problem: the plane problem, or conduction."""
        return self.loads.problems[0]

    @property
    def cell(self) -> unit_cell.TornCell:
        """Return the torn cell of the first problem."""
        return self.plane.cell

    @property
    def case(self) -> Case:
        """Return the case of the cell."""
        return self.cell.case

    def bonds(self, opening: float | None) -> BondState:
        """Return the initial bond state.  Debonded arcs without an angle of their own open by `opening` degrees."""
        return replace(self.plane.intact, status=np.where(self.cell.debonded(opening), OPEN, BONDED).astype(np.int8))

    def response_errors(
        self, groups: Sequence[Sequence[averaging.Response]]
    ) -> tuple[list[mesh_estimate.EnergyErrors], list[averaging.Response]]:
        """Estimate the mesh errors of responses, given as one group for each problem.  Collective.

        Returns the errors by problem, [] if `mesh_error = false`, and a flat list of responses with element errors and,
        where later steps need them, inner displacements.
        """
        has_tips = any(response.debonded for group in groups for response in group)
        if self.states.is_recording or self.case.output.sensitivities or has_tips:
            groups = [*map(recovered_fields.with_displacements, self.cell.problems, groups)]
        if not self.case.output.mesh_error:
            return [], [*chain(*groups)]
        from feti_homog.homogenization import mesh_estimate  # imports the recovery of stresses

        errors, estimated = list[mesh_estimate.EnergyErrors](), list[averaging.Response]()
        zones = self.tip_zones if has_tips else [None] * len(groups)
        for problem, group, tip_zones in zip(self.loads.problems, groups, zones, strict=False):
            touches = problem.interface.contact and any(response.debonded for response in group)
            errors.append(mesh_estimate.energy_errors(problem.cell, group, touches, zones=tip_zones))
            shares = errors[-1].shares.T
            estimated += [replace(response, shares=part) for response, part in zip(group, shares, strict=True)]
        return errors, estimated

    def unit_states(
        self, bonds: BondState, starts: Sequence[Float], sign: float = 1.0, label: str = "", point: int = 0
    ) -> tuple[dict[str, Float], list[mesh_estimate.EnergyErrors], list[averaging.Response]]:
        """Solve for `sign` times the unit loads, estimate mesh errors, and record the states.  Collective.

        Solves start from multipliers `starts`.  Returns `CellLoads.secants`, errors by problem, and all responses.
        States have the name `label` + load, with a minus for a negative `sign`, and the point number `point`.
        """
        prefix = f"{label}-" if sign < 0 else label
        responses = list[averaging.Response]()
        for problem in self.loads.problems:
            first, count = len(responses), len(problem.loads)
            responses += problem.respond(sign * np.eye(count), bonds, starts[first : first + count])
            for name, response in zip(problem.loads, responses[first:], strict=True):
                self.progress.say(self.checks.record(f"{prefix}{name}", response))
        columns = self.loads.secants(responses, sign)
        errors, responses = self.response_errors(self.loads.by_problem(responses))
        in_plane = len(self.plane.loads) if self.cell.solver.problem.turns else 0
        states = dict[str, Sequence[averaging.Response | None]]()
        for number, (name, response) in enumerate(zip(self.loads.names, responses, strict=True)):
            states[f"{prefix}{name}"] = (response, None) if number < in_plane else (None, response)
        self.states.record(states, sign, point)
        return columns, errors, responses

    @cached_property
    def checkpoint(self) -> checkpoints.EventsInMemory:
        """The store of path events, in the folder or in memory.  Collective when first read; may raise CaseError."""
        from feti_homog.results import checkpoints  # only paths have events

        comm, jumps, room = self.cell.comm, self.cell.solver.jump_operator, checkpoints.room_of(self.case)
        if self.directory is None:  # without recorded states and tips, a path never rereads an event
            reads_again = self.states.is_recording or self.cell.bond_law.has_toughness
            return checkpoints.EventsInMemory(comm, room if reads_again else 0)
        pieces = f"{self.cell.summary.subdomains} subdomains on {comm.size} ranks, {jumps.global_rows} multipliers"
        digest = mpi_errors.on_root(comm, self.case.digest, False)  # events are the same for any [output]
        return checkpoints.Checkpoint(self.directory, comm, f"case {digest}, {pieces}\n{self.opening(self)}", room)

    @cached_property
    def tip_zones(self) -> list[energy_release.TipZones]:
        """The zones about tips of debonded arcs, for energy release rates, by problem.  Collective when first read."""
        from feti_homog.homogenization import energy_release  # bonded cells have no tips

        return [energy_release.TipZones(problem.cell) for problem in self.loads.problems]

    @cached_property
    def fibre_interfaces(self) -> averaging.FibreInterfaces:
        """The fibre interfaces of the cell.  Collective when first read."""
        return averaging.FibreInterfaces(self.cell)

    def point(self, responses: Sequence[averaging.Response]) -> dict[str, Any]:
        """Build the result.json entries of a point on debonding and iterations.  Collective.

        Debonding is under gamma12 or, with a single load, under this load; iterations are summed over the responses.
        """
        last, faces = responses[: len(voigt.STRAINS)][-1], self.fibre_interfaces
        length = faces.length(last.state.status != BONDED)
        debonding = {"debonded_share": faces.share(length), "debonded_length": length}
        debonding["debonding_angle"] = faces.angle(length)
        if len(self.case.interfaces) > 1:
            debonding["debonded_shares"] = faces.shares(last.state.status)
        return debonding | last.counts | {"iterations": sum(r.state.iterations for r in responses)}

    def loaded_point(self, responses: Sequence[averaging.Response]) -> dict[str, Any]:
        """Build the entries of a point under one load: means, energies, debonding, iterations.  Collective.

        Also appends the undetermined strains of the point to `undetermined`, and updates `excess`.
        """
        pairs = [(problem.interface, r.state) for problem, r in zip(self.loads.problems, responses, strict=True)]
        masks = np.concatenate([interface.undetermined(state) for interface, state in pairs])
        self.undetermined.append([name for name, is_free in zip(self.loads.names, masks, strict=True) if is_free])
        excesses = [interface.scales.excess(state.solution.strain, state.asked) for interface, state in pairs]
        self.excess = max(self.excess, *excesses)
        in_springs = sum(response.in_springs for response in responses)
        energies = {"stored": sum(response.stored for response in responses), "stored_in_springs": in_springs}
        iterations = sum(response.state.iterations for response in responses)
        return self.loads.means(responses) | energies | self.point(responses[:1]) | {"iterations": iterations}

    def remarks(self) -> list[str]:
        """List `notes`, and remarks on corners, singular stresses, undetermined strains and absurdly large strains."""
        lines, label = [*dict.fromkeys(self.notes)], f"[{self.case.analysis.type}]"
        if places := sorted(self.states.singularities):
            lines.append(f"largest stresses beside {' and '.join(places)} rise without limit with finer elements")
        if self.cell.summary.corner_edges > 3 and self.case.output.mesh_error:
            sizes = "for moduli 10 to 1000 times larger 2 to 6 times, in axial shear and conduction 5 to 20 times"
            lines.append(f"[cell] phases meet at points: mesh errors exceed their estimates, {sizes}")
        if names := [name for name in voigt.SPATIAL_STRAINS if any(name in free for free in self.undetermined)]:
            points = f" at {sum(map(bool, self.undetermined))} of {len(self.undetermined)} points"
            where = points if self.case.section.is_followed else ""
            reason = "with a given stress nothing resists them, and the result has one value of many"
            lines.append(f"{label} {', '.join(names)}: undetermined{where}: {reason}")
        if self.excess > ABSURD:
            reason = "hardly anything carries the stresses"
            lines.append(f"{label} strains {self.excess:.1e} times those of the bonded cell: {reason}")
        return lines

    def warnings(self) -> list[str]:
        """List valid but probably unintended settings: process zones, element sizes, solver tolerance."""
        summary = self.cell.summary
        zones = cell_remarks.warnings(self.case, summary.width, summary.interface_edge, summary.radii)
        return [*zones, *self.checks.warnings()]
