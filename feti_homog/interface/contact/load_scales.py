"""Sizes of what loads make in a cell, whatever is debonded: for tolerances, and for errors to be relative to."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from mpi4py import MPI

from feti_homog.feti.dual_solution import DualSolution
from feti_homog.feti.solver import FetiSolver
from feti_homog.interface.loads import Load
from feti_homog.materials.bounds import reuss, voigt
from feti_homog.typing import Float

# A strain that is as many times that of the bonded cell is no scale for errors.
ABSURD = 1e3
# A force or a gap has a sign if it is larger than this many relative tolerances of the Krylov method, times the
# largest force or imposed displacement; below, the solver's error may have made it.
SIGN_NOISE_PER_RTOL = 10.0


class LoadScales:
    """Loads (v,) of a problem: its m strains, and what else acts."""

    def __init__(self, solver: FetiSolver, size: Float) -> None:
        """`size` (2,) is that of the cell."""
        self.solver, self.size = solver, size

    @cached_property
    def least_bonded_stiffness(self) -> Float:
        """(v, v) Reuss' bound <L^-1>^-1 of the strains, and <L> of the other loads.  Collective.

        It is a scale of stress and energy that debonding does not make zero.
        """
        shares, stiffnesses = self._phases
        m, least = self.solver.problem.strains, self.mean_stiffness.copy()
        least[:m, m:] = least[m:, :m] = 0.0
        least[:m, :m] = reuss(shares, stiffnesses[:, :m, :m])
        return least

    @cached_property
    def mean_stiffness(self) -> Float:
        """(v, v) <L>, Voigt's bound of the strains.  Collective."""
        return voigt(*self._phases)

    @cached_property
    def _phases(self) -> tuple[Float, Float]:
        """Shares (n,) and stiffnesses (n, v, v) of all subdomains.  Collective."""
        parts = self.solver.comm.allgather([(s.areas, s.laws) for s in self.solver.subdomains])
        areas, stiffnesses = (np.concatenate(own) for own in zip(*(part for own in parts for part in own), strict=True))
        return areas / areas.sum(), stiffnesses

    @cached_property
    def roots(self) -> Float:
        """(v,) scales of the diagonal of `least_bonded_stiffness`.  Collective.

        By these strains are multiplied and stresses divided that are compared with each other; inf of what works on no
        stress.
        """
        diagonal = np.full(len(self.least_bonded_stiffness), np.inf)
        stresses = slice(self.solver.problem.stresses)
        diagonal[stresses] = self.least_bonded_stiffness.diagonal()[stresses]
        return np.asarray(np.sqrt(diagonal))

    @cached_property
    def largest_stiffness(self) -> float:
        """The largest entry of Reuss' bound.  Collective."""
        m = self.solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m]).max())

    @cached_property
    def _bond_stiffness(self) -> Float:
        """(k,) stress at each bond of this rank per strain of the cell: of the softer body, its springs in a row.

        Collective.
        """
        solver, nodes = self.solver, self.solver.jump_operator.nodes
        m, own = solver.problem.strains, np.zeros(self._bodies)
        for s in solver.subdomains:
            own[s.submesh.body] = np.abs(s.L[:m, :m]).max()
        solver.comm.Allreduce(MPI.IN_PLACE, own, MPI.MAX)
        rows = nodes.row[:, None] + np.arange(solver.jump_operator.components)
        give = solver.intact_compliance[rows].min(axis=1, initial=np.inf) * nodes.length / self.size.max()
        return np.asarray(1.0 / (1.0 / own[nodes.bodies].min(axis=1, initial=np.inf) + give))

    @cached_property
    def _bodies(self) -> int:
        """Number of bodies.  Collective."""
        last = max((s.submesh.body for s in self.solver.subdomains), default=-1)
        return int(self.solver.comm.allreduce(last, MPI.MAX)) + 1

    def over_interface(self, values: Float) -> Float:
        """(k,) of each bond of this rank the largest of values (k,), 0 at least, on all of its inner body.

        Collective.
        """
        inner, largest = self.solver.jump_operator.nodes.bodies[:, 1], np.zeros(self._bodies)
        np.maximum.at(largest, inner, values)
        self.solver.comm.Allreduce(MPI.IN_PLACE, largest, MPI.MAX)
        return np.asarray(largest[inner])

    @cached_property
    def longest(self) -> Float:
        """(k,) the largest tributary length on the interface of each bond of this rank.  Collective."""
        return self.over_interface(self.solver.jump_operator.nodes.length)

    def bond_stress(self, loads: Float) -> Float:
        """(k,) or (k, n) stress that the loads (v,) or (v, n) make at each bond of this rank.  Collective.

        It is the stress that they make, or would if nothing else bore them.
        """
        largest: Float = np.multiply.outer(self._bond_stiffness, self.imposed_strain(loads).max(axis=0))
        return largest

    @cached_property
    def _free_strains(self) -> Float:
        """(m, v) sizes of the strains that the loads make: their own, and of the others the largest of free bodies.

        A soft body that expands hardly moves a stiff one, but its free motion is what the dual problem has to close.
        Collective."""
        m, stiffnesses = self.solver.problem.strains, self._phases[1]
        free = np.linalg.solve(stiffnesses[:, :m, :m], stiffnesses[:, :m, m:])
        return np.hstack([np.eye(m), np.abs(free).max(axis=0)])

    def imposed(self, loads: Float) -> float:
        """Largest displacement E y that the loads (v,) impose on the cell, or would on a free one.  Collective."""
        corners = self.size * np.array([[1, 0], [0, 1], [1, 1]])
        return float(np.abs(corners @ self.solver.problem.gradient(self.imposed_strain(loads)).T).max())

    def stress_scale(self, loads: Float) -> float:
        """Return a stress that the loads (v,) would make in the bonded cell at least, whatever their signs.

        Collective.
        """
        m = self.solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m] @ self.imposed_strain(loads)).max())

    @property
    def sign_noise(self) -> float:
        """Share of the largest force, or of the imposed displacement, below which a sign is the solver's error."""
        return SIGN_NOISE_PER_RTOL * self.solver.rtol

    def gap_noise(self, strain: Float) -> float:
        """Gaps smaller than this may be the solver's error.  Collective."""
        return self.sign_noise * self.imposed(strain)

    def stress_noise(self, strain: Float) -> float:
        """Macroscopic stresses smaller than this may be the solver's error.  Collective."""
        return self.sign_noise * self.stress_scale(strain)

    def force_noise(self, solution: DualSolution) -> Float:
        """(k,) nodal forces at each node of this rank smaller than which may be the solver's error; collective.

        It is a share of the largest of the same interface, or of what the imposed strain makes: an error of the jumps
        moves forces by the stiffness of the softer side.  Forces between the pieces of a cut body do not count here,
        however large, nor do those of other interfaces."""
        B = self.solver.jump_operator
        pairs = B.nodes.row[:, None] + np.arange(B.components)
        forces = np.abs(solution.lam[pairs]).max(axis=1, initial=0.0)
        caused = self.bond_stress(solution.strain) * self.longest
        return np.asarray(self.sign_noise * np.maximum(self.over_interface(forces), caused))

    def asked(self, load: Load) -> Float:
        """(v,) sizes of the strains of a load: those given, and the bonded cell's under its stresses.  Collective."""
        k = self.solver.problem.stresses
        given = np.abs(np.where(load.by_stress, 0.0, load.values))
        stress = np.abs(np.where(load.by_stress, load.values, 0.0))[:k]
        given[:k] += np.abs(np.linalg.inv(self.least_bonded_stiffness[:k, :k])) @ stress
        return np.asarray(given)

    def acting(self, strain: Float, asked: Float) -> Float:
        """(v,) sizes of strains that errors are relative to: those of a state, up to an absurd multiple of `asked`.

        Collective.
        """
        most = ABSURD * self.imposed_strain(asked).max()
        is_strain = np.arange(len(strain)) < self.solver.problem.strains
        return np.where(is_strain, np.minimum(np.abs(strain), most), np.abs(strain))

    def excess(self, strain: Float, asked: Float) -> float:
        """Return how many times as large as `asked` the strains (v,) of a state are.  Collective."""
        return float(self.imposed_strain(strain).max() / (self.imposed_strain(asked).max() or np.inf))

    def imposed_strain(self, loads: Float) -> Float:
        """(m,) or (m, n) sizes of the strains that the loads (v,) or (v, n) make.  Collective."""
        return np.asarray(self._free_strains @ np.abs(loads))
