"""Points of result.json in the printed summary: the table of an angle, what is shown of a path, and columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.mechanics.voigt import STRAINS, STRESSES

ENTRIES = {"C11": (0, 0), "C22": (1, 1), "C12": (0, 1), "C33": (2, 2)}
SPATIAL_ENTRIES = {f"C{i}{i}": (i - 1, i - 1) for i in range(1, 7)} | {"C12": (0, 1)}
STATES = ("bonded", "open", "closed")

Point = Mapping[str, Any]


def chosen(points: Sequence[Point], rows: int, among: Sequence[int] | None = None) -> list[int]:
    """Numbers of at most `rows` points of a path: the first, the last, and between them as evenly as bonds broke;
    with `among`, rising, of these points."""
    numbers = np.arange(len(points)) if among is None else np.asarray(among, int)
    if len(numbers) <= rows:
        return [int(number) for number in numbers]
    broken = np.cumsum([point["broke"] for point in points])[numbers]
    wanted = np.linspace(broken[0], broken[-1], rows)[1:-1]
    places = {int(np.abs(broken - w).argmin()) for w in wanted} | {0, len(numbers) - 1}
    return [int(numbers[place]) for place in sorted(places)]


def kept_points(document: Mapping[str, Any]) -> list[int]:
    """Numbers of the points of a path whose fields are kept, in the order of the states; of all if none are."""
    return list(document.get("states") or range(len(document["path"])))


def chosen_states(document: Mapping[str, Any], rows: int, count: int) -> list[int]:
    """Numbers of at most `rows` of the first `count` states of a path, chosen as `chosen` chooses points."""
    among = kept_points(document)[:count]
    return [among.index(number) for number in chosen(document["path"], rows, among)]


def shown_entries(points: Sequence[Point]) -> dict[str, tuple[int, int]]:
    """Names and places of the entries of the stiffnesses of an angle's points that are shown."""
    return ENTRIES if len(points[0]["stiffness"]) == len(STRAINS) else SPATIAL_ENTRIES


def angle_table(points: Sequence[Point], stress: str) -> list[str]:
    """A row for each angle: stiffnesses or stresses, and the states of the interface nodes."""
    stiff = "stiffness" in points[0]
    entries = shown_entries(points) if stiff else {}
    names, counted = tuple(entries) or STRESSES, len(entries) <= len(ENTRIES)
    width = 12 if counted else 10
    lines = [
        f"{'Stiffness' if stiff else 'Stress'}{stress} against the debonding angle (degrees)",
        f"{'angle':>9}" + "".join(f"{name:>{width}}" for name in names) + count_heads() * counted,
    ]
    for point in points:
        values = [point["stiffness"][i][j] for i, j in entries.values()] if stiff else point["stress"]
        numbers = "".join(number(value, width) for value in values)
        lines.append(f"{point['angle']:>9.5g}{numbers}" + counts(point) * counted)
    return lines


def sweep_table(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """A line for each case of a sweep: folder, status (if any is known) and inputs."""
    width = max(len(status) for _, status, _ in rows)
    return [f"{folder}  {status:<{width}}  {inputs}".replace("    ", "  ").rstrip() for folder, status, inputs in rows]


def sweep_failures(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Folder, inputs and reason of each case that failed."""
    return ["", f"{len(rows)} failed:"] + [
        line for folder, inputs, reason in rows for line in (f"  {folder}  {inputs}", f"    {reason}")
    ]


def count_heads() -> str:
    """Heads of the columns of `counts`."""
    return "".join(f"{state:>7}" for state in STATES)


def counts(point: Point) -> str:
    """How many interface nodes are bonded, open and closed."""
    return "".join(f"{point[state]:>7}" for state in STATES)


def number(value: float, width: int = 12) -> str:
    """The number; what the solver leaves of a zero is one."""
    return f" {value:>{width - 1}.5g}" if abs(value) > 1e-12 else f"{0:>{width}}"
