"""Runs of the command line for the tests of it."""

import re
from collections.abc import Sequence
from pathlib import Path

from feti_homog.verify.certificate import verify
from support.base_case import BASE
from support.jobs import mpirun
from support.standing_jobs import standing_job

COMMAND = ("-m", "feti_homog")
CASE = BASE.replace("mesh_size = 0.05", "mesh_size = 0.15")


def case_file(folder: Path, end: str = "[output]\npictures = false\n") -> Path:
    """Return a small case that ends with these lines; by default it draws nothing, which takes longest."""
    path = folder / "small.toml"
    path.write_text(CASE + end)
    return path


def command_line(ranks: int, *words: str | Path):
    """`python -m feti_homog words...` on so many ranks; none: without mpirun.

    Options of PETSc, which starts once, have a process of their own.
    """
    return command_process(ranks, *words) if has_options(words) else standing_job(max(ranks, 1)).run(*COMMAND, *words)


def command_process(ranks: int, *words: str | Path):
    """Run `command_line` by processes of its own."""
    return mpirun(ranks, *COMMAND, *words)


def has_options(words: Sequence[str | Path]) -> bool:
    return any(re.match("-[a-z]", str(word)) for word in words)


def assert_verified(*folders: Path) -> None:
    """Check that the results in these folders obey every law of `feti-homog verify`."""
    assert folders
    for folder in folders:
        certificate = verify(folder)
        assert certificate.holds, certificate.text
