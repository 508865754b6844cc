"""Many events on a terminal: a line a second at most, the first, the last and faults always."""

import pytest
from mpi4py import MPI

from feti_homog.analysis.path_events import EVENTS_BAR, STEPS_BAR, EventProgress
from feti_homog.system.runtime.progress_bar import Progress


class Words(Progress):
    """Keeps the lines."""

    def __init__(self, on_terminal=False):
        super().__init__(MPI.COMM_SELF, quiet=True)
        self.lines, self.on_terminal = [], on_terminal

    def say(self, line):
        self.lines.append(line)


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def shown_lines(steps, urgent=(), count=10):
    """Return the printed lines of events of so many seconds each."""
    progress, clock = Words(), Clock()
    with EventProgress(progress, EVENTS_BAR, "the log", clock) as shown:
        for number in range(count):
            clock.now += steps
            shown.report(f"event {number}", urgent=number in urgent)
    return progress.lines


def test_events_have_at_most_a_line_a_second():
    assert shown_lines(1.5) == [f"event {number}" for number in range(10)]
    assert shown_lines(0.01) == ["event 0", "event 9", "  8 more events are in the log"]
    assert shown_lines(0.26) == ["event 0", "event 4", "event 8", "event 9", "  6 more events are in the log"]


def test_faults_are_always_reported():
    assert shown_lines(0.01, urgent=(3, 4)) == [
        "event 0",
        "event 3",
        "event 4",
        "event 9",
        "  6 more events are in the log",
    ]


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_events(count):
    assert shown_lines(0.01, count=count) == [f"event {number}" for number in range(count)]


def test_the_last_line_is_reported_when_the_path_fails():
    progress = Words()
    with pytest.raises(ValueError), EventProgress(progress, EVENTS_BAR, "the log", Clock()) as shown:
        for number in range(3):
            shown.report(f"event {number}", urgent=False)
        raise ValueError
    assert progress.lines == ["event 0", "event 2", "  1 more event is in the log"]


@pytest.mark.parametrize(("layout", "left"), [(EVENTS_BAR, False), (STEPS_BAR, True)])
def test_a_terminal_has_a_bar(capsys, layout, left):
    """The share reached at most, for a snap-back goes back; time that is left where steps are alike."""
    with EventProgress(Words(on_terminal=True), layout, "the log") as shown:
        for share in (0.5, 0.25, 0.75):
            shown.advance(share, "3 events, 7 bonded, 2 broken")
        shown._bar.refresh()
        text = capsys.readouterr().err.split("\r")[-1]
    assert "path:  75%" in text and "3 events, 7 bonded, 2 broken" in text and (" left" in text) == left


def test_where_no_terminal_is_there_is_no_bar(capsys):
    with EventProgress(Words(), EVENTS_BAR, "the log") as shown:
        shown.advance(0.5, "words")
    assert capsys.readouterr().err == ""


def test_stages_within_a_stage_have_times_of_their_own(monkeypatch):
    times = iter([0.0, 2.0, 5.0, 10.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(times))
    progress = Words()
    with progress.stage("solve"), progress.stage("fields"):
        pass
    monkeypatch.undo()
    assert progress.seconds == {"fields": 3.0, "solve": 7.0}
