"""Where fibres lie that nothing holds: rigid motions that open all their gaps, or the nodes that squeeze them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_matrix

from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.jump_operator import InterfaceNodes
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.typing import Bool, Float

# Motions whose gaps are smaller than this, relative to their slips, do not open (a round fibre turns).
SLIDING = 1e-9


@dataclass(frozen=True)
class Placement:
    """Amplitudes (dimension,) to add to alpha, and the open nodes (k,) that must close for lack of room."""

    alpha: Float
    squeezed: Bool

    @classmethod
    def none(cls, nodes: int) -> Placement:
        """Nothing moves, nothing is squeezed."""
        return cls(np.zeros(0), np.zeros(nodes, bool))

    def jump(self, coarse: NaturalCoarseSpace) -> Float:
        """(owned rows,) G alpha."""
        return np.asarray(coarse.G @ self.alpha)


def place(
    comm: MPI.Intracomm,
    coarse: NaturalCoarseSpace,
    nodes: InterfaceNodes,
    is_open: Bool,
    solution: DualSolution,
    noise: float,
) -> Placement:
    """Move the loose fibres so that no open node overlaps by more than `noise`; collective, decided on rank 0.

    A fibre that overlaps is put where its smallest gap is largest: a linear programme in its rigid motions.  If even
    that overlaps, the programme's dual solution is a system of contact forces in balance, and its nodes close.
    """
    free = csr_matrix(coarse.unconstrained_modes)
    opening, slip = (np.asarray((coarse.G[nodes.row + i] @ free).todense()) for i in range(2))
    parts = comm.gather((solution.jump[nodes.row], opening, slip, nodes.fibre, is_open))
    answer = _place_all(parts, noise) if parts is not None else None
    amplitudes, squeezed = comm.bcast(answer)
    first = comm.exscan(len(nodes.row)) or 0
    return Placement(coarse.unconstrained_modes @ amplitudes, squeezed[first : first + len(nodes.row)])


def _place_all(parts: list[tuple[Float, Float, Float, NDArray[np.int64], Bool]], noise: float) -> tuple[Float, Bool]:
    gap, opening, slip, fibre, is_open = (np.concatenate(p) for p in zip(*parts, strict=True))
    squeezed, amplitudes = np.zeros(len(gap), bool), np.zeros(opening.shape[1])
    for f in np.unique(fibre[is_open & (gap < -noise)]):
        own = np.flatnonzero((fibre == f) & is_open)
        modes = _opening_modes(opening[own], slip[own])
        if modes.shape[1]:
            a, room, forces = _largest_gap(gap[own], opening[own] @ modes)
            amplitudes += modes @ a
            if room < -noise:
                squeezed[own[forces > 1e-6 * forces.max()]] = True
    return amplitudes, squeezed


def _opening_modes(opening: Float, slip: Float) -> Float:
    """(modes, m) the combinations of modes that open gaps: neither those of other fibres nor those that slide."""
    _, size, basis = np.linalg.svd(opening, full_matrices=False)
    return np.asarray(basis[size > SLIDING * max(size[0], np.abs(slip).max())].T)


def _largest_gap(gap: Float, motion: Float) -> tuple[Float, float, Float]:
    """max s with gap + motion a >= s: a, s, and the multipliers of the inequalities."""
    scale, size = np.abs(gap).max(), np.abs(motion).max(axis=0)
    rows = np.column_stack([-motion / size, np.ones(len(gap))])
    cost = np.r_[np.zeros(len(size)), -1.0]
    # Bounds keep a fibre in place that has room without end on one side.
    bounds = [(-1e3, 1e3)] * len(size) + [(None, 1.0)]
    result = linprog(cost, A_ub=rows, b_ub=gap / scale, bounds=bounds, method="highs")
    return result.x[:-1] * scale / size, float(result.x[-1] * scale), -result.ineqlin.marginals
