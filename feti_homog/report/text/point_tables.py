"""The points of result.json, `angle`, `path` and `load`, as short tables for the printed summary."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from feti_homog.case.mixed_load import TEMPERATURE
from feti_homog.materials.voigt import STRAINS, STRESSES, voigt_names
from feti_homog.results import path_curves

WIDTH = 79
ROWS = 15  # of a path's table
COLUMNS = 5  # of its strains, stresses and the temperature
ENTRIES = {"C11": (0, 0), "C22": (1, 1), "C12": (0, 1), "C33": (2, 2)}
SPATIAL_ENTRIES = {f"C{i}{i}": (i - 1, i - 1) for i in range(1, 7)} | {"C12": (0, 1)}
STATES = ("bonded", "open", "closed")

Point = Mapping[str, Any]


def chosen(document: Mapping[str, Any], rows: int, among: Sequence[int] | None = None) -> list[int]:
    """Numbers of at most `rows` points of a path: the first, the last, the ends of its legs if they are not too many,
    and between them as evenly as bonds broke; with `among`, rising, of these points."""
    points = document["path"]
    numbers = np.arange(len(points)) if among is None else np.asarray(among, int)
    if len(numbers) <= rows:
        return [int(number) for number in numbers]
    fixed = {0, len(numbers) - 1}
    ends = np.flatnonzero(np.isin(numbers, path_curves.ends_of_legs(document))).tolist()
    if len(fixed.union(ends)) <= rows:
        fixed = fixed.union(ends)
    broken = np.cumsum([point["broke"] for point in points])[numbers]
    wanted = np.linspace(broken[0], broken[-1], rows - len(fixed) + 2)[1:-1]
    places = {int(np.abs(broken - w).argmin()) for w in wanted} | fixed
    return [int(numbers[place]) for place in sorted(places)]


def kept_points(document: Mapping[str, Any]) -> list[int]:
    """Numbers of the points of a path whose fields are kept, in the order of the states; of all if none are."""
    return list(document.get("states") or range(len(document["path"])))


def chosen_states(document: Mapping[str, Any], rows: int, count: int) -> list[int]:
    """Numbers of at most `rows` of the first `count` states of a path, chosen as `chosen` chooses points."""
    among = kept_points(document)[:count]
    return [among.index(number) for number in chosen(document, rows, among)]


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
        f"{'angle':>9}" + "".join(f"{name:>{width}}" for name in names) + _heads() * counted,
    ]
    for point in points:
        values = [point["stiffness"][i][j] for i, j in entries.values()] if stiff else point["stress"]
        numbers = "".join(_number(value, width) for value in values)
        lines.append(f"{point['angle']:>9.5g}{numbers}" + _counts(point) * counted)
    return lines


def path_table(document: Mapping[str, Any], stress: str) -> list[str]:
    """Totals of the path, and rows of some of its points."""
    points = document["path"]
    numbers = chosen(document, ROWS)
    columns = _path_columns(document)
    shown = dict(list(columns.items())[:COLUMNS])
    broke = sum(point["broke"] for point in points)
    some = "" if len(numbers) == len(points) else f", {len(numbers)} shown"
    rest = [name for name in columns if name not in shown]
    lines = [
        f"Path{stress}: {len(points)} points{some}; {broke} bonds broke",
        *_path_energies(document, stress),
        *([f"Also in path.csv: {', '.join(rest)}"] if rest else []),
        f"{'point':>5}{'load':>9}" + "".join(f"{name:>{_width(name)}}" for name in shown) + _heads(),
    ]
    for number in numbers:
        values = "".join(_number(column[number], _width(name)) for name, column in shown.items())
        lines.append(f"{number:>5}{points[number]['load_factor']:>9.6f}{values}{_counts(points[number])}")
    return lines


def _path_columns(document: Mapping[str, Any]) -> dict[str, Any]:
    """What varies along a path: the leading strain, stresses that are named or there, the temperature, other strains
    under given stresses."""
    points = document["path"]
    strain, stress = (_without_noise([point[name] for point in points]) for name in ("strain", "stress"))
    strains, stresses = voigt_names(strain.shape[1])
    leading = path_curves.leading_component(document)
    there = {*path_curves.named_components(document), *path_curves.components_above(path_curves.FAINT, stress)}
    found = {strains[leading]: strain[:, leading]} | {stresses[k]: stress[:, k] for k in sorted(there)}
    if any(point.get("temperature") for point in points):
        found[TEMPERATURE] = np.array([point["temperature"] for point in points])
    given = {name for target in path_curves.targets(document) for name in target}
    others = path_curves.components_above(path_curves.FAINT, strain)
    return found | {strains[k]: strain[:, k] for k in others if stresses[k] in given}


def _width(name: str) -> int:
    """Columns of the text of a number of this name."""
    return max(11, len(name) + 1)


def _without_noise(values: Sequence[Sequence[float]]) -> Any:
    """(n, c) with zeros in the columns that have no more than the solver leaves of zero."""
    columns = np.array(values, float)
    is_there = np.isin(np.arange(columns.shape[1]), path_curves.components_above(path_curves.ZERO, columns))
    return np.where(is_there, columns, 0.0)


def load_table(document: Mapping[str, Any], stress: str) -> list[str]:
    """The equilibrium under one load: strains, stresses, energies, and the states of the interface nodes."""
    point = document["load"]
    strain, sigma = (_without_noise([point[name]])[0] for name in ("strain", "stress"))
    strains, stresses = voigt_names(len(strain))
    target = path_curves.targets(document)[0]
    given = ", ".join(f"{name} = {value:g}" for name, value in target.items() if value or name in strains)
    rows = [("strain", strain), (f"stress{stress}", sigma)]
    motions = point["free_motions"]
    return [
        *wrap(f"Equilibrium under {given}", WIDTH),
        f"{'':<14}" + "".join(f"{name[1:]:>12}" for name in stresses),
        *(f"{label:<14}" + "".join(_number(value) for value in values) for label, values in rows),
        *_energies(point, stress),
        *_debonded(document, point),
        ", ".join(f"{point[state]} {state}" for state in STATES) + " interface nodes",
        *([f"Free motions of fibres: {motions}"] if motions else []),
    ]


def _path_energies(document: Mapping[str, Any], stress: str) -> list[str]:
    """What the loads have done along a path, what is stored at its end, what breaks have lost, also if the load only
    rose, and what debonded."""
    last = document["path"][-1]
    where = " on the first leg" if path_curves.legs(document) > 1 else ""
    rising = f"{last['dissipated_strain_controlled']:.6g} if the {path_curves.what_rises(document)} only rises{where}"
    lines = [
        f"Work per area{stress}: {last['work']:.6g}",
        *_energies(last, stress),
        f"Dissipated per area{stress}: {last['dissipated']:.6g} along all equilibria, {rising}",
    ]
    if "dissipation_ratio" in last:
        ratio = f"{last['dissipation_ratio']:.4f} times it was dissipated"
        lines.append(f"Toughness of what broke per area{stress}: {last['fracture_energy']:.6g}; {ratio}")
    return [*lines, *_debonded(document, last)]


def _energies(point: Point, stress: str) -> list[str]:
    """What is stored."""
    springs = f", {point['stored_in_springs']:.6g} of it in springs" if point["stored_in_springs"] else ""
    return [f"Stored per area{stress}: {point['stored']:.6g}{springs}"]


def _debonded(document: Mapping[str, Any], point: Point) -> list[str]:
    """The share of the interfaces that has debonded, and those of the pairs of phases if there are several."""
    words = f"Debonded: {100 * point['debonded_share']:.1f} % of the interfaces"
    if "debonded_shares" in point:
        shares = zip(document["case"]["interface"], point["debonded_shares"], strict=True)
        pairs = [f"{100 * share:.1f} % of {' and '.join(section['between'])}" for section, share in shares]
        words += f"; {', '.join(pairs)}"
    return wrap(words, WIDTH)


def sweep_table(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """A line for each case of a sweep: folder, status (if any is known) and inputs."""
    width = max(len(status) for _, status, _ in rows)
    return [f"{folder}  {status:<{width}}  {inputs}".replace("    ", "  ").rstrip() for folder, status, inputs in rows]


def sweep_failures(rows: Sequence[tuple[str, str, str]]) -> list[str]:
    """Folder, inputs and reason of each case that failed."""
    return ["", f"{len(rows)} failed:"] + [
        line for folder, inputs, reason in rows for line in (f"  {folder}  {inputs}", f"    {reason}")
    ]


def _heads() -> str:
    return "".join(f"{state:>7}" for state in STATES)


def _counts(point: Point) -> str:
    return "".join(f"{point[state]:>7}" for state in STATES)


def _number(value: float, width: int = 12) -> str:
    """The number; what the solver leaves of a zero is one."""
    return f" {value:>{width - 1}.5g}" if abs(value) > 1e-12 else f"{0:>{width}}"
