"""Macroscopic response of the torn cell, and the laws that every response must obey.

The strain E is that of the problem, in the plane [E11, E22, gamma12], with its other loads behind; so is the stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.errors import ConvergenceError
from feti_homog.feti.decomposition.jump_operator import NodeBlocks
from feti_homog.homogenization.unit_cell import TornCell
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import energy_beside_springs, slipped
from feti_homog.interface.contact.states import BONDED, CLOSED, OPEN, BondState, Equilibrium, Status
from feti_homog.interface.loads import Load
from feti_homog.materials.voigt import STRAINS, STRESSES
from feti_homog.system.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float


@dataclass(frozen=True)
class Response:
    """The cell under one macroscopic strain.

    Attributes:
        strain: (v,) E.
        stress: (v,) Sigma = <sigma>, what works on E.
        scale: the response is `scale` times `state`.
        stored: energy per area of the cell, 1/2 <sigma:eps> from the displacements and what the springs store.
        in_springs: the latter, 1/2 sum lam^2 C / |UC|.
        state: interface states, multipliers, jumps and amplitudes.
        u: (boundary dofs,) fluctuating displacement u* on the boundaries of this rank's subdomains; (0,) if brief.
        checks: relative errors of the laws: `strain` <eps> = E, Eq. (3), with the opening of debonded faces and
            the strain of voids, which is that of their boundaries, as parts of <eps>;
            `hill` <sigma:eps> = Sigma:E, Eq. (8), springs included, relative to <sigma:eps> or, if
            that is less, to what a bonded cell stores at least by Reuss' bound, for a debonded one may store nothing;
            with friction <sigma:eps> and what the forces on debonded faces do on their jumps;
            `jump`, the largest opening of a glued node relative to the largest displacement, which does not vanish
            where forces do; the KKT certificate of contact; and if stresses are prescribed `stress`, the
            largest error of one relative to the largest stress or, if that is less, to what the strains would make in a
            bonded cell at least. Of a cell that is one subdomain nothing is glued, and there is no `jump`; `strain`
            is that of its mesh, which is closed, and `hill` that of the factor (`CondensedLoads.energy`).
        counts: numbers of `bonded`, `open` and `closed` interface nodes.
        damage: (k,) of the bonds, 0 intact to 1 broken.
        shares: (m,) what each element of this rank has of the estimated error of E . Sigma, where it is known.
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

    @property
    def leading(self) -> str:
        """The largest strain of the plane and its stress, in words."""
        k = int(np.abs(self.strain[: len(STRAINS)]).argmax())
        return f"{STRAINS[k]} {self.strain[k]:.4g}, {STRESSES[k]} {self.stress[k]:.4g}"

    @property
    def debonded(self) -> int:
        """Number of debonded interface nodes."""
        return self.counts["open"] + self.counts["closed"]


