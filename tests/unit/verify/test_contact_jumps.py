"""A tip that a change of contact overloads breaks there, be it within a leg or where one begins."""

import itertools
import json
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI
from support.verified_results import document

from feti_homog import Case, run
from feti_homog.verify import check_path
from feti_homog.verify.certificate import verify

JUMP, LEG = 8, 2  # number of the point, and of the legs
STRAINS = "E11", "E22", "gamma12"


def path_of(folder):
    return json.loads((folder / "result.json").read_text())["path"]


def cut(path):
    """Return the case whose second leg is cut in two where contact begins to change."""
    case = document("jump")
    begin, end = case["path"]["waypoints"]
    start = next(point["strain"] for point in path if point["load_factor"] == 1 / LEG)
    share = path[JUMP - 1]["load_factor"] * LEG - 1
    middle = (1 - share) * np.array(start) + share * np.array([end[name] for name in STRAINS])
    return case | {"path": {"waypoints": [begin, dict(zip(STRAINS, map(float, middle), strict=True)), end]}}


@pytest.mark.slow
def test_a_jump_at_a_waypoint_is_one_point(results, tmp_path):
    path = path_of(results("jump"))
    run(Case.parse(cut(path)), MPI.COMM_SELF, out=tmp_path / "cut")
    other = path_of(tmp_path / "cut")
    assert [(p["broke"], p["closed"]) for p in other] == [(p["broke"], p["closed"]) for p in path]
    assert all(p["broke"] or p["load_factor"] < q["load_factor"] for p, q in itertools.pairwise(other))
    assert verify(tmp_path / "cut").holds


@pytest.mark.parametrize(
    ("before", "may"),
    [
        ({}, [True, False]),
        ({"closed": 4}, [False, False]),
        ({"stress": [1.0, 2.001]}, [False, False]),
        ({"temperature": -49.0}, [False, False]),
        ({"broke": 1}, [False, False]),
        ({"broke": 1, "load_factor": 0.7}, [True, True]),
    ],
    ids=["contact", "no contact", "another stress", "another temperature", "a break", "a cascade"],
)
def test_only_tips_may_be_overloaded_by_contact_and_all_bonds_by_breaks(before, may):
    now = {"load_factor": 0.7, "broke": 1, "closed": 4, "strain": [1.0], "stress": [1.0, 2.0], "temperature": -50.0}
    state = SimpleNamespace(point=1, used=np.array([1.1, 1.1]), released=np.array([True, False]))
    points = [now | {"load_factor": 0.69999, "broke": 0, "closed": 5} | before, now]
    assert check_path.overloaded_by_jump(state, points, 1e-5).tolist() == may
    assert not check_path.overloaded_by_jump(state, [points[0], now | {"broke": 0}], 1e-5).any()
