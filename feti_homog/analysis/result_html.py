"""A result as tables of HTML, for notebooks."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

from feti_homog.materials.voigt import SPATIAL_STRESSES, voigt_names
from feti_homog.report.text.constants_tables import SHORT, comparison
from feti_homog.report.text.spatial_tables import THERMAL
from feti_homog.report.text.summary import title_of
from feti_homog.report.text.units import with_unit

Document = Mapping[str, Any]

LONGEST = 20  # rows of a table of points


def tables(document: Document) -> str:
    """L^ef, moduli, or the points of an angle or path, or the state under a load; then checks and status."""
    unit = document["case"].get("output", {}).get("stress_unit", "")
    label = f" ({unit})" if unit else ""
    blocks = [f"<h4>{escape(title_of(document))}</h4>"]
    for key, words in (("effective_stiffness", "L<sup>ef</sup>"), ("effective_stiffness_compression", "under minus E")):
        if key in document:
            strains, stresses = voigt_names(len(document[key]))
            rows = ([name, *map(_number, row)] for name, row in zip(stresses, document[key], strict=True))
            blocks.append(_table(f"{words}{escape(label)}", ["", *strains], rows))
    if "thermal_stress" in document:
        blocks.append(_thermal(document, label))
    blocks += _constants(document, unit, label)
    for key in ("angle", "path", "envelope"):
        if key in document:
            blocks.append(_points(key, document[key]))
    if "load" in document:
        blocks.append(_load(document["load"], label))
    checks = document["checks"].items()
    blocks.append(_table("largest relative errors", None, ([law, f"{error:.1e}"] for law, error in checks)))
    return "\n".join([*blocks, f"<p>{escape(document['status'])}</p>"])


def _constants(document: Document, unit: str, label: str) -> list[str]:
    """Moduli of the plane state; constants in space, with what closed estimates and bounds say of them."""
    blocks = [
        _table(key, None, ([with_unit(name, unit), _number(value)] for name, value in document[key].items()))
        for key in ("moduli", "constants", "transverse_moduli")
        if key in document
    ]
    if "transversely_isotropic" in document:
        names, sources = comparison(document)
        head = ["", *(SHORT[name] for name in names)]
        rows = ([title, *numbers] for title, numbers in sources)
        blocks.append(_table(f"along the fibres and across them{escape(label)}", head, rows))
    return blocks


def _thermal(document: Document, label: str) -> str:
    """What a unit of temperature does, a row for each component."""
    known = {words: document[key] for key, words in THERMAL.items() if key in document}
    rows = zip(SPATIAL_STRESSES, *known.values(), strict=True)
    words = ([stress[1:], *map("{:.7g}".format, numbers)] for stress, *numbers in rows)
    return _table(f"per unit of temperature{escape(label)}", ["", *known], words)


def _load(point: Document, label: str) -> str:
    """Strains and stresses of the state under a load, and its numbers."""
    strains, stresses = voigt_names(len(point["strain"]))
    components = [*zip(strains, point["strain"], strict=True), *zip(stresses, point["stress"], strict=True)]
    numbers = [(name, value) for name, value in point.items() if isinstance(value, int | float)]
    rows = ([name, _number(value)] for name, value in [*components, *numbers])
    return _table(f"equilibrium under the load{escape(label)}", None, rows)


def _points(key: str, points: Sequence[Document]) -> str:
    """The numbers, not the arrays, of the first points."""
    numbers = [{name: value for name, value in p.items() if isinstance(value, int | float)} for p in points[:LONGEST]]
    names = list(dict.fromkeys(name for point in numbers for name in point))
    rows = ([_number(point[name]) if name in point else "" for name in names] for point in numbers)
    more = f", the first {LONGEST} of {len(points)} points" if len(points) > LONGEST else ""
    return _table(f"{key}{more}", names, rows)


def _table(caption: str, head: Sequence[str] | None, rows: Iterable[Sequence[str]]) -> str:
    lines = [f"<table><caption>{caption}</caption>"]
    if head is not None:
        lines.append("<tr>" + "".join(f"<th>{escape(name)}</th>" for name in head) + "</tr>")
    lines += ["<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows]
    return "\n".join([*lines, "</table>"])


def _number(value: float) -> str:
    return f"{value:.7g}" if isinstance(value, int) or abs(value) > 1e-12 else "0"
