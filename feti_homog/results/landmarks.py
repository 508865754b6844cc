"""Landmarks of a path: first break, peak, stress left after it, end; points whose fields are kept, points to show.

The peak is the largest stress before a fall, in the component whose strain leads; points are entries of `path` in
result.json.  At the end of the path fields are kept for its ends, for points around drops, and evenly between.
"""

from collections.abc import Collection, Sequence
from heapq import heapify, heapreplace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.materials import voigt
from feti_homog.results import path_curves
from feti_homog.results.path_curves import SAME_LOAD, Document, Point
from feti_homog.typing import Float

# A fall of the stress, or a jump of the strain, by more than this share of the largest is a drop: saw teeth of single
# nodes are none.
LEAST_DROP = 0.01
# A path whose stress ends by less than this share below its largest ends near its peak.
LEAST_FALL = 0.05
PEAK, LARGEST, SO_FAR = "peak", "largest stress", "largest so far"


def turning_points(values: Float, threshold: float) -> list[int]:
    """Return numbers of peaks and valleys of a curve (n,), in turn, more than `threshold` apart.

    Ends count if the curve falls or rises by more than `threshold` from or to them.
    """
    entries, low, high, rises, falls = list[int](), 0, 0, True, True
    for number, value in enumerate(values):
        low = number if value < values[low] else low
        high = number if value > values[high] else high
        if rises and value < values[high] - threshold:
            entries.append(high)
            low, rises, falls = number, False, True
        elif falls and value > values[low] + threshold:
            entries.append(low)
            high, rises, falls = number, True, False
    return [*entries, high if rises else low] if entries else []


def peak_of(document: Document) -> dict[str, Any]:
    """Return the fields of `result_records.Peak` for a path with points.

    The peak is the largest stress up to the deepest fall in which bonds break, or on the path if it has no fall: once
    all fibres have come off, the matrix alone may carry more than the composite did.  A path cut off without a fall has
    a largest stress `so_far`, and no peak.
    """
    points, component = document["path"], path_curves.leading_component(document)
    # 0.0 is added, for a zero may have a sign.
    stress, strain = (np.array([p[name] for p in points], float)[:, component] + 0.0 for name in ("stress", "strain"))
    event, remaining, valley = _deepest_fall(document, stress)
    names = [names[component] for names in voigt.voigt_names(len(points[0]["stress"]))]
    entries = {"stress": float(stress[event]), "strain": float(strain[event]), "event": event}
    first = next((number for number, point in enumerate(points) if point["broke"]), None)
    if first is not None:
        entries |= {
            "first_break_stress": float(stress[first]),
            "first_break_strain": float(strain[first]),
            "first_break_event": first,
        }
    if valley is not None:
        entries |= {"stress_left": remaining, "event_left": valley}
    elif points[-1]["load_factor"] < 1.0 - SAME_LOAD:
        entries["so_far"] = True
    entries["dissipated"] = points[event].get("dissipated", 0.0)
    return {"strain_name": names[0], "stress_name": names[1], **entries}


def stresses_of(document: Document, peak: Document) -> list[float]:
    """Return the stress at each point, in the component of the peak."""
    component = voigt.voigt_names(len(document["path"][0]["stress"]))[1].index(peak["stress_name"])
    return [float(point["stress"][component]) for point in document["path"]]


def fall_of(document: Document, peak: Document) -> float:
    """Return the fall after the largest stress, to the valley or the end, as a share of that stress."""
    remaining = (stresses_of(document, peak)[-1], peak.get("stress_left", peak["stress"]))
    return max(1.0 - stress / peak["stress"] for stress in remaining) if peak["stress"] else 0.0


def name_of(document: Document, peak: Document) -> str:
    """Return PEAK if the path falls after its largest stress, SO_FAR if it was cut off, else LARGEST."""
    if "so_far" in peak:
        return SO_FAR
    return LARGEST if fall_of(document, peak) < LEAST_FALL else PEAK


