"""The largest shear that debonded layers and loose blocks between them carry: a linear programme of nodal forces.

Columns of a cell, full ones or stacks of blocks with voids between them, press on each other at nodes.  The force F
that acts on a column's left face from its neighbour, tension positive, is in Coulomb's cone at each node,

    F_x <= 0,   |F_y| <= -mu F_x,

blocks are in balance, and the forces of each face add up to the stresses times its height.  By the theorem of the
lower bound no load beyond the largest of these has an equilibrium, whatever the history.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linprog


@dataclass(frozen=True)
class Column:
    """A column between two abscissae, of blocks given by their nodes' ordinates; (all,) and `full` of a whole one."""

    left: float
    right: float
    blocks: tuple[np.ndarray, ...]
    full: bool
    friction: float


def largest_shear(columns: list[Column], height: float, stress: float) -> float:
    """Return the largest S12 under S11 = `stress`, inf if there is none; `columns` are those that press on others."""
    sides = [(column, block) for column in columns for block in column.blocks]
    sizes = [len(block) for _, block in sides]
    count = 4 * sum(sizes) + 1  # F_x and F_y of the left and the right nodes, then S12
    places = np.cumsum([0, *(4 * size for size in sizes)])
    cone, rows, right = [], [], []
    for (column, block), at in zip(sides, places, strict=False):
        n = len(block)
        for k in range(2 * n):
            for sign in (1.0, -1.0):
                row = np.zeros(count)
                row[at + 2 * k], row[at + 2 * k + 1] = column.friction, sign
                cone.append(row)
        left, other = np.arange(n), np.arange(n, 2 * n)
        if not column.full:
            for axis in range(2):
                row = np.zeros(count)
                row[at + 2 * left + axis], row[at + 2 * other + axis] = 1.0, -1.0
                rows.append(row)
                right.append(0.0)
            row = np.zeros(count)
            for nodes, x, sign in ((left, column.left, 1.0), (other, column.right, -1.0)):
                row[at + 2 * nodes], row[at + 2 * nodes + 1] = -sign * block, sign * x
            rows.append(row)
            right.append(0.0)
    for column in columns:
        for side in range(2):
            for axis in range(2):
                row = np.zeros(count)
                for (owner, block), at in zip(sides, places, strict=False):
                    if owner is column:
                        nodes = np.arange(len(block)) + side * len(block)
                        row[at + 2 * nodes + axis] = 1.0
                row[-1] = -height if axis else 0.0
                rows.append(row)
                right.append(0.0 if axis else stress * height)
    cost = np.zeros(count)
    cost[-1] = -1.0
    bounds = [(None, 0.0), (None, None)] * (2 * sum(sizes)) + [(None, None)]
    found = linprog(cost, np.array(cone), np.zeros(len(cone)), np.array(rows), np.array(right), bounds, method="highs")
    return np.inf if found.status == 3 else float(found.x[-1])
