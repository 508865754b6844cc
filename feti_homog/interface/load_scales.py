"""Sizes of what loads make in a cell, whatever is debonded: for tolerances, and for errors to be relative to."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from feti_homog.feti.solver import FetiSolver
from feti_homog.mechanics.bounds import reuss, voigt
from feti_homog.typing import Float


class LoadScales:
    """Of the loads (v,) of a problem: its m strains, and what else acts."""

    def __init__(self, solver: FetiSolver, size: Float) -> None:
        """`size` (2,) is that of the cell."""
        self._solver, self._size = solver, size

    @cached_property
    def least_bonded_stiffness(self) -> Float:
        """(v, v) Reuss' bound <L^-1>^-1 of the strains, and <L> of the other loads, collective: a scale of stress and
        energy that debonding does not make zero."""
        shares, stiffnesses = self._phases
        m, least = self._solver.problem.strains, voigt(shares, stiffnesses)
        least[:m, m:] = least[m:, :m] = 0.0
        least[:m, :m] = reuss(shares, stiffnesses[:, :m, :m])
        return least

    @cached_property
    def _phases(self) -> tuple[Float, Float]:
        """Shares (n,) and stiffnesses (n, v, v) of all subdomains.  Collective."""
        parts = self._solver.comm.allgather([(s.area, s.L) for s in self._solver.subdomains])
        areas, stiffnesses = zip(*(part for own in parts for part in own), strict=True)
        return np.array(areas) / sum(areas), np.stack(stiffnesses)

    @cached_property
    def largest_stiffness(self) -> float:
        """The largest entry of Reuss' bound.  Collective."""
        m = self._solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m]).max())

    @cached_property
    def _free_strains(self) -> Float:
        """(m, v) sizes of the strains that the loads make: their own, and of the others the largest of free bodies.

        A soft body that expands hardly moves a stiff one, but its free motion is what the dual problem has to close.
        Collective."""
        m, stiffnesses = self._solver.problem.strains, self._phases[1]
        free = np.linalg.solve(stiffnesses[:, :m, :m], stiffnesses[:, :m, m:])
        return np.hstack([np.eye(m), np.abs(free).max(axis=0)])

    def caused_stress(self, loads: Float) -> float:
        """A stress that the loads (v,) cause at least if all is bonded.  Collective."""
        problem = self._solver.problem
        mean, caused = voigt(*self._phases), self.least_bonded_stiffness.copy()
        caused[:, problem.strains :] = mean[:, problem.strains :]
        # What works on a temperature is no stress.
        return float(np.abs(caused[: problem.stresses] @ loads).max())

    def imposed(self, loads: Float) -> float:
        """Largest displacement E y that the loads (v,) impose on the cell, or would on a free one.  Collective."""
        corners = self._size * np.array([[1, 0], [0, 1], [1, 1]])
        return float(np.abs(corners @ self._solver.problem.gradient(self.imposed_strain(loads)).T).max())

    def stress_scale(self, loads: Float) -> float:
        """A stress that the loads (v,) would make in the bonded cell at least, whatever their signs.  Collective."""
        m = self._solver.problem.strains
        return float(np.abs(self.least_bonded_stiffness[:m, :m] @ self.imposed_strain(loads)).max())

    def imposed_strain(self, loads: Float) -> Float:
        """(m,) sizes of the strains that the loads (v,) make.  Collective."""
        return np.asarray(self._free_strains @ np.abs(loads))
