"""Show the progress of a long computation in steps: a bar on a terminal, one line per minute in a file."""

import shutil
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import Any

from feti_homog.system.runtime import standard_streams

SECONDS_A_LINE = 60.0


@contextmanager
def shown(
    progress: standard_streams.Progress, label: str, clock: Callable[[], float] = time.monotonic
) -> Iterator[Callable[[float, int, str, bool], object]]:
    """Context manager: show the finished share of a stepped computation, the rate of steps, and times.

    The block calls the yielded `advance(share, count, text, known)` after each step; `known` steps, such as restored
    ones, took no time.  The time left assumes that the share keeps growing at its mean rate since the last known step.
    """
    if (within := progress.within) is not None:
        yield lambda share, count, text, known: within(share, f"{label} {share:.0%}, {text}")
        return
    begin = clock()
    reached, next_line = 0.0, begin + SECONDS_A_LINE
    known_time, known_share, known_count = begin, 0.0, 0  # at the last known step
    bar: Any = None
    if progress.on_terminal:
        from tqdm import tqdm  # unused in most runs, and slow to import

        columns, rows = shutil.get_terminal_size()  # 80 x 24 for a terminal that reports 0 x 0
        look = "{l_bar}{bar}| {elapsed} used{postfix}"
        bar = tqdm(total=1.0, desc=label, bar_format=look, leave=False, ncols=columns, nrows=rows)

    def advance(share: float, count: int, text: str, known: bool) -> None:
        nonlocal reached, next_line, known_time, known_share, known_count
        now, reached = clock(), max(share, reached)
        if known:
            known_time, known_share, known_count = now, reached, count
        seconds, gain, steps = now - known_time, reached - known_share, count - known_count
        if steps and seconds:
            text += f", {60.0 * steps / seconds:,.1f} a minute"
        if share < reached:  # after a peak the load may fall for good
            text = f"falls to {share:.0%}, {text}"
        elif gain:  # first, since a narrow terminal shows the beginning
            text = f"{timedelta(seconds=round(min(seconds * (1.0 - reached) / gain, 1e9)))} left, {text}"
        if bar is not None:
            bar.set_postfix_str(text, refresh=False)
            bar.update(reached - bar.n)
        elif now >= next_line:
            used = timedelta(seconds=round(now - begin))
            progress.say(f"  {label} {reached:.0%}, {used} used, {text}")
            next_line = now + SECONDS_A_LINE

    try:
        yield advance
    finally:
        if bar is not None:
            bar.close()
