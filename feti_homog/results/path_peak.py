"""The peak of a path: its largest stress before it falls, the first break before it, and what is left after it.

The stress is that of the component whose strain leads; points are those of `path` in result.json.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.materials.voigt import voigt_names
from feti_homog.results import path_curves
from feti_homog.results.path_curves import Document
from feti_homog.typing import Float

# A fall of the stress, or a jump of the strain, by more than this share of the largest is a drop: saw teeth of single
# nodes are none.
LEAST_DROP = 0.01


def turning_points(values: Float, least: float) -> list[int]:
    """Numbers of the peaks and valleys of a curve (n,), in turn, that are more than `least` apart.

    The ends count if the curve falls or rises by so much from them, or to them.
    """
    found, low, high, rises, falls = list[int](), 0, 0, True, True
    for number, value in enumerate(values):
        low = number if value < values[low] else low
        high = number if value > values[high] else high
        if rises and value < values[high] - least:
            found.append(high)
            low, rises, falls = number, False, True
        elif falls and value > values[low] + least:
            found.append(low)
            high, rises, falls = number, True, False
    return [*found, high if rises else low] if found else []


def peak_of(document: Document) -> dict[str, Any]:
    """Return the fields of `result_records.Peak` of a path that has points.

    The peak is the largest stress up to the deepest fall in which bonds break, or of the whole path if there is none:
    once all fibres have come off, the matrix alone may carry more than the composite did.
    """
    points, component = document["path"], path_curves.leading_component(document)
    # 0.0 is added, for a zero may have a sign.
    stress, strain = (np.array([p[name] for p in points], float)[:, component] + 0.0 for name in ("stress", "strain"))
    event, left, valley = _deepest_fall(document, stress)
    names = [names[component] for names in voigt_names(len(points[0]["stress"]))]
    found = {"stress": float(stress[event]), "strain": float(strain[event]), "event": event}
    first = next((number for number, point in enumerate(points) if point["broke"]), None)
    if first is not None:
        found |= {
            "first_break_stress": float(stress[first]),
            "first_break_strain": float(strain[first]),
            "first_break_event": first,
        }
    if valley is not None:
        found |= {"stress_left": left, "event_left": valley}
    found["dissipated"] = points[event].get("dissipated", 0.0)
    return {"strain_name": names[0], "stress_name": names[1], **found}


def _deepest_fall(document: Document, stress: Float) -> tuple[int, float, int | None]:
    """Return the point of the largest stress (n,) up to the deepest fall in which bonds break, and the valley.

    With the stress in the valley and the point on whose branch it is; the largest of all points, and None, without a
    fall.

    On a path of one leg the load only rises: at the load of a point it comes to the branch of the next that holds.
    """
    number, broke = np.arange(len(stress)), np.array([point["broke"] for point in document["path"]])
    if path_curves.is_proportional(document):
        load = np.array([point["load_factor"] for point in document["path"]])
        records = np.flatnonzero(load >= np.maximum.accumulate(load))
        fallen = stress[records[1:]] * load[records[:-1]] / load[records[1:]]
        stress = np.r_[stress[records[0]], np.column_stack([fallen, stress[records[1:]]]).ravel()]
        number = np.r_[records[0], np.repeat(records[1:], 2)]
    size = np.abs(stress)
    turns = pairwise(turning_points(size, LEAST_DROP * float(size.max())))
    falls = [(size[a] - size[b], a, b) for a, b in turns if size[a] > size[b] and broke[number[a] : number[b]].any()]
    if not falls:
        return int(number[size.argmax()]), 0.0, None
    _, top, valley = max(falls)
    return int(number[size[: top + 1].argmax()]), float(stress[valley]), int(number[valley])


def marks(document: Document) -> dict[int, str]:
    """Return what some points of a path are, by their rising numbers: first break, peak, valley after it and end."""
    peak = peak_of(document)
    places = {"first break": "first_break_event", "peak": "event", "after the peak": "event_left"}
    found = {words: peak[name] for words, name in places.items() if name in peak}
    found["end"] = len(document["path"]) - 1
    numbers = sorted({int(number) for number in found.values()})
    return {number: " and ".join(words for words, own in found.items() if own == number) for number in numbers}
