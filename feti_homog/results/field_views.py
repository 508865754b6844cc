"""Datasets of result.h5 for viewers: vectors with three components, tensors, single columns.

They are virtual and nearly free: HDF5 fills them from other datasets when they are read.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from feti_homog.materials import voigt

GROUP_OF_STATES = "state/K"
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


def _vector(name: str, third: str = "") -> View:
    columns = {0: (name, 0), 1: (name, 1)} | ({2: (third, WHOLE)} if third else {})
    sentence = f"`{name}` with `{third}` as third component" if third else f"`{name}` with a third component 0"
    return View("vector", name, 3, name, columns, sentence)


def _tensor(name: str, source: str, entries: Mapping[tuple[int, int], tuple[str, int]]) -> View:
    """Return the symmetric tensor [11, 12, 13, 21, 22, 23, 31, 32, 33] with these entries."""
    places = [(3 * i + j, (min(i, j), max(i, j))) for i in range(3) for j in range(3)]
    columns = {place: entries[pair] for place, pair in places if pair in entries}
    sentence = f"tensor of `{source}`, rows of [[11, 12, 13], [12, 22, 23], [13, 23, 33]]"
    return View("tensor", name, 9, source, columns, sentence)


def _column(name: str, source: str, column: int) -> View:
    return View("column", name, 0, source, {0: (source, column)}, f"column {column} of `{source}`")


PLACES = ((0, 0), (1, 1), (0, 1), (2, 2))  # of 11, 22, 12, 33
STRESS_TENSOR = dict(zip(PLACES, (("stress", 0), ("stress", 1), ("stress", 2), ("stress_33", WHOLE)), strict=True))
COLUMNS = (
    *(_column(name, "stress", column) for column, name in enumerate(voigt.STRESSES)),
    *(_column(f"{table}_{name}", table, k) for table in ("traction", "jump") for k, name in enumerate("nt")),
)
AXIAL = "axial_displacement"  # that states of generalized plane strain have, and only they
AXIAL_PLACES = ((1, 2), (0, 2))  # of 23, 13

# The views of each group; those of /state/K are made for every state.
VIEWS: dict[str, tuple[View, ...]] = {
    "interface": (_vector("normal"),),
    GROUP_OF_STATES: (
        _vector("displacement"),
        _tensor("stress", "stress", STRESS_TENSOR),
        *COLUMNS,
    ),
}

# The same of a state of generalized plane strain.
SPATIAL_VIEWS: tuple[View, ...] = (
    _vector("displacement", AXIAL),
    _tensor("stress", "stress", STRESS_TENSOR | {at: ("axial_stress", k) for k, at in enumerate(AXIAL_PLACES)}),
    *COLUMNS,
    *(_column(name, "axial_stress", column) for column, name in enumerate(voigt.AXIAL_STRESSES)),
)


def add_views(file: Any) -> None:
    """Add the views to an open file with complete tables; empty tables have no views."""
    for group, view in _views_of(file):
        original = file[f"{group}/{view.source}"]
        shape = (len(original), view.components) if view.components else (len(original),)
        layout = h5py.VirtualLayout(shape, original.dtype)
        for place, (name, column) in view.columns.items():
            table = file[f"{group}/{name}"]
            source = h5py.VirtualSource(".", table.name, shape=table.shape, dtype=table.dtype)
            target: Any = (slice(None), place) if view.components else slice(None)
            layout[target] = source if column == WHOLE else source[:, column]
        dataset = file.create_virtual_dataset(view.path(group), layout, np.zeros((), layout.dtype)[()])
        dataset.attrs["meaning"] = view.words
        dataset.attrs["unit"] = original.attrs["unit"]


def bytes_of_views(file: Any) -> int:
    """Return the most bytes that `add_views` takes."""
    return (1 << 12) * (1 + len(_views_of(file)))  # 0.9 KB a view in the mean were measured


def _views_of(file: Any) -> list[tuple[str, View]]:
    """Return group and view for all views whose tables are in the file, and not empty."""
    groups = {"interface": VIEWS["interface"]}
    for group in (f"state/{number}" for number in sorted(file.get("state", ()), key=int)):
        groups[group] = SPATIAL_VIEWS if AXIAL in file[group] else VIEWS[GROUP_OF_STATES]
    return [
        (group, view)
        for group, views in groups.items()
        for view in views
        if {view.source, *(name for name, _ in view.columns.values())} <= file[group].keys()
        and len(file[group][view.source]) > 0
    ]
