"""The fibres of a table, a folder of results or a case file, as a pattern whose statistics are measured."""

from __future__ import annotations

from pathlib import Path

from feti_homog.case.fibre_window import read_window
from feti_homog.case.phase_names import VOID
from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError
from feti_homog.microstructure.fibre_pattern import FibrePattern


def read(source: Path, size: tuple[float, float] | None) -> FibrePattern:
    """The fibres, at least two, in the source's unit of length.  On one rank.

    Those of a table are in a window, of this width and height if the table has none; those of a folder or of a case, in
    a periodic cell. Voids are left out; ellipses count as discs of the same centres and areas.

    Raises:
        CaseError, MeshError: the source is faulty, a fibre is no circle or ellipse, or there are fewer than two.
    """
    if source.suffix != ".toml" and not source.is_dir():
        return read_window(source, size)
    if size is not None:
        raise CaseError(f"--size: only for a table of fibres; {source} says how large the cell is")
    fibres = listed_fibres.read(source)
    width, height = fibres.size.tolist()
    own = [name != VOID for name in fibres.phases]
    found = FibrePattern(width, height, fibres.ellipses.centres[own], fibres.radii[own], periodic=True)
    if found.count < 2:
        raise CaseError(f"{source}: expected at least two fibres, got {found.count}")
    return found
