"""Places of fibres that nothing holds: rigid motions that open all their gaps, or the nodes that squeeze them.

The gaps of such a fibre are known up to its rigid motions M a.  What is unique is whether it has room, i.e. whether
there are amplitudes a with gap + M a >= 0: a linear programme for each fibre, solved on rank 0.
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
from feti_homog.feti.coarse.natural import NaturalCoarseSpace
from feti_homog.feti.decomposition.constraint_layout import InterfaceNodes
from feti_homog.feti.dual_solution import DualSolution
from feti_homog.mesh.periodic_topology import components
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.typing import Array, Bool, Float

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

T = TypeVar("T")

# Rigid motions that change gaps by less than this, relative to slips, change none: a round fibre turns.
LARGEST_GAP_OF_SLIDING = 1e-9
# A node with less than this share of the largest contact force is not needed for the balance of forces.
LEAST_FORCE_SHARE = 1e-6
# Largest amplitude of a motion in a linear programme, in largest gaps: a fibre may have room without end on one side.
LARGEST_MOTION = 1e3
# The least tolerance of HiGHS, relative to the largest gap; its default of 1e-7 is coarser than the solver's error.
LP_TOLERANCES = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True)
class Placement:
    """Amplitudes (dimension,) to add to alpha, and the open nodes (k,) that must close for lack of room."""

    alpha: Float
    pressed: Bool

    def jump(self, coarse: NaturalCoarseSpace) -> Float:
        """(owned rows,) G alpha."""
        return np.asarray(coarse.G @ self.alpha)


@dataclass(frozen=True)
class _Fibres:
    """On rank 0, of all open nodes: the change of gap with each free motion, (k, motions), and the fibre.

    A fibre and its coating, which may part too, are one, and so are layers with others between them.  `reach`
    (motions,) is the largest gap or slip of each motion at any node: open nodes alone may be within what moves as one.
    """

    is_open: Bool
    opening: csr_matrix
    reach: Float
    fibre: Array

    def nodes_and_motions(self, of: Bool) -> Iterator[tuple[Array, Float, Array, Float]]:
        """For each fibre with an open node in `of` (k,): its open nodes (n,) and their motions M (n, m).

        With the numbers of the free motions (c,) that move them and the combinations (c, m) of these; m = 0 where
        nothing that is free opens a gap.
        """
        nodes = np.flatnonzero(self.is_open & np.isin(self.fibre, self.fibre[self.is_open & of]))
        nodes = nodes[np.argsort(self.fibre[nodes], kind="stable")]
        opening = self.opening[nodes]
        ends = [0, *(np.flatnonzero(np.diff(self.fibre[nodes])) + 1), len(nodes)]
        for first, last in pairwise(ends) if len(nodes) else ():
            columns, motions = _block(first, last, opening)
            modes = _opening_modes(motions, self.reach[columns])
            yield nodes[first:last], motions @ modes, columns, modes


def place(
    comm: MPI.Intracomm,
    coarse: NaturalCoarseSpace,
    nodes: InterfaceNodes,
    is_open: Bool,
    solution: DualSolution,
    noise: float,
) -> Placement:
    """Move the free fibres so that no open node overlaps by more than `noise`; collective, decided on rank 0.

    A fibre that overlaps is put where its smallest gap is largest.  If even that overlaps, the programme's dual
    solution is a system of contact forces in balance, and its nodes close.

    Raises:
        ConvergenceError: on every rank; a linear programme was not solved.
    """
    gap = solution.jump[nodes.row]
    if not comm.allreduce(bool((is_open & (gap < -noise)).any()), MPI.LOR):
        return Placement(np.zeros(coarse.kernel_dimension), np.zeros(len(gap), bool))
    amplitudes, pressed = _decided_on_root(comm, coarse, nodes, is_open, _place_all, [gap], noise)
    first = comm.exscan(len(nodes.row)) or 0
    return Placement(coarse.unconstrained_modes @ amplitudes, pressed[first : first + len(nodes.row)])


def admissible_share(
    comm: MPI.Intracomm,
    coarse: NaturalCoarseSpace,
    nodes: InterfaceNodes,
    is_open: Bool,
    here: Float,
    ahead: Float,
    noise: float,
) -> tuple[float, float]:
    """Return the room of every fibre on the way from the gaps `here` (k,) to `ahead` (k,), of which it has some here.

    The largest shares w <= 1 of the way for which all fibres have amplitudes a with

        (1 - w) here + w ahead + M a >= 0,   and   >= -2 noise,

    where the first fibre begins to be pressed, and where it is beyond doubt.
    Collective, decided on rank 0; raises as `place`.
    """
    return _decided_on_root(comm, coarse, nodes, is_open, _shares_of_all, [here, ahead], noise)


def shares_to_zero(here: Float, ahead: Float, noise: float | Float) -> tuple[float, float]:
    """Shares of the way from values here (k,) to ahead (k,) at which the first is 0, and is -2 noise, a number or (k,).

    Else 1, 1.

    Values that end above -2 noise may be the solver's error and do not count.
    """
    falls = ahead < -2 * noise
    a, b, doubt = here[falls], ahead[falls], np.broadcast_to(2 * noise, falls.shape)[falls]
    begins, certain = (np.maximum(a + slack, 0.0) / (a - b) for slack in (0.0, doubt))
    return float(begins.min(initial=1.0)), float(certain.min(initial=1.0))


def _decided_on_root(
    comm: MPI.Intracomm,
    coarse: NaturalCoarseSpace,
    nodes: InterfaceNodes,
    is_open: Bool,
    decide: Callable[..., T],
    gaps: list[Float],
    noise: float,
) -> T:
    """decide(fibres, *gaps, noise) of rank 0, with the gaps of all nodes, on every rank; collective."""
    free = coarse.unconstrained_modes.tocsr()
    opening, slip = ((coarse.G[nodes.row + i] @ free).tocsr() for i in range(2))
    reach = np.zeros(free.shape[1])
    np.maximum.at(reach, np.r_[opening.indices, slip.indices], np.abs(np.r_[opening.data, slip.data]))
    parts = comm.gather((is_open, opening, nodes.bodies, reach, *gaps))

    def decided() -> T:
        is_open, opening, bodies, reach, *gaps = zip(*(parts or []), strict=True)
        groups = _moving_together(np.concatenate(bodies), coarse.pinned_body)
        fibres = _Fibres(np.concatenate(is_open), vstack(opening).tocsr(), np.max(reach, axis=0), groups)
        return decide(fibres, *map(np.concatenate, gaps), noise)

    return on_root(comm, decided)


def _moving_together(bodies: Array, fixed: int) -> Array:
    """(k,) labels of nodes, the same where gaps depend on each other's motions.

    They are those of the two bodies (k, 2) of each node, of which one may be the body that is `fixed`.
    """
    outer, inner = bodies.T
    between = (bodies != fixed).all(axis=1)
    labels = components(int(bodies.max(initial=0)) + 1, outer[between], inner[between])
    return np.asarray(labels[np.where(inner == fixed, outer, inner)])


def _place_all(fibres: _Fibres, gap: Float, noise: float) -> tuple[Float, Bool]:
    pressed, amplitudes = np.zeros(len(gap), bool), np.zeros(fibres.opening.shape[1])
    for own, motion, columns, modes in fibres.nodes_and_motions(gap < -noise):
        if modes.shape[1]:
            a, room, forces = _largest_gap(gap[own], motion)
            amplitudes[columns] += modes @ a
            if room < -noise:
                pressed[own[forces > LEAST_FORCE_SHARE * forces.max()]] = True
    return amplitudes, pressed


def _shares_of_all(fibres: _Fibres, here: Float, ahead: Float, noise: float) -> tuple[float, float]:
    shares = [(1.0, 1.0)]
    for own, motion, *_ in fibres.nodes_and_motions(ahead < -2 * noise):
        a, b = here[own], ahead[own]
        if not motion.shape[1]:
            shares.append(shares_to_zero(a, b, noise))
        elif (certain := _last_share(a, b, motion, 2 * noise)) < 1.0:
            shares.append((_last_share(np.maximum(a, 0.0), b, motion, 0.0), certain))
    begins, certain = np.min(shares, axis=0)
    return float(begins), float(certain)


def _block(first: int, last: int, matrix: csr_matrix) -> tuple[Array, Float]:
    """Return the columns (c,) in which these rows of a matrix have entries, and the dense rows (rows, c) there."""
    columns = np.unique(matrix.indices[slice(*matrix.indptr[[first, last]])])
    return columns, matrix[first:last, columns].toarray()


def _opening_modes(opening: Float, reach: Float) -> Float:
    """(modes, m) the combinations of modes that open gaps: not those that slide, or move both faces alike."""
    if not opening.size:
        return np.zeros((opening.shape[1], 0))
    _, size, basis = np.linalg.svd(opening, full_matrices=False)
    return np.asarray(basis[size > LARGEST_GAP_OF_SLIDING * max(size[0], reach.max())].T)


def _largest_gap(gap: Float, motion: Float) -> tuple[Float, float, Float]:
    """max s with gap + motion a >= s: a, s, and the multipliers of the inequalities."""
    scale, size = np.abs(gap).max(), np.abs(motion).max(axis=0)
    result = _maximised(-motion / size, np.ones(len(gap)), gap / scale, (None, 1.0))
    return result.x[:-1] * scale / size, float(result.x[-1] * scale), -result.ineqlin.marginals


def _last_share(here: Float, ahead: Float, motion: Float, slack: float) -> float:
    """max w <= 1 with (1 - w) here + w ahead + motion a >= -slack; w = 0 is possible."""
    scale, size = np.abs([here, ahead]).max(), np.abs(motion).max(axis=0)
    result = _maximised(-motion / size, (here - ahead) / scale, (here + slack) / scale, (0.0, 1.0))
    return float(result.x[-1])


def _maximised(motions: Float, last: Float, limits: Float, bounds: tuple[float | None, float]) -> OptimizeResult:
    """max x_-1 with motions x_:-1 + last x_-1 <= limits and x_-1 within its bounds.

    Raises:
        ConvergenceError: there is no solution, or it was not found.
    """
    from scipy.optimize import linprog  # slow to import, and few cells have free fibres

    cost = np.r_[np.zeros(motions.shape[1]), -1.0]
    limited = [(-LARGEST_MOTION, LARGEST_MOTION)] * motions.shape[1] + [bounds]
    rows = np.column_stack([motions, last])
    result = linprog(cost, A_ub=rows, b_ub=limits, bounds=limited, method="highs", options=LP_TOLERANCES)
    if not result.success:
        raise ConvergenceError(f"the linear programme that places a free fibre was not solved: {result.message}")
    return result
