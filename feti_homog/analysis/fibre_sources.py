"""The fibres of a table, a folder of results or a case file, as a pattern whose statistics are measured."""

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
from feti_homog.config.fibre_window import read_window
from feti_homog.errors import CaseError
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.typing import Float


def read(source: Path, size: tuple[float, float] | None) -> FibrePattern:
    """The fibres, at least two, in the source's unit of length.  On one rank.

    Those of a table are in a window, of this width and height if the table has none; those of a folder or of a case, in
    a periodic cell.

    Raises:
        CaseError, MeshError: the source is faulty, a fibre is not round, or there are fewer than two.
    """
    if source.suffix != ".toml" and not source.is_dir():
        return read_window(source, size)
    if size is not None:
        raise CaseError(f"--size: only for a table of fibres; {source} says how large the cell is")
    found = _of_case(source) if source.suffix == ".toml" else _of_result(source)
    if not np.isfinite(found.radii).all():
        numbers = ", ".join(map(str, np.flatnonzero(~np.isfinite(found.radii))[:5] + 1))
        raise CaseError(f"{source}: fibres that are not round have no statistics: {numbers}")
    if found.count < 2:
        raise CaseError(f"{source}: expected at least two fibres, got {found.count}")
    return found


def _of_result(directory: Path) -> FibrePattern:
    document = stored_result.read(directory)
    fibres, cell = document["fibres"], document["cell"]
    circles = [(*(fibre.get("centre") or (0.0, 0.0)), fibre.get("radius") or np.nan) for fibre in fibres]
    return _periodic(cell["width"], cell["height"], np.array(circles).reshape(-1, 3))


def _of_case(path: Path) -> FibrePattern:
    cell = cases.load(path).cell
    if cell.geometry == "mesh":
        assert cell.file is not None
        mesh = read_mesh(cell.file)
        torus = Torus.of(mesh)
        return _periodic(mesh.width, mesh.height, fibre_circles(torus)[torus.constituent_phase > 0])
    arrangement = arrange(cell)
    scale = arrangement_scale(cell, arrangement)
    circles = scale * np.column_stack([arrangement.centres, arrangement.round_radii])
    return _periodic(scale * arrangement.width, scale * arrangement.height, circles)


def _periodic(width: float, height: float, circles: Float) -> FibrePattern:
    """That of circles (N, 3), centre and radius."""
    centres = circles[:, :2] % np.array([width, height])
    return FibrePattern(width, height, centres, circles[:, 2], periodic=True)