def _deepest_fall(document: Document, stress: Float) -> tuple[int, float, int | None]:
    """Return the point with the largest stress up to the deepest fall in which bonds break.

    Also the stress in the valley and the point on whose branch it lies; without a fall 0 and None, and the largest
    stress (n,) is sought on the path.

    On one leg the load only rises: at the load of a point the cell comes to the branch of the next point that holds.
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
    """Return words for the main points by rising number: first break, peak, valley after it, end."""
    peak = peak_of(document)
    largest = name_of(document, peak)
    places = {"first break": "first_break_event", largest: "event", f"after the {largest}": "event_left"}
    entries = {title: peak[name] for title, name in places.items() if name in peak}
    entries["end"] = len(document["path"]) - 1
    numbers = sorted({int(number) for number in entries.values()})
    return {
        number: " and ".join(title for title, position in entries.items() if position == number) for number in numbers
    }


Drop = tuple[float, int, int]
"""Stress fall (a strain jump scaled to stress), and the points before and after."""


def kept(points: Sequence[Point], states: int | str, legs: int, marked: Collection[int] = ()) -> list[int]:
    """Return rising numbers of the points to keep.

    `states`: "all"; "peaks": ends, `marked` points and points around every drop; or a count: ends, marked points unless
    too many, half the other places for points around drops, the deepest first, and evenly spaced points.
    The first of `legs` legs goes through all equilibria; 0 for increments.
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
    # Each further point divides the widest gap anew.
    gaps: list[tuple[float, int, int, int]] = [(a - b, 1, a, b) for a, b in pairwise(sorted(chosen))]
    heapify(gaps)
    for _ in range(states - len(chosen)):
        _, parts, a, b = gaps[0]
        heapreplace(gaps, ((a - b) / (parts + 1), parts + 1, a, b))
    return sorted({a + (b - a) * k // parts for _, parts, a, b in gaps for k in range(parts)} | ends)


def drops(points: Sequence[Point], legs: int) -> list[Drop]:
    """Return the stress drops, and the strain jumps at constant load.

    Drops go from each peak to the next valley, and on a first leg of events also from each load at which bonds break to
    the next point that a rising load comes to; the strain jumps where a prescribed stress cannot drop.
    """
    stress, strain = (np.array([point[name] for point in points], float) for name in ("stress", "strain"))
    size, length = _norm(stress, 2.0), _norm(strain, 0.5)
    largest = float(size.max())
    threshold = LEAST_DROP * largest
    entries = [
        (float(size[a] - size[b]), a, b) for a, b in pairwise(turning_points(size, threshold)) if size[a] > size[b]
    ]
    per_strain = largest / (float(length.max()) or 1.0)
    load = np.array([point["load_factor"] for point in points])
    of_first_leg = int((load * legs <= 1.0 + SAME_LOAD).sum()) if legs else 0
    # A rising load goes along rays through zero: stress and strain after a drop are scaled to the load before it.
    rising, scaled, later = load[:of_first_leg], per_strain * strain, list[Drop]()
    for a, b in pairwise(np.flatnonzero(rising >= np.maximum.accumulate(rising)).tolist()):
        scale = load[a] / load[b]
        jump = _norm((scaled[b] * scale - scaled[a])[None], 0.5)[0]
        later += [(max(float(size[a] - size[b] * scale), float(jump)), a, b)] * (b > a + 1)
    # Later, strain jumps over the points at one load, between which bonds break.
    starts = of_first_leg + np.flatnonzero(np.abs(np.diff(load[of_first_leg:], prepend=-1.0)) > SAME_LOAD)
    for a, b in pairwise([*starts.tolist(), len(load)]):
        jump = float(_norm((scaled[b - 1] - scaled[a])[None], 0.5)[0])
        later.append((jump, a, min(b, len(load) - 1)))
    return entries + [drop for drop in later if drop[0] > threshold]


def _norm(values: Float, shear: float) -> Float:
    """(n,) size of tensors (n, 3) or (n, 6); squared shears have weight `shear`."""
    tensions = 2 if values.shape[1] == len(voigt.STRAINS) else 3
    square = np.square(values)
    return np.asarray(np.sqrt(square[:, :tensions].sum(axis=1) + shear * square[:, tensions:].sum(axis=1)))


def chosen(document: Document, rows: int, among: Sequence[int] | None = None) -> list[int]:
    """Return numbers of at most `rows` points of a path, or of its points `among` (rising).

    First and last point; then main points, deepest drop and leg ends, each group unless too many; between them points
    spaced evenly by broken bonds.
    """
    points = document["path"]
    numbers = np.arange(len(points)) if among is None else np.asarray(among, int)
    if len(numbers) <= rows:
        return [int(number) for number in numbers]
    fixed = {0, len(numbers) - 1}
    of_events = document["case"]["path"]["method"] == "events"
    around = drops(points, path_curves.legs(document) if of_events else 0)
    deepest = max(around)[1:] if around else ()
    for group in (marks(document), deepest, path_curves.ends_of_legs(document)):
        places = np.flatnonzero(np.isin(numbers, list(group))).tolist()
        fixed = fixed.union(places) if len(fixed.union(places)) <= rows else fixed
    broken = np.cumsum([point["broke"] for point in points])[numbers]
    counts = np.linspace(broken[0], broken[-1], rows - len(fixed) + 2)[1:-1]
    evenly = {int(np.abs(broken - count).argmin()) for count in counts}
    return [int(numbers[place]) for place in sorted(evenly | fixed)]


def kept_points(document: Document) -> list[int]:
    """Return the numbers of the points with kept fields, in state order; all points if no fields are kept."""
    return list(document.get("states") or range(len(document["path"])))


def landmark_states(document: Document, rows: int, count: int) -> list[int]:
    """Return the states, among the first `count`, at main points: first break, peak, valley after it, end.

    With fewer than three main points: at most `rows` states from `chosen_states`.
    """
    among, marked = kept_points(document)[:count], marks(document)
    entries = [state for state, point in enumerate(among) if point in marked]
    return entries if len(entries) >= 3 else chosen_states(document, rows, count)


def chosen_states(document: Document, rows: int, count: int) -> list[int]:
    """Return at most `rows` states among the first `count`, at points from `chosen`."""
    among = kept_points(document)[:count]
    return [among.index(number) for number in chosen(document, rows, among)]
