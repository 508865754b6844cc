"""Stiffness and expansion in space: fourth-order tensors, closed forms, one form of a material against others."""

import dataclasses

import numpy as np
import pytest
from support.effective_results import PAIRS, Sample, turned_stiffness

from feti_homog.materials.laws import expansion, missing_constants, out_of_plane, plane_stiffness, spatial_stiffness
from feti_homog.materials.material_forms import General, Isotropic, Material, Orthotropic, TransverselyIsotropic

ORTHOTROPIC = Orthotropic(
    E1=140.0, E2=10.0, E3=12.0, nu12=0.3, nu13=0.25, nu23=0.4, G12=5.0, G13=6.0, G23=3.0, expansion=(-0.5, 20.0, 30.0)
)
# of the kind of the carbon fibre AS4, in GPa
AS4 = TransverselyIsotropic(E_axial=235.0, E_transverse=14.0, nu_axial=0.2, nu_transverse=0.25, G_axial=28.0)
ANGLES = [0.0, 30.0, -75.0, 123.0]


def turn(angle: float) -> np.ndarray:
    """(3, 3) whose columns are the material axes, turned about x3."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def compliance(m: Orthotropic) -> np.ndarray:
    """(6, 6) in the material axes."""
    return Sample((m.E1, m.E2, m.E3, m.nu12, m.nu13, m.nu23, m.G12, m.G13, m.G23), None).compliance


def rows(stiffness: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, stiffness.tolist()))


def same_material(young: float, poisson: float) -> list[Material]:
    """Return an isotropic material in all forms, with an expansion of 3."""
    shear, lame = young / (2 * (1 + poisson)), young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    whole = np.diag([2 * shear] * 3 + [shear] * 3)
    whole[:3, :3] += lame
    moduli, ratios = dict.fromkeys(("E1", "E2", "E3"), young), dict.fromkeys(("nu12", "nu13", "nu23"), poisson)
    shears = dict.fromkeys(("G12", "G13", "G23"), shear)
    across = {"E_axial": young, "E_transverse": young, "nu_axial": poisson, "nu_transverse": poisson, "G_axial": shear}
    return [
        Isotropic(young, poisson, 3.0),
        Orthotropic(**moduli, **ratios, **shears, angle=37.0, expansion=(3.0, 3.0, 3.0)),
        TransverselyIsotropic(**across, expansion_axial=3.0, expansion_transverse=3.0),
        TransverselyIsotropic(**across, expansion=3.0),
        TransverselyIsotropic(**across | {"nu_transverse": None, "G_transverse": shear}, expansion=3.0),
        General(rows(whole), 3.0),
    ]


def test_all_forms_of_an_isotropic_material_have_one_law():
    forms = same_material(88.0, 0.299)
    first = forms[0]
    expected = spatial_stiffness(forms[-1])
    for material in forms:
        np.testing.assert_allclose(spatial_stiffness(material), expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(expansion(material), [3.0, 3.0, 3.0, 0.0, 0.0, 0.0], rtol=1e-14, atol=1e-14)
        for plane in ("strain", "stress"):
            own = plane_stiffness(material, plane)
            np.testing.assert_allclose(own, plane_stiffness(first, plane), rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(
                out_of_plane(material, plane), out_of_plane(first, plane), rtol=1e-12, atol=1e-14
            )


def test_a_transversely_isotropic_stiffness_is_that_of_hills_moduli():
    """Hill, J. Mech. Phys. Solids 12 (1964): k, l, n, m and the axial shear modulus."""
    k = 1 / (2 * (1 - AS4.nu_transverse) / AS4.E_transverse - 4 * AS4.nu_axial**2 / AS4.E_axial)
    m = AS4.E_transverse / (2 * (1 + AS4.nu_transverse))
    cross, n = 2 * AS4.nu_axial * k, AS4.E_axial + 4 * AS4.nu_axial**2 * k
    expected = np.diag([0.0, 0.0, 0.0, AS4.G_axial, AS4.G_axial, m])
    expected[:3, :3] = [[k + m, k - m, cross], [k - m, k + m, cross], [cross, cross, n]]
    np.testing.assert_allclose(spatial_stiffness(AS4), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_rotation_is_that_of_the_fourth_order_tensor(angle):
    expected = turned_stiffness(np.linalg.inv(compliance(ORTHOTROPIC)), turn(angle))
    turned = spatial_stiffness(dataclasses.replace(ORTHOTROPIC, angle=angle))
    np.testing.assert_allclose(turned, expected, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("angle", ANGLES)
def test_expansion_turns_as_a_tensor(angle):
    turned = expansion(dataclasses.replace(ORTHOTROPIC, angle=angle))
    expected = turn(angle) @ np.diag(ORTHOTROPIC.expansion) @ turn(angle).T
    own = np.array([expected[i, j] * (1 if i == j else 2) for i, j in PAIRS])
    np.testing.assert_allclose(turned, own, rtol=1e-13, atol=1e-13)


def test_expansions_stand_in_their_places():
    assert list(expansion(dataclasses.replace(AS4, expansion_axial=-0.9, expansion_transverse=9.0))[:3]) == [
        9.0,
        9.0,
        -0.9,
    ]
    assert list(expansion(ORTHOTROPIC)) == [-0.5, 20.0, 30.0, 0.0, 0.0, 0.0]
    assert list(expansion(dataclasses.replace(ORTHOTROPIC, expansion=2.0, angle=90.0))[:3]) == [2.0, 2.0, 2.0]
    assert expansion(General(rows(np.eye(3)), (1.0, 2.0, 3.0)))[2] == 3.0
    assert all(expansion(material) is None for material in (AS4, Isotropic(1.0, 0.2), General(rows(np.eye(3)))))
    assert list(expansion(Isotropic(1.0, 0.2, 0.0))) == [0.0] * 6


@pytest.mark.parametrize("angle", ANGLES)
def test_plane_states_follow_from_the_law_in_space(angle):
    """Plane strain is a block, plane stress has S33 = 0; of the orthotropic form and of the same material as 6x6."""
    turned = dataclasses.replace(ORTHOTROPIC, angle=angle)
    whole = spatial_stiffness(turned)
    plane, strain = [0, 1, 5], np.array([0.3, -0.2, 0.5])
    block = whole[np.ix_(plane, plane)]
    E33 = -whole[2, plane] @ strain / whole[2, 2]
    for material in (turned, General(rows(whole))):
        np.testing.assert_allclose(plane_stiffness(material, "strain"), block, rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(plane_stiffness(material, "generalized"), block, rtol=1e-11, atol=1e-11)
        stress = plane_stiffness(material, "stress") @ strain
        np.testing.assert_allclose(stress, block @ strain + whole[plane, 2] * E33, rtol=1e-11)
        np.testing.assert_allclose(out_of_plane(material, "stress")[1] @ stress, E33, rtol=1e-10)
        S33 = out_of_plane(material, "strain")[0] @ (block @ strain)
        np.testing.assert_allclose(S33, whole[2, plane] @ strain, rtol=1e-10)
        np.testing.assert_array_equal(out_of_plane(material, "stress")[0], 0.0)


def test_constants_that_a_plane_state_does_not_need_may_be_absent():
    sheet = TransverselyIsotropic(E_transverse=14.0, nu_transverse=0.25)
    np.testing.assert_array_equal(plane_stiffness(sheet, "stress"), plane_stiffness(AS4, "stress"))
    assert np.isnan(out_of_plane(sheet, "stress")[1]).all()
    long = dataclasses.replace(AS4, G_axial=None)
    np.testing.assert_array_equal(plane_stiffness(long, "strain"), plane_stiffness(AS4, "strain"))
    np.testing.assert_array_equal(out_of_plane(long, "strain"), out_of_plane(AS4, "strain"))


@pytest.mark.parametrize(
    ("material", "words"),
    [
        (Isotropic(1.0, 0.5), "less than 0.5 in generalized plane strain"),
        (General(rows(np.eye(3))), "^stiffness: expected 6x6 in generalized plane strain"),
    ],
)
def test_what_does_not_say_a_law_in_space_is_refused(material, words):
    with pytest.raises(ValueError, match=words):
        spatial_stiffness(material)


@pytest.mark.parametrize(
    ("form", "names", "plane", "expected"),
    [
        (TransverselyIsotropic, ["E_axial"], "stress", ["nu_transverse, G_transverse: missing; expected one"]),
        (TransverselyIsotropic, ["E_transverse", "G_transverse"], "stress", []),
        (TransverselyIsotropic, ["nu_transverse", "nu_axial"], "strain", ["E_axial: missing; plane strain needs it"]),
        (
            TransverselyIsotropic,
            ["E_axial", "E_transverse"],
            "generalized",
            [
                "nu_transverse, G_transverse: missing; expected one",
                "nu_axial, G_axial: missing; generalized plane strain needs them",
            ],
        ),
        (
            Orthotropic,
            ["E1", "nu13", "G13"],
            "generalized",
            [
                "E3, nu23, G23: missing; generalized plane strain needs them; axis 3 is along the fibres; for data "
                "sheets: E_axial, E_transverse, nu_axial, nu_transverse, G_axial"
            ],
        ),
        (Orthotropic, ["E1"], "stress", []),
        (Isotropic, ["young"], "generalized", []),
    ],
)
def test_all_constants_that_a_plane_state_lacks_are_named(form, names, plane, expected):
    assert missing_constants(form, names, plane) == expected


def is_refused(material: Material) -> bool:
    try:
        spatial_stiffness(material)
    except ValueError:
        return True
    return False


def test_orthotropic_constants_are_refused_where_their_compliance_has_a_negative_eigenvalue():
    random = np.random.default_rng(5)
    refused = []
    for _ in range(400):
        E1, E2, E3, G12, G13, G23 = random.uniform(0.2, 5.0, 6)
        nu12, nu13, nu23 = random.uniform(-1.2, 1.2, 3)
        material = Orthotropic(E1=E1, E2=E2, E3=E3, nu12=nu12, nu13=nu13, nu23=nu23, G12=G12, G13=G13, G23=G23)
        refused.append(is_refused(material))
        assert refused[-1] == (np.linalg.eigvalsh(compliance(material)).min() <= 0.0)
    assert 100 < sum(refused) < 300


def test_transversely_isotropic_constants_are_refused_where_their_compliance_has_a_negative_eigenvalue():
    random = np.random.default_rng(6)
    refused = []
    for _ in range(400):
        E_axial, E_transverse = random.uniform(0.2, 5.0, 2)
        nu_axial, nu_transverse = random.uniform(-1.5, 1.5), random.uniform(-0.99, 0.99)
        material = TransverselyIsotropic(
            E_axial=E_axial, E_transverse=E_transverse, nu_axial=nu_axial, nu_transverse=nu_transverse, G_axial=1.0
        )
        refused.append(is_refused(material))
        minor = -nu_axial / E_axial
        normal = np.array(
            [
                [1 / E_transverse, -nu_transverse / E_transverse, minor],
                [-nu_transverse / E_transverse, 1 / E_transverse, minor],
                [minor, minor, 1 / E_axial],
            ]
        )
        assert refused[-1] == (np.linalg.eigvalsh(normal).min() <= 0.0)
    assert 100 < sum(refused) < 300


def test_a_stiffness_is_refused_where_an_eigenvalue_is_negative():
    random = np.random.default_rng(7)
    refused = []
    for _ in range(200):
        given = np.zeros((6, 6))
        for places in ([0, 1, 2, 5], [3, 4]):
            half = random.normal(size=(len(places), len(places)))
            given[np.ix_(places, places)] = half @ half.T + random.uniform(-1.0, 0.5) * np.eye(len(places))
        refused.append(is_refused(General(rows(given))))
        assert refused[-1] == (np.linalg.eigvalsh(given).min() <= 0.0)
    assert 40 < sum(refused) < 180


@pytest.mark.parametrize("entry", ["C14", "C15", "C24", "C25", "C34", "C35", "C46", "C56"])
def test_a_coupling_to_the_shears_along_x3_is_refused_by_its_name(entry):
    i, j = int(entry[1]) - 1, int(entry[2]) - 1
    given = 10.0 * np.eye(6)
    given[i, j] = given[j, i] = -0.25
    for plane in ("strain", "stress"):
        with pytest.raises(ValueError, match=rf"^stiffness: {entry} = -0.25: expected 0; x3 must be normal"):
            plane_stiffness(General(rows(given)), plane)
    given[i, j] = given[j, i] = 1e-12
    np.testing.assert_array_equal(spatial_stiffness(General(rows(given))), 10.0 * np.eye(6))
