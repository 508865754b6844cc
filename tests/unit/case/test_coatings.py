"""Coatings in a case file, and their faults."""

import pytest
from support import cases

from feti_homog.case.cases import Case
from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh.arrange import arrange

MATERIAL = {"young": 1.0, "poisson": 0.3}
SQUARE = {"geometry": "square", "fibre_fraction": 0.5, "coating": 0.1}
BARE = {"geometry": "square", "fibre_fraction": 0.5}


def case_of(cell: dict, *phases: str) -> Case:
    return cases.case_of(cell, material=dict.fromkeys(["matrix", "fibre", *phases], MATERIAL))


def listed(*coatings: float | None, **cell: object) -> dict:
    entries = [
        {"x": 3.0 * k, "y": 1.0, "radius": 1.0} | ({} if coating is None else {"coating": coating})
        for k, coating in enumerate(coatings)
    ]
    return {"geometry": "table", "width": 3.0 * len(coatings), "height": 4.0, "fibre_list": entries, **cell}


@pytest.mark.parametrize(("cell", "phases", "fault"), [
    (SQUARE, (), "[material.coating]: missing section; [cell] has coatings"),
    (BARE, ("coating",), "[material.coating]: no fibre has a coating; expected [cell] coating, or a column of a table"),
    (SQUARE | {"coating": 0.0}, ("coating",), "[cell] coating = 0.0: expected a number at least 0.01 and at most 1"),
    (SQUARE | {"fibre_fraction": 0.65}, ("coating",),
     '[cell] fibre_fraction = 0.65: expected less than 0.6491 for geometry = "square": there the coatings touch'),
    (listed(0.1, 0.0), (), "[material.coating]: missing section; [cell] has coatings"),
    (listed(0.1, None, coating=0.2), ("coating",), "[cell] coating = 0.2: fibre_list has a column coating; give one"),
])  # fmt: skip
def test_faults_of_coatings(cell, phases, fault):
    with pytest.raises(CaseError) as caught:
        case_of(cell, *phases)
    assert fault in caught.value.faults


@pytest.mark.parametrize(("cell", "fault"), [
    (listed(0.001, 0.1), "row 1: coating = 0.001: expected 0, or from 0.01 to 1"),
    (listed(0.5, 0.5), "rows 1 and 2: touch"),
    (listed(0.6, 0.5), "rows 1 and 2: overlap by 0.1"),
])  # fmt: skip
def test_faults_of_coated_fibres_in_a_table(cell, fault):
    with pytest.raises(MeshError) as caught:
        arrange(case_of(cell, "coating").cell)
    assert any(fault in line for line in caught.value.faults)


def test_a_key_coats_all_fibres_of_a_table_and_a_column_each():
    assert arrange(case_of(listed(None, None, coating=0.1), "coating").cell).coating == pytest.approx([0.1 / 6] * 2)
    assert arrange(case_of(listed(0.2, None), "coating").cell).coating == pytest.approx([0.2 / 6, 0.0])
    assert arrange(case_of(listed(0.0, 0.0)).cell).phases == ("matrix", "fibre")
