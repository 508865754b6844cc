"""The points of an angle, a path, a load or an envelope, and the energy release rates at their tips, as tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import cos, radians, sin
from textwrap import wrap
from typing import Any

import numpy as np

from feti_homog.materials.voigt import STRAINS, STRESSES, voigt_names
from feti_homog.report.text.table import Column, Table, without_noise
from feti_homog.results import path_curves
from feti_homog.typing import Document

WIDTH = 79
ENVELOPE_ROWS = 12  # of its table
ENTRIES = {"C11": (0, 0), "C22": (1, 1), "C12": (0, 1), "C33": (2, 2)}
SPATIAL_ENTRIES = {f"C{i}{i}": (i - 1, i - 1) for i in range(1, 7)} | {"C12": (0, 1)}
STATES = ("bonded", "open", "closed")
COUNTS = [Column(state, 7, "d") for state in STATES]
ENVELOPE_NUMBERS = ("fibre", "interface", "bond_angle", "normal", "tangential", "axial", "psi")
SHARES = {"normal": "normal", "tangential": "tangent", "axial": "axial", "psi": "psi"}
RATES = (*(Column(name) for name in ("G", "G_I", "G_II")), Column("psi", 8, ".1f"), Column("fibre", 8, "d"),
         Column("angle", 9))  # fmt: skip
SECTION = Column("interface", 11, "d")  # of cases that have several
LAST_STRAIN = "bonded, open, closed: interface nodes under the unit strain gamma12"
TIP_TITLE = "Largest energy release rate"

Point = Mapping[str, Any]


def shown_entries(points: Sequence[Point]) -> dict[str, tuple[int, int]]:
    """Names and places of the entries of the stiffnesses of an angle's points that are shown."""
    return ENTRIES if len(points[0]["stiffness"]) == len(STRAINS) else SPATIAL_ENTRIES


def all_numbers(key: str, document: Document, label: str, numbers: Sequence[int]) -> Table:
    """Return the numbers and stresses, or entries of the stiffness, of these points of an angle or a path.

    Of a path its marks, the leading strain and the stresses come first.
    """
    points = document[key]
    some = "" if len(numbers) == len(points) else f", {len(numbers)} of {len(points)}"
    names = [name for name, value in points[0].items() if isinstance(value, int | float)]
    if key == "path":
        return _path_numbers(document, f"Points of the path{some}; stress{label}", names, numbers)
    stiff = points[0].get("stiffness") is not None
    entries = shown_entries(points) if stiff else {}
    rows = []
    for number in numbers:
        point = points[number]
        values = [point["stiffness"][i][j] for i, j in entries.values()] if stiff else point["stress"]
        rows.append([number, *(point[name] for name in names), *values])
    head = ["point", *names, *(entries or voigt_names(len(points[0]["stress"]))[1])]
    title = f"Points of the {key}{some}; stress{label}"
    return Table(title, [*map(Column, head)], rows, [LAST_STRAIN] if stiff else [])


def _path_numbers(document: Document, title: str, names: Sequence[str], numbers: Sequence[int]) -> Table:
    leading, points = path_curves.leading_component(document), document["path"]
    strains, stresses = voigt_names(len(points[0]["stress"]))
    head = ["point", "mark", strains[leading], *stresses, *names]
    strain, stress = (columns_without_noise([point[name] for point in points]) for name in ("strain", "stress"))
    rows = []
    for number in numbers:
        point, means = points[number], [strain[number, leading], *stress[number]]
        rows.append([number, point.get("mark", ""), *map(float, means), *(point.get(name, "") for name in names)])
    return Table(title, [*map(Column, head)], rows)


def angle_table(points: Sequence[Point], label: str) -> Table:
    """Return a row for each angle: stiffnesses or stresses, and the states of the interface nodes.

    `label` is the unit of stresses in brackets, or empty.
    """
    stiff = "stiffness" in points[0]
    entries, above = (shown_entries(points), [LAST_STRAIN]) if stiff else ({}, [])
    counts = COUNTS if len(entries) <= len(ENTRIES) else []
    rows = []
    for point in points:
        values = [point["stiffness"][i][j] for i, j in entries.values()] if stiff else point["stress"]
        states = (point[column.name] for column in counts)
        rows.append([point["angle"], *map(without_noise, values), *states])
    width = 12 if counts else 10
    columns = [Column("angle", 9), *(Column(name, width) for name in tuple(entries) or STRESSES), *counts]
    title = f"{'Stiffness' if stiff else 'Stress'}{label} against the debonding angle (degrees)"
    return Table(title, columns, rows, above if counts else [])


