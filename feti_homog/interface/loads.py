"""Prescribe loads by strains or conjugate stresses, compute scales of load effects, and solve under a load.

Errors are relative to sizes of load effects in the bonded cell, which debonding does not change.  For mixed loads,
solutions under prescribed strains and under unit strains, with equal active rows, are superposed to meet the stresses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from feti_homog.errors import NotCarriedError
from feti_homog.feti import DualSolution, FetiSolver
from feti_homog.materials import phase_bounds
from feti_homog.system.parallel import distributed_arrays
from feti_homog.typing import Bool, Float

# Rounding error of loads relative to the ends of a leg, of fractions of a leg, and of vanishing jumps and strains.
ROUNDING = 1e-12
# Multiple of the bonded cell's strains beyond which strains are not a scale for errors.
ABSURD = 1e3
# Sizes up to this many relative tolerances of the Krylov method, times the largest force or the imposed displacement,
# may be the solver's error, which in solves from good multipliers was a few hundredths of a tolerance.
SIGN_NOISE_PER_RTOL = 10.0
# Fraction of the largest force, stress or squared amplitude below which values are rounding errors.
NEGLIGIBLE = 1e-6

Multipliers = tuple[Float, ...]
"""Multipliers (owned rows,) of each problem, the plane problem first."""


@dataclass(frozen=True)
class Macroscopic:
    """The macroscopic strains E, with temperature changes, and their work conjugates Sigma.

    E.Sigma is an energy per cell area.  With fixed bonds the cell stores E.Sigma / 2, and E'.Sigma = E.Sigma' for two
    states E, Sigma and E', Sigma' (Betti).

    Attributes:
        strain, stress: (n,) E and Sigma.
    """

    strain: Float
    stress: Float

    @property
    def stored(self) -> float:
        """The energy E.Sigma / 2 per cell area that the cell stores with fixed bonds."""
        return 0.5 * float(self.strain @ self.stress)

    def scaled(self, factor: float) -> Macroscopic:
        """Return the state under `factor` times the load."""
        return Macroscopic(factor * self.strain, factor * self.stress)

    def load(self, by_stress: Bool) -> Load:
        """Return the load with this state's stresses in the components `by_stress` (n,), strains in others."""
        return Load(np.where(by_stress, self.stress, self.strain), by_stress)

    def released_to(self, after: Macroscopic) -> float:
        """Return the energy per cell area that a break releases at constant load.

        Work minus the change of stored energy is 1/2 (E'.Sigma - E.Sigma'), where ' marks the state `after` the break;
        at constant strain it is 1/2 E.(Sigma - Sigma').
        """
        return 0.5 * float(after.strain @ self.stress - self.strain @ after.stress)


@dataclass(frozen=True)
class Load:
    """A load of n components: each is a macroscopic strain or temperature change, or the conjugate stress.

    Attributes:
        values: (n,) strains and stresses.
        by_stress: (n,) whether a component prescribes the stress.
    """

    values: Float
    by_stress: Bool

    @classmethod
    def strain(cls, values: Float) -> Load:
        """Make the load that prescribes strains (n,) in all components."""
        return cls(values, np.zeros(len(values), bool))

    def parts(self, sizes: Sequence[int]) -> list[Load]:
        """Split the load into consecutive loads with the numbers of components in `sizes`."""
        ends = np.cumsum(sizes)[:-1]
        return [Load(*part) for part in zip(np.split(self.values, ends), np.split(self.by_stress, ends), strict=True)]

    def after(self, share: float, end: Load) -> Load:
        """Return the load at the fraction `share` of the way to the load `end`; components that cancel are zero.

        Both loads must prescribe stresses in the same components.
        """
        values = (1.0 - share) * self.values + share * end.values
        largest = np.abs([self.values, end.values]).max(axis=0)
        return Load(np.where(np.abs(values) <= ROUNDING * largest, 0.0, values), self.by_stress)


