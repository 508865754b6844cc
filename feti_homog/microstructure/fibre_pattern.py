"""Represent patterns of round fibres in a rectangle: a periodic cell, or a window of a micrograph."""

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import ceil, fsum, pi
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from feti_homog.errors import CaseError
from feti_homog.microstructure.fibre_table import SAME_FIBRE, FibreTable, read_table
from feti_homog.microstructure.shapes.shapes import BOTH_SIZES, have_both_sizes
from feti_homog.typing import Bool, Float, Int


@dataclass(frozen=True)
class FibrePattern:
    """A pattern of N discs with centres within the rectangle [0, width] x [0, height].

    Attributes:
        width, height: size of the rectangle.
        centres, radii: (N, 2) and (N,) centres and radii of the discs.
        periodic: whether the pattern repeats; otherwise the rectangle is a window with unknown surroundings.
    """

    width: float
    height: float
    centres: Float
    radii: Float
    periodic: bool

    @property
    def size(self) -> Float:
        """The width and height (2,) of the rectangle."""
        return np.array([self.width, self.height])

    @property
    def area(self) -> float:
        """The area of the rectangle."""
        return self.width * self.height

    @property
    def count(self) -> int:
        """The number N of discs."""
        return len(self.radii)

    @property
    def mean_radius(self) -> float:
        """The mean radius of the discs."""
        return fsum(self.radii) / self.count

    @property
    def fibre_fraction(self) -> float:
        """The area fraction of the discs with centres in the rectangle: sum_i pi R_i^2 / area.

        For a window the value is unbiased: on average, these discs cover as much outside as other discs cover inside.
        """
        return pi * fsum(self.radii * self.radii) / self.area

    @cached_property
    def wrapped(self) -> Float:
        """The centres (N, 2), wrapped to [0, width) x [0, height)."""
        inside = self.centres % self.size
        return np.asarray(np.where(inside < self.size, inside, 0.0))

    def images(self, reach: float) -> tuple[Float, Int]:
        """Return centres (m, 2) of discs and images within `reach` of the rectangle, and disc indices (m,).

        The N discs in the rectangle come first; for a window, there are no images.
        """
        number = np.arange(self.count)
        if not self.periodic:
            return self.centres, number
        periods = [ceil(reach / length) for length in self.size]
        steps = product(*(range(-n, n + 1) for n in periods))
        shifts = np.array([step for step in steps if any(step)], dtype=float).reshape(-1, 2) * self.size
        result = self.wrapped + shifts[:, None]
        shift, owner = np.nonzero(np.all((result > -reach) & (result < self.size + reach), axis=2))
        return np.concatenate([self.wrapped, result[shift, owner]]), np.concatenate([number, owner])


def read_window(path: Path, size: tuple[float, float] | None = None) -> FibrePattern:
    """Read the fibre pattern of a window from a table; ellipses count as equal-area discs, voids are left out.

    `size` is the width and height of the window, by default the size in the table. The lower left corner is `left` and
    `bottom` of the table, by default 0.

    Raises:
        CaseError: the table is faulty or lacks the size; fibres are fewer than two, outside, or at one place.
    """
    table = read_table(path)
    table = table.rows(np.flatnonzero(~table.is_void))
    width, height = size or (table.width, table.height)
    if width is None or height is None:
        raise CaseError(
            f'{table.name}: the size of the window is missing; expected a line such as "# width = 120, height = 80"'
        )
    centres = table.centres - [table.left or 0.0, table.bottom or 0.0]
    radii = table.radius
    outside = ~np.all((centres >= 0) & (centres <= [width, height]), axis=1)
    faults = [
        *_faults(table, have_both_sizes(table.columns), BOTH_SIZES),
        *_faults(table, outside, f"its centre is outside of the window of {width:g} x {height:g}"),
    ]
    if not faults:
        pairs = cKDTree(centres).query_pairs(SAME_FIBRE * float(radii.min()), output_type="ndarray")
        again = np.isin(np.arange(len(centres)), pairs.max(axis=1, initial=-1))
        faults = _faults(table, again, "there is a fibre at the same place before")
    if len(centres) < 2:
        faults.append(f"{table.name}: expected at least two fibres, got {len(centres)}")
    if faults:
        raise CaseError(*faults)
    return FibrePattern(width, height, centres, radii, periodic=False)


def _faults(table: FibreTable, are_faulty: Bool, words: str) -> list[str]:
    return [f"{table.name}: row {row}: {words}" for row in table.row[are_faulty]]
