"""Energy release rates at the tips of debonded arcs as short tables for the printed summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Document = Mapping[str, Any]

COLUMNS = ("G", "G_I", "G_II")
NAMES = ("load", "fibre", "angle", *COLUMNS, "psi")
SECTION = "interface"
"""Of cases that have several."""
TITLE = "Largest energy release rate"


def tip_table(tips: Document | None, unit: str) -> list[str]:
    """For each load the tip of the largest G; none without tips."""
    largest = _largest(tips)
    rows = [f"{tip['load']:>9}{_numbers(tip)}" for tip in largest]
    return [f"{TITLE}{unit}", f"{'load':>9}{_heads(largest)}", *rows] if rows else []


def angle_tip_table(points: Sequence[Document], unit: str) -> list[str]:
    """For each angle the largest G of each load, or of a single load all about the tip; none without tips."""
    found = [(f"{point['angle']:>9.5g}", tips) for point in points if (tips := _largest(point.get("tips")))]
    loads = list(dict.fromkeys(tip["load"] for _, tips in found for tip in tips))
    if len(loads) == 1:
        rows = [f"{angle}{_numbers(tip)}" for angle, (tip,) in found]
        return [f"{TITLE}{unit}", f"{'angle':>9}{_heads(found[0][1])}", *rows]
    rows = [f"{angle}" + "".join(f"{tip['G']:>12.5g}" for tip in tips) for angle, tips in found]
    heads = "".join(f"{load:>12}" for load in loads)
    return [f"{TITLE}{unit} under each load", f"{'angle':>9}{heads}", *rows] if rows else []


def _largest(tips: Document | None) -> list[Document]:
    """The tip of the largest G of each load, in the order of the loads."""
    best: dict[str, Document] = {}
    names = [*NAMES, *([SECTION] if tips and SECTION in tips else [])]
    for values in zip(*(tips[name] for name in names), strict=True) if tips else ():
        tip = dict(zip(names, values, strict=True))
        # Of tips that are alike but for rounding, the first.
        if tip["load"] not in best or tip["G"] > best[tip["load"]]["G"] * (1 + 1e-6):
            best[tip["load"]] = tip
    return list(best.values())


def _heads(tips: Sequence[Document]) -> str:
    section = f"{SECTION:>11}" if SECTION in tips[0] else ""
    return "".join(f"{name:>12}" for name in COLUMNS) + f"{'psi':>8}{'fibre':>8}{'at':>9}{section}"


def _numbers(tip: Document) -> str:
    values = "".join(f"{tip[name]:>12.5g}" for name in COLUMNS)
    section = f"{tip[SECTION]:>11}" if SECTION in tip else ""
    return f"{values}{tip['psi']:>8.1f}{tip['fibre']:>8}{tip['angle']:>9.5g}{section}"
