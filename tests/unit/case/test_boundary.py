"""Conditions on the sides: the analyses and repairs that refuse them, in one line."""

import pytest

from feti_homog.case.cases import Case
from feti_homog.errors import CaseError


def faults(cell, **sections):
    (mesh := cell["folder"] / "cell.msh").write_text("")
    document = {
        "cell": {"geometry": "mesh", "file": str(mesh)} | {k: v for k, v in cell.items() if k != "folder"},
        "material": {"matrix": {"young": 1.0, "poisson": 0.3}},
        "analysis": {"type": "stiffness", "plane": "strain"},
    }
    with pytest.raises(CaseError) as error:
        Case.parse(document | sections)
    return error.value.faults


def test_a_path_refuses_them(tmp_path):
    sections = {
        "analysis": {"type": "path", "plane": "strain"},
        "path": {"strain": [0.1, 0.0, 0.0]},
        "interface": {"normal_strength": 1.0},
    }
    found = faults({"folder": tmp_path, "boundary": "traction"}, **sections)
    assert (
        '[cell] boundary = "traction": belongs to [analysis] type = "stiffness" or "conductivity", not "path"' in found
    )


def test_sides_that_need_not_match_are_not_snapped(tmp_path):
    found = faults({"folder": tmp_path, "boundary": "displacement", "repair": "snap"})
    assert found == ('[cell] boundary: excludes repair = "snap" and smooth = true, whose sides match',)


def test_other_values_and_other_cells(tmp_path):
    (line,) = faults({"folder": tmp_path, "boundary": "free"})
    assert line.startswith('[cell] boundary = "free": expected one of "periodic", "displacement", "traction"')
