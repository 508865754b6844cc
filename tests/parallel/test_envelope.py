"""Onsets of debonding in a plane of loads, against paths, closed forms and laws, at any number of ranks."""

from __future__ import annotations

import numpy as np
import pytest
from support.envelopes import ENERGY, MAX, QUADRATIC, envelope, path_onset, torn
from support.ranks import parallel_assert

from feti_homog.mechanics.voigt import STRAINS

pytestmark = pytest.mark.parallel

RANDOM = {
    "cell": {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "fibre_fraction": 0.4, "mesh_size": 0.2}
}
ARC = {"contact": False, "debonded": [{"fibre": 1, "centre": 20.0, "angle": 50.0}]}


def onsets(result, names, field):
    """(n, 2) the components at onset of the directions that have one."""
    columns = [field.index(name) for name in names]
    values = [(point.strain if field == STRAINS else point.stress)[columns] for point in result.envelope]
    return np.array(values)


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("bonds", [MAX, QUADRATIC, ENERGY], ids=["max", "quadratic", "energy"])
def test_onsets_are_the_first_events_of_paths(comm, plane, bonds):
    result = envelope(comm, plane, bonds, ["E11", "gamma12"], RANDOM, directions=12)
    with torn(comm, plane, bonds, **RANDOM) as cell:
        for point in result.envelope:
            angle = np.radians(point.angle)
            factor, stress = path_onset(cell, np.array([np.cos(angle), 0.0, np.sin(angle)]))
            parallel_assert(comm, abs(point.factor / factor - 1) < 1e-9, f"{point.angle}")
            parallel_assert(comm, np.abs(point.stress - stress).max() < 1e-9 * np.abs(stress).max())
