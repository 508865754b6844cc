"""Landmarks of a path: its first break, its peak, what is left after it, its end; the points that are kept and shown.

The peak is the largest stress before it falls, of the component whose strain leads; points are those of `path` in
result.json.  Kept with their fields are the ends, the points around drops, and the rest evenly.  The choice is made at
the end of the path.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from heapq import heapify, heapreplace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.materials.voigt import STRAINS, voigt_names
from feti_homog.results import path_curves
from feti_homog.results.path_curves import SAME_LOAD, Document, Point
from feti_homog.typing import Float

# A fall of the stress, or a jump of the strain, by more than this share of the largest is a drop: saw teeth of single
# nodes are none.
LEAST_DROP = 0.01
# A path whose stress ends by less than this share below its largest ends near its peak.
LEAST_FALL = 0.05
PEAK, LARGEST, SO_FAR = "peak", "largest stress", "largest so far"


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
    once all fibres have come off, the matrix alone may carry more than the composite did.  Of a path that ended before
    its end without a fall it is the largest `so_far`, and no peak.
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
    elif points[-1]["load_factor"] < 1.0 - SAME_LOAD:
        found["so_far"] = True
    found["dissipated"] = points[event].get("dissipated", 0.0)
    return {"strain_name": names[0], "stress_name": names[1], **found}


def stresses_of(document: Document, peak: Document) -> list[float]:
    """Return the stress of the component of a peak at each point."""
    component = voigt_names(len(document["path"][0]["stress"]))[1].index(peak["stress_name"])
    return [float(point["stress"][component]) for point in document["path"]]


def fall_of(document: Document, peak: Document) -> float:
    """Return the share of its largest stress by which a path falls after it, to the valley or its end."""
    left = (stresses_of(document, peak)[-1], peak.get("stress_left", peak["stress"]))
    return max(1.0 - stress / peak["stress"] for stress in left) if peak["stress"] else 0.0


def name_of(document: Document, peak: Document) -> str:
    """Return PEAK of a largest stress after which the path falls, else LARGEST, of one that was cut off SO_FAR."""
    if "so_far" in peak:
        return SO_FAR
    return LARGEST if fall_of(document, peak) < LEAST_FALL else PEAK


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
    largest = name_of(document, peak)
    places = {"first break": "first_break_event", largest: "event", f"after the {largest}": "event_left"}
    found = {words: peak[name] for words, name in places.items() if name in peak}
    found["end"] = len(document["path"]) - 1
    numbers = sorted({int(number) for number in found.values()})
    return {number: " and ".join(words for words, own in found.items() if own == number) for number in numbers}


FEWEST_MARKED = 3  # points of a path whose marks show how it went

Drop = tuple[float, int, int]
"""How far the stress falls, of a jump of the strain as much of the largest, and the points before and after."""


def kept(points: Sequence[Point], states: int | str, legs: int, marked: Collection[int] = ()) -> list[int]:
    """Numbers of the points to keep, rising.

    `states` is "all", "peaks": the ends, the points that are `marked` and those around every drop, or how many at most:
    the ends, those marked if they are not too many, of the other places half for the points around drops, the deepest
    first, and the rest as evenly between as they can be.
    Of `legs` legs the first goes through all equilibria; 0 of increments.
    """
    if states == "all" or not points:
        return list(range(len(points)))
    ends, around = {0, len(points) - 1}, drops(points, legs)
    if isinstance(states, str):
        return sorted(ends.union(marked, *(drop[1:] for drop in around)))
    if len(points) <= states:
        return list(range(len(points)))
    chosen = ends.union(marked) if len(ends.union(marked)) <= states else ends
    room = len(chosen) + (states - len(chosen)) // 2
    for _, *pair in sorted(around, key=lambda drop: -drop[0]):
        if len(chosen.union(pair)) <= room:
            chosen = chosen.union(pair)
    return _filled(sorted(chosen), states)


def drops(points: Sequence[Point], legs: int) -> list[Drop]:
    """Return the drops of the stress, and the jumps of the strain at a load that is held.

    Drops go from each peak to the valley after it, and on a first leg of events also from each load at which bonds
    break to the next point that a rising load comes to; jumps are where a stress is given that cannot drop.
    """
    stress, strain = (np.array([point[name] for point in points], float) for name in ("stress", "strain"))
    size, length = _norm(stress, 2.0), _norm(strain, 0.5)
    largest = float(size.max())
    least = LEAST_DROP * largest
    found = [(float(size[a] - size[b]), a, b) for a, b in pairwise(turning_points(size, least)) if size[a] > size[b]]
    per_strain = largest / (float(length.max()) or 1.0)
    load = np.array([point["load_factor"] for point in points])
    of_first_leg = int((load * legs <= 1.0 + SAME_LOAD).sum()) if legs else 0
    found += _of_rising_load(load[:of_first_leg], size, per_strain * strain, least)
    return found + _jumps(load, of_first_leg, per_strain * strain, least)


def _norm(values: Float, shear: float) -> Float:
    """(n,) size of the tensors of (n, 3) or (n, 6), whose shears count as so much."""
    tensions = 2 if values.shape[1] == len(STRAINS) else 3
    square = np.square(values)
    return np.asarray(np.sqrt(square[:, :tensions].sum(axis=1) + shear * square[:, tensions:].sum(axis=1)))


def _of_rising_load(load: Float, size: Float, strain: Float, least: float) -> list[Drop]:
    """On rays through zero: the point after a drop is at another load, to which stress and strain are scaled."""
    records = np.flatnonzero(load >= np.maximum.accumulate(load)).tolist() if len(load) else []
    found = []
    for a, b in pairwise(records):
        scale = load[a] / load[b]
        jump = _norm((strain[b] * scale - strain[a])[None], 0.5)[0]
        found.append((max(float(size[a] - size[b] * scale), float(jump)), a, b))
    return [drop for drop in found if drop[0] > least and drop[2] > drop[1] + 1]


def _jumps(load: Float, first: int, strain: Float, least: float) -> list[Drop]:
    """From point `first` on: to the point behind those at one load, between which bonds break at that load alone."""
    starts = first + np.flatnonzero(np.abs(np.diff(load[first:], prepend=-1.0)) > SAME_LOAD)
    found = []
    for a, b in pairwise([*starts.tolist(), len(load)]):
        jump = float(_norm((strain[b - 1] - strain[a])[None], 0.5)[0])
        found.append((jump, a, min(b, len(load) - 1)))
    return [drop for drop in found if drop[0] > least]


def _filled(numbers: list[int], count: int) -> list[int]:
    """`numbers` and others between them, `count` in all: the widest gap is always the next to be divided further."""
    gaps: list[tuple[float, int, int, int]] = [(a - b, 1, a, b) for a, b in pairwise(numbers)]
    heapify(gaps)
    for _ in range(count - len(numbers)):
        _, parts, a, b = gaps[0]
        heapreplace(gaps, ((a - b) / (parts + 1), parts + 1, a, b))
    return sorted({a + (b - a) * k // parts for _, parts, a, b in gaps for k in range(parts)} | {numbers[-1]})


def chosen(document: Document, rows: int, among: Sequence[int] | None = None) -> list[int]:
    """Numbers of at most `rows` points of a path.

    These are the first, the last, the first break, the peak and the valley after it, the deepest drop, the ends of its
    legs, each if they are not too many, and between them as evenly as bonds broke; with `among`, rising, of these
    points.
    """
    points = document["path"]
    numbers = np.arange(len(points)) if among is None else np.asarray(among, int)
    if len(numbers) <= rows:
        return [int(number) for number in numbers]
    fixed = {0, len(numbers) - 1}
    for wanted in (marks(document), _deepest(document), path_curves.ends_of_legs(document)):
        places = np.flatnonzero(np.isin(numbers, list(wanted))).tolist()
        fixed = fixed.union(places) if len(fixed.union(places)) <= rows else fixed
    broken = np.cumsum([point["broke"] for point in points])[numbers]
    counts = np.linspace(broken[0], broken[-1], rows - len(fixed) + 2)[1:-1]
    evenly = {int(np.abs(broken - count).argmin()) for count in counts}
    return [int(numbers[place]) for place in sorted(evenly | fixed)]


def _deepest(document: Document) -> tuple[int, ...]:
    """Return the points before and after the deepest drop of a path, none without drops."""
    of_events = document["case"]["path"]["method"] == "events"
    around = drops(document["path"], path_curves.legs(document) if of_events else 0)
    return max(around)[1:] if around else ()


def kept_points(document: Document) -> list[int]:
    """Numbers of the points of a path whose fields are kept, in the order of the states; of all if none are."""
    return list(document.get("states") or range(len(document["path"])))


def landmark_states(document: Document, rows: int, count: int) -> list[int]:
    """Numbers of those of the first `count` states of a path that are at its main points.

    These are its first break, its peak, the valley after it and its end; with fewer than three of them at most `rows`
    states, chosen as `chosen_states` chooses.
    """
    among, marked = kept_points(document)[:count], marks(document)
    found = [state for state, point in enumerate(among) if point in marked]
    return found if len(found) >= FEWEST_MARKED else chosen_states(document, rows, count)


def chosen_states(document: Document, rows: int, count: int) -> list[int]:
    """Numbers of at most `rows` of the first `count` states of a path, chosen as `chosen` chooses points."""
    among = kept_points(document)[:count]
    return [among.index(number) for number in chosen(document, rows, among)]
