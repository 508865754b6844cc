"""The fibres of a case or of a result: where they are, how large, of which phases, and how thick their coatings are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from feti_homog.analysis import stored_result
from feti_homog.cell.arrangement import arrange
from feti_homog.cell.fibre_centres import fibre_circles
from feti_homog.cell.fibre_numbers import coating_thickness, fibre_numbers
from feti_homog.cell.gmsh_mesher import arrangement_scale
from feti_homog.cell.msh_reader import read as read_mesh
from feti_homog.cell.periodic_topology import Torus
from feti_homog.config import case as cases
from feti_homog.config.cell_section import Cell
from feti_homog.errors import CaseError
from feti_homog.typing import Float


@dataclass(frozen=True)
class ListedFibres:
    """The N fibres of a periodic cell [0, width] x [0, height], in the order of their numbers.

    Attributes:
        size: (2,) width and height.
        circles: (N, 3) centre within the cell and radius; NaN of those that are not round.
        phases: their names.
        coatings: (N,) thickness of the coatings, 0 without one.
    """

    size: Float
    circles: Float
    phases: tuple[str, ...]
    coatings: Float


def read(source: Path) -> ListedFibres:
    """Those of a case file or a folder of results.  On one rank.

    Raises:
        CaseError, MeshError: the source is faulty, or a fibre is not round.
    """
    found = _of_result(source) if source.is_dir() else _of_cell(cases.load(source).cell)
    lost = np.flatnonzero(~np.isfinite(np.column_stack([found.circles, found.coatings])).all(axis=1)) + 1
    if len(lost):
        raise CaseError(f"{source}: fibres that are not round have no radius: {', '.join(map(str, lost[:10]))}")
    return found


def _of_result(directory: Path) -> ListedFibres:
    document = stored_result.read(directory)
    fibres, cell = document["fibres"], document["cell"]
    if cell.get("porosity"):
        raise CaseError(f"{directory}: results do not list voids; give the case file")
    nowhere = (np.nan, np.nan)
    circles = [(*(fibre.get("centre") or nowhere), fibre.get("radius") or np.nan) for fibre in fibres]
    return ListedFibres(
        np.array([cell["width"], cell["height"]]),
        np.array(circles, float).reshape(-1, 3),
        tuple(fibre["phase"] for fibre in fibres),
        np.array([fibre.get("coating") or 0.0 for fibre in fibres]),
    )


def _of_cell(cell: Cell) -> ListedFibres:
    if cell.has_own_mesh:
        return _of_mesh(cell)
    arrangement = arrange(cell)
    scale = arrangement_scale(cell, arrangement)
    size = scale * np.array([arrangement.width, arrangement.height])
    circles = scale * np.column_stack([arrangement.centres, arrangement.round_radii])
    circles[:, :2] %= size
    return ListedFibres(size, circles, arrangement.phase, scale * arrangement.thickness)


def _of_mesh(cell: Cell) -> ListedFibres:
    assert cell.file is not None
    mesh = read_mesh(cell.file)
    torus = Torus.of(mesh)
    numbers, is_fibre = fibre_numbers(torus)
    circles = fibre_circles(torus)
    coatings = coating_thickness(numbers, is_fibre, circles[:, 2])
    circles[:, :2] %= mesh.period
    phases = tuple(mesh.phases[phase] for phase in torus.constituent_phase[is_fibre])
    return ListedFibres(mesh.period, circles[is_fibre], phases, coatings)
