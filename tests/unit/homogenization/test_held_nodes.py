"""Nodes that never part: remarks of a run and of `feti-homog check`, and arcs that select no other."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.layered_meshes import layers
from support.pixel_images import pixel_mesh
from unit.mesh.test_bodies import BRANCHES, TWO_FIBRES

from feti_homog import run
from feti_homog.analysis.description import describe
from feti_homog.errors import CaseError

TOUCHES = "[interface] nodes that never part: at 1 two bodies meet more than once"
MEET = "[interface] nodes that never part: at 1 three bodies meet"


def of_image(folder: Path, image: np.ndarray, **interface: Any) -> Any:
    pixel_mesh(image).write(folder / "pixels.msh")
    return case_of({"geometry": "mesh", "file": "pixels.msh"}, folder, output={"mesh_error": False}, **interface)


@pytest.mark.parametrize(("image", "remark"), [(BRANCHES, TOUCHES), (TWO_FIBRES, MEET)], ids=["touching", "triple"])
def test_they_are_remarked_where_there_are_interfaces(tmp_path: Path, image: np.ndarray, remark: str) -> None:
    bonded, debonding = of_image(tmp_path, image), of_image(tmp_path, image, interface={"normal_stiffness": 1.0})
    assert f"remark     {remark}" in describe(debonding, MPI.COMM_SELF).splitlines()
    assert "never part" not in describe(bonded, MPI.COMM_SELF)
    assert run(debonding, MPI.COMM_SELF).remarks == (remark,) and run(bonded, MPI.COMM_SELF).remarks == ()


def test_they_are_printed_once(tmp_path: Path, capfd: Any) -> None:
    case = of_image(tmp_path, BRANCHES, interface={"normal_stiffness": 1.0})
    run(case, MPI.COMM_SELF, quiet=False)
    assert " ".join("".join(capfd.readouterr()).split()).count(TOUCHES) == 1


@pytest.mark.parametrize(("phases", "pinned"), [("MF", True), ("MMF", False)])
def test_a_bond_that_holds_the_cell_is_remarked(tmp_path: Path, phases: str, pinned: bool) -> None:
    """Layers one element thick have no other node."""
    layers(phases, 0).write(tmp_path / "layers.msh")
    case = case_of({"geometry": "mesh", "file": "layers.msh"}, tmp_path, interface={"normal_stiffness": 1.0})
    described = describe(case, MPI.COMM_SELF)
    assert ("never parts: it holds the cell" in described) == pinned


def test_an_arc_that_selects_no_other_node_is_faulty(tmp_path: Path) -> None:
    """The corner of the first fibre at which it touches the second."""
    arc = {"fibre": [1], "centre": 45.0, "angle": 20.0}
    with pytest.raises(CaseError, match="no node of fibre 1 is within the arc of 20"):
        describe(of_image(tmp_path, TWO_FIBRES, interface={"debonded": [arc]}), MPI.COMM_SELF)
    other = arc | {"centre": 135.0}
    assert describe(of_image(tmp_path, TWO_FIBRES, interface={"debonded": [other]}), MPI.COMM_SELF)
