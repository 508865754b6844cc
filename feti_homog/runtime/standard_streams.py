"""Standard output and error: where they cannot be written, the work goes on and its results are kept."""

from __future__ import annotations

import contextlib
import io
import os
import sys

from feti_homog.errors import FetiHomogError, escaped

KEPT = "\n\t"  # of the characters that are not printable; others may come from files


def prepare() -> None:
    """Call before anything is printed: characters that the locale lacks are escaped, and closed streams are silent."""
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:  # the next file that is opened would take its place, and what is printed
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115 (None if it was closed)
    sys.stderr = sys.stderr or open(os.devnull, "w")  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def say(text: str) -> None:
    """Print a line beside the results.  If it cannot be written, nothing more is, and standard error says so once."""
    try:
        print(escaped(text, KEPT), flush=True)
    except OSError as error:
        _give_up()
        if not isinstance(error, BrokenPipeError):  # a reader that left, as `head` does, wants no more
            complain(f"warning: standard output cannot be written: {error.strerror}; result files are not affected")


def print_product(text: str) -> None:
    """Print what a command is for.

    Raises:
        FetiHomogError: it cannot be written, and not because the reader left.
    """
    try:
        print(escaped(text, KEPT), flush=True)
    except OSError as error:
        _give_up()
        if not isinstance(error, BrokenPipeError):
            raise FetiHomogError(f"standard output cannot be written: {error.strerror}") from error


def complain(*lines: str) -> None:
    """Print lines on standard error, if that can be written."""
    with contextlib.suppress(OSError):
        print(*(escaped(line, KEPT) for line in lines), sep="\n", file=sys.stderr, flush=True)


def _give_up() -> None:
    """From now on what goes to standard output, also from PETSc and at the end of Python, is lost without an error."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
