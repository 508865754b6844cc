"""The cost model of events of a path, on made up runs and on counted calls."""

from dataclasses import replace

import pytest
from scaling_events import EventModel, EventRow, fitted, table

MODEL = EventModel(constant=2e-3, serial=1e-7, parallel=5e-7, latency=3e-6)


def made_up(fibres: int, ranks: int) -> EventRow:
    """Return an event of 30 collective calls and 2 exchanges with `ranks` messages that takes the time of MODEL."""
    row = EventRow(
        fibres=fibres, ranks=ranks, dofs=1000 * fibres, events=10, seconds=0.0, worst=0.1, setup=1.0, solves=1.0,
        iterations=0.0, exchanges=2.0, collectives=30.0, kilobytes=5.0, neighbours=ranks if ranks > 1 else 0,
        latency=MODEL.latency,
    )  # fmt: skip
    return replace(row, seconds=MODEL.seconds(row))


ROWS = [made_up(fibres, ranks) for fibres in (5, 50) for ranks in (1, 2)]


def test_messages_of_an_event():
    """2 exchanges of 16 messages each and 30 calls that are log2 16 = 4 deep; alone, no message."""
    assert MODEL.messages(made_up(5, 16)) == pytest.approx(3e-6 * (2 * 16 + 30 * 4))
    assert MODEL.messages(made_up(5, 1)) == 0.0


def test_constants_are_found_again():
    """Runs on more ranks than cores have no say."""
    found = fitted([*ROWS, replace(made_up(50, 4), seconds=1e3)], cores=2)
    assert (found.constant, found.serial, found.parallel) == pytest.approx((2e-3, 1e-7, 5e-7), rel=1e-4)
    assert found.seconds(made_up(100, 16)) == pytest.approx(MODEL.seconds(made_up(100, 16)), rel=1e-4)


@pytest.mark.parametrize("rows", [ROWS[:2], ROWS[::2]], ids=["one size", "one number of ranks"])
def test_runs_that_do_not_tell_the_constants(rows):
    with pytest.raises(ValueError, match="two sizes"):
        fitted(rows, cores=2)
    assert "no model" in table(rows, cores=2)[-1]


def test_table_has_the_error_of_each_timed_run():
    """One run that takes half as long as by the model shows as too dear; of those without cores only the model."""
    lines = table([*ROWS, made_up(50, 16)], cores=2)[2:-1]
    assert [line.split()[-1] for line in lines] == ["+0%", "+0%", "+0%", "+0%", "-"]
