"""Numbers of fibres and sizes of cells of several phases, against trying them out, and what is wrong with a mix."""

import math
from fractions import Fraction
from itertools import product

import pytest
from support import cases

from feti_homog.case.cases import Case
from feti_homog.case.cell_section import Cell
from feti_homog.case.cell_sizes import fibre_counts, mixed_width
from feti_homog.errors import CaseError

MIX = {"glass": 0.3, "carbon": 0.25}
RADII = {"glass": 6.0, "carbon": 3.5}
PHASE = {"young": 70.0, "poisson": 0.2}


def case_of(*phases: str, **cell: object) -> Case:
    materials = dict.fromkeys(["matrix", *(phases or ("glass", "carbon"))], PHASE)
    return cases.case_of({"geometry": "random", "mesh_size": 0.1} | cell, material=materials)


def cell_of(**keys) -> Cell:
    return Cell(geometry="random", **keys)


@pytest.mark.parametrize("fibres", [2, 3, 7, 20, 61])
def test_numbers_are_the_whole_ones_next_to_those_that_fractions_and_radii_make(fibres):
    """The rule of Sainte-Lague makes sum (n_p - e_p)^2 / e_p least, of all numbers with the sum N and one of each."""
    mix, radii = MIX | {"boron": 0.04}, RADII | {"boron": 7.0}
    if fibres < 3:
        mix, radii = MIX, RADII
    density = {phase: Fraction(mix[phase]) / Fraction(radii[phase]) ** 2 for phase in sorted(mix)}
    whole = sum(density.values())
    expected = [fibres * density[phase] / whole for phase in density]
    choices = [n for n in product(range(1, fibres + 1), repeat=len(mix)) if sum(n) == fibres]
    best = min(choices, key=lambda n: sum((own - e) ** 2 / e for own, e in zip(n, expected, strict=True)))
    assert fibre_counts(cell_of(fibres=fibres, mix=mix, radii=radii)) == dict(zip(density, best, strict=True))


def test_numbers_of_one_phase_and_of_equal_radii():
    assert fibre_counts(cell_of(fibres=9, fibre_fraction=0.4)) == {"fibre": 9}
    assert fibre_counts(cell_of(fibres=1, mix={"glass": 0.4})) == {"glass": 1}
    own = fibre_counts(cell_of(fibres=30, mix=MIX))
    assert own == fibre_counts(cell_of(fibres=30, mix=MIX, radii={"glass": 1e-6, "carbon": 1e-6}))
    assert own == {"carbon": 14, "glass": 16}


def test_width_and_number_follow_from_each_other():
    by_number = cell_of(fibres=40, mix=MIX, radii=RADII)
    width = mixed_width(by_number)
    counts = fibre_counts(by_number)
    areas = {phase: count * math.pi * RADII[phase] ** 2 / width**2 for phase, count in counts.items()}
    assert sum(areas.values()) == pytest.approx(0.55, rel=1e-14)
    assert all(abs(areas[phase] - share) < math.pi * RADII[phase] ** 2 / width**2 for phase, share in MIX.items())
    assert fibre_counts(cell_of(width=width, mix=MIX, radii=RADII)) == counts


def test_the_order_of_phases_does_not_matter():
    turned = {phase: MIX[phase] for phase in reversed(MIX)}
    first, second = (case_of(fibres=5, mix=mix) for mix in (MIX, turned))
    assert first == second and first.digest() == second.digest()
    assert list(first.cell.fractions) == list(second.cell.fractions)


def test_resolved_cases_are_cases():
    for keys in (
        {"fibres": 5},
        {"fibres": 5, "width": 3.0},
        {"fibres": 9, "radii": RADII},
        {"width": 60.0, "radii": RADII},
    ):
        case = case_of(mix=MIX, **keys)
        assert Case.parse(case.resolved()) == case


FAULTS = {
    "fraction too": ({"fibres": 9, "mix": MIX, "fibre_fraction": 0.5}, "fibre_fraction, mix: exclude each other"),
    "match too": ({"fibres": 9, "mix": MIX, "match": "t.csv"}, "[cell] match, mix: exclude each other; give one"),
    "no number": ({"mix": MIX}, "[cell] fibres: missing; expected an integer at least 1 and at most 100000"),
    "no size": ({"mix": MIX, "radii": RADII}, "100000, or the width of the cell"),
    "two sizes": (
        {"mix": MIX, "radii": RADII, "fibres": 9, "width": 60.0},
        "[cell] fibres, width: exclude each other beside radii; one follows from the other",
    ),
    "mean radius too": (
        {"mix": MIX, "radii": RADII, "fibres": 9, "fibre_radius": 4.0}, "[cell] fibre_radius, radii: exclude each other"
    ),
    "no mix": ({"fibres": 9, "fibre_fraction": 0.5, "radii": RADII}, "[cell] radii: belongs to mix, which is missing"),
    "lattice": ({"geometry": "square", "mix": MIX}, "carbon = 0.25}: belongs to geometry = "),
    "no fraction": ({"fibres": 9, "mix": {"glass": 0.3, "carbon": 0.0}}, "carbon = 0.0}: expected a table by phase"),
    "nothing": ({"fibres": 9, "mix": {}}, "[cell] mix = {}: expected a table by phase"),
    "of matrix": ({"fibres": 9, "mix": {"glass": 0.3, "matrix": 0.2}}, "without matrix, coating and void"),
    "no table": ({"fibres": 9, "mix": [0.3, 0.25]}, "[cell] mix = [0.3, 0.25]: expected a table by phase"),
    "radius of none": ({"mix": MIX, "fibres": 9, "radii": {"glass": 1, "carbon": 0}}, "of numbers from 1e-9 to 1e9"),
}  # fmt: skip
BETWEEN_NUMBERS = {
    "full": ({"fibres": 9, "mix": {"glass": 0.6, "carbon": 0.4}}, "carbon = 0.4}: expected a sum below 1"),
    "radius missing": (
        {"fibres": 9, "mix": MIX, "radii": {"glass": 6.0}},
        "[cell] radii = {glass = 6.0}: expected a radius of each of mix: glass, carbon",
    ),
    "radius of another": (
        {"fibres": 9, "mix": MIX, "radii": RADII | {"boron": 1.0}},
        "expected a radius of each of mix",
    ),
    "less than half a fibre": (
        {"width": 5.0, "mix": MIX, "radii": RADII},
        "makes 0.066 fibres of glass; expected at least 0.5: give more fibres or a wider cell",
    ),
}


@pytest.mark.parametrize("name", FAULTS | BETWEEN_NUMBERS)
def test_faults_of_mixes(name):
    cell, words = (FAULTS | BETWEEN_NUMBERS)[name]
    with pytest.raises(CaseError) as caught:
        case_of(**cell)
    assert any(words in fault for fault in caught.value.faults), caught.value.faults
    assert all(len(fault.splitlines()) == 1 for fault in caught.value.faults)


@pytest.mark.parametrize(
    ("phases", "fault"),
    [
        (("glass",), "[material.carbon]: missing section"),
        (
            ("glass", "carbon", "fibre"),
            "[material.fibre]: unknown phase; expected one of matrix, glass, carbon, coating",
        ),
        (("glass", "carbon", "coating"), "[material.coating]: no fibre has a coating"),
    ],
)
def test_each_phase_of_a_mix_has_its_material(phases, fault):
    with pytest.raises(CaseError) as caught:
        case_of(*phases, fibres=9, mix=MIX)
    assert any(fault in line for line in caught.value.faults), caught.value.faults
