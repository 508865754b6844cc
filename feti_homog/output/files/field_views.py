"""Datasets of result.h5 that show others as viewers want them: vectors of three components, tensors, single columns.

They are virtual: HDF5 fills them from the other datasets when they are read, so that they take next to no space.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from feti_homog.mechanics.voigt import STRESSES

WHOLE = -1  # instead of a column: all of a dataset that has none


@dataclass(frozen=True)
class View:
    """A virtual dataset /`kind`/GROUP/`name` over datasets of /GROUP.

    Attributes:
        components: its columns; 0 if it has rows alone.
        source: the dataset that its type and unit are from.
        columns: its columns that are not 0: for each the dataset and the column there.
        meaning: in words.
    """

    kind: str
    name: str
    components: int
    source: str
    columns: Mapping[int, tuple[str, int]]
    meaning: str

    @property
    def words(self) -> str:
        """Its meaning, and that it is virtual."""
        return f"{self.meaning}; virtual"

    def path(self, group: str) -> str:
        """Its place in the file."""
        return f"{self.kind}/{group}/{self.name}"


def _vector(name: str) -> View:
    words = f"`{name}` with a third component 0"
    return View("vector", name, 3, name, {0: (name, 0), 1: (name, 1)}, words)


def _tensor(name: str, source: str, entries: Mapping[tuple[int, int], tuple[str, int]]) -> View:
    """The symmetric tensor [11, 12, 13, 21, 22, 23, 31, 32, 33] with these entries."""
    places = [(3 * i + j, (min(i, j), max(i, j))) for i in range(3) for j in range(3)]
    columns = {place: entries[pair] for place, pair in places if pair in entries}
    words = f"tensor of `{source}`, rows of [[11, 12, 13], [12, 22, 23], [13, 23, 33]]"
    return View("tensor", name, 9, source, columns, words)


def _column(name: str, source: str, column: int) -> View:
    return View("column", name, 0, source, {0: (source, column)}, f"column {column} of `{source}`")


PLACES = ((0, 0), (1, 1), (0, 1), (2, 2))  # of 11, 22, 12, 33
STRESS_TENSOR = dict(zip(PLACES, (("stress", 0), ("stress", 1), ("stress", 2), ("stress_33", WHOLE)), strict=True))
STRAIN_TENSOR = {place: ("element_strain", column) for column, place in enumerate(PLACES)}
PAIRS = [(f"{source}_{name}", source, column) for source in ("traction", "jump") for column, name in enumerate("nt")]

# The views of each group; those of /state/K are made for every state.
VIEWS: dict[str, tuple[View, ...]] = {
    "interface": (_vector("normal"),),
    "state/K": (
        _vector("displacement"),
        _vector("fluctuation"),
        _tensor("stress", "stress", STRESS_TENSOR),
        _tensor("strain", "element_strain", STRAIN_TENSOR),
        *(_column(name, "stress", column) for column, name in enumerate(STRESSES)),
        *(_column(*pair) for pair in PAIRS),
    ),
}
