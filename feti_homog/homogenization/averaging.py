"""Average fields to macroscopic responses, measure errors in the balance laws, and sum debonded lengths of fibres.

A strain E is [E11, E22, gamma12], followed by the other loads of the problem; a stress has the conjugate entries.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.errors import ConvergenceError
from feti_homog.feti import DualSolution
from feti_homog.feti.decomposition import jump_operator
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface import Load
from feti_homog.interface.contact import BondState, Contact, ContactProblem, Equilibrium, Status, coupled_interfaces
from feti_homog.materials import voigt
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float


@dataclass(frozen=True)
class Response:
    """The response of the cell to one macroscopic strain.

    Attributes:
        strain: (v,) E.
        stress: (v,) Sigma = <sigma>, conjugate to E.
        scale: ratio of the response to `state`.
        stored: energy per cell area, 1/2 <sigma:eps> with springs; if brief, 1/2 Sigma.E minus half the friction work.
        in_springs: spring energy per cell area; without friction 1/2 sum lam^2 C / area.
        state: interface states, multipliers, jumps and amplitudes.
        u: (boundary dofs,) fluctuating displacement u* on this rank's subdomain boundaries; (0,) if brief.
        checks: relative error in each law; if brief, only of the contact certificate.
            `strain`: <eps> = E, Eq. (3), where <eps> includes the opening of debonded faces and the strain of voids,
            both from boundaries; in a cell of one subdomain this error shows whether the mesh is closed.
            `hill`: <sigma:eps> = Sigma:E, Eq. (8), with the spring energy and the friction work on debonded faces;
            relative to the larger of <sigma:eps> and Reuss' energy bound for a bonded cell, because a debonded
            cell may store nothing; in a cell of one subdomain from the factor (`CondensedLoads.energy`).
            `jump`: the largest opening at a glued node relative to the largest u* plus the largest displacement that
            the loads impose; absent in a cell of one subdomain.
            `stress`: the largest error in a prescribed stress relative to the larger of the largest stress and the
            least stress that the strains cause in a bonded cell.  The errors of the contact certificate (KKT) follow.
        counts: numbers of `bonded`, `open` and `closed` interface nodes.
        damage: (k,) bond damage, 0 intact to 1 broken.
        shares: (m,) contributions of this rank's elements to the estimated error of E . Sigma; None if not estimated.
        inside: (dofs,) u* in this rank's parts; (0,) before `recovered_fields.with_displacements`.
    """

    strain: Float
    stress: Float
    scale: float
    stored: float
    in_springs: float
    state: Equilibrium
    u: Float
    checks: dict[str, float]
    counts: dict[str, int]
    damage: Float
    shares: Float | None = None
    inside: Float = field(default_factory=lambda: np.zeros(0))

    @property
    def leading(self) -> str:
        """The largest in-plane strain and the stress of this component, in words."""
        k = int(np.abs(self.strain[: len(voigt.STRAINS)]).argmax())
        return f"{voigt.STRAINS[k]} {self.strain[k]:.4g}, {voigt.STRESSES[k]} {self.stress[k]:.4g}"

    @property
    def all_loads(self) -> Float:
        """All loads (v,) of the response times `scale`, with all entries of `DualSolution.strain`."""
        return self.scale * self.state.solution.strain

    @property
    def solution(self) -> DualSolution:
        """The dual solution times `scale`, except for the amplitudes and the residual."""
        state = self.state.solution
        return replace(state, strain=self.all_loads, lam=self.scale * state.lam, jump=self.scale * state.jump)

    @property
    def debonded(self) -> int:
        """The number of debonded interface nodes."""
        return self.counts["open"] + self.counts["closed"]


class Homogenization:
    """Solve unit-cell problems on the torn `cell`, with contact of faces if `contact`, and average their fields.

    Attributes:
        law: bond law, without the energies released at tips; None without [interface].
        interface: the contact problem.
    """

    def __init__(self, cell: TornCell, contact: bool) -> None:
        self.cell, size = cell, np.array([cell.summary.width, cell.summary.height])
        self.law = cell.bond_law if cell.case.interfaces else None
        softening = None if self.law is None else self.law.softening
        self.interface = ContactProblem(cell.solver, contact, size, softening)

    @property
    def intact(self) -> BondState:
        """The interface state in which all bonds hold."""
        nodes = len(self.interface.nodes.row)
        history = np.zeros((nodes, 0)) if self.law is None else self.law.begin(nodes)
        return BondState(np.zeros(nodes, np.int8), history, np.zeros(nodes, bool))

    @property
    def loads(self) -> tuple[str, ...]:
        """The names of the unit loads."""
        return self.cell.solver.problem.loads

    def respond(self, strains: Float, bonds: BondState, starts: Sequence[Float]) -> list[Response]:
        """Solve the unit-cell problem under each strain, and average.  Collective.

        Strains are (k, v); `bonds` has debonded nodes and a first guess of contact; `starts` are initial multipliers.
        Raises like `response` and `ContactProblem.equilibrium`.
        """
        if self.interface.is_linear(bonds.status):
            return [self.response(state, 1.0) for state in self.interface.equilibria(strains, bonds, starts)]
        pairs = zip(strains, starts, strict=True)
        return [self.response(self.interface.equilibrium(Load.strain(E), bonds, start), 1.0) for E, start in pairs]

    def response(self, state: Equilibrium, scale: float, brief: bool = False) -> Response:
        """Average an equilibrium, multiplied by `scale`.  Collective.

        If `brief`, a state without kernel amplitudes is averaged from its multipliers, and only the contact is checked.
        Raises ConvergenceError if the residual of the state is not finite, because the Krylov method broke down.
        """
        if not np.isfinite(state.solution.residual):
            end = f"after {state.iterations} iterations (KSPConvergedReason {state.solution.reason})"
            raise ConvergenceError(f"strain {state.solution.strain.tolist()}: the Krylov method broke down {end}")
        if brief and state.solution.alpha is None:
            strain, stress = state.solution.strain, self.interface.stress(state.solution)
            energy = float(stress @ strain) - self._rubbing(state)
            return self._scaled(state, scale, stress, energy, np.zeros(0), {})
        cell, solver = self.cell, self.cell.solver
        state = self.interface.completed(state)
        loads, u = state.solution.strain, solver.boundary_displacement(state.solution)
        strain = loads[: len(self.loads)]
        # <sigma>, <eps*> over bodies and voids, and <sigma:eps>.
        without_u, from_u = solver.condensed.stiffness @ loads, solver.condensed.boundary.T @ u
        work = loads @ solver.condensed.energy @ loads + 2 * loads @ from_u
        work += u @ solver.interface_operators.apply_schur(u)
        sums = np.concatenate([without_u + from_u, self._strain_of_displacements.T @ u, [work]])
        means = distributed_arrays.allreduce_sum(cell.comm, sums) / cell.summary.area
        all_stresses, fluctuation, (energy,) = np.split(means, [len(loads), -1])
        sides, stress = all_stresses[len(strain) :], solver.closure.T @ all_stresses
        springs = state.solution.compliance * state.solution.lam
        active = self.interface.active(state.status) * (coupled_interfaces.slipped(self.interface, state) == 0.0)
        opened = state.solution.jump * (1 - active) + springs
        opening = distributed_arrays.allreduce_sum(self.cell.comm, self._strain_of_jumps.T @ opened)
        energy = float(energy) + self._stretched(state)
        rubbing = self._rubbing(state)
        scales = self.interface.scales
        acting = scales.acting(strain, state.asked)
        largest = (self._largest(u) + scales.imposed(acting)) or 1.0
        imposed = float(scales.imposed_strain(acting).max()) or 1.0
        reuss = scales.stress_scale(acting) * imposed
        unbalanced = sides if sides.size else fluctuation - opening / self.cell.summary.area
        checks = {
            "strain": float(np.abs(unbalanced).max() / imposed) + (0.0 if sides.size else self._strain_inside),
            "hill": float(abs(energy + rubbing - stress @ strain) / (max(abs(energy), reuss) or 1.0)),
        }
        if solver.jump_operator.global_rows:
            checks["jump"] = self._largest(active * state.solution.jump) / largest
        if state.load.by_stress.any():
            checks["stress"] = self._unmet_stress(state, stress)
        return self._scaled(state, scale, stress, energy, u, checks)

    def _stretched(self, state: Equilibrium) -> float:
        """Return twice the spring energy per area, including bonds with friction.  Collective."""
        springs = state.solution.compliance * state.solution.lam
        twice = float(state.solution.lam @ springs) + coupled_interfaces.energy_beside_springs(self.interface, state)
        return float(self.cell.comm.allreduce(twice)) / self.cell.summary.area

    def _scaled(
        self, state: Equilibrium, scale: float, stress: Float, energy: float, u: Float, checks: dict[str, float]
    ) -> Response:
        """Return the response of a state times `scale`; `energy` is twice the state's energy per area.  Collective."""
        means = scale * state.solution.strain[: len(stress)], scale * stress
        energies = scale**2 * energy / 2, scale**2 * self._stretched(state) / 2
        errors, damage = checks | state.certificate, self.damage(state.bonds)
        return Response(*means, scale, *energies, state, scale * u, errors, self.counts(state.status), damage)

    def damage(self, bonds: BondState) -> Float:
        """Return the bond damage (k,), from 0, intact, to 1, broken."""
        damage = None if self.law is None else self.law.damage(bonds)
        return (bonds.status != Contact.BONDED).astype(float) if damage is None else damage

    def _rubbing(self, state: Equilibrium) -> float:
        """Return the friction work per area, which the cell does not store; 0 without friction.  Collective."""
        if state.bonds.gap_and_slip is None:
            return 0.0
        work = float(state.solution.lam @ state.solution.jump)
        work -= coupled_interfaces.energy_beside_springs(self.interface, state)
        return float(self.cell.comm.allreduce(work)) / self.cell.summary.area

    def _unmet_stress(self, state: Equilibrium, stress: Float) -> float:
        """Return the relative error in a prescribed stress, as in `Response.checks`."""
        load, scales = state.load, self.interface.scales
        # Roots of stiffnesses scale the stresses, so that all stresses have similar sizes.
        root, imposed = scales.roots, scales.imposed_strain(state.asked)
        error = np.abs((stress - load.values)[load.by_stress] / root[load.by_stress]).max()
        largest = max(np.abs(stress / root)[: len(imposed)].max(), (root[: len(imposed)] * imposed).max())
        return float(error / (largest or 1.0))

    def counts(self, status: Status) -> dict[str, int]:
        """Count interface nodes on all ranks by contact state: `bonded`, `open`, `closed`.  Collective."""
        if self.cell.summary.across:  # without multipliers no bond can break
            return {"bonded": self.cell.summary.interface_nodes or 0, "open": 0, "closed": 0}
        numbers = np.array([(status == kind).sum() for kind in (Contact.BONDED, Contact.OPEN, Contact.CLOSED)])
        return dict(zip(("bonded", "open", "closed"), self.cell.comm.allreduce(numbers).tolist(), strict=True))

    @cached_property
    def _strain_of_jumps(self) -> Float:
        """The matrix nu (owned rows, m) that gives int eps* = nu^T B u from jumps B u.  Collective when first read."""
        solver = self.cell.solver
        B = solver.interface_operators.B
        integrals = solver.jump_operator.sum(B @ self._strain_of_displacements)
        gram = jump_operator.NodeBlocks(self.cell.comm, solver.jump_operator, B @ B.T)
        return np.asarray(gram.inverse(np.ones(gram.rows)) @ integrals)

    @cached_property
    def _strain_of_displacements(self) -> Float:
        """The matrix N (boundary dofs, m) that gives int eps* = N^T u, over bodies and voids, from displacements u."""
        m, dofs = self.cell.solver.problem.strains, self.cell.solver.interface_operators.dofs
        pairs = zip(self.cell.subdomains, dofs, strict=True)
        return np.concatenate([np.zeros((0, m)), *(s.mean_strain(boundary) for s, boundary in pairs)])

    @cached_property
    def _strain_inside(self) -> float:
        """The largest weight of nodes inside subdomains in int eps* / sqrt(area); 0 for closed meshes.  Collective."""
        inner, size = 0.0, 0.0
        for s, boundary in zip(self.cell.subdomains, self.cell.solver.interface_operators.dofs, strict=True):
            size = max(size, float(np.sqrt(s.area)))
            if not s.loads_inside:
                continue
            inside = np.ones(s.n_dofs, bool)
            inside[boundary] = False
            inside[s.problem.dofs(s.held)] = False  # these nodes do not move
            inner = max(inner, float(np.abs(s.mean_strain(np.flatnonzero(inside))).max(initial=0.0)))
        return float(self.cell.comm.allreduce(inner, MPI.MAX) / self.cell.comm.allreduce(size, MPI.MAX))

    def _largest(self, values: Float) -> float:
        """Return max |values| over all ranks.  Collective."""
        return float(self.cell.comm.allreduce(np.abs(values).max(initial=0.0), MPI.MAX))