def columns_without_noise(values: Sequence[Sequence[float]]) -> Any:
    """Return values (n, c) with zeros in the columns that have no more than the solver leaves of zero."""
    columns = np.array(values, float)
    is_there = np.isin(np.arange(columns.shape[1]), path_curves.components_above(path_curves.ZERO, columns))
    return np.where(is_there, columns, 0.0)


def load_lines(document: Document, label: str) -> list[str]:
    """Return the equilibrium under one load: strains, stresses, energies, and the states of the interface nodes."""
    point = document["load"]
    strain, sigma = (map(without_noise, columns_without_noise([point[name]])[0]) for name in ("strain", "stress"))
    strains, stresses = voigt_names(len(point["strain"]))
    target = path_curves.targets(document)[0]
    given = ", ".join(f"{name} = {value:g}" for name, value in target.items() if value or name in strains)
    columns = [Column("", -14, indent=0), *(Column(name[1:]) for name in stresses)]
    motions = point["free_motions"]
    return [
        *wrap(f"Equilibrium under {given}", WIDTH),
        *Table("", columns, [["strain", *strain], [f"stress{label}", *sigma]]).lines[1:],
        *energies(point, label),
        *debonded(document, point),
        ", ".join(f"{point[state]} {state}" for state in STATES) + " interface nodes",
        *([f"Free motions of fibres: {motions}"] if motions else []),
    ]


def load_table(document: Document, label: str) -> Table:
    """Strains, stresses and numbers of the equilibrium under one load."""
    point = document["load"]
    names = zip(*voigt_names(len(point["strain"])), strict=True)
    values = zip(point["strain"], point["stress"], strict=True)
    rows = [
        [name, value]
        for pair, found in zip(names, values, strict=True)
        for name, value in zip(pair, found, strict=True)
    ]
    numbers = [[name, value] for name, value in point.items() if isinstance(value, int | float)]
    title = f"Equilibrium under the load; stress{label}"
    return Table(title, [Column(""), Column("computed")], [*rows, *numbers])


def energies(point: Point, label: str) -> list[str]:
    springs = f", {point['stored_in_springs']:.6g} of it in springs" if point["stored_in_springs"] else ""
    error = f", mesh error {point['mesh_error']:.1e} of it" if "mesh_error" in point else ""
    return [f"Stored per area{label}: {point['stored']:.6g}{springs}{error}"]


def debonded(document: Document, point: Point) -> list[str]:
    """Return the share of the interfaces that has debonded, and those of the pairs of phases if there are several."""
    text = f"Debonded: {100 * point['debonded_share']:.1f} % of the interfaces"
    if "debonded_shares" in point:
        shares = zip(document["case"]["interface"], point["debonded_shares"], strict=True)
        pairs = [f"{100 * share:.1f} % of {' and '.join(section['between'])}" for section, share in shares]
        text += f"; {', '.join(pairs)}"
    return wrap(text, WIDTH)


def counts(point: Point) -> list[int]:
    return [point[state] for state in STATES]


def envelope_lines(document: Document, label: str) -> list[str]:
    """Return the least and the largest load, and the first bond that breaks in some directions."""
    section, points = document["case"]["envelope"], document["envelope"]
    axes, known = section["plane"], [point for point in points if "factor" in point]
    unit = label if axes[0].startswith("S") else ""
    warmer = section.get("temperature")
    after = "" if warmer is None else f", after a temperature of {warmer:g}"
    lines = [f"Onset of debonding in the plane {axes[0]}, {axes[1]}{unit}: {len(points)} directions{after}"]
    if len(known) < len(points):
        lines.append(f"  no load breaks a bond in {len(points) - len(known)} of them")
    if not known:
        return lines
    for title, point in (("least", min(known, key=_load)), ("largest", max(known, key=_load))):
        lines.append(f"  {title:<9}{_load(point):.7g} at {point['angle']:g} degrees")
    return lines + _onset_lines(points, axes, known[0])


