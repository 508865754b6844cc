"""Lengths and normals of interfaces that are no circles follow from the files: right ones hold, false ones do not."""

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.falsifications import SMALL, broken, shift
from support.users_meshes import polar_cell
from support.verified_results import FIBRE, MATRIX, SPRINGS, falsified

from feti_homog import run

pytestmark = pytest.mark.slow

ELLIPSE = {"x": 0.5, "y": 0.5, "a": 0.36, "b": 0.18, "angle": 20.0}
POLYGON = {"x": 0.5, "y": 0.5, "radius": 0.36, "sides": 4, "corner": 0.5}
# Rows of the table or changes of a user's mesh, orders, and errors that are noticed.
SHAPES = {
    "ellipse": (ELLIPSE, 1, SMALL),
    "quadratic ellipse": (ELLIPSE, 2, SMALL),
    "rounded polygon": (POLYGON, 2, SMALL),
    "coated ellipse": (ELLIPSE | {"coating": 0.1}, 1, SMALL),
    "user's ellipse": ({"stretch": 1.5}, 2, 20 * SMALL),
    "user's curve": ({"wave": 0.06}, 2, 20 * SMALL),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_lengths_and_normals_follow_from_the_mesh(shape, tmp_path):
    row, order, off = SHAPES[shape]
    cell = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": [row], "mesh_size": 0.3}
    if "x" not in row:
        polar_cell((0.5, 0.5), 0.2, tmp_path / "cell.msh", order=2, size=0.2, **row)
        cell = {"geometry": "mesh", "file": str(tmp_path / "cell.msh")}
    materials, bonds = {"matrix": MATRIX, "fibre": FIBRE}, SPRINGS
    if "coating" in row:
        materials["coating"] = MATRIX
        bonds = [SPRINGS | {"between": pair} for pair in (["fibre", "coating"], ["coating", "matrix"])]
    output = {"pictures": False, "fields": True}
    case = case_of(cell | {"order": order}, material=materials, interface=bonds, output=output)
    run(case, MPI.COMM_SELF, out=tmp_path / "out")
    assert not broken(tmp_path / "out")

    def longer(_, file):
        file["interface/length"][()] *= 1 + off * (np.arange(len(file["interface/length"])) == 5)

    for name, edit in (("length", longer), ("normal", shift("normal", by=off, row=5, group="interface"))):
        assert "interface" in broken(falsified(tmp_path / "out", tmp_path / name, edit)), name
