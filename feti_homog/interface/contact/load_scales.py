"""Scales for tolerances and errors: sizes of load effects in the bonded cell, independent of debonding."""

import numpy as np
from mpi4py import MPI

from feti_homog.feti import DualSolution, FetiSolver
from feti_homog.interface.loads import Load
from feti_homog.materials import phase_bounds
from feti_homog.typing import Float

# Multiple of the bonded cell's strains beyond which strains are not a scale for errors.
ABSURD = 1e3
# Sizes up to this many relative tolerances of the Krylov method, times the largest force or the imposed displacement,
# may be the solver's error, which in solves from good multipliers was a few hundredths of a tolerance.
SIGN_NOISE_PER_RTOL = 10.0
# Fraction of the largest force, stress or squared amplitude below which values are rounding errors.
NEGLIGIBLE = 1e-6


class LoadScales:
    """The scales of the loads (v,) in a problem: m strains, then actions such as a temperature.

    Attributes:
        mean_stiffness: (v, v) mean stiffness <L>, Voigt's bound for strains.
        least_bonded_stiffness: (v, v) Reuss' bound <L^-1>^-1 for strains, <L> for other loads.
        largest_stiffness: largest entry of Reuss' bound.
        bound_ratio: least ratio of Reuss' to Voigt's bound for strains: least share of `asked` that a stress causes.
        roots: (v,) square roots of the diagonal of `least_bonded_stiffness`, inf for loads without a stress; strains
            times these roots, and stresses over them, are comparable.
        longest: (k,) largest tributary length on the interface of each node.
    """

    def __init__(self, solver: FetiSolver, size: Float) -> None:
        """Compute the scales for a dual solver and a cell with sides `size` (2,).  Collective."""
        self.solver, self.size = solver, size
        m, stresses, nodes = solver.problem.strains, solver.problem.stresses, solver.jump_operator.nodes
        parts = self.solver.comm.allgather([(s.areas, s.laws) for s in self.solver.subdomains])
        areas, stiffnesses = map(np.concatenate, zip(*(pair for pairs in parts for pair in pairs), strict=True))
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
        # Actions other than strains cause the largest strains of free bodies: a soft body that expands hardly moves a
        # stiff body, but the dual problem has to close its free expansion.
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
        """Return, for each node, the largest of the values (k,) on its interface, at least 0.  Collective."""
        inner, largest = self.solver.jump_operator.nodes.bodies[:, 1], np.zeros(self._bodies)
        np.maximum.at(largest, inner, values)
        self.solver.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
        return np.asarray(largest[inner])

    def bond_stress(self, loads: Float) -> Float:
        """Bound the stresses at this rank's bonds, (k,) or (k, n), under loads (v,) or (v, n)."""
        largest: Float = np.multiply.outer(self._bond_stiffness, self.imposed_strain(loads).max(axis=0))
        return largest

    def imposed(self, loads: Float) -> float:
        """Return the largest displacement E y that loads (v,) impose on the cell."""
        corners = self.size * np.array([[1, 0], [0, 1], [1, 1]])
        return float(np.abs(corners @ self.solver.problem.gradient(self.imposed_strain(loads)).T).max())

    def stress_scale(self, loads: Float) -> float:
        """Return a lower bound for the stress in the bonded cell under loads (v,) of any sign."""
        m = self.solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m] @ self.imposed_strain(loads)).max())

    @property
    def sign_noise(self) -> float:
        """The relative size up to which a force, a gap or a stiffness may be the solver's error."""
        return SIGN_NOISE_PER_RTOL * self.solver.rtol

    def gap_noise(self, strain: Float) -> float:
        """Return the size up to which a gap may be the solver's error."""
        return self.sign_noise * self.imposed(strain)

    def force_noise(self, solution: DualSolution) -> Float:
        """Return the sizes (k,) up to which the nodal forces may be the solver's error.  Collective.

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
        """Return the sizes (v,) of the strains that a load prescribes or causes in the bonded cell."""
        k = self.solver.problem.stresses
        strain = np.abs(np.where(load.by_stress, 0.0, load.values))
        stress = np.abs(np.where(load.by_stress, load.values, 0.0))[:k]
        strain[:k] += np.abs(np.linalg.inv(self.least_bonded_stiffness[:k, :k])) @ stress
        return np.asarray(strain)

    def acting(self, strain: Float, asked: Float) -> Float:
        """Bound the strain sizes (v,) of a state by `bound_ratio` and ABSURD times `asked`, as scales for errors.

        The lower bound counts where a path with friction returns to zero stress.
        """
        sizes, m = np.abs(strain), self.solver.problem.strains
        sizes[:m] = np.clip(sizes[:m], self.bound_ratio * asked[:m], ABSURD * self.imposed_strain(asked).max())
        return np.asarray(sizes)

    def excess(self, strain: Float, asked: Float) -> float:
        """Return the largest strain of a state (v,), relative to the largest strain of `asked` (v,)."""
        return float(self.imposed_strain(strain).max() / (self.imposed_strain(asked).max() or np.inf))

    def imposed_strain(self, loads: Float) -> Float:
        """Return the strain sizes, (m,) or (m, n), that loads (v,) or (v, n) cause in the bonded cell.

        Loads behind the first v, which follow from them, do not count.
        """
        return np.asarray(self._strains @ np.abs(loads[: self._strains.shape[1]]))
