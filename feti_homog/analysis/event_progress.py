"""Lines and a bar about the events of a path while they are found."""

from __future__ import annotations

import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

from feti_homog.system.runtime.progress import Progress

SECONDS_A_LINE = 1.0
# The time left of equal steps is printed; the number of events is unknown.
STEPS_BAR = "{l_bar}{bar}| {elapsed}, {remaining} left{postfix}"
EVENTS_BAR = "{l_bar}{bar}| {elapsed}{postfix}"
BARS = {"events": EVENTS_BAR, "increments": STEPS_BAR}


class EventProgress:
    """Lines about the events of a path, and a bar of the share of the path that they have reached; a context manager.

    The first line, the last and urgent ones are printed, of the others one a second at most.  The bar is there if
    `progress` writes to a terminal.
    """

    def __init__(
        self, progress: Progress, layout: str, everything: str, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`layout` of the bar is STEPS_BAR or EVENTS_BAR, `everything` the file of all lines."""
        self._progress, self._layout, self._everything, self._clock = progress, layout, everything, clock
        self._next_line, self._held_back, self._left_out = float("-inf"), "", 0
        self._bar: Any = None

    def __enter__(self) -> Self:
        if self._progress.on_terminal:
            from tqdm import tqdm  # of no use to most runs, and slow to import

            self._bar = tqdm(total=1.0, desc="path", bar_format=self._layout, leave=False)
        return self

    def report(self, line: str, urgent: bool) -> None:
        """Print or hold back a line about an event."""
        now = self._clock()
        self._left_out += bool(self._held_back)
        self._held_back = ""
        if urgent or now >= self._next_line:
            self._progress.say(line)
            self._next_line = now + SECONDS_A_LINE
        else:
            self._held_back = line

    def advance(self, share: float, words: str) -> None:
        """Move the bar to the share of the path at an event, with `words` beside it."""
        if self._bar is not None:
            self._bar.set_postfix_str(words, refresh=False)
            self._bar.update(max(share - self._bar.n, 0.0))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.close()
        if self._held_back:
            self._progress.say(self._held_back)
        if self._left_out:
            count = "1 more event is" if self._left_out == 1 else f"{self._left_out} more events are"
            self._progress.say(f"  {count} in {self._everything}")
