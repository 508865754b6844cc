"""`feti-homog fibres`: the table of the fibres of a case or of a result, which [cell] geometry = "table" reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feti_homog.analysis import stored_result
from feti_homog.cell.arrangement import arrange
from feti_homog.cell.fibre_centres import fibre_circles
from feti_homog.cell.gmsh_mesher import arrangement_scale
from feti_homog.cell.msh_reader import read as read_mesh
from feti_homog.cell.periodic_topology import Torus
from feti_homog.config import case as cases
from feti_homog.config.cell_section import Cell
from feti_homog.errors import CaseError
from feti_homog.typing import Float


def table(source: Path) -> str:
    """The table, a row for each fibre in the order of their numbers, of a case file or a folder of results.

    Its numbers are exact, so that it gives the same cell again.  On one rank.

    Raises:
        CaseError, MeshError: the source is faulty, or a fibre is not round.
    """
    is_folder = source.is_dir()
    size, circles, phases = _of_result(source) if is_folder else _of_cell(cases.load(source).cell)
    lost = (np.flatnonzero(~np.isfinite(circles).all(axis=1)) + 1)[:10].tolist()
    if lost:
        raise CaseError(f"{source}: fibres that are not round have no radius: {', '.join(map(str, lost))}")
    rows = [f"{x!r},{y!r},{radius!r},{name}" for (x, y, radius), name in zip(circles.tolist(), phases, strict=True)]
    width, height = size.tolist()
    return "\n".join([f"# width = {width!r}, height = {height!r}, left = 0, bottom = 0", "x,y,radius,phase", *rows])


def _of_result(directory: Path) -> tuple[Float, Float, list[str]]:
    """Size of the cell (2,), circles (N, 3) of its fibres, NaN of those that have none, and their phases."""
    document = stored_result.read(directory)
    fibres, cell = document["fibres"], document["cell"]
    nowhere = (np.nan, np.nan)
    circles = [(*(fibre.get("centre") or nowhere), fibre.get("radius") or np.nan) for fibre in fibres]
    size = np.array([cell["width"], cell["height"]])
    return size, np.array(circles, float).reshape(-1, 3), [fibre["phase"] for fibre in fibres]


def _of_cell(cell: Cell) -> tuple[Float, Float, list[str]]:
    """Those of a case."""
    if cell.has_own_mesh:
        assert cell.file is not None
        mesh = read_mesh(cell.file)
        torus = Torus.of(mesh)
        inner = torus.constituent_phase > 0
        circles = fibre_circles(torus)[inner]
        circles[:, :2] %= mesh.period
        return mesh.period, circles, [mesh.phases[phase] for phase in torus.constituent_phase[inner]]
    arrangement = arrange(cell)
    scale = arrangement_scale(cell, arrangement)
    circles = scale * np.column_stack([arrangement.centres, arrangement.round_radii])
    return scale * np.array([arrangement.width, arrangement.height]), circles, list(arrangement.phase)
