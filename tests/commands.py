"""Runs of the command line for the tests of it."""

from __future__ import annotations

from pathlib import Path

from support import mpirun

CASE = """\
[cell]
geometry = "hexagonal"
fibre_fraction = 0.4
mesh_size = 0.15

[material.matrix]
young = 88.0
poisson = 0.299

[material.fibre]
young = 200.0
poisson = 0.222

[analysis]
type = "stiffness"
plane = "strain"
"""


def case_file(folder: Path, end: str = "[output]\npictures = false\n") -> Path:
    """A small case that ends with these lines; by default it draws nothing, which takes longest."""
    path = folder / "small.toml"
    path.write_text(CASE + end)
    return path


def command_line(ranks: int, *words: str | Path, timeout: float = 60.0):
    """`python -m feti_homog words...` on so many ranks; none: without mpirun."""
    return mpirun(ranks, "-m", "feti_homog", *words, timeout=timeout)
