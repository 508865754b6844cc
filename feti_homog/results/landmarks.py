"""Find the landmarks of a path, and choose the points to store and to show.

Landmarks are first softening, first break, peak, valley after the peak, and end.  The peak is the largest stress before
a fall, in the component with the largest strain.  Points are entries of `path` in result.json.  When a path ends,
fields are kept at its first and last point, at points around drops, and at evenly spaced points in between.
"""

from collections.abc import Collection, Sequence
from heapq import heapify, heapreplace
from itertools import pairwise
from typing import Any

import numpy as np

from feti_homog.materials import voigt
from feti_homog.results import path_curves
from feti_homog.typing import Float

# A drop is a fall of the stress, or a jump of the strain, by more than this fraction of the largest value; the saw
# teeth of single nodes are smaller.
LEAST_DROP = 0.01
# A path has a peak if its stress falls by at least this fraction of the largest stress.
LEAST_FALL = 0.05
PEAK, LARGEST, SO_FAR = "peak", "largest stress", "largest so far"


def turning_points(values: Float, threshold: float) -> list[int]:
    """Return the alternating peaks and valleys of a curve (n,), as point numbers.

    Values at successive turning points, which may be ends of the curve, differ by more than `threshold`.  A curve whose
    values differ less has none.
    """
    entries, low, high = list[int](), 0, 0  # low, high: extremes since the last turning point
    rises = falls = True  # the curve may begin with either
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


def deepest_fall(size: Float, share: float | None, broken: Float) -> tuple[int, int | None]:
    """Return the numbers of the top and the valley of the deepest fall of a curve `size` (n,).

    A fall counts if bonds break in it (their number `broken` (n,) rises), and it begins at the largest value or takes
    the fraction `share` (None: never) of its top.  Returns (n, None) if none exceeds `LEAST_DROP` of the largest value.
    """
    top = np.maximum.accumulate(np.where(size >= np.maximum.accumulate(size), np.arange(len(size)), 0))
    fall = np.where(broken > broken[top], size[top] - size, 0.0)
    counts = size[top] == size.max()
    if share is not None:
        counts |= fall >= share * size[top]
    valley = int(np.where(counts, fall, 0.0).argmax())
    is_fall = counts[valley] and fall[valley] > LEAST_DROP * size.max()
    return (int(top[valley]), valley) if is_fall else (len(size), None)


