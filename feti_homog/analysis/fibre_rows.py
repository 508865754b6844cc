"""`feti-homog fibres`: the table of the fibres of a case or of a result, which [cell] geometry = "table" reads."""

from __future__ import annotations

from pathlib import Path

from feti_homog.analysis import listed_fibres


def table(source: Path) -> str:
    """The table, a row for each fibre in the order of their numbers, of a case file or a folder of results; with a
    column `coating`, thickness / radius, if any fibre has one.

    Its numbers are exact, so that it gives the same cell again.  On one rank.

    Raises:
        CaseError, MeshError: the source is faulty, or a fibre is not round.
    """
    fibres = listed_fibres.read(source)
    rows = [
        f"{x!r},{y!r},{radius!r},{name}"
        for (x, y, radius), name in zip(fibres.circles.tolist(), fibres.phases, strict=True)
    ]
    names = "x,y,radius,phase"
    if fibres.coatings.any():
        ratios = (fibres.coatings / fibres.circles[:, 2]).tolist()
        rows, names = [f"{row},{ratio!r}" for row, ratio in zip(rows, ratios, strict=True)], f"{names},coating"
    width, height = fibres.size.tolist()
    return "\n".join([f"# width = {width!r}, height = {height!r}, left = 0, bottom = 0", names, *rows])
