"""Files of a cell that are links in a circle, or folders: a fault of the input, not of the program."""

import pytest

from feti_homog import Case
from feti_homog.errors import CaseError

CELLS = {"file": {"geometry": "table", "file": "loop.csv"}, "match": {"geometry": "random", "match": "loop.csv"}}
MATERIAL = {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.2}}


def parse(key):
    Case.parse({"cell": CELLS[key], "material": MATERIAL, "analysis": {"type": "stiffness", "plane": "strain"}})


@pytest.mark.parametrize("key", CELLS)
def test_links_in_a_circle_are_no_file(key, tmp_path, monkeypatch):
    (tmp_path / "loop.csv").symlink_to("loop.csv")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match=rf'^\[cell\] {key} = "loop.csv": no such file'):
        parse(key)


@pytest.mark.parametrize("key", CELLS)
def test_a_folder_is_no_file(key, tmp_path, monkeypatch):
    (tmp_path / "loop.csv").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(CaseError, match=rf'^\[cell\] {key} = "loop.csv": a folder; expected a file at /'):
        parse(key)