def peak_of(document: path_curves.Document) -> dict[str, Any]:
    """Return the entries of `result_records.Peak` for a non-empty path; no stress, strain or event if no stress acts.

    The peak is the largest stress from the leg with the first damage under stress to the deepest fall in which bonds
    break or, without such a fall, to the end of the first leg with breaks: after all fibres debond, the matrix alone
    may carry more.  A fall by less than `LEAST_FALL` counts only from the largest stress; so does every fall of an
    unfinished path, and of a path whose bonds broke earlier without stress.  The entry `so_far` marks a path that is
    unfinished, stopped by max_events, or ends early without a fall.

    On the first leg of a path of events the load only rises: where bonds break, the cell drops to the next stable
    branch.  A prescribed stress cannot fall so: the peak is then one of all equilibria.
    """
    leg, breaking = path_curves.legs_of(document), path_curves.damaging_leg(document)
    points = document["path"] if breaking is None else document["path"][: np.count_nonzero(leg <= breaking)]
    start, stop = 0, len(leg)  # all points, or the points of the leg where damage begins
    if (damaging := path_curves.damaging_leg(document, ("broke", "softened"))) is not None:
        start, stop = int((leg < damaging).sum()), int((leg <= damaging).sum())
    component = path_curves.leading_component(document)
    strain = np.array([point["strain"][component] for point in points], float) + 0.0  # turns -0.0 into 0.0
    stresses = path_curves.stresses(document)[: len(points)]
    stress = stresses[:, component] + 0.0
    broke = np.array([point["broke"] for point in points])
    number, curve = np.arange(len(stress)), stress  # values of the leading stress, each with its point
    strains, names = voigt.voigt_names(len(points[0]["stress"]))
    given, method = path_curves.targets(document)[0].get(names[component]), document["case"]["path"]["method"]
    if method == "events" and not given:  # two corners of each branch on the first leg, one of the first
        on_first = path_curves.first_leg(document)
        later = path_curves.later_corners({**document, "path": points})
        is_point = np.isin([id(point) for point in later], [id(point) for point in points])
        number = np.repeat(path_curves.rising_points(points[:on_first]), 2)[1:]
        number = np.append(number, on_first + np.cumsum(is_point) - is_point).astype(int)
        curve = path_curves.load_controlled(points[:on_first])[1:, component]
        curve = np.append(curve, [point["stress"][component] for point in later])
        number, curve = number[np.isfinite(curve)], curve[np.isfinite(curve)]
        curve = np.where(np.abs(curve) > path_curves.noise(document), curve, 0.0)
    size = np.abs(curve)
    if path_curves.legs(document) > 1:  # compression is no peak of an earlier tension
        size = np.clip(curve * np.sign(stress[start + np.abs(stress[start:stop]).argmax()]), 0.0, None)
        size[number < start] = 0.0
    share = None if "unfinished" in document or broke[:start].any() else LEAST_FALL
    top, valley = deepest_fall(size, share, np.append(0, np.cumsum(broke))[number])
    event = int(number[(size >= (1.0 - path_curves.ZERO) * size[: top + 1].max()).argmax()])  # first of a plateau
    entries: dict[str, Any] = {"strain_name": strains[component], "stress_name": names[component]}
    if stresses.any():
        entries |= {"stress": float(stress[event]), "strain": float(strain[event]), "event": event}
        entries["dissipated"] = points[event].get("dissipated", 0.0)
    for title, count in (("first_softening", "softened"), ("first_break", "broke")):
        first = next((k for k, point in enumerate(points) if point.get(count)), None)
        if first is not None:
            numbers = {"stress": float(stress[first]), "strain": float(strain[first]), "event": first}
            entries |= {f"{title}_{name}": value for name, value in numbers.items()}
    if valley is not None:
        entries |= {"stress_left": float(curve[valley]), "event_left": int(number[valley])}
    is_cut_off = document["path"][-1]["load_factor"] < 1.0 - path_curves.SAME_LOAD
    is_cut_off &= valley is None or path_curves.is_stopped(document)
    if stresses.any() and (is_cut_off or "unfinished" in document):
        entries["so_far"] = True
    # The fibres and directions of the bonds follow from the states alone.
    bonds = {name: value for name, value in document.get("peak", {}).items() if name.endswith(("fibre", "angle"))}
    return entries | bonds


def bond_of(peak: path_curves.Document, title: str = "") -> str:
    """Describe a landmark's bond by fibre and direction, "" if unknown; its keys in `peak` begin with `title`."""
    if peak.get(f"{title}fibre") is None:
        return ""
    return f"fibre {peak[f'{title}fibre']} at {round(peak[f'{title}angle'], 3) + 0.0:.4g} degrees"


def name_of(document: path_curves.Document, peak: path_curves.Document) -> str:
    """Name the largest stress: SO_FAR if `peak` has `so_far`, PEAK before a fall by LEAST_FALL, else LARGEST.

    The stress falls to the valley or to the end of the leg.
    """
    if "so_far" in peak:
        return SO_FAR
    if not peak.get("stress"):
        return LARGEST
    leg = path_curves.legs_of(document)
    last = path_curves.table_of(document["path"])[peak["stress_name"]][leg == leg[peak["event"]]][-1]
    fall = max(1.0 - stress / peak["stress"] for stress in (last, peak.get("stress_left", last)))
    return LARGEST if fall < LEAST_FALL else PEAK