def _onset_lines(points: Sequence[Point], axes: Sequence[str], first: Point) -> list[str]:
    """Return some directions, with the numbers that `first`, one with an onset, has."""
    several, names = "interface" in first, [name for name in SHARES if name in first]
    used = "psi of its traction" if names == ["psi"] else "traction / strength"
    columns = [
        Column("angle", 8),
        *(Column(axis, 12, ".6g") for axis in axes),
        Column("fibre", 6, "d"),
        Column("at", 9, ".2f"),
        *([Column("interface", 10, "d")] * several),
        *(Column(SHARES[name], 10, ".4g") for name in names),
    ]
    shown = ["fibre", "bond_angle", *(["interface"] * several), *names]
    rows = [_onset(point, shown) for point in _evenly(points)]
    return Table(f"  first bond: its fibre, its direction there (degrees), {used}", columns, rows).lines


def envelope_table(document: Document, label: str, most: int) -> Table:
    """Return the two components at onset, where the bond is, and how it breaks; of many directions some."""
    axes, points = document["case"]["envelope"]["plane"], document["envelope"]
    step = -(-len(points) // most)
    names = [name for name in ENVELOPE_NUMBERS if any(name in point for point in points)]
    rows = [_onset(point, names) for point in points[::step]]
    some = "" if step == 1 else f", {len(rows)} of {len(points)} directions"
    unit = label if axes[0].startswith("S") else ""
    return Table(f"Onset of debonding{some}; load{unit}", [*map(Column, ("angle", *axes, *names))], rows)


def components(point: Point) -> tuple[float, float]:
    """Return the two components of the load at onset."""
    angle, load = radians(point["angle"]), _load(point)
    return without_noise(load * cos(angle), load), without_noise(load * sin(angle), load)


def _onset(point: Point, names: Sequence[str]) -> list[Any]:
    """Direction, load and these numbers of a direction."""
    if "factor" not in point:
        return [point["angle"], "none", "none", *[""] * len(names)]
    return [point["angle"], *components(point), *(without_noise(point[name]) for name in names)]


def _load(point: Point) -> float:
    return float(point["factor"])


def _evenly(points: Sequence[Point]) -> list[Point]:
    """Evenly spaced directions, the first among them."""
    step = max(1, -(-len(points) // ENVELOPE_ROWS))
    while len(points) % step:
        step += 1
    return list(points[::step])


def tip_table(tips: Document | None, label: str) -> list[Table]:
    """For each load the tip of the largest G; none without tips."""
    largest = _largest(tips)
    rows = [[load, *_rates(tip)] for load, tip in largest.items()]
    return [Table(f"{TIP_TITLE}{label}", [Column("load", 9), *_rate_columns(largest)], rows)] if rows else []


def angle_tip_table(points: Sequence[Document], label: str) -> list[Table]:
    """For each angle the largest G of each load, or of a single load all about the tip; none without tips."""
    found = [(point["angle"], tips) for point in points if (tips := _largest(point.get("tips")))]
    loads = dict.fromkeys(load for _, tips in found for load in tips)
    if len(loads) == 1:
        rows = [[angle, *_rates(tip)] for angle, tips in found for tip in tips.values()]
        return [Table(f"{TIP_TITLE}{label}", [Column("angle", 9), *_rate_columns(found[0][1])], rows)]
    rows = [[angle, *(tip["G"] for tip in tips.values())] for angle, tips in found]
    columns = [Column("angle", 9), *map(Column, loads)]
    return [Table(f"{TIP_TITLE}{label} under each load", columns, rows)] if rows else []


def _largest(tips: Document | None) -> dict[str, Document]:
    """Return the tip of the largest G of each load, in the order of the loads."""
    best: dict[str, Document] = {}
    names = ["load", *(column.name for column in RATES), *([SECTION.name] if tips and SECTION.name in tips else [])]
    for values in zip(*(tips[name] for name in names), strict=True) if tips else ():
        tip = dict(zip(names, values, strict=True))
        # Of tips that are alike but for rounding, the first.
        if tip["load"] not in best or tip["G"] > best[tip["load"]]["G"] * (1 + 1e-6):
            best[tip["load"]] = tip
    return best


def _rate_columns(tips: Mapping[str, Document]) -> list[Column]:
    shown = [replace(column, name="at") if column.name == "angle" else column for column in RATES]
    return [*shown, *([SECTION] if any(SECTION.name in tip for tip in tips.values()) else [])]


def _rates(tip: Document) -> list[Any]:
    return [value for name, value in tip.items() if name != "load"]
