"""Utilisations of phase strengths: 1 at each strength, in proportion to the stress, and by hand beyond."""

import numpy as np
import pytest
from support.cases import MATRIX, case_of

from feti_homog.errors import CaseError
from feti_homog.materials import voigt
from feti_homog.materials.material_forms import PhaseStrength, utilisation

HASHIN = {
    "axial_tension": 3500.0, "axial_compression": 2500.0, "axial_shear": 80.0, "transverse_tension": 60.0,
    "transverse_compression": 150.0, "transverse_shear": 70.0,
}  # fmt: skip
PAIR = {"tension": 80.0, "compression": 120.0}
AXIAL, ACROSS, AXIAL_SHEAR, SHEAR = [0, 0, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0], [0, 0, 0, 0.6, 0.8, 0], [0, 0, 0, 0, 0, 1]


def used(keys, stress):
    rows = np.atleast_2d(np.asarray(stress, float))
    in_plane, S33, shears = rows[:, voigt.IN_PLANE], rows[:, 2], rows[:, [3, 4]]
    principal = voigt.spatial_principal(in_plane, S33, shears)[:, 0]
    von_mises = voigt.spatial_von_mises(in_plane, S33, shears)
    modes = utilisation(PhaseStrength(**keys), rows, principal, von_mises)[0]
    assert len(modes) == (4 if keys == HASHIN else 1)
    return modes.max()


@pytest.mark.parametrize(
    ("keys", "stress"),
    [
        ({"principal": 80.0}, [80.0, -50.0, 10.0, 0.0, 0.0, 0.0]),
        ({"von_mises": 80.0}, [0.0, 0.0, 0.0, 0.0, 0.0, 80.0 / np.sqrt(3)]),
        (PAIR, [80.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
        (PAIR, [0.0, 0.0, -120.0, 0.0, 0.0, 0.0]),
        (HASHIN, np.multiply(AXIAL, 3500.0)),
        (HASHIN, np.multiply(AXIAL, -2500.0)),
        (HASHIN, np.multiply(AXIAL_SHEAR, 80.0)),
        (HASHIN, np.multiply(ACROSS, 60.0)),
        (HASHIN, np.multiply(ACROSS, -150.0)),
        (HASHIN, np.multiply(SHEAR, 70.0)),
    ],
)
def test_failure_is_at_the_strength_and_the_utilisation_grows_with_the_load(keys, stress):
    assert used(keys, stress) == pytest.approx(1.0, rel=1e-12)
    assert used(keys, np.multiply(stress, 0.37)) == pytest.approx(0.37, rel=1e-12)


def test_equal_strengths_are_von_mises_and_all_round_pressure_breaks_nothing():
    stress = [10.0, -30.0, 25.0, 4.0, -6.0, 12.0]
    assert used({"tension": 50.0, "compression": 50.0}, stress) == pytest.approx(used({"von_mises": 50.0}, stress))
    assert used(PAIR, [-200.0, -200.0, -200.0, 0.0, 0.0, 0.0]) == 0.0


def test_hashin_at_a_combination_of_stresses():
    """S11 = -90, S22 = -30, S12 = 20, S13 = 24 at 1 / f: the compressive transverse mode of Hashin's Eq. (19)."""
    stress = np.array([-90.0, -30.0, 0.0, 0.0, 24.0, 20.0])
    factor = 1.0 / used(HASHIN, stress)
    S11, S22, _, _, S13, S12 = factor * stress
    mode = ((150.0 / 140.0) ** 2 - 1.0) * (S11 + S22) / 150.0 + ((S11 + S22) / 140.0) ** 2
    mode += (S12**2 - S11 * S22) / 70.0**2 + (S13 / 80.0) ** 2
    assert mode == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("keys", [{"tension": 80.0}, {"principal": 80.0, "von_mises": 90.0}, {"axial_tension": 1.0}])
def test_the_keys_of_one_criterion_are_needed(keys):
    materials = {"matrix": MATRIX | {"strength": keys}, "fibre": MATRIX}
    fault = r"\[material.matrix\] strength: .*: expected the keys of one criterion"
    with pytest.raises(CaseError, match=fault) as caught:
        case_of({"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3}, material=materials)
    hint = f". With {next(iter(keys))} alone write principal, or add the other keys of its criterion"
    assert [fault.endswith(hint) for fault in caught.value.faults] == [len(keys) == 1]
