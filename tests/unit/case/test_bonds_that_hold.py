"""A debonded arc on a fibre with strong bonds, beside fibres with a cohesive law."""

import itertools

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog import Case, CaseError, run
from feti_homog.verify import certificate

GLASS = {
    "between": ["glass", "matrix"],
    "law": "bilinear",
    "normal_stiffness": 2e6,
    "tangential_stiffness": 2e6,
    "normal_strength": 50.0,
    "tangential_strength": 50.0,
    "normal_toughness": 0.001,
    "tangential_toughness": 0.001,
    "teeth": 1,
}
ARC = {"between": ["carbon", "matrix"], "debonded": [{"fibre": 1, "angle": 90.0}]}
FIBRES = [
    {"x": 0.3, "y": 0.3, "radius": 0.18, "phase": "carbon"},
    {"x": 0.72, "y": 0.7, "radius": 0.18, "phase": "glass"},
]


def case_of(carbon):
    """Return the path of a cell with two fibres, by the interface of the carbon fibre."""
    moduli = {"matrix": (3500.0, 0.35), "carbon": (15000.0, 0.25), "glass": (74000.0, 0.2)}
    return Case.parse({
        "cell": {"geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.15, "fibre_list": FIBRES},
        "material": {name: {"young": E, "poisson": nu} for name, (E, nu) in moduli.items()},
        "analysis": {"type": "path", "plane": "strain"},
        "path": {"strain": [0.02, 0.0, 0.0]},
        "interface": [GLASS, carbon],
        "output": {"pictures": False, "mesh_error": False},
    })  # fmt: skip


def test_a_pair_without_the_law_is_told_how_its_bonds_hold():
    words = "normal_strength: missing; .*; bonds that hold have normal_strength = inf, tangential_strength = inf, and"
    with pytest.raises(CaseError, match=words):
        case_of(ARC | {"law": "bilinear"})


def test_such_bonds_hold_beside_an_arc():
    strengths = dict.fromkeys(("normal_strength", "tangential_strength"), 100.0 * GLASS["normal_strength"])
    toughnesses = dict.fromkeys(("normal_toughness", "tangential_toughness"), 1e4 * GLASS["normal_toughness"])
    result = run(case_of(GLASS | strengths | toughnesses | ARC), MPI.COMM_SELF)
    shares = [point.debonded_shares for point in result.path]
    assert shares[-1][0] > 0.3 and all(share[1] == shares[0][1] > 0.1 for share in shares)


UNLIMITED = ARC | {"law": "bilinear", "normal_strength": float("inf"), "tangential_strength": "inf"}


def test_unlimited_strengths_hold_as_rigid_bonds_do(tmp_path):
    """The limit of a million times the stiffnesses and strengths."""
    names = [name for name in GLASS if name.endswith(("stiffness", "strength", "toughness"))]
    strong = GLASS | {name: 1e6 * GLASS[name] for name in names} | ARC
    found = run(case_of(UNLIMITED | {"teeth": 1}), MPI.COMM_SELF, out=tmp_path)
    expected = run(case_of(strong), MPI.COMM_SELF)
    paths = [np.array([point.stress for point in result.path]) for result in (found, expected)]
    assert np.abs(paths[0] - paths[1]).max() < 2e-5 * np.abs(paths[1]).max()
    assert [point.broke for point in found.path] == [point.broke for point in expected.path]
    assert certificate.verify(tmp_path).holds


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"normal_stiffness": 2e6}, 'normal_strength: law = "bilinear" needs a finite one'),
        ({"normal_strength": 5.0}, "normal_toughness: missing"),
        ({"teeth": 2}, "teeth = 2: expected 1"),
    ],
)
def test_unlimited_strengths_have_no_other_constants(change, words):
    with pytest.raises(CaseError, match=words):
        case_of(UNLIMITED | {"teeth": 1} | change)


def test_bonds_that_hold_are_no_strengths_in_another_unit():
    numbers = {"strength": 5e4, "toughness": 1e3}
    wrong = GLASS | {f"{mode}_{name}": numbers[name] for mode in ("normal", "tangential") for name in numbers}
    for glass, count in ((GLASS, 0), (wrong, 2)):
        for sections in itertools.permutations([glass, UNLIMITED | {"teeth": 1}]):
            document = case_of(GLASS | ARC).resolved() | {"interface": list(sections)}
            assert len(Case.parse(document).warnings()) == count


def test_bonds_hold_only_beside_bonds_that_break():
    with pytest.raises(CaseError, match='tangential_strength: law = "bilinear" needs a finite one'):
        Case.parse(case_of(GLASS | ARC).resolved() | {"interface": UNLIMITED})
