"""The onset of debonding in a plane of loads as a short table for the printed summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, radians, sin
from typing import Any

ROWS = 12  # of the table, at most
ROUNDING = 1e-12  # shares of the load below which a component is what rounding leaves of zero
SHARES = ("normal", "tangential", "axial")
HEADS = {"tangential": "tangent"}

Document = Mapping[str, Any]


def envelope_table(document: Document, stress: str) -> list[str]:
    """The least and the largest load, and what breaks first in some directions; `stress` is the unit in brackets."""
    section, points = document["case"]["envelope"], document["envelope"]
    axes, known = section["plane"], [point for point in points if "factor" in point]
    unit = stress if axes[0].startswith("S") else ""
    warmer = section.get("temperature")
    after = "" if warmer is None else f", after a temperature of {warmer:g}"
    lines = [f"Onset of debonding in the plane {axes[0]}, {axes[1]}{unit}: {len(points)} directions{after}"]
    if len(known) < len(points):
        lines.append(f"  no load breaks a bond in {len(points) - len(known)} of them")
    if not known:
        return lines
    for words, point in (("least", min(known, key=_load)), ("largest", max(known, key=_load))):
        lines.append(f"  {words:<9}{_load(point):.7g} at {point['angle']:g} degrees")
    names = [name for name in (*SHARES, "psi") if name in known[0]]
    return [*lines, *_head(axes, names, known[0]), *(_row(point, names) for point in _chosen(points))]


def _head(axes: Sequence[str], names: Sequence[str], point: Document) -> list[str]:
    """What the columns of the table are."""
    used = "psi of its traction" if list(names) == ["psi"] else "traction / strength"
    return [
        f"  first bond: its fibre, its direction there (degrees), {used}",
        f"{'angle':>8}{axes[0]:>12}{axes[1]:>12}{'fibre':>6}{'at':>9}{_interface(point, 'interface')}"
        + "".join(f"{HEADS.get(name, name):>10}" for name in names),
    ]


def components(point: Document) -> tuple[float, float]:
    """The two components of the load at onset."""
    angle, load = radians(point["angle"]), _load(point)
    return _rounded(load * cos(angle), load), _rounded(load * sin(angle), load)


def _load(point: Document) -> float:
    return float(point["factor"])


def _rounded(value: float, size: float) -> float:
    return value if abs(value) > ROUNDING * size else 0.0


def _chosen(points: Sequence[Document]) -> list[Document]:
    """Evenly spaced ones, the first among them."""
    step = max(1, -(-len(points) // ROWS))
    while len(points) % step:
        step += 1
    return list(points[::step])


def _row(point: Document, names: Sequence[str]) -> str:
    if "factor" not in point:
        return f"{point['angle']:>8.5g}{'none':>12}{'none':>12}"
    first, second = components(point)
    used = "".join(f"{_rounded(point[name], 1.0):>10.4g}" for name in names)
    place = f"{point['fibre']:>6}{point['bond_angle']:>9.2f}{_interface(point, point.get('interface'))}"
    return f"{point['angle']:>8.5g}{first:>12.6g}{second:>12.6g}{place}{used}"


def _interface(point: Document, words: object) -> str:
    """A column of cases that have several."""
    return f"{words:>10}" if "interface" in point else ""
