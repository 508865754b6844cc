"""Places of free fibres: rigid motions that open all their gaps, or the nodes that squeeze them.

The gaps of such a fibre are unique up to its rigid motions M a.  It has room if amplitudes a exist with gap + M a >= 0:
a linear programme for each fibre, solved on rank 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix, vstack

from feti_homog.errors import ConvergenceError
from feti_homog.feti import DualSolution
from feti_homog.feti.coarse import natural
from feti_homog.feti.decomposition import constraint_layout
from feti_homog.mesh import periodic_topology
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Array, Bool, Float

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

T = TypeVar("T")

# Rigid motions that change gaps by less than this, relative to slips, open none: a round fibre turns.
LARGEST_GAP_OF_SLIDING = 1e-9
# Nodes with a smaller share of the largest contact force are not needed for the balance of forces.
LEAST_FORCE_SHARE = 1e-6
# Largest amplitude of a motion in a linear programme, in largest gaps: a fibre may have room without end on one side.
LARGEST_MOTION = 1e3
# The least tolerance of HiGHS, relative to the largest gap; its default of 1e-7 is coarser than the solver's error.
LP_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True)
class _Fibres:
    """On rank 0, for all nodes: the gaps (k, motions) that free motions open, and the fibre of each.

    A fibre and its coating, which may part too, count as one fibre, and so do neighbouring layers.  `reach` (motions,)
    is the largest gap or slip of each motion at any node, for the open nodes may lie within one rigid group.
    """

    is_open: Bool
    opening: csr_matrix
    reach: Float
    fibre: Array

    def nodes_and_motions(self, of: Bool) -> Iterator[tuple[Array, Float, Array, Float]]:
        """Yield the open nodes (n,) of each fibre with an open node in `of` (k,), and their motions M (n, m).

        Then the numbers (c,) of the free motions that move them, and the combinations (c, m) of these; m = 0 if no free
        motion opens a gap.
        """
        nodes = np.flatnonzero(self.is_open & np.isin(self.fibre, self.fibre[self.is_open & of]))
        nodes = nodes[np.argsort(self.fibre[nodes], kind="stable")]
        opening = self.opening[nodes]
        ends = [0, *(np.flatnonzero(np.diff(self.fibre[nodes])) + 1), len(nodes)]
        for first, last in pairwise(ends) if len(nodes) else ():
            columns = np.unique(opening.indices[slice(*opening.indptr[[first, last]])])
            motions, modes = opening[first:last, columns].toarray(), np.zeros((len(columns), 0))
            if motions.size:
                _, size, basis = np.linalg.svd(motions, full_matrices=False)
                # Combinations that open gaps: not sliding, nor motions of both faces together.
                modes = basis[size > LARGEST_GAP_OF_SLIDING * max(size[0], self.reach[columns].max())].T
            yield nodes[first:last], motions @ modes, columns, modes

    def place(self, gap: Float, noise: float) -> tuple[Float, Bool]:
        """Return amplitudes (motions,) that move fibres with overlaps, and the nodes (k,) that close."""
        pressed, amplitudes = np.zeros(len(gap), bool), np.zeros(self.opening.shape[1])
        for node, motion, columns, modes in self.nodes_and_motions(gap < -noise):
            if not modes.shape[1]:
                continue
            # The largest s with gap + motion a >= s, and the multipliers of the inequalities.
            scale, size = np.abs(gap[node]).max(), np.abs(motion).max(axis=0)
            result = _maximised(-motion / size, np.ones(len(node)), gap[node] / scale, (None, 1.0))
            amplitudes[columns] += modes @ (result.x[:-1] * scale / size)
            if float(result.x[-1] * scale) < -noise:
                forces = -result.ineqlin.marginals
                pressed[node[forces > LEAST_FORCE_SHARE * forces.max()]] = True
        return amplitudes, pressed

    def shares(self, before: Float, after: Float, noise: float) -> tuple[float, float]:
        """Return the shares of `FloatingBodies.admissible_share` for gaps (k,)."""
        shares = [(1.0, 1.0)]
        for node, motion, *_ in self.nodes_and_motions(after < -2 * noise):
            a, b = before[node], after[node]
            if not motion.shape[1]:
                shares.append(shares_to_zero(a, b, noise))
            elif (certain := _last_share(a, b, motion, 2 * noise)) < 1.0:
                shares.append((_last_share(np.maximum(a, 0.0), b, motion, 0.0), certain))
        begins, certain = np.min(shares, axis=0)
        return float(begins), float(certain)


@dataclass(frozen=True)
class FloatingBodies:
    """Free fibres, with the open nodes (k,) of this rank; gaps below `noise` may be the solver's error."""

    comm: MPI.Intracomm
    coarse: natural.NaturalCoarseSpace
    nodes: constraint_layout.InterfaceNodes
    is_open: Bool
    noise: float

    def place(self, solution: DualSolution) -> tuple[Float, Bool]:
        """Move the free fibres so that no open node overlaps by more than noise.  Collective, decided on rank 0.

        A fibre that overlaps moves to the place where its smallest gap is largest.  If even this gap overlaps, the
        programme's dual solution is a system of contact forces in balance, and its nodes close.

        Return amplitudes (dimension,) to add to alpha, and the open nodes (k,) that close for lack of room.

        Raises:
            ConvergenceError: on every rank; a linear programme was not solved.
        """
        gap = solution.jump[self.nodes.row]
        if not self.comm.allreduce(bool((self.is_open & (gap < -self.noise)).any()), MPI.LOR):
            return np.zeros(self.coarse.kernel_dimension), np.zeros(len(gap), bool)
        amplitudes, pressed = self._on_root(_Fibres.place, gap)
        first = self.comm.exscan(len(gap)) or 0
        return np.asarray(self.coarse.unconstrained_modes @ amplitudes), pressed[first : first + len(gap)]

    def admissible_share(self, before: Float, after: Float) -> tuple[float, float]:
        """Return the shares of the way from gaps `before` (k,) to `after` (k,) up to which fibres have room.

        The largest w <= 1 for which all fibres have amplitudes a with

            (1 - w) before + w after + M a >= 0,   and   >= -2 noise:

        there the first fibre begins to be pressed, and is beyond doubt.  Collective, decided on rank 0; raises as
        `place`.
        """
        return self._on_root(_Fibres.shares, before, after)

    def _on_root(self, decide: Callable[..., T], *gaps: Float) -> T:
        """Return decide(fibres, *gaps, noise) of rank 0, with the gaps of all nodes, on every rank.  Collective."""
        free = self.coarse.unconstrained_modes.tocsr()
        opening, slip = ((self.coarse.G[self.nodes.row + i] @ free).tocsr() for i in range(2))
        reach = np.zeros(free.shape[1])
        np.maximum.at(reach, np.r_[opening.indices, slip.indices], np.abs(np.r_[opening.data, slip.data]))
        parts = self.comm.gather((self.is_open, opening, self.nodes.bodies, reach, *gaps))

        def decided() -> T:
            is_open, opening, bodies, reach, *gaps = zip(*(parts or []), strict=True)
            # Bodies between two fibres link their motions, except the pinned body.
            pairs, fixed = np.concatenate(bodies), self.coarse.pinned_body
            (outer, inner), between = pairs.T, (pairs != fixed).all(axis=1)
            labels = periodic_topology.components(int(pairs.max(initial=0)) + 1, outer[between], inner[between])
            groups = np.asarray(labels[np.where(inner == fixed, outer, inner)])
            fibres = _Fibres(np.concatenate(is_open), vstack(opening).tocsr(), np.max(reach, axis=0), groups)
            return decide(fibres, *map(np.concatenate, gaps), self.noise)

        return mpi_errors.on_root(self.comm, decided)