def passed_strengths(document: path_curves.Document, peak: path_curves.Document, numbers: Sequence[int]) -> list[str]:
    """Return a line for each phase that passes its strength, on a path with a peak only before the peak.

    The lines give stress and strain, or the temperature if only this changes.  On the first leg, where stresses are
    proportional to the load but for breaks, utilisations at the kept points `numbers` are interpolated; on later legs
    the lines give the kept points before and after.
    """
    lines, stress, leg = list[str](), path_curves.stresses(document), path_curves.legs_of(document)
    table = path_curves.table_of([document["path"][number] | {"stress": stress[number]} for number in numbers])
    last, subject = numbers[-1], "; the path"
    if name_of(document, peak) == PEAK:
        last, subject = peak["event"], ", before the peak of the path, which"
    for phase in document.get("phase_stresses", ()):
        ratios = [0.0, *phase.get("utilisation", ())]
        k = next((k for k, ratio in enumerate(ratios) if ratio >= 1.0), 0)
        if k and numbers[k - 1] <= last:
            is_thermal = path_curves.temperature_of(document, numbers[k - 1]) is not None
            names = ("temperature",) if is_thermal else (peak["stress_name"], peak["strain_name"])
            ends = {name: [0.0, *table[name]][k - 1 : k + 1] for name in names}
            if leg[numbers[k - 1]] == 1:
                way, share = "at about", ratios[k - 1 : k + 1]
                places = [f"{name} = {np.interp(1.0, share, pair):.4g}" for name, pair in ends.items()]
            else:
                way, pairs = "between", {name: (f"{a:.4g}", f"{b:.4g}") for name, (a, b) in ends.items()}
                differing = [name for name, (a, b) in pairs.items() if a != b] or names
                places = [f"{name} = {' and '.join(pairs[name])}" for name in differing]
            passed = f"[material.{phase['phase']}] strength: the utilisation reaches 1 {way} {', '.join(places)}"
            lines.append(f"{passed}{subject} takes the phase as elastic beyond")
    return lines


def marks(document: path_curves.Document) -> dict[int, str]:
    """Return the titles of all landmarks by point number, in ascending order."""
    peak = peak_of(document)
    largest = name_of(document, peak)
    places = {"first softening": "first_softening_event", "first break": "first_break_event"}
    places |= {largest: "event", f"after the {largest}": "event_left"}
    entries = {title: peak[name] for title, name in places.items() if name in peak} | {"end": len(document["path"]) - 1}
    numbers = sorted({int(number) for number in entries.values()})
    return {number: " and ".join(title for title, place in entries.items() if place == number) for number in numbers}


Drop = tuple[float, int, int]
"""Stress fall, or strain jump scaled to a stress, and the point numbers before and after."""


