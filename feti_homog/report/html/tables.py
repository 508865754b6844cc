"""The numbers of a result as rows of tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feti_homog.materials.voigt import SPATIAL_STRESSES, voigt_names
from feti_homog.report.text.constants_tables import SHORT, comparison
from feti_homog.report.text.envelope_table import components
from feti_homog.report.text.point_tables import chosen, shown_entries
from feti_homog.report.text.spatial_tables import THERMAL
from feti_homog.report.text.summary import check_applies
from feti_homog.report.text.units import with_unit

ENVELOPE_NUMBERS = ("fibre", "interface", "bond_angle", "normal", "tangential", "axial", "psi")
MOST_ROWS = 60  # of a table of points
NOISE = 1e-12  # what the solver leaves of a zero

Document = Mapping[str, Any]


@dataclass(frozen=True)
class Table:
    """Rows of words; the first column has their names."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Check:
    """A law with its largest relative error and the limit of it."""

    law: str
    error: float
    limit: float

    @property
    def holds(self) -> bool:
        return self.error <= self.limit


def facts(document: Document) -> list[tuple[str, str]]:
    """What was computed, of what, and by what."""
    case, cell, solver = document["case"], document["cell"], document["solver"]
    length = case["output"].get("length_unit", "")
    fractions = ", ".join(f"{phase} {share:.4f}" for phase, share in cell["fractions"].items())
    iterations, ranks = solver["iterations"], solver["ranks"]
    return [
        ("Analysis", f"{case['analysis']['type']}, plane {case['analysis']['plane']}"),
        ("Cell", f"{case['cell']['geometry']}, {cell['width']:.6g} x {cell['height']:.6g} {length}".rstrip()),
        ("Phases", fractions),
        ("Mesh", f"{_count(cell['elements'])} elements, {_count(cell['nodes'])} nodes, "
                 f"order {case['cell'].get('order', 1)}, refine {case['cell'].get('refine', cell.get('refine', 0))}"),
        ("Solver", f"{_count(ranks)} rank{'' if ranks == 1 else 's'}, {_count(solver['subdomains'])} subdomains, "
                   f"{_count(solver['dofs'])} degrees of freedom"),
        ("Iterations", f"{sum(iterations)} in {len(iterations)} states, to {solver['rtol']:g}"),
        ("Time", ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in document["timings"].items())),
        ("Version", f"feti-homog {document['version']}, layout {document['schema']}"),
    ]  # fmt: skip


def answers(document: Document) -> list[Table]:
    """What was asked for: stiffness with moduli and bounds, or points of an angle or path, or onsets."""
    unit = document["case"]["output"].get("stress_unit", "")
    label = f" ({unit})" if unit else ""
    found = [_envelope(document, label)] if document.get("envelope") else []
    found += _stiffnesses(document, label)
    if document.get("thermal_stress") is not None:
        found.append(_thermal(document, label))
    found += _constants(document, label)
    if document.get("moduli") is not None:
        rows = [[with_unit(name, unit), _number(value)] for name, value in document["moduli"].items()]
        found.append(Table("Engineering moduli", ["", "computed"], rows))
    if document.get("bounds") is not None:
        found.append(Table(f"Bounds{label}", ["", "lower", "computed", "upper"], list(_bounds(document))))
    found += [_points(key, document, label) for key in ("angle", "path") if document.get(key)]
    return found + ([_load(document["load"], label)] if document.get("load") else [])


def _stiffnesses(document: Document, label: str) -> list[Table]:
    """The effective stiffness, also under minus the unit strains."""
    found = []
    for key, words in (
        ("effective_stiffness", "Effective stiffness"),
        ("effective_stiffness_compression", "Effective stiffness under minus the unit strains"),
    ):
        if document.get(key) is not None:
            strains, stresses = voigt_names(len(document[key]))
            rows = [[name, *map(_number, row)] for name, row in zip(stresses, document[key], strict=True)]
            found.append(Table(f"{words}{label}", ["", *strains], rows))
    return found


