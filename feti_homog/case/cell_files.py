"""Read and check the files of [cell]: a mesh, a fibre table with the cell size, or a table to match."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from feti_homog.case.cell_section import FEWEST_MATCHED, Cell
from feti_homog.case.cell_sizes import size_faults
from feti_homog.case.section_values import IMAGE_SUFFIXES, MESH_SUFFIXES, TABLE_SUFFIXES
from feti_homog.errors import MOST_FAULTS, CaseError
from feti_homog.schema import wording
from feti_homog.typing import Bool

if TYPE_CHECKING:
    from feti_homog.microstructure import fibre_table

SUFFIXES = {"mesh": MESH_SUFFIXES, "pixels": IMAGE_SUFFIXES, "table": TABLE_SUFFIXES}
LIST = "fibre_list"
# Distance outside a cut window, in radii, up to which a centre counts as a centre on the border.
LEFT_OUT = 0.01


def checked_cell(cell: Cell, folder: Path, faults: list[str]) -> Cell:
    """Return the cell with absolute file names and the contents of tables; append all faults to `faults`."""
    cell = _with_match(cell, folder, faults)
    faults += size_faults(cell)
    if cell.geometry not in SUFFIXES or (cell.file is not None and cell.fibre_list is not None):
        return cell
    if cell.file is None:
        return cell if cell.fibre_list is None else _with_table(cell, faults)
    named = folder / cell.file  # the suffix of a link itself counts
    file = Path(os.path.realpath(named.parent)) / named.name  # unlike Path.resolve, without an error for circular links
    if file.suffix.lower() not in SUFFIXES[cell.geometry]:
        return cell
    if words := missing(file):
        faults.append(f"[cell] file = {wording.toml_value(str(cell.file))}: {words}")
        return replace(cell, file=file)
    return _with_table(replace(cell, file=file), faults) if cell.geometry == "table" else replace(cell, file=file)


def missing(file: Path) -> str:
    """Return the reason why a path is no regular file, or an empty string if it is one."""
    if os.path.isfile(file):  # False, not an error, if the name is too long
        return ""
    if not os.path.exists(file):
        return f"no such file (expected at {file})"
    return f"{'a folder' if os.path.isdir(file) else 'a pipe or device'}; expected a file at {file}"


def _with_match(cell: Cell, folder: Path, faults: list[str]) -> Cell:
    """Read the fibre table `match` of a random cell into `matched`; append faults to `faults`.

    The table provides a missing fibre count or fraction. Without a readable table the cell is returned unchanged.
    """
    if cell.match is None:
        return cell
    file, given = Path(os.path.realpath(folder / cell.match)), f"[cell] match = {wording.toml_value(str(cell.match))}"
    if words := missing(file):
        faults.append(f"{given}: {words}")
        return cell
    from feti_homog.microstructure import fibre_pattern, random_fibres  # few cases need SciPy's trees

    try:
        window = fibre_pattern.read_window(file)
    except CaseError as error:
        faults += [f"[cell] match: {fault}" for fault in error.faults]
        return cell
    if not random_fibres.nearest_neighbours(window, random_fibres.SHELLS).weights.any(axis=0).all():
        faults.append(f"{given}: the window is too small to find the nearest and second neighbours of any fibre")
    count = window.count if cell.fibres is None else cell.fibres
    if count < FEWEST_MATCHED:
        faults.append(f"[cell] fibres = {count}: expected at least {FEWEST_MATCHED} with match")
    fraction = window.fibre_fraction if cell.fibre_fraction is None else cell.fibre_fraction
    return replace(cell, match=file, matched=window, fibres=count, fibre_fraction=fraction)


def _with_table(cell: Cell, faults: list[str]) -> Cell:
    """Return a cell with its fibre table, unchanged if the table is not readable; append faults to `faults`."""
    from feti_homog.microstructure import fibre_table  # few cases need it
    from feti_homog.microstructure.shapes import shapes

    try:
        if cell.file is None:
            table = fibre_table.table_of(cell.fibre_list or (), LIST)
        else:
            table = fibre_table.read_table(cell.file, cell.columns)
    except CaseError as error:
        faults += [f"[cell] {fault}" for fault in error.faults]
        return cell
    if cell.coating is not None and "coating" in table.given:
        faults.append(f"[cell] coating = {cell.coating:g}: {table.name} has a column coating; give one")
    elif cell.coating is not None:
        coating = np.where(table.is_void, 0.0, cell.coating)
        table = replace(table, columns={**table.columns, "coating": coating})
    check_shapes(table, faults)
    for shape in [] if cell.tip_size is None else shapes.given_shapes(table.columns, has_tips=False):
        words = f"{table.name} has {shape.name}, whose meshes have no nodes at tips"
        faults.append(f"[cell] tip_size = {cell.tip_size:g}: {words}")
    for name in ("width", "height"):
        asked, stored = getattr(cell, name), getattr(table, name)
        if asked is None and stored is None and table.name != LIST:
            faults.append(f"[cell] {name}: missing; {table.name} has no line such as # width = 120, height = 80")
        elif None not in (asked, stored) and asked != stored:
            faults.append(f"[cell] {name} = {asked:g}: {table.name} says {stored:g}; give one")
        table = replace(table, **{name: stored if asked is None else asked})
    if cell.window == "cut" and table.width is not None and table.height is not None:
        over = np.maximum(-table.places, table.places - table.size).max(axis=1)
        outside = over > LEFT_OUT * table.radius
        if outside.any() and not outside.all():
            rows = table.row[outside]
            listed = ", ".join(map(str, rows[:MOST_FAULTS])) + (", ..." if len(rows) > MOST_FAULTS else "")
            left = "1 row with its centre" if len(rows) == 1 else f"{len(rows)} rows with centres"
            line = f'[cell] window = "cut": leaves out {left} outside: {listed}'
            table = replace(table.rows(np.flatnonzero(~outside)), remarks=(*table.remarks, line))
    return replace(cell, table=table)


# Smallest and largest ratio of inner to outer radius of hollow fibres.
WIDEST_CORE = 0.05, 0.98
HOLLOW_WORDS = f"expected inner_radius / radius from {WIDEST_CORE[0]:g} to {WIDEST_CORE[1]:g}, or 0"


def check_shapes(table: fibre_table.FibreTable, faults: list[str]) -> None:
    """Check the fibre shapes in a table and, if these are valid, its hollow fibres; append faults to `faults`."""
    from feti_homog.microstructure.shapes import shapes  # few cases need it

    rows, before = table.columns, len(faults)
    _tell(table, shapes.have_both_sizes(rows), shapes.BOTH_SIZES, faults)
    for shape in shapes.SHAPES:
        for are_faulty, words in shape.faults(rows):
            _tell(table, are_faulty, words, faults)
    if len(faults) > before:
        return
    hollow, inner = table.inner_radius > 0, table.inner_radius / table.radius
    _tell(table, hollow & ((inner < WIDEST_CORE[0]) | (inner > WIDEST_CORE[1])), HOLLOW_WORDS, faults)
    _tell(table, hollow & (table.coating > 0), "has an inner_radius and a coating; give one", faults)


def _tell(table: fibre_table.FibreTable, are_faulty: Bool, words: str, faults: list[str]) -> None:
    faults += [f"[cell] {table.name}: row {row}: {words}" for row in table.row[are_faulty].tolist()]