def kept(points: Sequence[path_curves.Point], states: int | str, legs: int, marked: Collection[int] = ()) -> list[int]:
    """Choose the points to store with fields; return their numbers in ascending order.

    Args:
        states: "all"; "peaks": ends, `marked` points and points around every drop; or a number of points: the ends, the
            marked points if they all fit, points around the deepest drops (up to half the rest), evenly spaced points.
        legs: number of legs of an event path, which passes all equilibria on the first leg; 0 for increments.
        marked: numbers of points at landmarks.
    """
    if not points or states == "all" or (isinstance(states, int) and len(points) <= states):
        return list(range(len(points)))
    ends, falls = {0, len(points) - 1}, drops(points, legs)
    if isinstance(states, str):
        return sorted(ends.union(marked, *((before, after) for _, before, after in falls)))
    chosen = ends.union(marked) if len(ends.union(marked)) <= states else ends
    room = len(chosen) + (states - len(chosen)) // 2
    for _, *pair in sorted(falls, key=lambda drop: -drop[0]):
        if len(chosen.union(pair)) <= room:
            chosen = chosen.union(pair)
    # Each further point divides the widest remaining gap: minus its width, number of parts, ends.
    gaps: list[tuple[float, int, int, int]] = [(a - b, 1, a, b) for a, b in pairwise(sorted(chosen))]
    heapify(gaps)
    for _ in range(states - len(chosen)):
        _, parts, a, b = gaps[0]
        heapreplace(gaps, ((a - b) / (parts + 1), parts + 1, a, b))
    return sorted({a + (b - a) * k // parts for _, parts, a, b in gaps for k in range(parts)} | ends)


def drops(points: Sequence[path_curves.Point], legs: int) -> list[Drop]:
    """List stress drops, and strain jumps at one load, above LEAST_DROP of the largest stress or strain.

    A drop leads from a peak to the next valley.  On the first of `legs` legs (see `kept`), a drop also leads from each
    load at which bonds break to the next point that a rising load reaches.  On later legs, and on paths of increments,
    a jump leads across all points at one load.
    """
    stress, strain = (np.array([point[name] for point in points], float) for name in ("stress", "strain"))
    size = _norm(stress, 2.0)
    largest = float(size.max())
    least = LEAST_DROP * largest
    entries = [(float(size[a] - size[b]), a, b) for a, b in pairwise(turning_points(size, least)) if size[a] > size[b]]
    scaled = largest / (float(_norm(strain, 0.5).max()) or 1.0) * strain  # strains as stresses
    load = np.array([point["load_factor"] for point in points])
    of_first_leg = int((load * legs <= 1.0 + path_curves.SAME_LOAD).sum()) if legs else 0
    # Branches are rays through zero: stress and strain after a drop are scaled to the load before the drop.
    jumps = list[Drop]()
    for a, b in pairwise(path_curves.rising_points(points[:of_first_leg]).tolist()):
        if b > a + 1:
            scale = load[a] / load[b]
            jump = float(_norm((scaled[b] * scale - scaled[a])[None], 0.5)[0])
            jumps.append((max(float(size[a] - size[b] * scale), jump), a, b))
    # On later legs the strain jumps across all points at one load, between which bonds break.
    starts = of_first_leg + np.flatnonzero(np.abs(np.diff(load[of_first_leg:], prepend=-1.0)) > path_curves.SAME_LOAD)
    for a, b in pairwise([*starts.tolist(), len(load)]):
        jump = float(_norm((scaled[b - 1] - scaled[a])[None], 0.5)[0])
        jumps.append((jump, a, min(b, len(load) - 1)))
    return entries + [drop for drop in jumps if drop[0] > least]


def _norm(values: Float, shear: float) -> Float:
    """Return the norms (n,) of strains or stresses (n, 3) or (n, 6), with weight `shear` for squared shears."""
    tensions = 2 if values.shape[1] == len(voigt.STRAINS) else 3
    square = np.square(values)
    return np.asarray(np.sqrt(square[:, :tensions].sum(axis=1) + shear * square[:, tensions:].sum(axis=1)))


def chosen(document: path_curves.Document, rows: int, among: Sequence[int] | None = None) -> list[int]:
    """Choose at most `rows`, at least 2, points of the path, or of the points `among` (in ascending order).

    Returns point numbers: the first and last point; then landmarks, the points of the deepest drop, and leg ends, each
    group if it fits; then points at evenly spaced numbers of broken bonds.
    """
    points = document["path"]
    numbers = np.arange(len(points)) if among is None else np.asarray(among, int)
    if len(numbers) <= rows:
        return [int(number) for number in numbers]
    fixed = {0, len(numbers) - 1}
    by_events = document["case"]["path"]["method"] == "events"
    _, *deepest = max(drops(points, path_curves.legs(document) if by_events else 0), default=(0.0,))
    for group in (marks(document), deepest, path_curves.ends_of_legs(document)):
        places = np.flatnonzero(np.isin(numbers, list(group))).tolist()
        fixed = fixed.union(places) if len(fixed.union(places)) <= rows else fixed
    broken = np.cumsum([point["broke"] for point in points])[numbers]
    counts = np.linspace(broken[0], broken[-1], rows - len(fixed) + 2)[1:-1]
    evenly = {int(np.abs(broken - count).argmin()) for count in counts}
    return [int(numbers[place]) for place in sorted(evenly | fixed)]


def kept_points(document: path_curves.Document) -> list[int]:
    """Return the point number of each state with stored fields; all point numbers if no fields are stored."""
    return list(document.get("states") or range(len(document["path"])))


def landmark_states(document: path_curves.Document, rows: int, count: int) -> list[int]:
    """Return the numbers of the states at landmarks, among the first `count` states.

    If fewer than three landmarks have states, returns at most `rows` states by `chosen_states` instead.
    """
    among, marked = kept_points(document)[:count], marks(document)
    entries = [state for state, point in enumerate(among) if point in marked]
    return entries if len(entries) >= 3 else chosen_states(document, rows, count)


def chosen_states(document: path_curves.Document, rows: int, count: int) -> list[int]:
    """Return the numbers of at most `rows` of the first `count` states, whose points `chosen` selects."""
    among = kept_points(document)[:count]
    return [among.index(number) for number in chosen(document, rows, among)]
