"""Where debonding ends: the bonded nodes beside debonded ones, and the chains of nodes behind and before them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from feti_homog.interface.contact.states import BONDED, Status
from feti_homog.typing import Bool, Float, Int


class InterfaceChains:
    """Interface nodes with their neighbours along the interface.

    Attributes:
        neighbours: (n, 2) of each node, -1 of nodes that have not two.
    """

    def __init__(self, adjacency: csr_matrix) -> None:
        """`adjacency` (n, n) is 1 between neighbours."""
        two = np.diff(adjacency.indptr) == 2
        self.neighbours = np.full((len(two), 2), -1)
        self.neighbours[two] = adjacency.indices[adjacency.indptr[:-1][two][:, None] + np.arange(2)]

    def tips(self, status: Status) -> CrackTips:
        """Return the tips under the states (n,): one bonded node beside a debonded one. A node between two is none."""
        known = self.neighbours[:, 0] >= 0
        debonded = (status != BONDED)[self.neighbours] & known[:, None]
        node = np.flatnonzero((status == BONDED) & (debonded[:, 0] != debonded[:, 1]))
        pair, side = self.neighbours[node], np.argmax(debonded[node], axis=1)
        return CrackTips(node, np.take_along_axis(pair, side[:, None], 1)[:, 0], pair[np.arange(len(node)), 1 - side])

    def onward(self, start: Int, through: Int, steps: int) -> Int:
        """(t, steps + 1) the nodes start, through, and those that follow; -1 beyond the end of a chain."""
        found = [start, through]
        while len(found) <= steps:
            before, last = found[-2:]
            pair = self.neighbours[last]
            following = np.where(pair[:, 0] == before, pair[:, 1], pair[:, 0])
            found.append(np.where(last >= 0, following, -1))
        return np.stack(found, axis=1)


@dataclass(frozen=True)
class CrackTips:
    """The t tips of the debonded arcs, as numbers of interface nodes.

    Attributes:
        node: (t,) the tip, which is bonded.
        behind, ahead: (t,) the next node on the debonded and on the bonded side.
    """

    node: Int
    behind: Int
    ahead: Int

    def chosen(self, which: Int | Bool) -> CrackTips:
        """Return some of them."""
        return CrackTips(self.node[which], self.behind[which], self.ahead[which])


def closing_work(length: float, ahead: Float, force: Float, behind: Float, jump: Float) -> Float:
    """(2,) the work of closing a crack along its last part / the length a of that (Irwin's integral):

        sum_k F_k w(a - s_k) / (2 a)  ->  1 / (2 a) int_0^a t(s) w(a - s) ds,

    in opening and in shear, not less than zero.

    Args:
        ahead, force: (j,) distances s from the tip, which comes first, and forces (j, 2) on bonded nodes before it.
        behind, jump: (k,) rising distances from the tip, which comes first, and jumps (k, 2) behind it.
    """
    near = ahead < length
    w = np.stack([np.interp(length - ahead[near], behind, jump[:, mode]) for mode in (0, 1)], axis=1)
    return np.asarray(np.maximum((force[near] * w).sum(axis=0), 0.0) / (2 * length))
