"""Runs of the command line for the tests of it."""

from pathlib import Path

from feti_homog.verify.certificate import verify
from support.base_case import BASE
from support.jobs import mpirun

COMMAND = ("-m", "feti_homog")
CASE = BASE.replace("mesh_size = 0.05", "mesh_size = 0.15")


def case_file(folder: Path, end: str = "[output]\npictures = false\n") -> Path:
    """Return a small case that ends with these lines; by default it draws nothing, which takes longest."""
    path = folder / "small.toml"
    path.write_text(CASE + end)
    return path


def command_line(ranks: int, *words: str | Path):
    """`python -m feti_homog words...` on so many ranks; none: without mpirun."""
    return mpirun(ranks, *COMMAND, *words)


def assert_verified(*folders: Path) -> None:
    """Check that the results in these folders obey every law of `feti-homog verify`."""
    assert folders
    for folder in folders:
        certificate = verify(folder)
        assert certificate.holds, certificate.text
