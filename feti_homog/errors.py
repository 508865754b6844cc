"""Define the errors that the program prints for the user, and its exit codes."""

import re
from enum import IntEnum
from typing import Any, Self

# Limits of the length and number of faults, since a file may cause any number of long faults.
LONGEST_LINE, KEPT_END, MOST_FAULTS = 1000, 200, 20
COUNT = re.compile(r"\band (\d+) more faults$")


class ExitCode(IntEnum):
    """The exit codes of the program."""

    DONE = 0
    DEFECT = 1
    INPUT = 2
    UNCONVERGED = 3


def escaped(text: str, allowed: str = "") -> str:
    """Replace unprintable characters, except `allowed`, by escapes: a terminal would obey control characters."""
    return re.sub(r"[^ -~]", lambda c: c[0] if c[0].isprintable() or c[0] in allowed else ascii(c[0])[1:-1], text)


class FetiHomogError(Exception):
    """An error printed for the user without a traceback, with a line for each of its `faults`."""

    exit_code = ExitCode.DEFECT

    def __init__(self, *faults: str) -> None:
        """Keep the first MOST_FAULTS of the lines `faults`, and a count of the others.

        A line keeps at most LONGEST_LINE characters, among them its last KEPT_END.
        """
        counts = {fault: int(count[1]) for fault in faults if (count := COUNT.search(fault))}
        lines = [fault for fault in faults if fault not in counts]
        room = MOST_FAULTS + (not counts and len(lines) == MOST_FAULTS + 1)  # the last fault, or a line with the count
        more, end = sum(counts.values()) + max(len(lines) - room, 0), LONGEST_LINE - KEPT_END - 3
        lines[room:] = [f"and {more} more faults"] if more else []
        # The reason stands at the end of a line.
        self.faults = tuple(f"{n[:end]}...{n[-KEPT_END:]}" if len(n) > LONGEST_LINE else n for n in map(escaped, lines))
        super().__init__("\n".join(self.faults))

    def __reduce__(self) -> tuple[type[Self], tuple[Any, ...]]:
        return type(self), self.faults


class CaseError(FetiHomogError):
    """The case file or the command line is faulty.  Each fault names section and key."""

    exit_code = ExitCode.INPUT


class FolderError(FetiHomogError):
    """The folder of a study's cases cannot be used: it is damaged, locked, or begun on other ranks."""

    exit_code = ExitCode.INPUT


class MeshError(FetiHomogError):
    """The cell cannot be meshed, or a user's mesh is faulty.  Each fault names the key, or nodes or elements."""

    exit_code = ExitCode.INPUT


class ConvergenceError(FetiHomogError):
    """A solve did not converge, a check failed, or nothing carries the load; the result has the status `not converged`.

    Attributes:
        result: the computed part as a `Result`, if `feti_homog.run` raised the error after an analysis; else None.
    """

    exit_code = ExitCode.UNCONVERGED
    result: Any = None


class NotCarriedError(ConvergenceError):
    """Nothing in the cell carries the prescribed stresses."""


class NoMemoryError(FetiHomogError):
    """A rank has no memory left; raised on all ranks."""


class LibraryError(FetiHomogError):
    """A library that pip does not install is missing or does not fit.  Each fault gives the remedy."""

    exit_code = ExitCode.INPUT