def _envelope(document: Document, label: str) -> Table:
    """The two components at onset, where the bond is, and how it breaks; of many directions some."""
    axes, points = document["case"]["envelope"]["plane"], document["envelope"]
    step = -(-len(points) // MOST_ROWS)
    names = [name for name in ENVELOPE_NUMBERS if any(name in point for point in points)]
    rows = [
        [f"{point['angle']:g}", *map(_number, components(point)), *(_number(point[name]) for name in names)]
        if "factor" in point
        else [f"{point['angle']:g}", *["none"] * 2, *[""] * len(names)]
        for point in points[::step]
    ]
    some = "" if step == 1 else f", {len(rows)} of {len(points)} directions"
    unit = label if axes[0].startswith("S") else ""
    return Table(f"Onset of debonding{some}; load{unit}", ["angle", *axes, *names], rows)


def _load(point: Document, label: str) -> Table:
    """The equilibrium under one load: strains, stresses and its numbers."""
    names = zip(*voigt_names(len(point["strain"])), strict=True)
    values = zip(point["strain"], point["stress"], strict=True)
    rows = [
        [name, _number(value)]
        for pair, found in zip(names, values, strict=True)
        for name, value in zip(pair, found, strict=True)
    ]
    numbers = [[name, _number(value)] for name, value in point.items() if isinstance(value, int | float)]
    return Table(f"Equilibrium under the load; stress{label}", ["", "computed"], rows + numbers)


def checks(document: Document) -> list[Check]:
    """Every law that was checked."""
    tolerance, contact = document["check_tolerance"], document["kkt_tolerance"]
    return [
        Check(law, error, contact if law.startswith("kkt_") else tolerance)
        for law, error in document["checks"].items()
        if check_applies(law, document)
    ]


def _bounds(document: Document) -> Iterator[list[str]]:
    bounds, here = document["bounds"], document["effective_stiffness"]
    for i, name in enumerate(("C11", "C22", "C33")):
        values = (bounds["reuss"][i][i], here[i][i], bounds["voigt"][i][i])
        yield [f"{name} (Reuss, Voigt)", *map(_number, values)]
    for name, (lower, upper) in (bounds["hashin_shtrikman"] or {}).items():
        yield [f"{name} (Hashin-Shtrikman)", *map(_number, (lower, document["moduli"][name], upper))]


def _constants(document: Document, label: str) -> list[Table]:
    """Engineering constants in space, and what closed estimates and bounds say of them."""
    found = []
    if (constants := document.get("constants")) is not None:
        rows = [[name, _number(value)] for name, value in constants.items()]
        found.append(Table(f"Engineering constants in the axes of the cell{label}", ["", "computed"], rows))
    if (across := document.get("transverse_moduli")) is not None:
        rows = [[name, *(_number(across[f"{name}_{end}"]) for end in ("least", "largest"))] for name in ("E", "G")]
        found.append(Table(f"Over all directions across the fibres{label}", ["", "least", "largest"], rows))
    if document.get("transversely_isotropic") is not None:
        names, sources = comparison(document)
        compared = [[title, *numbers] for title, numbers in sources]
        found.append(
            Table(f"Along the fibres and across them{label}", ["", *(SHORT[name] for name in names)], compared)
        )
    return found


def _thermal(document: Document, label: str) -> Table:
    """What a unit of temperature does, a row for each component."""
    known = {words: document[key] for key, words in THERMAL.items() if document.get(key) is not None}
    rows = [
        [stress[1:], *map("{:.7g}".format, numbers)]
        for stress, *numbers in zip(SPATIAL_STRESSES, *known.values(), strict=True)
    ]
    return Table(f"Per unit of temperature{label}", ["", *known], rows)


def _points(key: str, document: Document, label: str) -> Table:
    """The points of an angle or path, of many some."""
    points = document[key]
    numbers = chosen(document, MOST_ROWS) if key == "path" else range(min(len(points), MOST_ROWS))
    some = "" if len(numbers) == len(points) else f", {len(numbers)} of {len(points)}"
    names = [name for name, value in points[0].items() if isinstance(value, int | float)]
    entries = shown_entries(points) if points[0].get("stiffness") is not None else {}
    head = ["point", *names, *(entries or voigt_names(len(points[0]["stress"]))[1])]
    rows = []
    for number in numbers:
        point = points[number]
        stiff = point.get("stiffness")
        values = point["stress"] if stiff is None else [stiff[i][j] for i, j in entries.values()]
        rows.append([str(number), *(_number(point[name]) for name in names), *map(_number, values)])
    return Table(f"Points of the {key}{some}; stress{label}", head, rows)


def _number(value: float) -> str:
    return f"{value:.7g}" if isinstance(value, int) or abs(value) > NOISE else "0"


def _count(number: int) -> str:
    return f"{number:,}".replace(",", "\N{NO-BREAK SPACE}")
