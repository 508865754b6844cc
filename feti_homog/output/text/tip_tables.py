"""Energy release rates at the tips of debonded arcs as short tables for the printed summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

Document = Mapping[str, Any]

COLUMNS = ("G", "G_I", "G_II")
NAMES = ("load", "fibre", "angle", *COLUMNS, "psi")
TITLE = "Largest energy release rate"


def tip_table(tips: Document | None, unit: str) -> list[str]:
    """For each load the tip of the largest G; none without tips."""
    rows = [f"{tip['load']:>9}{_numbers(tip)}" for tip in _largest(tips)]
    return [f"{TITLE}{unit}", f"{'load':>9}{_heads()}", *rows] if rows else []


def angle_tip_table(points: Sequence[Document], unit: str) -> list[str]:
    """For each angle the largest G of each load, or of a single load all about the tip; none without tips."""
    found = [(f"{point['angle']:>9.5g}", _largest(point.get("tips"))) for point in points]
    loads = list(dict.fromkeys(tip["load"] for _, tips in found for tip in tips))
    if len(loads) == 1:
        rows = [f"{angle}{_numbers(tip)}" for angle, tips in found for tip in tips]
        return [f"{TITLE}{unit}", f"{'angle':>9}{_heads()}", *rows]
    rows = [f"{angle}" + "".join(f"{tip['G']:>12.5g}" for tip in tips) for angle, tips in found if tips]
    heads = "".join(f"{load:>12}" for load in loads)
    return [f"{TITLE}{unit} under each load", f"{'angle':>9}{heads}", *rows] if rows else []


def _largest(tips: Document | None) -> list[Document]:
    """The tip of the largest G of each load, in the order of the loads."""
    best: dict[str, Document] = {}
    for values in zip(*(tips[name] for name in NAMES), strict=True) if tips else ():
        tip = dict(zip(NAMES, values, strict=True))
        # Of tips that are alike but for rounding, the first.
        if tip["load"] not in best or tip["G"] > best[tip["load"]]["G"] * (1 + 1e-6):
            best[tip["load"]] = tip
    return list(best.values())


def _heads() -> str:
    return "".join(f"{name:>12}" for name in COLUMNS) + f"{'psi':>8}{'fibre':>8}{'at':>9}"


def _numbers(tip: Document) -> str:
    values = "".join(f"{tip[name]:>12.5g}" for name in COLUMNS)
    return f"{values}{tip['psi']:>8.1f}{tip['fibre']:>8}{tip['angle']:>9.5g}"