class LoadScales:
    """Scales of the effects of v loads in a problem: m strains, then actions such as a temperature.

    Attributes:
        mean_stiffness: (v, v) mean stiffness <L>, Voigt's bound for strains.
        least_bonded_stiffness: (v, v) Reuss' bound <L^-1>^-1 for strains, <L> for other loads, 0 between both.
        largest_stiffness: largest entry of Reuss' bound.
        bound_ratio: least eigenvalue of Reuss' bound relative to Voigt's bound for strains; `acting` raises strains to
            this fraction of `asked`.
        roots: (v,) square roots of the diagonal of `least_bonded_stiffness`, inf for loads without a stress; strains
            times these roots, and stresses over them, are comparable.
        longest: (k,) for each node of this rank, the largest tributary length on the node's interface.
    """

    def __init__(self, solver: FetiSolver, size: Float) -> None:
        """Compute the scales for a dual solver and a cell with sides `size` (2,).  Collective."""
        self.solver, self.size = solver, size
        m, stresses, nodes = solver.problem.strains, solver.problem.stresses, solver.jump_operator.nodes
        parts = self.solver.comm.allgather([(s.areas, s.laws) for s in self.solver.subdomains])
        pairs = [pair for pairs_of_rank in parts for pair in pairs_of_rank]
        areas, stiffnesses = (np.concatenate(arrays) for arrays in zip(*pairs, strict=True))
        shares = areas / areas.sum()
        self.mean_stiffness = phase_bounds.voigt(shares, stiffnesses)
        self.least_bonded_stiffness = self.mean_stiffness.copy()
        self.least_bonded_stiffness[:m, m:] = self.least_bonded_stiffness[m:, :m] = 0.0
        self.least_bonded_stiffness[:m, :m] = phase_bounds.reuss(shares, stiffnesses[:, :m, :m])
        self.largest_stiffness = float(np.abs(self.least_bonded_stiffness[:m, :m]).max())
        ratios = np.linalg.solve(self.mean_stiffness[:m, :m], self.least_bonded_stiffness[:m, :m])
        self.bound_ratio = float(np.linalg.eigvals(ratios).real.min())
        self.roots = np.full(len(self.mean_stiffness), np.inf)
        self.roots[:stresses] = np.sqrt(self.least_bonded_stiffness.diagonal()[:stresses])
        # The scale of a load other than a strain is the largest strain that the load causes in a free body: a soft body
        # that expands hardly moves a stiff body, but the dual problem has to close the free expansion.
        free = np.linalg.solve(stiffnesses[:, :m, :m], stiffnesses[:, :m, m:])
        self._strains = np.hstack([np.eye(m), np.abs(free).max(axis=0)])
        # The softer body in series with the springs: stress (k,) at bonds per cell strain.
        last = solver.comm.allreduce(max((s.submesh.body for s in solver.subdomains), default=-1), MPI.MAX)
        of_body = np.zeros(int(last) + 1)
        for s in solver.subdomains:
            of_body[s.submesh.body] = np.abs(s.L[:m, :m]).max()
        solver.comm.Allreduce(MPI.IN_PLACE, of_body, MPI.MAX)
        rows = nodes.row[:, None] + np.arange(solver.jump_operator.components)
        give = solver.intact_compliance[rows].min(axis=1, initial=np.inf) * nodes.length / self.size.max()
        self._bond_stiffness = 1.0 / (1.0 / of_body[nodes.bodies].min(axis=1, initial=np.inf) + give)
        self._bodies = len(of_body)
        self.longest = self.over_interface(nodes.length)

    def over_interface(self, values: Float) -> Float:
        """Return, for each node, the largest of 0 and `values` (k,) on its interface over all ranks.  Collective."""
        inner, largest = self.solver.jump_operator.nodes.bodies[:, 1], np.zeros(self._bodies)
        np.maximum.at(largest, inner, values)
        self.solver.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
        return np.asarray(largest[inner])

    def bond_stress(self, loads: Float) -> Float:
        """Return the scale of the stresses at this rank's bonds, (k,) or (k, n), under loads (v,) or (v, n).

        This is the largest `imposed_strain` times the stiffness of the softer body and the springs in series.
        """
        largest: Float = np.multiply.outer(self._bond_stiffness, self.imposed_strain(loads).max(axis=0))
        return largest

    def imposed(self, loads: Float) -> float:
        """Return the largest displacement that the strains of loads (v,) impose on the cell."""
        corners = self.size * np.array([[1, 0], [0, 1], [1, 1]])
        return float(np.abs(corners @ self.solver.problem.gradient(self.imposed_strain(loads)).T).max())

    def stress_scale(self, loads: Float) -> float:
        """Return the scale of the stress in the bonded cell under loads (v,), by Reuss' bound."""
        m = self.solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m] @ self.imposed_strain(loads)).max())

    @property
    def sign_noise(self) -> float:
        """The relative size up to which forces, gaps and stiffnesses may be the solver's error."""
        return SIGN_NOISE_PER_RTOL * self.solver.rtol

    def gap_noise(self, strain: Float) -> float:
        """Return the size of gaps, under the loads `strain` (v,), up to which a gap may be the solver's error."""
        return self.sign_noise * self.imposed(strain)

    def force_noise(self, solution: DualSolution) -> Float:
        """Return the sizes (k,) up to which nodal forces may be the solver's error.  Collective.

        The error is relative to the largest force on the interface or, if larger, to the force that the imposed strain
        causes: errors in jumps change forces by the stiffness of the softer side.  Forces on other interfaces and
        between the pieces of a cut body do not count.
        """
        B = self.solver.jump_operator
        pairs = B.nodes.row[:, None] + np.arange(B.components)
        forces = np.abs(solution.lam[pairs]).max(axis=1, initial=0.0)
        caused = self.bond_stress(solution.strain) * self.longest
        return np.asarray(self.sign_noise * np.maximum(self.over_interface(forces), caused))

    def asked(self, load: Load) -> Float:
        """Return the absolute strains (v,) that a load prescribes, or causes by stresses, in the bonded cell."""
        k = self.solver.problem.stresses
        strain = np.abs(np.where(load.by_stress, 0.0, load.values))
        stress = np.abs(np.where(load.by_stress, load.values, 0.0))[:k]
        strain[:k] += np.abs(np.linalg.inv(self.least_bonded_stiffness[:k, :k])) @ stress
        return np.asarray(strain)

    def acting(self, strain: Float, asked: Float) -> Float:
        """Return the sizes (v,) of a state's loads `strain` (v,), with strains clipped, as scales for errors.

        The lower limit of a strain, `bound_ratio` times its size in `asked` (v,), matters where a path with friction
        returns to zero stress.  The upper limit is ABSURD times the largest strain that `asked` imposes.
        """
        sizes, m = np.abs(strain), self.solver.problem.strains
        sizes[:m] = np.clip(sizes[:m], self.bound_ratio * asked[:m], ABSURD * self.imposed_strain(asked).max())
        return np.asarray(sizes)

    def excess(self, strain: Float, asked: Float) -> float:
        """Return the largest imposed component of `strain` (v,) over that in `asked` (v,); 0 if `asked` is zero."""
        return float(self.imposed_strain(strain).max() / (self.imposed_strain(asked).max() or np.inf))

    def imposed_strain(self, loads: Float) -> Float:
        """Return the sizes, (m,) or (m, n), of strains plus largest free thermal strains, under loads (v,) or (v, n).

        Entries after the first v, the stresses of tractions on the sides, follow from the first v and do not count.
        """
        return np.asarray(self._strains @ np.abs(loads[: self._strains.shape[1]]))


