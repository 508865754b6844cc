"""Which elements a cell has: their order, and whether they are mixed, with a bubble and a pressure of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from feti_homog.case.cell_section import Cell
from feti_homog.materials.forms import Isotropic, Material
from feti_homog.materials.laws import isotropic_ratio
from feti_homog.materials.plane_state import PLANE_STATES
from feti_homog.schema.wording import toml_key

MIXED = "mixed"
LOCKING_POISSON = 0.49
"""Linear triangles lock above it."""
# Rounding takes checks to their tolerance beside fibres of a thousandth of the matrix: from 2e-4 to 1e-9 of energies
# at 0.4999999 for mixed elements, whose products are refined; the others' are not.
ROUNDING_POISSON = {MIXED: 0.49999999, "displacement": 0.49999}


def is_mixed(element: str, order: int, material: Material, plane: str) -> bool:
    """Return whether the elements of a phase have a bubble and a pressure of their own in the plane problem."""
    has_pressure = isotropic_ratio(material) is not None and not PLANE_STATES[plane].is_sheet
    return has_pressure and order == 2 and element == MIXED


def orders(
    cell: Cell, table: Mapping[str, Any], materials: Mapping[str, Material], plane: str, faults: list[str]
) -> tuple[int, ...]:
    """Return the orders that a cell may have, its own if its table gives it; a linear one that locks is a fault.

    Without `accuracy` it is the first of them.
    """
    locking = _above(LOCKING_POISSON, materials, plane)
    if "order" not in table:
        return (2,) if locking else (1, 2)
    if cell.order == 1:
        faults += [f"[cell] order = 1: linear triangles lock: {line}; expected order = 2" for line in locking]
    return (cell.order,)


def warnings(cell: Cell, materials: Mapping[str, Material], plane: str) -> list[str]:
    """List the phases whose elements err by locking or by rounding, a line each."""
    most = ROUNDING_POISSON[cell.element]
    locking = _above(LOCKING_POISSON, materials, plane) if cell.element != MIXED else []
    return [
        f'{line}: displacements alone err the more the nearer it is to 0.5; use element = "{MIXED}" in [cell]'
        for line in locking
    ] + [
        f"{line}: so near to 0.5 that rounding may exceed the tolerance of the checks; use at most {most:.10g}"
        for line in _above(most, materials, plane)
    ]


def remarks(materials: Mapping[str, Material], plane: str) -> tuple[str, ...]:
    """List the phases for which elements are quadratic, a line each."""
    lines = _above(LOCKING_POISSON, materials, plane)
    return tuple(f"{line}: elements are quadratic, for linear ones lock above {LOCKING_POISSON}" for line in lines)


def _above(limit: float, materials: Mapping[str, Material], plane: str) -> list[str]:
    """List the phases of a larger ratio that keep their volume: not in plane stress."""
    if PLANE_STATES[plane].is_sheet:
        return []
    ratios = {phase: isotropic_ratio(material) for phase, material in materials.items()}
    names = {phase: "poisson" if isinstance(m, Isotropic) else "Poisson's ratio" for phase, m in materials.items()}
    return [f"[material.{toml_key(phase)}] {names[phase]} = {nu}" for phase, nu in ratios.items() if nu and nu > limit]
