"""`feti-homog statistics`: how the fibres of a table, a result or a case are placed."""

from __future__ import annotations

import re
from pathlib import Path

from feti_homog.case.fibre_window import read_window
from feti_homog.case.phase_names import VOID
from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError
from feti_homog.fibres.hard_core import hard_core
from feti_homog.microstructure.fibre_pattern import FibrePattern
from feti_homog.microstructure.statistics import measure, poisson
from feti_homog.report.text import statistics_text
from feti_homog.results import atomic, output_folder

MODELS = {"hard-core": hard_core, "poisson": poisson}


def run(
    source: Path, out: Path | None, model: str, simulations: int, size: tuple[float, float] | None = None
) -> list[str]:
    """Measure, write three tables and a picture to `out` if it is given; returns the lines to print.  On one rank.

    `size` is that of the window of a table that gives none.

    Raises:
        CaseError, MeshError: the source is faulty, `out` cannot be used, or the model has no such pattern.
        FetiHomogError: a file cannot be written.
    """
    fibres = pattern(source, size)
    if out is not None:
        output_folder.usable(out)
    found = measure(fibres, MODELS[model], simulations)
    lines = [statistics_text.text(found, model, simulations)]
    if out is not None:
        from feti_homog.report.plots import statistics_picture

        out.mkdir(parents=True, exist_ok=True)
        atomic.remove_abandoned(out, re.compile(r"[a-z_]+\.(csv|png)"))
        paths = statistics_text.write(out, found)
        paths.append(statistics_picture.write(out, found, source.stem, model))
        lines += map(str, paths)
    return lines


def pattern(source: Path, size: tuple[float, float] | None) -> FibrePattern:
    """Return the fibres, at least two, in the source's unit of length. On one rank.

    Those of a table are in a window, of this width and height if the table has none; those of a folder or of a case, in
    a periodic cell. Voids are left out; ellipses count as discs of the same centres and areas.

    Raises:
        CaseError, MeshError: the source is faulty, a fibre is no circle or ellipse, or there are fewer than two.
    """
    if source.suffix != ".toml" and not source.is_dir():
        return read_window(source, size)
    if size is not None:
        raise CaseError(f"--size: only for a table of fibres; {source} gives the size of the cell")
    fibres = listed_fibres.read(source)
    width, height = fibres.size.tolist()
    own = [name != VOID for name in fibres.phases]
    found = FibrePattern(width, height, fibres.ellipses.centres[own], fibres.radii[own], periodic=True)
    if found.count < 2:
        raise CaseError(f"{source}: expected at least two fibres, got {found.count}")
    return found
