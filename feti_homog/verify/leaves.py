"""Numbers of result.json: those that laws have read, and in words those that none has."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

# Why laws leave numbers alone, by a part of their names; the first that fits.
REASONS = {
    "names of the program and the case, and how the run went": (
        "version", "digest", "resumed", "solver", "timings", "memory", "iterations", "free_motions",
    ),
    "residuals of the solver, of which only the tolerance is checked": ("checks",),
    "texts, but for those that follow from numbers": ("warnings", "remarks", "faults"),
    "closed formulas, which no field bears witness to": ("estimates", "fibre_bounds"),
    "estimates of the mesh's error, but for those of energies": ("mesh_error",),
    "derivatives under contact or beside a temperature, but for those of energies": ("derivatives",),
    "what breaks at tips would release": ("G_I", "G_II"),
    "of the mesher, or of a table that is not in the files": ("match_distance", "mesh_size", "refine"),
    "copies of other numbers, for readers": (
        "fibres", "peak", "mark", "debonding_angle", "debonded_share", "dissipation_ratio", "parameter_values",
    ),
    "scatter, which follows from derivatives and the case": ("uncertainty",),
}  # fmt: skip
# Files and tables of result.h5 that are written from others.
COPIES = "tables for viewers and spreadsheets"
COPIED = ("*.csv", "traction_vector", "jump_vector", "displacement_fibre", "displacement_matrix", "fibre_node",
          "matrix_node", "fibre/number", "fibre/phase")  # fmt: skip
NO_REASON, THINNED = "no law", "at points whose fields are not in the files"


class Section(dict[str, Any]):
    """A table of result.json; what is taken out of it is no longer `unread`.  The case counts as one number."""

    def __init__(self, content: Mapping[str, Any], unread: dict[str, bool] | None = None, place: str = "") -> None:
        self.unread = {} if unread is None else unread
        self._places = {key: f"{place}.{key}" if place else key for key in content}
        super().__init__({key: self._inner(self._places[key], value) for key, value in content.items()})
        self.places = tuple(self.unread)

    def _inner(self, place: str, value: Any) -> Any:
        if isinstance(value, dict) and place != "case":
            return Section(value, self.unread, place)
        if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            return [Section(entry, self.unread, f"{place}[{k}]") for k, entry in enumerate(value)]
        self.unread[place] = False
        return value

    def __getitem__(self, key: str) -> Any:
        if self.unread.get(self._places[key]) is False:
            del self.unread[self._places[key]]
        return super().__getitem__(key)

    def get(self, key: str, default: Any = None) -> Any:
        """Return an entry, which counts as read."""
        return self[key] if key in self else default  # noqa: SIM401, which would be this again

    def items(self) -> Iterator[tuple[str, Any]]:  # type: ignore[override]
        """Yield all entries, which count as read."""
        return ((key, self[key]) for key in self)

    def covers(self, key: str) -> None:
        """Count an entry as read, and all in it."""
        for place in list(self.unread):
            if place == self._places.get(key) or place.startswith(f"{self._places.get(key)}."):
                del self.unread[place]

    def leaves_open(self, key: str) -> None:
        """Count an entry as unread for good, which laws use but do not determine."""
        self.unread[self._places[key]] = True

    def hint(self, key: str, default: Any = None) -> Any:
        """Return an entry that a law uses without checking it."""
        return super().get(key, default)


Points = Sequence[Section]


def unchecked(document: Section) -> dict[str, list[str]]:
    """Return the names of the numbers that no law has read by the reason for it, such as path[].iterations.

    A table none of whose numbers is read has its own name.  Copies of tables are always among them.
    """
    unread, known = (
        Counter(re.sub(r"\[\d+\]", "[]", place) for place in of) for of in (document.unread, document.places)
    )
    read = {name.partition(".")[0] for name in known if name not in unread}
    found: dict[str, list[str]] = {COPIES: [*COPIED]}
    for name, count in unread.items():
        table, parts = name.partition(".")[0], {*name.replace("[]", "").split(".")}
        own = THINNED if count < known[name] else NO_REASON
        reason = next((words for words, names in REASONS.items() if parts & {*names}), own)
        found.setdefault(reason, []).append(name if table in read else table)
    return {reason: [*dict.fromkeys(names)] for reason, names in found.items()}