class FibreInterfaces:
    """The interface lengths of f fibres, by fibre number; a coated fibre may have two interfaces."""

    def __init__(self, cell: TornCell) -> None:
        """Sum the interface lengths of each fibre.  Collective."""
        self._cell, self._nodes, self._numbers = cell, cell.solver.jump_operator.nodes, cell.summary.numbers
        self._fibre = self._numbers[self._nodes.fibre] - 1
        self._length = self.length(np.ones(len(self._fibre), bool))
        of_coating = self.length(~cell.summary.is_fibre[self._nodes.fibre])
        radius = np.where(of_coating > 0, np.nan, cell.summary.radii[cell.summary.fibre_bodies])
        round_fibre = np.degrees(1.0 / np.where(np.isnan(radius), 1.0, radius))
        self._degrees = np.where(np.isnan(radius), 360.0 / np.where(self._length > 0, self._length, 1.0), round_fibre)

    def length(self, which: Bool) -> Float:
        """Sum the interface length of each fibre (f,) over the nodes in the mask `which` (k,).  Collective."""
        sums: Float = np.bincount(self._fibre, self._nodes.length * which, self._cell.summary.fibres).astype(float)
        return distributed_arrays.allreduce_sum(self._cell.comm, sums)

    def loose(self, status: Status) -> list[int]:
        """List the numbers, from 1, of fibres with an interface on which no bond is intact.  Collective."""
        inner, count = self._nodes.fibre, len(self._numbers)
        lengths = [np.bincount(inner, self._nodes.length * which, count) for which in (status == Contact.BONDED, 1.0)]
        bonded, length = distributed_arrays.allreduce_sum(self._cell.comm, np.stack(lengths))
        return [int(number) for number in np.unique(self._numbers[(bonded == 0.0) & (length > 0.0)])]

    def angle(self, length: Float) -> Float:
        """Convert interface lengths (f,) to degrees: by the radius of round, uncoated fibres, else as shares of 360."""
        return np.asarray(length * self._degrees)

    def share(self, length: Float) -> float:
        """Return the sum of lengths (f,) over the interface length of all fibres; 0 without interfaces."""
        return float(length.sum() / (self._length.sum() or 1.0))

    def shares(self, status: Status) -> Float:
        """Return the debonded length fraction (i,) of each [[interface]] section, 0 without nodes.  Collective."""
        weights = np.stack([self._nodes.length, self._nodes.length * (status != Contact.BONDED)])
        sums = [np.bincount(self._nodes.pair, row, len(self._cell.case.interfaces)).astype(float) for row in weights]
        length, debonded = distributed_arrays.allreduce_sum(self._cell.comm, np.stack(sums))
        return np.asarray(debonded / np.where(length > 0, length, 1.0))


def asymmetry(L: Float) -> float:
    """Return the relative asymmetry max |L - L^T| / max |L| of a matrix L."""
    return float(np.abs(L - L.T).max() / np.abs(L).max())
