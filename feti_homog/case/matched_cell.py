"""What a random cell takes from the table of fibres that it is to match."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from feti_homog.case.cell_files import missing
from feti_homog.case.cell_section import Cell
from feti_homog.errors import CaseError
from feti_homog.schema.wording import toml_value

FEWEST_FIBRES = 10  # of fewer, distances have no distribution


def with_match(cell: Cell, folder: Path, faults: list[str]) -> Cell:
    """The cell with its table read, the path of that completed, and the number and the fraction of the table's fibres
    where it has none of its own; faults are added to `faults`."""
    if cell.match is None:
        return cell
    file, given = Path(os.path.realpath(folder / cell.match)), f"[cell] match = {toml_value(str(cell.match))}"
    if words := missing(file):
        faults.append(f"{given}: {words}")
        return cell
    from feti_homog.case.fibre_window import read_window
    from feti_homog.microstructure.neighbour_match import knows_neighbours

    try:
        window = read_window(file)
    except CaseError as error:
        faults += [f"[cell] match: {fault}" for fault in error.faults]
        return cell
    if not knows_neighbours(window):
        faults.append(f"{given}: the window is too small to know the nearest and the second neighbour of any fibre")
    if cell.radius_spread > 0:
        faults.append("[cell] match, radius_spread: exclude each other; the radii are those of the table")
    count = window.count if cell.fibres is None else cell.fibres
    if count < FEWEST_FIBRES:
        faults.append(f"[cell] fibres = {count}: expected at least {FEWEST_FIBRES} with match")
    fraction = window.fibre_fraction if cell.fibre_fraction is None else cell.fibre_fraction
    return replace(cell, match=file, matched=window, fibres=count, fibre_fraction=fraction)
