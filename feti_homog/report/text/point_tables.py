"""Build the tables of an angle, a load or an envelope, and of energy release rates G at tips."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import ceil, cos, radians, sin
from textwrap import wrap
from typing import Any

import numpy as np

from feti_homog.materials import voigt
from feti_homog.report.text.tables import WIDTH, Column, Table, stress_label, toughness_label, without_noise
from feti_homog.results import path_curves
from feti_homog.typing import Document

ENVELOPE_ROWS = 12  # rows of the envelope table
ENTRIES = {"C11": (0, 0), "C22": (1, 1), "C12": (0, 1), "C33": (2, 2)}
SPATIAL_ENTRIES = {f"C{i}{i}": (i - 1, i - 1) for i in range(1, 7)} | {"C12": (0, 1)}
STATES = ("bonded", "open", "closed")
COUNTS = [Column(state, 7, "d") for state in STATES]
ONSET = {
    "fibre": Column("fibre", 6, "d"),
    "bond_angle": Column("at", 9, ".2f"),
    "interface": Column("interface", 10, "d"),
    "normal": Column("normal", 10, ".4g"),
    "tangential": Column("tangent", 10, ".4g"),
    "axial": Column("axial", 10, ".4g"),
    "psi": Column("psi", 10, ".4g"),
}
RATES = (*(Column(name) for name in ("G", "G_I", "G_II", "G_III")), Column("psi", 8, ".1f"), Column("fibre", 8, "d"),
         Column("angle", 9), Column("interface", 11, "d"))  # fmt: skip
LAST_STRAIN = "C33: shear; bonded, open, closed: interface nodes under the unit strain gamma12"
TIP_TITLE = "Largest energy release rate at tips on circles"

Point = Mapping[str, Any]


def shown_entries(points: Sequence[Point]) -> dict[str, tuple[int, int]]:
    """Return the stiffness entries in angle tables: names, with row and column."""
    return ENTRIES if len(points[0]["stiffness"]) == len(voigt.STRAINS) else SPATIAL_ENTRIES


def angle_table(document: Document, limit: int | None = None) -> Table:
    """Return a table of stresses or stiffnesses at up to `limit` angles (None: all); plane states have node counts."""
    points, stiff = document["angle"], "stiffness" in document["angle"][0]
    entries = shown_entries(points) if stiff else {}
    counted = COUNTS if len(entries) <= len(ENTRIES) else []
    some = points if limit is None else points[:: ceil(len(points) / limit)]

    def row(point: Point) -> list[Any]:
        values = [point["stiffness"][i][j] for i, j in entries.values()] if stiff else point["stress"]
        return [point["angle"], *map(without_noise, values), *(point[column.name] for column in counted)]

    width = 12 if counted else 10
    columns = [Column("angle", 9), *(Column(name, width) for name in tuple(entries) or voigt.STRESSES), *counted]
    title = f"{'Stiffness' if stiff else 'Stress'}{stress_label(document)} against the debonding angle (degrees)"
    title += "" if len(some) == len(points) else f", {len(some)} of {len(points)}"
    return Table(title, columns, [*map(row, some)], [LAST_STRAIN] if stiff and counted else [])


def columns_without_noise(values: Sequence[Sequence[float]]) -> Any:
    """Return the values (n, c), with zero in columns that contain only solver noise."""
    columns = np.array(values, float)
    is_there = np.isin(np.arange(columns.shape[1]), path_curves.components_above(path_curves.ZERO, columns))
    return np.where(is_there, columns, 0.0)


def load_table(document: Document) -> Table:
    """Return the table of a load: strains, stresses, energies, interface node counts."""
    point, label = document["load"], stress_label(document)
    strain, sigma = (map(without_noise, columns_without_noise([point[name]])[0]) for name in ("strain", "stress"))
    strains, stresses = voigt.voigt_names(len(point["strain"]))
    target = path_curves.targets(document)[0]
    loads = ", ".join(f"{name} = {value:g}" for name, value in target.items() if value or name in strains)
    title, *more = wrap(f"Equilibrium under {loads}", WIDTH)
    columns = [Column("", -14, indent=0), *(Column(name[1:]) for name in stresses)]
    below = [*energies(point, label), *debonded(document, point)]
    below.append(", ".join(f"{point[state]} {state}" for state in STATES) + " interface nodes")
    if point["free_motions"]:
        below.append(f"Free motions of fibres: {point['free_motions']}")
    return Table(title, columns, [["strain", *strain], [f"stress{label}", *sigma]], more, below)


def energies(point: Point, label: str) -> list[str]:
    springs = f", including {point['stored_in_springs']:.6g} in springs" if point["stored_in_springs"] else ""
    error = f", relative mesh error {point['mesh_error']:.1e}" if "mesh_error" in point else ""
    return [f"Stored per area{label}: {point['stored']:.6g}{springs}{error}"]


def debonded(document: Document, point: Point) -> list[str]:
    """Describe the debonded percentage of all interfaces and, for several sections, of each phase pair."""
    text = f"Debonded: {100 * point['debonded_share']:.1f} % of the interfaces"
    if "debonded_shares" in point:
        shares = zip(document["case"]["interface"], point["debonded_shares"], strict=True)
        pairs = [f"{100 * share:.1f} % of {' and '.join(section['between'])}" for section, share in shares]
        text += f"; {', '.join(pairs)}"
    return wrap(text, WIDTH)


def envelope_table(document: Document, limit: int | None = None) -> Table:
    """Return the table of onset loads and first breaks in at most `limit` directions, by default `ENVELOPE_ROWS`."""
    section, points = document["case"]["envelope"], document["envelope"]
    axes, temperature = section["plane"], section.get("temperature")
    unit = stress_label(document) if axes[0].startswith("S") else ""
    title = f"Onset of debonding or softening in the plane {', '.join(axes)}{unit}: {len(points)} directions"
    title += "" if temperature is None else f", after a temperature of {temperature:g}"
    broken = [point for point in points if "factor" in point]
    rest = len(points) - len(broken)
    above = [f"  no load breaks a bond in {rest} of them"] if rest else []
    if not broken:
        return Table(title, [], [], above)
    for extreme, choose in (("least", min), ("largest", max)):
        point = choose(broken, key=lambda point: point["factor"])
        above.append(f"  {extreme:<9}{point['factor']:.7g} at {point['angle']:g} degrees")
    names = [name for name in ONSET if name in broken[0]]
    used = "traction / strength" if "normal" in names else "psi of its traction"
    above.append(f"  first bond: its fibre, its direction there (degrees), {used}")
    columns = [Column("angle", 8), *(Column(axis, 12, ".6g") for axis in axes), *map(ONSET.__getitem__, names)]
    step = max(1, ceil(len(points) / (limit or ENVELOPE_ROWS)))
    while len(points) % step:  # directions are evenly spaced
        step += 1
    rows = []
    for point in points[::step]:
        if "factor" in point:
            rows.append([point["angle"], *components(point), *(without_noise(point[name]) for name in names)])
        else:
            rows.append([point["angle"], "none", "none", *[""] * len(names)])
    return Table(title, columns, rows, above)


def components(point: Point) -> tuple[float, float]:
    """Return both components, factor * (cos, sin), of the load at onset in a direction."""
    angle, load = radians(point["angle"]), float(point["factor"])
    return without_noise(load * cos(angle), load), without_noise(load * sin(angle), load)


def tip_table(document: Document, tips: Document) -> Table:
    """Return a table of tips: for each load, the tip with the largest energy release rate G."""
    largest = _largest(tips)
    rows = [list(tip.values()) for tip in largest.values()]
    return Table(f"{TIP_TITLE}{toughness_label(document)}", [Column("load", 9), *_rate_columns(largest)], rows)


def angle_tip_table(document: Document) -> list[Table]:
    """Return [table of the largest G by angle and load], for a single load with all rates; [] without tips."""
    largest = [(point["angle"], tips) for point in document["angle"] if (tips := _largest(point.get("tips")))]
    loads, title = dict.fromkeys(load for _, tips in largest for load in tips), TIP_TITLE + toughness_label(document)
    if len(loads) == 1:
        tips_of_load = [(angle, tip) for angle, tips in largest for tip in tips.values()]
        rows = [[angle, *(value for name, value in tip.items() if name != "load")] for angle, tip in tips_of_load]
        return [Table(title, [Column("angle", 9), *_rate_columns(largest[0][1])], rows)]
    rows = [[angle, *(tip["G"] for tip in tips.values())] for angle, tips in largest]
    return [Table(f"{title} under each load", [Column("angle", 9), *map(Column, loads)], rows)] if rows else []


def _largest(tips: Document | None) -> dict[str, Document]:
    """Return the tip with the largest G for each load, in load order; {} without tips."""
    best: dict[str, Document] = {}
    names = ["load", *(column.name for column in RATES if column.name in (tips or ()))]
    for values in zip(*(tips[name] for name in names), strict=True) if tips else ():
        tip = dict(zip(names, values, strict=True))
        # The first tip wins where several differ only by rounding.
        if tip["load"] not in best or tip["G"] > best[tip["load"]]["G"] * (1 + 1e-6):
            best[tip["load"]] = tip
    return best


def _rate_columns(tips: Mapping[str, Document]) -> list[Column]:
    columns = [column for column in RATES if any(column.name in tip for tip in tips.values())]
    return [replace(column, name="at") if column.name == "angle" else column for column in columns]


TABLES: dict[str, Callable[[Document, int | None], list[Table]]] = {
    "angle": lambda document, limit: [angle_table(document, limit), *angle_tip_table(document)],
    "load": lambda document, limit: [load_table(document)],
    "envelope": lambda document, limit: [envelope_table(document, limit)],
}
"""Functions that return tables by analysis, with at most `limit` rows of points (None: as in the summary)."""