def shares_to_zero(before: Float, after: Float, noise: float | Float) -> tuple[float, float]:
    """Return the shares of the way between values (k,) at which the first is 0, and is -2 noise; else 1, 1.

    Values that end above -2 noise, a number or (k,), may be the solver's error and do not count.
    """
    falls = after < -2 * noise
    a, b, doubt = before[falls], after[falls], np.broadcast_to(2 * noise, falls.shape)[falls]
    begins, certain = (np.maximum(a + slack, 0.0) / (a - b) for slack in (0.0, doubt))
    return float(begins.min(initial=1.0)), float(certain.min(initial=1.0))


def _last_share(before: Float, after: Float, motion: Float, slack: float) -> float:
    """Return max w <= 1 with (1 - w) before + w after + motion a >= -slack; w = 0 is possible."""
    scale, size = np.abs([before, after]).max(), np.abs(motion).max(axis=0)
    result = _maximised(-motion / size, (before - after) / scale, (before + slack) / scale, (0.0, 1.0))
    return float(result.x[-1])


def _maximised(motions: Float, last: Float, limits: Float, bounds: tuple[float | None, float]) -> OptimizeResult:
    """Return max x_-1 with motions x_:-1 + last x_-1 <= limits and x_-1 within its bounds.

    Raises:
        ConvergenceError: HiGHS found no solution.
    """
    from scipy.optimize import linprog  # slow to import, and few cells have free fibres

    cost = np.r_[np.zeros(motions.shape[1]), -1.0]
    limited = [(-LARGEST_MOTION, LARGEST_MOTION)] * motions.shape[1] + [bounds]
    rows = np.column_stack([motions, last])
    result = linprog(cost, A_ub=rows, b_ub=limits, bounds=limited, method="highs", options=LP_TOLERANCES)
    if not result.success:
        raise ConvergenceError(f"the linear programme that places a free fibre was not solved: {result.message}")
    return result
