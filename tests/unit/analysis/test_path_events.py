"""Events of a checkpoint that F lambda confirmed, in each problem by itself."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from feti_homog.analysis import path_events
from feti_homog.analysis.path_events import holding, last_confirmed

YES, NO = np.zeros(2), np.full(2, np.nan)


def test_problems_are_confirmed_at_events_of_their_own():
    states = [SimpleNamespace(solution=SimpleNamespace(alpha=alpha)) for alpha in (None, YES)]
    point = SimpleNamespace(state=SimpleNamespace(problems=states))
    assert last_confirmed([4, 2], 7, point) == [4, 7]


@pytest.mark.parametrize(
    ("plane", "axial", "unconfirmed"),
    [
        ([YES, YES, YES], [YES, YES, YES], []),
        ([YES, NO, YES, NO], [YES, YES, NO, NO], [2, 3]),
        ([YES, NO, NO], None, [1, 2]),
        ([NO, NO], [NO, YES], [0, 1]),
        ([None, None, YES, NO], [None, None, NO, NO], [2, 3]),
    ],
    ids=["all", "in turn", "plane alone", "never", "after lean ones"],
)
def test_events_after_the_last_that_holds_in_all_problems_are_checked(monkeypatch, plane, axial, unconfirmed):
    columns = {"alpha": plane} if axial is None else {"alpha": plane, "alpha_axial": axial}
    events = [
        {"number": number} | {name: own[number] for name, own in columns.items() if own[number] is not None}
        for number in range(len(plane))
    ]
    checked = []
    monkeypatch.setattr(path_events, "restored", lambda event, _: (SimpleNamespace(state=event, scale=1.0), None))
    loads = SimpleNamespace(
        interfaces=SimpleNamespace(completed=lambda event: event),
        responses=lambda event, _: checked.append(event["number"]) or [],
    )
    context = SimpleNamespace(loads=loads, checkpoint=SimpleNamespace(read=events.__getitem__))
    assert holding(context, len(events)) == len(events) and checked == unconfirmed
