"""events.log: a line an event of a path, there to be followed while the path goes on."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from feti_homog.errors import FetiHomogError
from feti_homog.results import atomic
from feti_homog.version import __version__

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpi4py.MPI import Intracomm

NAME = "events.log"
HEADER = "# feti-homog: events"  # the beginning of the first line, by which a log is known as one of this program


class EventLog:
    """The log in `directory`, written by rank 0 from the first line on; an earlier one is replaced.

    If it cannot be written `say` is told so once, and the path goes on without it: the log holds no results.
    """

    def __init__(self, directory: Path, comm: Intracomm, title: str, say: Callable[[str], object]) -> None:
        self.path, self._title, self._say = directory / NAME, title, say
        self._wanted = comm.rank == 0
        self._stream: TextIO | None = None

    def write(self, line: str) -> None:
        """Add a line."""
        if not self._wanted:
            return
        try:
            with atomic.write_errors(self.path):
                if self._stream is None:
                    self._stream = self.path.open("w", encoding="utf-8", buffering=1)  # whole lines
                    print(f"{HEADER} of {self._title}, version {__version__}", file=self._stream)
                print(line.strip(), file=self._stream)
        except FetiHomogError as error:
            self._say(f"warning: {error}; the path goes on without it")
            self.close()

    def close(self) -> None:
        """No more lines."""
        self._wanted = False
        if self._stream is not None:
            with contextlib.suppress(OSError):  # every line was written when it was given
                self._stream.close()
