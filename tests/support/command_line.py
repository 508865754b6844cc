"""Runs of the command line for the tests of it."""

import os
import signal
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from subprocess import CompletedProcess

from feti_homog import cli
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


def in_process(*words: str | Path) -> CompletedProcess[str]:
    """Run `feti-homog words...` in the process of the test, which has one rank.

    Options of PETSc, which starts once in a process, and tests of the process itself need `command_line`.
    """
    output, errors = StringIO(), StringIO()
    # Programs that a test starts later would inherit more.
    blocked, environment = signal.pthread_sigmask(signal.SIG_BLOCK, ()), dict(os.environ)
    try:
        with redirect_stdout(output), redirect_stderr(errors):
            code = cli.main([str(word) for word in words])
    except SystemExit as end:
        code = int(str(end.code or 0))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
        os.environ.clear()
        os.environ.update(environment)
    return CompletedProcess(words, code, output.getvalue(), errors.getvalue())


def on_ranks(ranks: int, *words: str | Path) -> CompletedProcess[str]:
    """Run `feti-homog words...` on so many ranks; none: in the process of the test."""
    return command_line(ranks, *words) if ranks else in_process(*words)


def assert_verified(*folders: Path) -> None:
    """Check that the results in these folders obey every law of `feti-homog verify`."""
    assert folders
    for folder in folders:
        certificate = verify(folder)
        assert certificate.holds, certificate.text
