"""Envelopes in which one number is false break the laws that they must break."""

import pytest
from support.falsifications import broken
from support.verified_results import falsified

pytestmark = pytest.mark.slow

STRESS, ENERGY, SPACE = "envelope", "envelope by energy", "envelope in space"


def onset_by(share):
    """All of the load at onset, so that it stays in the plane."""

    def edit(document, _):
        point = document["envelope"][3]
        for name in ("strain", "stress"):
            point[name] = [share * value for value in point[name]]
        point["factor"] *= share

    return edit


def entry(name, change, number=1):
    def edit(document, _):
        document["envelope"][number][name] = change(document["envelope"][number][name])

    return edit


def component(name, place, by):
    def edit(document, _):
        vector = document["envelope"][2][name]
        vector[place] += by * max(map(abs, vector))

    return edit


def no_onset(document, _):
    document["envelope"][5] = {"angle": document["envelope"][5]["angle"]}


def one_direction_less(document, _):
    del document["envelope"][-1]


FALSIFICATIONS = {
    "a load a little larger": (STRESS, onset_by(1 + 1e-6), {"onset"}),
    "a load a little smaller": (STRESS, onset_by(1 - 1e-6), {"onset"}),
    "a factor": (STRESS, entry("factor", lambda v: v * (1 + 1e-6)), {"load"}),
    "a strain of stresses": (STRESS, component("strain", 0, 1e-6), {"load", "onset"}),
    "a stress that is not named": (STRESS, component("stress", 0, 1e-6), {"load"}),
    "a direction": (STRESS, entry("angle", lambda v: v + 1e-6), {"load"}),
    "another bond": (STRESS, entry("bond_angle", lambda v: v + 1.0), {"tables"}),
    "another share": (STRESS, entry("tangential", lambda v: v + 1e-6), {"onset"}),
    "no onset": (STRESS, no_onset, {"onset"}),
    "one less": (STRESS, one_direction_less, {"load"}),
    "too large a load of tips": (ENERGY, onset_by(10.0), {"onset"}),
    "another mode": (ENERGY, entry("psi", lambda v: v + 1e-4), {"onset"}),
    "a load in space": (SPACE, onset_by(1 + 1e-6), {"load", "onset"}),
    "a share along the fibre": (SPACE, entry("axial", lambda v: v + 1e-6), {"onset"}),
    "a strain in space": (SPACE, component("strain", 3, 1e-6), {"load"}),
}


@pytest.mark.parametrize("name", FALSIFICATIONS)
def test_one_false_number_is_found(results, tmp_path, name):
    kind, edit, laws = FALSIFICATIONS[name]
    found = broken(falsified(results(kind), tmp_path / "copy", edit))
    assert found >= laws, found
