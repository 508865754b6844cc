"""Bonds that hold every body where its own have broken, so that a cell with broken bonds can be factored."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.feti.decomposition.jump_operator import JumpOperator
from feti_homog.parallel.distributed_arrays import allreduce_sum
from feti_homog.typing import Float

# Bonds, each in all directions, that let no rigid-body motion pass between two bodies.
HOLDING_BONDS = 2


class BodyTies:
    """Of every fibre and the body around it two bonds, the second as far as can be from the first."""

    def __init__(self, comm: MPI.Intracomm, jump_operator: JumpOperator) -> None:
        """Collective."""
        nodes = jump_operator.nodes
        self._comm = comm
        self._rows = nodes.row[:, None] + np.arange(jump_operator.components)
        bodies, points = (np.concatenate(comm.allgather(x)) for x in (nodes.bodies, nodes.points))
        _, first, pair = np.unique(bodies, axis=0, return_index=True, return_inverse=True)
        pair = pair.ravel()
        distance = np.linalg.norm(points - points[first[pair]], axis=1)
        order = np.lexsort([distance, pair])
        last = order[np.cumsum(np.bincount(pair)) - 1] if len(pair) else first
        begin = comm.exscan(len(nodes.row)) or 0
        self._ties = np.stack([first, last], axis=1) - begin
        self._pair = pair[begin : begin + len(nodes.row)]

    def tied(self, active: Float) -> Float:
        """`active` (owned rows,) with all rows of the ties where fewer than two bonds hold two bodies.  Collective."""
        bonded = active[self._rows].prod(axis=1)
        holding = allreduce_sum(self._comm, np.bincount(self._pair, bonded, len(self._ties)).astype(float))
        ties = self._ties[holding < HOLDING_BONDS].ravel()
        own = self._rows[ties[(ties >= 0) & (ties < len(self._rows))]]
        tied = active.copy()
        tied[own] = 1.0
        return tied
