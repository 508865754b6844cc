"""Errors that a user can cause or must hear of, and the exit codes of the program."""

from __future__ import annotations

EXIT_DONE, EXIT_DEFECT, EXIT_INPUT, EXIT_UNCONVERGED = 0, 1, 2, 3


class FetiHomogError(Exception):
    """An error told to the user in words, one line per fault, without a traceback."""

    exit_code = EXIT_DEFECT

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults

    def __reduce__(self) -> tuple[type[FetiHomogError], tuple[str, ...]]:
        return type(self), self.faults


class CaseError(FetiHomogError):
    """The case file or the command line is faulty; each fault names section and key."""

    exit_code = EXIT_INPUT


class MeshError(FetiHomogError):
    """The cell cannot be meshed, or a user's mesh is faulty; each fault names nodes or elements."""

    exit_code = EXIT_INPUT


class ConvergenceError(FetiHomogError):
    """A solve did not converge or a check failed; what was computed is written and marked."""

    exit_code = EXIT_UNCONVERGED


class NotCarriedError(ConvergenceError):
    """Stresses are prescribed that nothing in the cell carries."""


class LibraryError(FetiHomogError):
    """A library that pip does not bring is missing or does not fit; each fault says what to do."""

    exit_code = EXIT_INPUT
