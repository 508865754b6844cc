"""The certificate's own plane stiffnesses, by way of three dimensions, are those of the solver's elements."""

from __future__ import annotations

import numpy as np
import pytest
from support.verified_results import FIBRE, MATRIX, TURNED

from feti_homog.config.case import parse
from feti_homog.config.materials import plane_stiffness
from feti_homog.errors import CaseError
from feti_homog.verification.constitutive_law import plane_stiffnesses

GENERAL = {"stiffness": [[10.0, 2.0, 0.5], [2.0, 8.0, 0.1], [0.5, 0.1, 3.0]]}
IN_PLANE = {"E1": 15.0, "E2": 230.0, "nu12": 0.013, "G12": 25.0, "angle": 30.0}
STIFF = {"E1": 2.0, "E2": 9.0, "E3": 4.0, "nu12": -0.2, "nu13": 0.4, "nu23": 0.3, "G12": 1.0, "angle": -73.0}


@pytest.mark.parametrize("plane", ["strain", "stress"])
@pytest.mark.parametrize("fibre", [FIBRE, TURNED, STIFF, GENERAL, IN_PLANE], ids=str)
def test_both_ways_to_a_plane_stiffness_agree(tmp_path, fibre, plane):
    if plane == "strain" and fibre is IN_PLANE:
        pytest.skip("plane strain needs constants out of the plane")
    document = {
        "cell": {"geometry": "square", "fibre_fraction": 0.3},
        "material": {"matrix": MATRIX, "fibre": fibre},
        "analysis": {"type": "stiffness", "plane": plane},
    }
    case = parse(document, tmp_path)
    own = plane_stiffnesses(case.resolved(), ["matrix", "fibre", "fibre:2"])
    for stiffness, phase in zip(own, ("matrix", "fibre", "fibre"), strict=True):
        expected = plane_stiffness(case.material_of(phase), plane)
        assert np.abs(stiffness - expected).max() < 1e-13 * np.abs(expected).max()


def test_a_phase_without_material_is_told():
    case = {"material": {"matrix": MATRIX}, "analysis": {"plane": "strain"}}
    with pytest.raises(CaseError, match="no material for the phase fibre"):
        plane_stiffnesses(case, ["matrix", "fibre"])
