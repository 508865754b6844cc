"""Results that make a material, and those that are refused."""

import numpy as np
import pytest
from support.effective_results import BORON_ALUMINIUM, COSINES, DISTINCT, changed, document, turned_stiffness

from feti_homog.errors import CaseError
from feti_homog.report.cards.effective_material import (
    NEGLIGIBLE,
    in_axes_of_the_cell,
    nearest_transversely_isotropic,
)

both = pytest.mark.parametrize("reading", [in_axes_of_the_cell, nearest_transversely_isotropic])


def coupled(size):
    """Return the entries 16 and 45 of a stiffness are this part of sqrt(C_ii C_jj)."""
    C = DISTINCT.stiffness_in_the_cell
    C[0, 5] = C[5, 0] = size * np.sqrt(C[0, 0] * C[5, 5])
    C[3, 4] = C[4, 3] = -size * np.sqrt(C[3, 3] * C[4, 4])
    return C


def test_negligible_couplings_are_left_out_and_constants_are_those_of_the_compliance():
    C = coupled(0.9 * NEGLIGIBLE)
    material = in_axes_of_the_cell(document(DISTINCT, effective_stiffness=C))
    S = np.linalg.inv(C)
    assert material.is_orthotropic and material.symmetry.startswith("Orthotropic; couplings of shears of up to 0.0009 ")
    assert material.constants["E2"] == pytest.approx(1 / S[0, 0], rel=1e-13)
    assert material.constants["G23"] == pytest.approx(1 / S[5, 5], rel=1e-13)


@pytest.mark.parametrize("form", ["in_axes", "expansion"])
def test_other_couplings_are_kept(form):
    more = {"effective_stiffness": coupled(1.1 * NEGLIGIBLE)}
    if form == "expansion":
        more = {"thermal_expansion": [1e-5, 1e-5, 2e-5, 0.0, 0.0, 3e-8]}
    material = in_axes_of_the_cell(document(DISTINCT, **more))
    assert not material.is_orthotropic and material.symmetry.startswith("Not orthotropic in these axes")
    C = more.get("effective_stiffness", DISTINCT.stiffness_in_the_cell)
    assert np.abs(material.stiffness - turned_stiffness(C, COSINES.T)).max() < 1e-12 * np.abs(C).max()


def test_the_antisymmetric_part_of_the_solution_is_left_out():
    C = BORON_ALUMINIUM.stiffness_in_the_cell
    C[0, 1] += 2e-7
    material = in_axes_of_the_cell(document(BORON_ALUMINIUM, effective_stiffness=C))
    assert np.array_equal(material.stiffness, material.stiffness.T)
    assert material.stiffness[1, 2] == pytest.approx(C[1, 0] + 1e-7, abs=1e-9)


def test_transversely_isotropic_material_is_isotropic_across_the_fibre():
    material = nearest_transversely_isotropic(document(DISTINCT))
    cosines = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    turned = turned_stiffness(material.stiffness, cosines)
    assert np.abs(turned - material.stiffness).max() < 1e-14 * np.abs(turned).max()
    first = "The nearest transversely isotropic material, at a relative distance of 0.01."
    assert material.symmetry == first
    ranges = {"E_least": 8092.0, "E_largest": 9419.0, "G_least": 2945.0, "G_largest": 3742.0}
    material = nearest_transversely_isotropic(document(DISTINCT, transverse_moduli=ranges))
    more = "the cell has E from 8092 to 9419, G from 2945 to 3742."
    assert material.symmetry == f"{first} Over all directions across the fibres {more}"


@both
def test_expansions_need_not_be_there(reading):
    zero = in_axes_of_the_cell(document(DISTINCT, thermal_expansion=np.zeros(6))).expansion
    assert zero is not None and not zero.any()
    sample = document(type(DISTINCT)(DISTINCT.constants, None))
    assert reading(sample).expansion is None
    assert reading(sample | {"thermal_expansion": None}).expansion is None


@both
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"status": "not converged", "faults": ["a", "b"]},
            r'its status is "not converged": a \(and 1 more\); run the',
        ),
        ({"effective_stiffness_compression": np.eye(6)}, "its debonded faces touch .*; cards are of linear materials"),
        ({"effective_stiffness": -np.eye(6)}, "is not positive definite; cards are of stable materials"),
        ({"effective_stiffness": None}, 'analysis.type = "stiffness" has no effective stiffness'),
        (
            {"case": changed(document(DISTINCT), "analysis", type="path")["case"], "effective_stiffness": None},
            r'analysis.type = "path" has no effective stiffness; cards need "stiffness"',
        ),
    ],
)
def test_results_without_a_linear_stable_material_are_refused(reading, more, words):
    with pytest.raises(CaseError, match=words):
        reading(document(DISTINCT, **more))


@both
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_constants_of_the_plane_are_refused(reading, plane):
    plain = changed(document(DISTINCT), "analysis", plane=plane) | {"effective_stiffness": np.eye(3)}
    words = f'plane = "{plane}" gives constants of the plane; cards need plane = "generalized"'
    with pytest.raises(CaseError, match=words):
        reading(plain)
