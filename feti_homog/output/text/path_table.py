"""The points of a path as a short table for the printed summary, and its energies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.mechanics.response import leading_component, shown_stresses
from feti_homog.mechanics.voigt import voigt_names
from feti_homog.output.text.point_tables import chosen, count_heads, counts, number
from feti_homog.typing import Float

ROWS = 15
COLUMNS = 5  # of loads and stresses, at most, that a table of 100 columns has room for
TEMPERATURE = "temperature"

Document = Mapping[str, Any]


def path_table(document: Document, stress: str) -> list[str]:
    """Totals of the path, and rows of some of its points."""
    points = document["path"]
    numbers = chosen(points, ROWS)
    broke = sum(point["broke"] for point in points)
    some = "" if len(numbers) == len(points) else f", {len(numbers)} shown"
    shown, hidden = _columns(document)
    lines = [
        f"Path{stress}: {len(points)} points{some}; {broke} bonds broke",
        *_energies(points[-1], stress),
        *([f"Not shown here: {', '.join(hidden)}"] if hidden else []),
        f"{'point':>5}{'load':>9}" + "".join(f"{name:>{_width(name)}}" for name in shown) + count_heads(),
    ]
    for k in numbers:
        values = "".join(number(float(column[k]), _width(name)) for name, column in shown.items())
        lines.append(f"{k:>5}{points[k]['load_factor']:>9.6f}{values}{counts(points[k])}")
    return lines


def _columns(document: Document) -> tuple[dict[str, Float], list[str]]:
    """The temperature if it changes, the leading strain and the stresses that are not zero, each (points,); and the
    names of the smallest stresses, for which there is no room."""
    points, leading = document["path"], leading_component(document)
    strain, stress = (np.array([point[name] for point in points]) for name in ("strain", "stress"))
    strains, stresses = voigt_names(strain.shape[1])
    warmer = np.array([point.get(TEMPERATURE, 0.0) for point in points])
    found = ({TEMPERATURE: warmer} if warmer.any() else {}) | {strains[leading]: strain[:, leading]}
    by_size = sorted(
        shown_stresses(points, leading), key=lambda k: (k == leading, np.abs(stress[:, k]).max()), reverse=True
    )
    room = COLUMNS - len(found)
    found |= {stresses[k]: stress[:, k] for k in sorted(by_size[:room])}
    return found, [stresses[k] for k in sorted(by_size[room:])]


def _width(name: str) -> int:
    return max(11, len(name) + 1)


def _energies(last: Document, stress: str) -> list[str]:
    """What is stored at the end of a path, what breaks have lost, also if the load only rose, and what debonded."""
    springs = f", {last['stored_in_springs']:.6g} of it in springs" if last["stored_in_springs"] else ""
    rising = f"{last['dissipated_strain_controlled']:.6g} if the load only rises"
    lines = [
        f"Stored per area{stress}: {last['stored']:.6g}{springs}",
        f"Dissipated per area{stress}: {last['dissipated']:.6g} along all equilibria, {rising}",
    ]
    if "dissipation_ratio" in last:
        ratio = f"{last['dissipation_ratio']:.4f} times it was dissipated"
        lines.append(f"Toughness of what broke per area{stress}: {last['fracture_energy']:.6g}; {ratio}")
    return [*lines, f"Debonded: {100 * last['debonded_share']:.1f} % of the interfaces"]
