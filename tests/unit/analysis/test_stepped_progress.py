"""A bar on a terminal and a line a minute in a file show the same numbers."""

import os
from functools import partial

import pytest
import tqdm
from mpi4py import MPI

from feti_homog.analysis import stepped_progress
from feti_homog.system.runtime.standard_streams import Progress


class Words(Progress):
    """Keeps the lines."""

    def __init__(self, on_terminal=False):
        super().__init__(MPI.COMM_SELF, quiet=True)
        self.lines, self.on_terminal = [], on_terminal

    def say(self, line):
        self.lines.append(line)


class Clock:
    now = 100.0

    def __call__(self):
        return self.now


def shown_lines(shares, seconds, known=0):
    """Return the lines about steps that take `seconds` each; the first `known` steps take no time."""
    progress, clock = Words(), Clock()
    with stepped_progress.shown(progress, "load", clock) as advance:
        for count, share in enumerate(shares, 1):
            clock.now += 0.0 if count <= known else seconds
            advance(share, count, f"{count} events", count <= known)
    return progress.lines


def test_a_file_has_a_line_a_minute():
    """Steps of 1 % in 20 s: three a minute, 2000 s for all."""
    lines = shown_lines([0.01 * count for count in range(1, 11)], 20.0)
    assert lines == [
        "  load 3%, 0:01:00 used, 0:32:20 left, 3 events, 3.0 a minute",
        "  load 6%, 0:02:00 used, 0:31:20 left, 6 events, 3.0 a minute",
        "  load 9%, 0:03:00 used, 0:30:20 left, 9 events, 3.0 a minute",
    ]
    assert shown_lines([0.5, 1.0], 29.0) == []
    assert len(shown_lines([0.5, 0.6, 0.7], 3600.0)) == 3


def test_known_steps_have_no_part_in_rate_and_time_left():
    """From half of the load on, a tenth a minute."""
    assert shown_lines([0.3, 0.5, 0.6, 0.7], 60.0, known=2) == [
        "  load 60%, 0:01:00 used, 0:04:00 left, 3 events, 1.0 a minute",
        "  load 70%, 0:02:00 used, 0:03:00 left, 4 events, 1.0 a minute",
    ]
    assert shown_lines([0.4], 60.0) == shown_lines([0.4, 0.4], 60.0)[:1]


def test_a_snap_back_leaves_the_share():
    """The share is the largest load so far; while the load is below it the time left is unknown."""
    assert shown_lines([0.4, 0.1, 0.2], 60.0, known=1) == [
        "  load 40%, 0:01:00 used, falls to 10%, 2 events, 1.0 a minute",
        "  load 40%, 0:02:00 used, falls to 20%, 3 events, 1.0 a minute",
    ]
    assert shown_lines([0.4, 0.2, 0.8], 60.0) == [
        "  load 40%, 0:01:00 used, 0:01:30 left, 1 events, 1.0 a minute",
        "  load 40%, 0:02:00 used, falls to 20%, 2 events, 1.0 a minute",
        "  load 80%, 0:03:00 used, 0:00:45 left, 3 events, 1.0 a minute",
    ]


def test_a_computation_within_another_shows_its_share_there():
    shown = []
    progress = Progress(MPI.COMM_SELF, quiet=True, within=lambda *words: shown.append(words))
    with stepped_progress.shown(progress, "load") as advance:
        advance(0.25, 3, "3 events", False)
    assert shown == [(0.25, "load 25%, 3 events")]


def test_a_terminal_has_a_bar_with_the_same_numbers(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr("tqdm.tqdm", partial(tqdm.tqdm, mininterval=0))  # drawn after each step
    progress, clock = Words(on_terminal=True), Clock()
    with pytest.raises(ValueError), stepped_progress.shown(progress, "load", clock) as advance:
        for count, share in enumerate((0.25, 0.125, 0.75), 1):
            clock.now += 60.0
            advance(share, count, f"{count} events", False)
        raise ValueError  # the bar goes with a path that fails
    drawn = [text for text in capsys.readouterr().err.split("\r") if text.strip()]
    assert [text[:10] for text in drawn if "2 events" not in text] == ["load:   0%", "load:  25%", "load:  75%"]
    assert drawn[-1].rstrip().endswith("used, 0:01:00 left, 3 events, 1.0 a minute") and progress.lines == []


def test_a_terminal_of_unknown_size_has_a_bar(monkeypatch):
    """mpirun gives rank 0 a terminal of 0 x 0."""
    sizes, bar = [], tqdm.tqdm
    monkeypatch.setattr("os.get_terminal_size", lambda *_: os.terminal_size((0, 0)))
    monkeypatch.setattr("tqdm.tqdm", lambda **look: sizes.append((look["ncols"], look["nrows"])) or bar())
    for name in ("COLUMNS", "LINES"):
        monkeypatch.delenv(name, raising=False)
    with stepped_progress.shown(Words(on_terminal=True), "load", Clock()):
        pass
    assert sizes == [(80, 24)]


def test_stages_within_a_stage_have_times_of_their_own(monkeypatch):
    times = iter([0.0, 2.0, 5.0, 10.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(times))
    progress = Words()
    with progress.stage("solve"), progress.stage("fields"):
        pass
    monkeypatch.undo()
    assert progress.seconds == {"fields": 3.0, "solve": 7.0}


def test_a_start_at_a_tiny_load_has_a_forecast():
    assert shown_lines([1e-99], 60.0) == [
        "  load 0%, 0:01:00 used, 11574 days, 1:46:40 left, 1 events, 1.0 a minute",
    ]
