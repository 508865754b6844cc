"""Add datasets for viewers to result.h5: vectors with three components, tensors, single columns.

The datasets are virtual and nearly free: HDF5 fills them from other datasets when a viewer reads them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np

from feti_homog.materials import voigt

GROUP_OF_STATES = "state/K"


@dataclass(frozen=True)
class View:
    """A virtual dataset /`kind`/GROUP/`name` over datasets of /GROUP.

    Attributes:
        components: column count; 0 for a dataset with one dimension.
        source: dataset that provides type and unit.
        columns: for each nonzero column, the source dataset and source column; None for the whole dataset.
        meaning: description in words.
    """

    kind: str
    name: str
    components: int
    source: str
    columns: Mapping[int, tuple[str, int | None]]
    meaning: str

    def path(self, group: str) -> str:
        """Return the path of the view in the file."""
        return f"{self.kind}/{group}/{self.name}"


def _vector(name: str, third: str = "") -> View:
    columns = {0: (name, 0), 1: (name, 1)} | ({2: (third, None)} if third else {})
    sentence = f"`{name}` with `{third}` as third component" if third else f"`{name}` with a third component 0"
    return View("vector", name, 3, name, columns, sentence)


def _tensor(name: str, source: str, entries: Mapping[str, tuple[str, int | None]]) -> View:
    """Return the view of a symmetric tensor [11, 12, 13, 21, 22, 23, 31, 32, 33] with some `entries`."""
    places = enumerate(("11", "12", "13", "12", "22", "23", "13", "23", "33"))
    columns = {place: entries[entry] for place, entry in places if entry in entries}
    sentence = f"tensor of `{source}`, rows of [[11, 12, 13], [12, 22, 23], [13, 23, 33]]"
    return View("tensor", name, 9, source, columns, sentence)


def _column(name: str, source: str, column: int) -> View:
    return View("column", name, 0, source, {0: (source, column)}, f"column {column} of `{source}`")


STRESS_TENSOR: dict[str, tuple[str, int | None]] = {
    **{name[1:]: ("stress", column) for column, name in enumerate(voigt.STRESSES)},
    "33": ("stress_33", None),
}
COLUMNS = (
    *(_column(name, "stress", column) for column, name in enumerate(voigt.STRESSES)),
    *(_column(f"{table}_{name}", table, k) for table in ("traction", "jump") for k, name in enumerate("nt")),
)
AXIAL = "axial_displacement"  # dataset that only states of generalized plane strain have

# The views of each group; /state/K stands for every state.
VIEWS: dict[str, tuple[View, ...]] = {
    "interface": (_vector("normal"),),
    GROUP_OF_STATES: (_vector("displacement"), _tensor("stress", "stress", STRESS_TENSOR), *COLUMNS),
}

# The views of a state in generalized plane strain.
SPATIAL_VIEWS: tuple[View, ...] = (
    _vector("displacement", AXIAL),
    _tensor(
        "stress", "stress", STRESS_TENSOR | {s[1:]: ("axial_stress", k) for k, s in enumerate(voigt.AXIAL_STRESSES)}
    ),
    *COLUMNS,
    *(_column(name, "axial_stress", column) for column, name in enumerate(voigt.AXIAL_STRESSES)),
)


def add_views(file: Any) -> None:
    """Add all views to an open file with complete tables; empty tables have no views."""
    for group, view in views_of(file):
        original = file[f"{group}/{view.source}"]
        shape = (len(original), view.components) if view.components else (len(original),)
        layout = h5py.VirtualLayout(shape, original.dtype)
        for place, (name, column) in view.columns.items():
            table = file[f"{group}/{name}"]
            source = h5py.VirtualSource(".", table.name, shape=table.shape, dtype=table.dtype)
            target: Any = (slice(None), place) if view.components else slice(None)
            layout[target] = source if column is None else source[:, column]
        dataset = file.create_virtual_dataset(view.path(group), layout, np.zeros((), layout.dtype)[()])
        dataset.attrs["meaning"] = f"{view.meaning}; virtual"
        dataset.attrs["unit"] = original.attrs["unit"]


def bytes_of_views(file: Any) -> int:
    """Return an upper bound of the bytes that `add_views` adds."""
    return (1 << 12) * (1 + len(views_of(file)))  # measured: 0.9 KB for each view on average


def views_of(file: Any) -> list[tuple[str, View]]:
    """Return group and view for each view with existing, non-empty tables."""
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
