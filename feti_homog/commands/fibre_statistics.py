"""`feti-homog statistics`: how the fibres of a table, a result or a case are placed."""

from __future__ import annotations

from pathlib import Path

from feti_homog.commands import fibre_sources
from feti_homog.fibres.hard_core import hard_core
from feti_homog.microstructure.randomness import poisson
from feti_homog.microstructure.statistics import measure
from feti_homog.report.text import statistics_text
from feti_homog.results import output_folder

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
    pattern = fibre_sources.read(source, size)
    if out is not None:
        output_folder.usable(out)
    found = measure(pattern, MODELS[model], simulations)
    lines = [statistics_text.text(found, model, simulations)]
    if out is not None:
        from feti_homog.report.plots import statistics_picture

        out.mkdir(parents=True, exist_ok=True)
        paths = statistics_text.write(out, found)
        paths.append(statistics_picture.write(out, found, source.stem, model))
        lines += map(str, paths)
    return lines
