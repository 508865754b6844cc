"""Find positions of free fibres without overlap, or the nodes that squeeze a fibre.

Gaps around a free fibre are unique up to the gaps M a of rigid motions with amplitudes a.  The fibre has room if some a
satisfy gap + M a >= 0.  A linear programme for each fibre, solved on rank 0, decides.
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
from feti_homog.interface.loads import NEGLIGIBLE
from feti_homog.mesh import periodic_topology
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Array, Bool, Float

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

T = TypeVar("T")

# Ratio of gaps to slips below which a rigid motion opens no gap: a round fibre turns.
LARGEST_GAP_OF_SLIDING = 1e-9
# Largest motion in a linear programme over the largest gap: a fibre may have unlimited room on one side.
LARGEST_MOTION = 1e3
# Smallest tolerance of HiGHS, relative to the largest gap; its default of 1e-7 is coarser than the solver's error.
LP_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True)
class _Fibres:
    """All k interface nodes of all ranks, gathered on rank 0, and the free rigid motions of fibres.

    Attributes:
        is_open: (k,) open nodes.
        opening: (k, motions) gaps that the free motions open.
        reach: (motions,) largest gap or slip of each motion at any node, open or not.
        fibre: (k,) number of the fibre; bodies that share an interface, such as a fibre and its coating, share a
            number.
    """

    is_open: Bool
    opening: csr_matrix
    reach: Float
    fibre: Array

    def nodes_and_motions(self, which: Bool) -> Iterator[tuple[Array, Float, Array, Float]]:
        """Yield the open nodes and gap-opening motions of each fibre with an open node in `which` (k,).

        The items are the nodes (n,), their gaps (n, m) under m motions, the numbers (c,) of the free motions that move
        the nodes, and the m motions as combinations (c, m) of these; m = 0 if no free motion opens a gap.
        """
        nodes = np.flatnonzero(self.is_open & np.isin(self.fibre, self.fibre[self.is_open & which]))
        nodes = nodes[np.argsort(self.fibre[nodes], kind="stable")]
        opening = self.opening[nodes]
        ends = [0, *(np.flatnonzero(np.diff(self.fibre[nodes])) + 1), len(nodes)]
        for first, last in pairwise(ends) if len(nodes) else ():
            columns = np.unique(opening.indices[opening.indptr[first] : opening.indptr[last]])
            motions, modes = opening[first:last, columns].toarray(), np.zeros((len(columns), 0))
            if motions.size:
                _, size, basis = np.linalg.svd(motions, full_matrices=False)
                # Combinations that open gaps, without sliding and without motions of both faces together.
                modes = basis[size > LARGEST_GAP_OF_SLIDING * max(size[0], self.reach[columns].max())].T
            yield nodes[first:last], motions @ modes, columns, modes

    def place(self, gap: Float, noise: float) -> tuple[Float, Bool]:
        """Compute the motions of overlapping fibres, and the nodes that squeeze a fibre, from gaps (k,).

        Return amplitudes (motions,), 0 for other fibres, and the mask (k,) of nodes.  Raises like `_maximised`.
        """
        squeezes, amplitudes = np.zeros(len(gap), bool), np.zeros(self.opening.shape[1])
        for node, motion, columns, modes in self.nodes_and_motions(gap < -noise):
            if not modes.shape[1]:
                continue
            # The largest s with gap + motion a >= s, and the multipliers of the inequalities.
            scale, size = np.abs(gap[node]).max(), np.abs(motion).max(axis=0)
            result = _maximised(-motion / size, np.ones(len(node)), gap[node] / scale, (None, 1.0))
            amplitudes[columns] += modes @ (result.x[:-1] * scale / size)
            if float(result.x[-1] * scale) < -noise:
                forces = -result.ineqlin.marginals
                # Forces below this fraction of the largest are not needed for balance.
                squeezes[node[forces > NEGLIGIBLE * forces.max()]] = True
        return amplitudes, squeezes

    def shares(self, before: Float, after: Float, noise: float) -> tuple[float, float]:
        """Return the fractions of `FloatingBodies.admissible_share` for gaps (k,); raises like `_maximised`."""
        shares = [(1.0, 1.0)]
        for node, motion, *_ in self.nodes_and_motions(after < -2 * noise):
            a, b = before[node], after[node]
            if not motion.shape[1]:
                shares.append(shares_to_zero(a, b, noise))
                continue
            certain = _last_share(a, b, motion, 2 * noise)
            if certain < 1.0:
                shares.append((_last_share(np.maximum(a, 0.0), b, motion, 0.0), certain))
        begins, certain = np.min(shares, axis=0)
        return float(begins), float(certain)


@dataclass(frozen=True)
class FloatingBodies:
    """Free fibres, confined by faces at this rank's open nodes `is_open` (k,); overlaps up to `noise` may be errors."""

    comm: MPI.Intracomm
    coarse: natural.NaturalCoarseSpace
    nodes: constraint_layout.InterfaceNodes
    is_open: Bool
    noise: float

    def place(self, solution: DualSolution) -> tuple[Float, Bool]:
        """Find motions of free fibres that open all overlaps, up to noise.  Collective, decided on rank 0.

        A fibre that overlaps moves to the position with the largest minimum gap.  If even this gap overlaps, the dual
        solution of the linear programme is a system of contact forces in balance: the nodes of these forces squeeze the
        fibre, and have to close.  Raises ConvergenceError on every rank if HiGHS does not solve a linear programme.

        Returns:
            Amplitudes (kernel dimension,) to add to alpha, and the mask (k,) of open nodes that squeeze a fibre.
        """
        gap = solution.jump[self.nodes.row]
        if not self.comm.allreduce(bool((self.is_open & (gap < -self.noise)).any()), MPI.LOR):
            return np.zeros(self.coarse.kernel_dimension), np.zeros(len(gap), bool)
        amplitudes, squeezes = self._on_root(_Fibres.place, gap)
        first = self.comm.exscan(len(gap)) or 0
        return np.asarray(self.coarse.unconstrained_modes @ amplitudes), squeezes[first : first + len(gap)]

    def admissible_share(self, before: Float, after: Float) -> tuple[float, float]:
        """Return the fractions of a step between gaps (k,) up to which all fibres have room.

        The fractions are the largest w <= 1 for which all fibres have amplitudes a with

            (1 - w) before + w after + M a >= 0,   for the second fraction   >= -2 noise.

        At the first fraction, faces begin to squeeze a fibre; at the second, the squeezing is beyond doubt.  If no
        fibre is squeezed beyond doubt, both are 1.  Collective, decided on rank 0; raises like `place`.
        """
        return self._on_root(_Fibres.shares, before, after)

    def _on_root(self, decide: Callable[..., T], *gaps: Float) -> T:
        """Call `decide` on rank 0, with fibres, gaps of all ranks and noise; return the result on all.  Collective."""
        free = self.coarse.unconstrained_modes.tocsr()
        opening, slip = ((self.coarse.G[self.nodes.row + i] @ free).tocsr() for i in range(2))
        reach = np.zeros(free.shape[1])
        np.maximum.at(reach, np.r_[opening.indices, slip.indices], np.abs(np.r_[opening.data, slip.data]))
        parts = self.comm.gather((self.is_open, opening, self.nodes.bodies, reach, *gaps))

        def decided() -> T:
            is_open, openings, bodies, reaches, *gaps = zip(*(parts or []), strict=True)
            # A body between two fibres links their motions, unless the body is pinned.
            pairs, fixed = np.concatenate(bodies), self.coarse.pinned_body
            outer, inner = pairs.T
            between = (pairs != fixed).all(axis=1)
            labels = periodic_topology.components(int(pairs.max(initial=0)) + 1, outer[between], inner[between])
            groups = np.asarray(labels[np.where(inner == fixed, outer, inner)])
            fibres = _Fibres(np.concatenate(is_open), vstack(openings).tocsr(), np.max(reaches, axis=0), groups)
            return decide(fibres, *map(np.concatenate, gaps), self.noise)

        return mpi_errors.on_root(self.comm, decided)


