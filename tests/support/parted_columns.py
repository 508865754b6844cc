"""Cells of columns that press on each other: layers, and stacks of loose blocks with voids between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from reference.limit_load import Column, largest_shear
from unit.mesh.faulty_meshes import MshFile

from support.ranks import PIECES

PHASES = {1: "matrix", 2: "fibre", 3: "fibre:2"}


@dataclass(frozen=True)
class Columns:
    """Columns of a cell.

    Attributes:
        x, y: abscissae of the columns and ordinates of the rows.
        phase: (columns, rows) tags of `PHASES`, 0 of voids; those of the matrix are full.
        friction: by the tag of the phase that the matrix meets.
        across: axis normal to the columns.
    """

    x: np.ndarray
    y: np.ndarray
    phase: np.ndarray
    friction: dict[int, float]
    across: int = 0

    @classmethod
    def random(cls, rng: np.random.Generator, loose: bool) -> Columns:
        """Return layers alone, or with `loose` blocks."""
        pairs, rows = int(rng.integers(1, 3)), int(rng.integers(5, 8)) if loose else int(rng.integers(2, 5))
        x = np.r_[0.0, np.cumsum(rng.uniform(0.5, 1.5, 2 * pairs + 1))]
        y = np.r_[0.0, np.cumsum(rng.uniform(0.7, 1.3, rows))]
        phase = np.ones((2 * pairs + 1, rows), int)
        for k in range(1, 2 * pairs, 2):
            phase[k] = rng.integers(2, 4)
        if loose:
            # One or two voids, none on a side of the cell: one block, and one only if there are two, crosses it.
            k, first = 2 * int(rng.integers(0, pairs)) + 1, int(rng.integers(1, rows - 3))
            phase[k, [first, int(rng.integers(first + 2, rows - 1)) if rng.random() < 0.7 else first]] = 0
        friction = {2: float(rng.uniform(0.1, 0.8)), 3: float(rng.uniform(0.1, 0.8))}
        return cls(x / x[-1], y / x[-1], phase, friction, int(rng.integers(0, 2)))

    @property
    def height(self) -> float:
        return float(self.y[-1])

    def mesh(self) -> MshFile:
        """Return squares cut in two, those of voids left out."""
        rows, elements = len(self.y), {}
        used = set[int]()

        def node(i: int, j: int) -> int:
            return 1 + i * rows + j

        for (i, j), tag in np.ndenumerate(self.phase):
            if tag:
                a, b, c, d = node(i, j), node(i + 1, j), node(i + 1, j + 1), node(i, j + 1)
                for corners in ((a, b, c), (a, c, d)):
                    ordered = corners if self.across == 0 else corners[::-1]
                    elements[len(elements) + 1] = (2, int(tag), int(tag), ordered)
                    used |= set(ordered)
        places = {node(i, j): (x, y) for i, x in enumerate(self.x) for j, y in enumerate(self.y)}
        nodes = {tag: (*place[:: 1 - 2 * self.across], 0.0) for tag, place in places.items() if tag in used}
        return MshFile(nodes, elements, {tag: PHASES[tag] for tag in np.unique(self.phase[self.phase > 0]).tolist()})

    def largest_shear(self, stress: float) -> float:
        """Return the largest S12 that the columns carry under a stress across them."""
        columns = []
        for k, phase in enumerate(self.phase):
            if phase.max() > 1:
                full = bool((phase > 0).all())
                # A node of the last row is that of the first.
                blocks = [self.y[:-1]] if full else self._blocks(phase)
                columns.append(Column(self.x[k], self.x[k + 1], tuple(blocks), full, self.friction[int(phase.max())]))
        return largest_shear(columns, self.height, stress)

    def _blocks(self, phase: np.ndarray) -> list[np.ndarray]:
        """Return the ordinates of the nodes of each block of a column."""
        first = int(np.flatnonzero(phase == 0)[0])
        y = np.r_[self.y[first:], self.height + self.y[1 : first + 1]]
        ends = np.flatnonzero(np.diff(np.r_[0, np.roll(phase > 0, -first).astype(int), 0]))
        return [y[start : last + 1] for start, last in ends.reshape(-1, 2)]

    @property
    def coefficients(self) -> list[float]:
        """Return the coefficients of friction of the faces that are there."""
        return [mu for tag, mu in self.friction.items() if (self.phase == tag).any()]

    def case(self, stress: float, shear: float, method: dict[str, Any], plane: str = "strain") -> dict[str, Any]:
        """Return the document of a path to a stress across the debonded columns, then to a shear."""
        tags = [tag for tag in (2, 3) if (self.phase == tag).any()]
        debonded = {"debonded": [{"fibre": "all", "angle": 360.0}]}
        pairs = [{"between": ["matrix", PHASES[tag]], "friction": self.friction[tag]} | debonded for tag in tags]
        name = "S11" if self.across == 0 else "S22"
        return {
            "cell": {"geometry": "mesh", "file": "cell.msh", "voids": True},
            "material": {PHASES[tag]: {"young": 1.0 + tag, "poisson": 0.2 + 0.02 * tag} for tag in (1, *tags)},
            "analysis": {"type": "path", "plane": plane},
            "interface": pairs if len(pairs) > 1 else pairs[0],
            "path": {"waypoints": [{name: stress}, {name: stress, "S12": shear}]} | method,
            "decomposition": PIECES,
            "output": {"pictures": False, "fields": False},
        }
