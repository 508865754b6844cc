"""Numbers along the fibres are those around them where a case gives none: one law for all shear."""

import numpy as np
import pytest

from feti_homog.case.bond_laws import LAWS
from feti_homog.case.interface_section import InterfaceSection
from feti_homog.interface.laws import law_of_sections

NUMBERS = {
    "normal_stiffness": 100.0, "tangential_stiffness": 50.0, "normal_strength": 2.0, "tangential_strength": 1.5,
    "normal_toughness": 0.5, "tangential_toughness": 0.7, "toughness": 0.5, "openings": (0.02, 0.5),
    "tractions": (2.0, 0.0), "teeth": 4,
}  # fmt: skip
AROUND, ALONG = np.array([[0.3, 0.7, 0.0]]), np.array([[0.3, 0.0, 0.7]])


def shares(law, **more):
    """Return what shears around and along a fibre use of its bonds."""
    found = law_of_sections([InterfaceSection(criterion=law, **NUMBERS | more)], np.zeros(1, np.int64))
    return found.share(AROUND)[0], found.share(ALONG)[0]


@pytest.mark.parametrize("law", LAWS)
def test_shear_along_the_fibres_uses_what_it_uses_around_them(law):
    around, along = shares(law)
    assert along == pytest.approx(around, rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_numbers_along_the_fibres_are_their_own_where_they_are_given(law):
    """A strength, or with the root of it the stiffness, four times as large is that of a shear a fourth, or half."""
    has_strength = "axial_strength" in LAWS[law].keys
    key, size = ("axial_strength", 6.0) if has_strength else ("axial_stiffness", 200.0)
    around, along = shares(law, **{key: size})
    assert around == pytest.approx(shares(law)[0])
    found = law_of_sections([InterfaceSection(criterion=law, **NUMBERS)], np.zeros(1, np.int64))
    fewer = np.array([[0.3, 0.0, 0.7 / (4.0 if has_strength else 2.0)]])
    assert along == pytest.approx(found.share(fewer)[0], rel=1e-12)
