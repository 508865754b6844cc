"""Tables of points that are not those of result.json break their law, and no other; those that are missing do not."""

from __future__ import annotations

import shutil

import pytest
from support.falsifications import broken

from feti_homog.verify.certificate import verify

KINDS = {"path": "cooled", "angle": "angle", "load": "load"}


def junk(lines):
    return ["junk"]


def number(lines):
    return [*lines[:-1], lines[-1].replace("1", "2").replace("0", "1")]


def row(lines):
    return lines[:-1]


def column(lines):
    return [line.partition(",")[2] for line in lines]


def nothing(lines):
    return []


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_false_table_is_reported(results, tmp_path, name):
    copy = shutil.copytree(results(KINDS[name]), tmp_path / "copy")
    table = copy / f"{name}.csv"
    right = table.read_text().splitlines()
    assert not broken(copy)
    for edit in (junk, number, row, column, nothing):
        table.write_text("\n".join(edit(right)))
        assert broken(copy) == {"CSV"}, edit.__name__
    table.unlink()
    assert verify(copy).holds