def shares_to_zero(before: Float, after: Float, noise: float | Float) -> tuple[float, float]:
    """Return the fractions of a step at which the first of k values reaches 0 and -2 noise.

    The values go from `before` (k,) to `after` (k,); `noise` may be (k,).  Both fractions are 1 if all values end at or
    above -2 noise, for such values may be the solver's error.
    """
    falls = after < -2 * noise
    a, b, doubt = before[falls], after[falls], np.broadcast_to(2 * noise, falls.shape)[falls]
    begins, certain = (np.maximum(a + slack, 0.0) / (a - b) for slack in (0.0, doubt))
    return float(begins.min(initial=1.0)), float(certain.min(initial=1.0))


def _last_share(before: Float, after: Float, motion: Float, slack: float) -> float:
    """Return the largest w in [0, 1] for which amplitudes a give (1 - w) before + w after + motion a >= -slack."""
    scale, size = np.abs([before, after]).max(), np.abs(motion).max(axis=0)
    result = _maximised(-motion / size, (before - after) / scale, (before + slack) / scale, (0.0, 1.0))
    return float(result.x[-1])


def _maximised(motions: Float, last: Float, limits: Float, bounds: tuple[float | None, float]) -> OptimizeResult:
    """Maximize w within `bounds`, subject to motions a + last w <= limits and |a| <= LARGEST_MOTION.

    Return SciPy's result, where x = (a, w).  Raises ConvergenceError if HiGHS finds no solution.
    """
    from scipy.optimize import linprog  # slow to import, and few cells have free fibres

    cost = np.r_[np.zeros(motions.shape[1]), -1.0]
    limited = [(-LARGEST_MOTION, LARGEST_MOTION)] * motions.shape[1] + [bounds]
    rows = np.column_stack([motions, last])
    result = linprog(cost, A_ub=rows, b_ub=limits, bounds=limited, method="highs", options=LP_TOLERANCES)
    if not result.success:
        raise ConvergenceError(f"the linear programme that places a free fibre was not solved: {result.message}")
    return result
