"""Derivatives of the laws of phases against central differences of the laws, and of the constants of composites."""

from dataclasses import replace

import numpy as np
import pytest

from feti_homog.materials.engineering_constants import (
    constants,
    engineering_constants,
    engineering_moduli,
    transversely_isotropic_part,
)
from feti_homog.materials.laws import expansion, spatial_stiffness, stiffness_of
from feti_homog.materials.material_derivatives import constant_changes, law_changes
from feti_homog.materials.material_forms import General, Isotropic, Orthotropic, TransverselyIsotropic

TURNED = Orthotropic(
    E1=20.0, E2=9.0, E3=30.0, nu12=0.2, nu13=0.1, nu23=0.15, G12=5.0, G13=4.0, G23=6.0, angle=33.0,
    expansion=(1e-6, 5e-6, 3e-6),
)  # fmt: skip
PHASES = {
    "isotropic": Isotropic(young=3.45, poisson=0.35, expansion=5e-5),
    "nearly incompressible": Isotropic(young=3.45, poisson=0.4999),
    "turned": TURNED,
    "carbon": TransverselyIsotropic(
        E_axial=230.0, E_transverse=15.0, nu_axial=0.2, nu_transverse=0.07, G_axial=24.0, expansion_axial=-5e-7,
        expansion_transverse=7e-6,
    ),
    "general": General(stiffness=tuple(map(tuple, spatial_stiffness(TURNED).tolist())), expansion=(1e-6, 2e-6, 3e-6)),
    "in the plane": General(stiffness=((10.0, 2.0, 0.5), (2.0, 8.0, 0.1), (0.5, 0.1, 3.0))),
    "sheet": TransverselyIsotropic(E_transverse=14.0, nu_transverse=-0.25),
    "by shears": TransverselyIsotropic(E_axial=230.0, E_transverse=15.0, nu_axial=0.2, G_transverse=7.0, G_axial=24.0),
}  # fmt: skip
PLANES = {"in the plane": ("strain", "stress"), "sheet": ("stress",)}
CASES = [(name, plane) for name in PHASES for plane in PLANES.get(name, ("strain", "stress", "generalized"))]


def moved(material, name, step):
    """Return the material with another value of a constant."""
    key, _, place = name.partition(".")
    value = getattr(material, key)
    if key == "stiffness":
        i, j = int(place[1]) - 1, int(place[2]) - 1
        rows = np.array(value)
        rows[i, j] += step
        rows[j, i] = rows[i, j]
        return replace(material, stiffness=tuple(map(tuple, rows.tolist())))
    if place:
        return replace(material, expansion=tuple(np.array(value) + step * np.eye(3)[int(place) - 1]))
    return replace(material, **{key: value + step})


def slope(function, step):
    """Central differences, extrapolated."""
    once, twice = ((function(h) - function(-h)) / (2 * h) for h in (step, step / 2))
    return (4 * twice - once) / 3


@pytest.mark.parametrize(("name", "plane"), CASES, ids=str)
def test_derivatives_of_laws_are_their_slopes(name, plane):
    material = PHASES[name]
    size = np.abs(stiffness_of(material, plane)).max()
    changes = list(law_changes(material, plane))
    assert len({change.name for change in changes}) == len(changes) > 1
    for change in changes:
        step = 1e-4 * (abs(change.value) or 1.0) * (0.05 if material.__class__ is Isotropic else 1.0)
        expected = slope(lambda h, to=change.name: stiffness_of(moved(material, to, h), plane), step)
        np.testing.assert_allclose(change.stiffness, expected, rtol=2e-7, atol=1e-9 * size / abs(change.value))
        if expansion(material) is not None:
            expected = slope(lambda h, to=change.name: expansion(moved(material, to, h)), step)
            np.testing.assert_allclose(change.expansion, expected, rtol=1e-7, atol=1e-9)


def test_every_given_constant_has_a_derivative():
    assert [change.name for change in law_changes(PHASES["carbon"], "generalized")] == [
        "E_axial", "E_transverse", "nu_axial", "nu_transverse", "G_axial", "expansion_axial", "expansion_transverse",
    ]  # fmt: skip
    entries = [change.name for change in law_changes(PHASES["in the plane"], "strain")]
    assert entries == [f"stiffness.C{pair}" for pair in ("11", "12", "13", "22", "23", "33")]
    assert sum(change.name.startswith("stiffness") for change in law_changes(PHASES["general"], "generalized")) == 13
    assert [change.name for change in law_changes(PHASES["sheet"], "stress")] == ["E_transverse", "nu_transverse"]
    by_shears = [change.name for change in law_changes(PHASES["by shears"], "strain")]
    assert by_shears == ["E_axial", "E_transverse", "nu_axial", "G_transverse", "G_axial"]


def test_constants_of_composites_are_those_of_results():
    C = spatial_stiffness(TURNED)
    strains = expansion(TURNED)
    found = constants(C, -C @ strains)
    records = (
        engineering_constants(C),
        transversely_isotropic_part(C, strains),
        engineering_moduli(stiffness_of(TURNED, "strain")),
    )
    expected = vars(records[0]) | vars(records[1])
    shared = found.keys() & expected.keys()
    assert len(shared) == 18
    for name in shared:
        assert found[name] == pytest.approx(expected[name], rel=1e-12)
    assert [found[f"expansion_{axis}"] for axis in ("x1", "x2", "axial")] == pytest.approx(strains[:3], rel=1e-12)
    in_plane = constants(stiffness_of(TURNED, "strain"), None)
    for name in ("E1", "E2", "nu12", "nu21", "G12"):
        assert in_plane[name] == pytest.approx(getattr(records[2], name), rel=1e-12)


def test_changes_of_constants_are_their_slopes():
    C, thermal = spatial_stiffness(TURNED), -spatial_stiffness(TURNED) @ expansion(TURNED)
    other = spatial_stiffness(PHASES["carbon"])
    found = constant_changes(C, thermal, other, 0.1 * thermal)
    names = found.keys()
    expected = slope(lambda h: np.array([*constants(C + h * other, thermal * (1 + 0.1 * h)).values()]), 1e-4)
    np.testing.assert_allclose([found[name] for name in names], expected, rtol=1e-7, atol=1e-12)
