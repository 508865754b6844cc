"""[cell.phases]: proposals that can be pasted, and groups that two phases select."""

import re
import tomllib
from dataclasses import replace

import pytest
from unit.mesh.faulty_meshes import grid

from feti_homog.mesh.readers.msh_reader import read

NAMES = {1: "Epoxy resin", 2: "E-Glass"}


@pytest.mark.parametrize(
    ("names", "phases", "materials", "proposed"),
    [
        ({1: "resin", 2: "glas fibre"}, {"matrix": ("resin",)}, (), 'set in [cell]: phases = {matrix = "resin", fibre'),
        ({1: "resin", 2: "glass"}, {}, ("matrix", "glass"), 'add to [cell]: phases = {matrix = "resin"}.'),
        ({1: "resin", 2: "E 1"}, {}, ("matrix", "glass"), 'phases = {matrix = "resin", glass = "E 1"}.'),
        ({1: "matrix", 2: "E 1"}, {}, (), 'are fibres, add to [cell]: phases = {fibre = "E 1"}.'),
        ({1: "fibre", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin"}. Shares'),
        ({1: "Fibers", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin", fibre = "Fibers"}. Shares'),
        ({1: "fibre:2", 2: "resin"}, {}, (), 'add to [cell]: phases = {matrix = "resin"}. Shares'),
    ],
)
def test_phases_that_are_proposed_read_the_mesh(tmp_path, names, phases, materials, proposed):
    """Fibres are not the matrix, even if they are the largest group."""
    fault = replace(grid(), names=names).faults(tmp_path, phases=phases, materials=materials)[-1]
    assert proposed in fault and all(f'"{name}"' in fault.partition("the file has")[2] for name in names.values())
    entries = tomllib.loads(re.search(r"phases = \{.*?\}", fault)[0])["phases"]
    read(tmp_path / "faulty.msh", phases={name: (group,) for name, group in entries.items()})


@pytest.mark.parametrize(
    ("names", "phases", "fault"),
    [
        ({}, {"matrix": (1,), "glass": (2,), "carbon": (2,)}, "carbon = 2: also in glass; expected each group in one"),
        (NAMES, {"matrix": (1,), "a": ("E-Glass",), "b": ("e-glass",)}, 'b = "e-glass": also in a; expected each'),
        (NAMES, {"matrix": (1,), "a": ("E-Glass",), "b": (2,)}, "is in 2 physical surfaces: a, b; [cell.phases] names"),
    ],
)
def test_a_group_in_two_phases_is_refused(tmp_path, names, phases, fault):
    assert any(fault in line for line in replace(grid(), names=names).faults(tmp_path, phases=phases))


@pytest.mark.parametrize(
    ("names", "proposed"),
    [
        ({1: "Fibre", 2: "Interphase", 3: "Matrix"}, '{matrix = "Matrix", fibre = "Fibre", coating = "Interphase"}'),
        ({1: "1", 2: "2", 3: "3"}, '{matrix = "1", fibre = "3", coating = "2"}'),
        ({1: "Coating", 2: "MATRIX", 3: "glass"}, '{matrix = "MATRIX", coating = "Coating", fibre = "glass"}'),
    ],
)
def test_proposals_follow_the_materials_whatever_the_capitals(tmp_path, names, proposed):
    """Of 50 %, 12.5 % and 37.5 % of the area: alike names belong together, and a coating is the smallest."""
    elements = {}
    for tag, (kind, _, _, nodes) in grid().elements.items():
        number = 1 if tag <= 16 else 2 if tag <= 20 else 3
        elements[tag] = (kind, number, number, nodes)
    mesh = replace(grid(), elements=elements, names=names)
    fault = mesh.faults(tmp_path, materials=("matrix", "coating", "fibre"))[-1]
    assert f"add to [cell]: phases = {proposed}. Shares" in fault
