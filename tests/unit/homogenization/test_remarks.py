"""What `feti-homog check` says of components that no load names."""

from __future__ import annotations

import tomllib

import pytest
from mpi4py import MPI
from unit.config.valid_cases import VALID_CASES

from feti_homog.config.case import Case
from feti_homog.homogenization.cell_description import describe


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("path to a load", ["remark     [path] S12: never named: stress-free"]),
        ("load on a sheet", ["remark     [load] S11, S22: never named: stress-free"]),
        ("path there and back", []),
        ("base", []),
    ],
)
def test_check_tells_what_is_free_of_stress(name, expected):
    content = VALID_CASES[name].replace("mesh_size = 0.05", "mesh_size = 0.3")
    lines = describe(Case.parse(tomllib.loads(content)), MPI.COMM_SELF).splitlines()
    assert [line for line in lines if line.startswith("remark")] == expected