def solve_load(scales: LoadScales, load: Load, start: Float) -> DualSolution:
    """Solve the dual problem under a load, from multipliers `start` (owned rows,).  Collective.

    Strains that no stiffness resists stay zero if their stresses are below the solver's error.  Raises NotCarriedError
    on every rank if the stresses are larger.
    """
    solver = scales.solver
    if not (load.by_stress.any() and load.values.any()):
        return solver.solve(load.values, start)
    unknown = np.flatnonzero(load.by_stress)
    strains = np.vstack([np.where(load.by_stress, 0.0, load.values), np.eye(len(load.values))[unknown]])
    starts = np.column_stack([start, np.zeros((len(start), len(unknown)))])
    has_strain = bool(strains[0].any())
    needed = slice(0 if has_strain else 1, None)
    solutions = solver.solve_many(strains[needed], starts[:, needed])
    stresses = np.stack([solver.stress_integral(solution)[unknown] / scales.size.prod() for solution in solutions])
    deficit = load.values[unknown] - stresses[0] if has_strain else load.values[unknown]
    imposed = scales.imposed_strain(strains[0])
    noise = scales.sign_noise * float((scales.roots[: len(imposed)] * imposed).max())
    # Roots of stiffnesses scale the strains, so that all strains have similar sizes.  Scaled stiffnesses below the
    # solver's error, and scaled stresses below `noise`, are zero.
    stiffness, roots = stresses[-len(unknown) :], scales.roots[unknown]
    eigenvalues, vectors = np.linalg.eigh((stiffness + stiffness.T) / (2 * np.outer(roots, roots)))
    along = vectors.T @ (deficit / roots)
    resists = eigenvalues > scales.sign_noise
    largest = max(NEGLIGIBLE * np.abs(deficit / roots).max(), noise)
    is_carried = not np.abs(along[~resists]).max(initial=0.0) > largest
    answer = vectors[:, resists] @ (along[resists] / eigenvalues[resists]) / roots if is_carried else None
    # Rank 0 decides: where a stiffness nearly vanishes, rounding may differ from processor to processor.
    unknown_strains = solver.comm.bcast(answer)
    if unknown_strains is None:
        raise NotCarriedError("nothing in the cell carries the stresses of the load")
    factors = np.concatenate([np.ones(len(solutions) - len(unknown)), unknown_strains])
    return solver.jumps.superposed(solutions, factors, solver.d)


def unresisted(solver: FetiSolver, by_stress: Bool, voigt: Float) -> Bool:
    """Mark the strains (v,) that prescribed stresses leave undetermined.  Collective.

    Under such a strain, rigid motions of the torn bodies close all active jumps, and the bodies bear no stress: only
    debonded faces move apart.  `by_stress` (v,) marks prescribed stresses; `voigt` (v, v) is area times mean stiffness.
    """
    unknown, undetermined = np.flatnonzero(by_stress), np.zeros(len(by_stress), bool)
    torn = solver.d[:, unknown]
    opened = solver.natural.project(solver.jumps.restrict(torn))
    sizes, open_jumps = (distributed_arrays.allreduce_sum(solver.comm, jumps.T @ jumps) for jumps in (torn, opened))
    largest = np.array([np.diag(sizes), np.abs(voigt[unknown, unknown])])
    scales = np.sqrt(np.where(largest > 0.0, largest, 1.0))
    stiffness = solver.torn_stiffness[np.ix_(unknown, unknown)]
    resistance = open_jumps / np.outer(scales[0], scales[0]) + stiffness / np.outer(scales[1], scales[1])
    values, vectors = np.linalg.eigh(resistance)  # the eigenvalues are squares of sizes
    undetermined[unknown] = (np.abs(vectors[:, values < NEGLIGIBLE**2]) > NEGLIGIBLE).any(axis=1)
    return np.asarray(solver.comm.bcast(undetermined))