class Homogenization:
    """Averages over a torn cell with its interfaces.

    Attributes:
        law: of the bonds, without what tips release.
        interface: the contact problem.
    """

    def __init__(self, cell: TornCell, contact: bool) -> None:
        self.cell, size = cell, np.array([cell.summary.width, cell.summary.height])
        self.law = cell.bond_law
        self.interface = ContactProblem(cell.solver, contact, size, self.law.softening)

    @property
    def intact(self) -> BondState:
        """State of the interfaces with all bonds."""
        nodes = len(self.interface.nodes.row)
        return BondState(np.zeros(nodes, np.int8), self.law.begin(nodes), np.zeros(nodes, bool))

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the unit loads."""
        return self.cell.solver.problem.loads

    def respond(self, strains: Float, bonds: BondState, starts: Sequence[Float]) -> list[Response]:
        """Solve the unit-cell problem under every strain of (k, v) and average.  Collective.

        `bonds` have the debonded nodes and a guess of who is in contact; `starts` are first multipliers.

        Raises:
            ConvergenceError: a solve broke down and left no numbers.
        """
        if self.interface.is_linear(bonds.status):
            return [self.response(state, 1.0) for state in self.interface.equilibria(strains, bonds, starts)]
        pairs = zip(strains, starts, strict=True)
        return [self.response(self.interface.equilibrium(Load.strain(E), bonds, start), 1.0) for E, start in pairs]

    def response(self, state: Equilibrium, scale: float, brief: bool = False) -> Response:
        """Return the averages of `scale` times an equilibrium. Collective.

        If `brief`, a state that F lambda did not confirm has those that follow from its multipliers, and of the checks
        those of contact alone.

        Raises:
            ConvergenceError: its numbers are not finite.
        """
        if not np.isfinite(state.solution.residual):
            raise ConvergenceError(
                f"strain {state.solution.strain.tolist()}: the Krylov method broke down after {state.iterations} "
                f"iterations (KSPConvergedReason {state.solution.reason})"
            )
        if brief and state.solution.alpha is None:
            strain, stress = state.solution.strain, self.interface.stress(state.solution)
            energy = float(stress @ strain) - self._rubbing(state)
            return self._scaled(state, scale, stress, energy, np.zeros(0), {})
        solver, state = self.cell.solver, self.interface.completed(state)
        strain, u = state.solution.strain, solver.boundary_displacement(state.solution)
        stress, star, energy = self._averages(strain, u)
        springs = state.solution.compliance * state.solution.lam
        active = self.interface.active(state.status) * (slipped(self.interface, state) == 0.0)
        opened = state.solution.jump * (1 - active) + springs
        opening = allreduce_sum(self.cell.comm, self._strain_of_jumps.T @ opened)
        energy += self._stretched(state)
        rubbing = self._rubbing(state)
        acting = self.interface.acting(state.bonds, strain, state.asked)
        largest = (self._largest(u) + self.interface.scales.imposed(acting)) or 1.0
        imposed = float(self.interface.scales.imposed_strain(acting).max()) or 1.0
        least = self.interface.scales.stress_scale(acting) * imposed
        checks = {
            "strain": float(np.abs(star - opening / self.cell.summary.area).max() / imposed) + self._strain_inside,
            "hill": float(abs(energy + rubbing - stress @ strain) / (max(abs(energy), least) or 1.0)),
        }
        if solver.jump_operator.global_rows:
            checks["jump"] = self._largest(active * state.solution.jump) / largest
        if state.load.by_stress.any():
            checks["stress"] = self._unmet_stress(state, stress)
        return self._scaled(state, scale, stress, energy, u, checks)

    def _stretched(self, state: Equilibrium) -> float:
        """Return lam C lam per area, twice what springs store; also of bonds that rub.  Collective."""
        springs = state.solution.compliance * state.solution.lam
        twice = float(state.solution.lam @ springs) + energy_beside_springs(self.interface, state)
        return float(self.cell.comm.allreduce(twice)) / self.cell.summary.area

    def _scaled(
        self, state: Equilibrium, scale: float, stress: Float, energy: float, u: Float, checks: dict[str, float]
    ) -> Response:
        """Return the response that is `scale` times a state with <sigma:eps> = `energy`.  Collective."""
        counts = self.counts(state.status)
        means = scale * state.solution.strain, scale * stress
        energies = scale**2 * energy / 2, scale**2 * self._stretched(state) / 2
        checks, damage = checks | state.certificate, self.damage(state.bonds)
        return Response(*means, scale, *energies, state, scale * u, checks, counts, damage)

    def damage(self, bonds: BondState) -> Float:
        """(k,) damage of the bonds, 0 intact to 1 broken."""
        damage = self.law.damage(bonds)
        return (bonds.status != BONDED).astype(float) if damage is None else damage

    def _rubbing(self, state: Equilibrium) -> float:
        """Return the sum of force times slip of faces with friction, per area: what the loads do not store.

        Collective.
        """
        if state.bonds.gap_and_slip is None:
            return 0.0
        own = float(state.solution.lam @ state.solution.jump) - energy_beside_springs(self.interface, state)
        return float(self.cell.comm.allreduce(own)) / self.cell.summary.area

    def _unmet_stress(self, state: Equilibrium, stress: Float) -> float:
        """Return the error of the prescribed stresses, relative to the load and to the stresses. Collective."""
        load, scales = state.load, self.interface.scales
        # Scaled by the roots of their stiffnesses, so that none is small beside another.
        root, imposed = scales.roots, scales.imposed_strain(state.asked)
        off = np.abs((stress - load.values)[load.by_stress] / root[load.by_stress]).max()
        largest = max(np.abs(stress / root)[: len(imposed)].max(), (root[: len(imposed)] * imposed).max())
        return float(off / (largest or 1.0))

    def counts(self, status: Status) -> dict[str, int]:
        """Interface nodes in each state; collective."""
        if self.cell.summary.across:  # no multiplier is there, and nothing can part
            return {"bonded": self.cell.summary.interface_nodes or 0, "open": 0, "closed": 0}
        numbers = np.array([(status == kind).sum() for kind in (BONDED, OPEN, CLOSED)])
        sums = self.cell.comm.allreduce(numbers)
        return dict(zip(("bonded", "open", "closed"), sums.tolist(), strict=True))

    @cached_property
    def _strain_of_jumps(self) -> Float:
        """(owned rows, m) nu with int eps* = nu^T B u for every displacement u: nu = (B B^T)^-1 B int B_e."""
        solver = self.cell.solver
        B = solver.interface_operators.B
        integrals = solver.jump_operator.sum(B @ self._strain_of_displacements)
        gram = NodeBlocks(self.cell.comm, solver.jump_operator, B @ B.T)
        return np.asarray(gram.inverse(np.ones(gram.rows)) @ integrals)

    @cached_property
    def _strain_of_displacements(self) -> Float:
        """(boundary dofs, m) of which int eps* over bodies and voids is the transpose times u."""
        m, dofs = self.cell.solver.problem.strains, self.cell.solver.interface_operators.dofs
        pairs = zip(self.cell.subdomains, dofs, strict=True)
        return np.concatenate([np.zeros((0, m)), *(s.mean_strain(own) for s, own in pairs)])

    @cached_property
    def _strain_inside(self) -> float:
        """The largest share of an inner node in int eps*, relative: 0 of closed meshes and voids.  Collective."""
        inner, size = 0.0, 0.0
        for s, own in zip(self.cell.subdomains, self.cell.solver.interface_operators.dofs, strict=True):
            size = max(size, float(np.sqrt(s.area)))
            if not s.loads_inside:
                continue
            inside = np.ones(s.n_dofs, bool)
            inside[own] = False
            if s.submesh.pinned >= 0:  # it does not move
                inside[s.problem.dofs(np.array([s.submesh.pinned]))] = False
            inner = max(inner, float(np.abs(s.mean_strain(np.flatnonzero(inside))).max(initial=0.0)))
        return float(self.cell.comm.allreduce(inner, MPI.MAX) / self.cell.comm.allreduce(size, MPI.MAX))

    def _averages(self, E: Float, u: Float) -> tuple[Float, Float, float]:
        """<sigma>, <eps*> over bodies and voids, and <sigma:eps>; collective."""
        cell, v = self.cell, len(E)
        without_u, from_u = cell.solver.condensed.stiffness @ E, cell.solver.loads.T @ u
        energy = (
            E @ cell.solver.condensed.energy @ E + 2 * E @ from_u + u @ cell.solver.interface_operators.apply_schur(u)
        )
        sums = np.concatenate([without_u + from_u, self._strain_of_displacements.T @ u, [energy]])
        sums = allreduce_sum(cell.comm, sums) / cell.summary.area
        return sums[:v], sums[v:-1], float(sums[-1])

    def _largest(self, values: Float) -> float:
        """max |values| over all ranks."""
        return float(self.cell.comm.allreduce(np.abs(values).max(initial=0.0), MPI.MAX))


def asymmetry(L: Float) -> float:
    """max |L - L^T| / max |L|."""
    return float(np.abs(L - L.T).max() / np.abs(L).max())


def displacement(cell: TornCell, strain: Float, u: Float) -> Float:
    """(nodes, c) total displacement H y + u*, Eq. (14), at the plane nodes of this rank's parts; H y of the strains."""
    points = np.concatenate([s.mesh.points for s in cell.parts] or [np.zeros((0, 2))])
    problem = cell.solver.problem
    imposed = points @ problem.gradient(strain[: problem.strains]).T
    return np.asarray(imposed + fluctuation(cell, u))


def fluctuation(cell: TornCell, u: Float) -> Float:
    """(nodes, c) u* at these nodes."""
    parts, c = zip(cell.parts, cell.offsets, strict=False), cell.solver.problem.components
    own = [u[o : o + len(s.dofs)].reshape(-1, c)[s.mesh.node_class] for s, o in parts]
    return np.concatenate(own or [np.zeros((0, c))])
