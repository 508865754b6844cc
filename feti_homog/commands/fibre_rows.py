"""`feti-homog fibres`: the table of the fibres of a case or of a result, which [cell] geometry = "table" reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError
from feti_homog.typing import Float


def table(source: Path) -> str:
    """Return the table of a case file or a folder of results: a row for each fibre, in the order of their numbers,
    and for each void; with columns `a`, `b` and `angle` if any is an ellipse, and a column `coating` if any has
    one.

    Its numbers are exact, so that it gives the same cell again.  On one rank.

    Raises:
        CaseError, MeshError: the source is faulty, or a fibre is neither round nor an ellipse, or voids are not known.
    """
    fibres = listed_fibres.read(source)
    if fibres.lacks_voids:
        raise CaseError(f"{source}: has voids, which only a case of a table or of a random cell lists")
    ellipses, is_round = fibres.ellipses, fibres.ellipses.are_round
    a, b = ellipses.semi_axes.T
    columns = dict(zip("xy", map(_words, ellipses.centres.T), strict=True))
    columns["radius"] = _words(np.where(is_round, a, np.nan))
    columns["phase"] = list(fibres.phases)
    if not is_round.all():
        columns |= {name: _words(np.where(is_round, np.nan, of)) for name, of in zip("ab", (a, b), strict=True)}
        columns["angle"] = _words(np.where(is_round, np.nan, ellipses.angles))
    if fibres.coatings.any():
        columns["coating"] = _words(fibres.coatings / fibres.radii)
    for name, values in fibres.others.items():
        before = columns.get(name, [""] * len(is_round))
        columns[name] = [new or old for old, new in zip(before, _words(values), strict=True)]
    if fibres.cores.any():
        columns["inner_radius"] = _words(fibres.cores)
    rows = map(",".join, zip(*columns.values(), strict=True))
    width, height = fibres.size.tolist()
    size = f"# width = {width!r}, height = {height!r}, left = 0, bottom = 0"
    return "\n".join([size, ",".join(columns), *rows])


def _words(values: Float) -> list[str]:
    """Return the exact numbers (N,), nothing where they are NaN."""
    return ["" if np.isnan(value) else repr(value) for value in values.tolist()]
