"""The constants as a table for spreadsheets: name, value, unit, meaning."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from itertools import combinations_with_replacement

from feti_homog.materials.constants import MATERIAL_EXPANSIONS
from feti_homog.report.cards.effective_material import PAIRS, EffectiveMaterial, number

COLUMNS = ("name", "value", "unit", "meaning")
AXES = ("the fibre (x3 of the cell)", "x1 of the cell", "x2 of the cell")
COMPONENTS = ("11", "22", "33", "gamma23", "gamma13", "gamma12")


def text(material: EffectiveMaterial) -> str:
    """Return the table: engineering constants, expansions, and the stiffness in the order [11, 22, 33, 23, 13, 12]."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows((name, number(value), unit, meaning) for name, value, unit, meaning in _rows(material))
    return stream.getvalue().removesuffix("\n")


def _rows(material: EffectiveMaterial) -> Iterator[tuple[str, float, str, str]]:
    for name, value in material.constants.items():
        axes = [int(digit) for digit in name if digit.isdigit()]
        yield name, value, "" if name.startswith("nu") else material.stress_unit, _meaning(name, axes)
    if material.expansion is not None:
        for name, component, value in zip(MATERIAL_EXPANSIONS, COMPONENTS, material.expansion, strict=True):
            yield name, float(value), "1 / temperature", f"thermal strain {component} per unit of temperature"
    C = material.stiffness
    for i, j in combinations_with_replacement(range(6), 2):
        digits = "".join(str(axis + 1) for axis in PAIRS[i])
        words = f"stress {digits} under the unit strain {COMPONENTS[j]}"
        yield f"C{i + 1}{j + 1}", float(C[i, j]), material.stress_unit, f"stiffness: {words}"


def _meaning(name: str, axes: list[int]) -> str:
    where = " and ".join(f"axis {axis}, {AXES[axis - 1]}" for axis in axes)
    if name.startswith("E"):
        return f"Young's modulus along {where}"
    if name.startswith("G"):
        return f"shear modulus between {where}"
    return f"-eps_{axes[1]}/eps_{axes[0]} under stress along axis {axes[0]}: {where}"
