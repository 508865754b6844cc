"""Events of a checkpoint that F lambda confirmed, in each problem by itself."""

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.analysis import path_events
from feti_homog.analysis.path_events import holding

YES, NO = True, False


@pytest.mark.parametrize(
    ("plane", "axial", "unconfirmed"),
    [
        ([YES, YES, YES], [YES, YES, YES], [2]),
        ([YES, NO, YES, NO], [YES, YES, NO, NO], [2, 3]),
        ([YES, NO, NO], None, [1, 2]),
        ([NO, NO], [NO, YES], [0, 1]),
    ],
    ids=["all", "in turn", "plane alone", "never"],
)
def test_the_last_event_and_those_after_the_last_that_holds_in_all_problems_are_checked(
    monkeypatch, plane, axial, unconfirmed
):
    columns = {"confirmed": plane} if axial is None else {"confirmed": plane, "confirmed_axial": axial}
    events = [
        {"number": number} | {name: column[number] for name, column in columns.items()} for number in range(len(plane))
    ]
    checked = []
    points = {number: SimpleNamespace(state=event, scale=1.0) for number, event in enumerate(events)}
    monkeypatch.setattr(path_events, "read", lambda context, number: (events[number], points[number], None))
    monkeypatch.setattr(path_events, "averages", lambda *_: [])
    loads = SimpleNamespace(
        problems=[*columns],
        interfaces=SimpleNamespace(completed=lambda event: event),
        responses=lambda event, _: checked.append(event["number"]) or [],
    )
    context = SimpleNamespace(loads=loads, checkpoint=SimpleNamespace(read=events.__getitem__))
    assert holding(context, len(events)) == len(events) and checked == unconfirmed


@pytest.mark.parametrize("wrong", [None, 0, 1])
def test_events_whose_means_are_wrong_do_not_hold(monkeypatch, wrong):
    """As are those of an event without multipliers that was found with wrong ones."""
    events = [{"confirmed": False, "stress": np.array([1.0, 2.0 + 1e-3 * (number == wrong)])} for number in range(2)]
    point = SimpleNamespace(state=None, scale=1.0)
    response = SimpleNamespace(stress=np.array([1.0, 2.0]), checks={"strain": 1e-12})
    monkeypatch.setattr(path_events, "read", lambda context, number: (events[number], point, None))
    monkeypatch.setattr(path_events, "averages", lambda event, *_: [SimpleNamespace(stress=event["stress"])])
    loads = SimpleNamespace(
        problems=["plane"], interfaces=SimpleNamespace(completed=lambda state: state), responses=lambda *_: [response]
    )
    checks = SimpleNamespace(tolerance=lambda law: 1e-6)
    context = SimpleNamespace(loads=loads, checkpoint=SimpleNamespace(read=events.__getitem__), checks=checks)
    assert holding(context, 2) == (2 if wrong is None else wrong)
