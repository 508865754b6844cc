"""The inner one of two bodies, and the number of a coating."""

from dataclasses import replace

import numpy as np
import pytest
from support import coated_cells
from unit.case.test_interface_pairs import Case, document
from unit.mesh.faulty_meshes import grid

from feti_homog.homogenization import cell_remarks
from feti_homog.mesh.mesh_fibres import fibre_numbers
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read


@pytest.fixture
def coated(tmp_path):
    coated_cells.write(tmp_path / "coated.msh", "fibre", "fibre:2")
    return read(tmp_path / "coated.msh")


@pytest.mark.parametrize("order", [("matrix", "fibre", "coating"), ("matrix", "coating", "fibre")])
def test_a_coating_is_around_its_fibre_whatever_the_order_of_phases(coated, order):
    named = np.array([order.index(name) for name in ("matrix", "fibre", "coating")], np.int32)
    mesh = replace(coated, phase=named[coated.phase], precedence=named[coated.phase], phases=order)
    torus = Torus.of(mesh)
    inwards = [order[torus.constituent_phase[body]] for body in np.argsort(torus.nesting)]
    assert inwards == ["matrix", "coating", "fibre"]
    number, is_fibre = fibre_numbers(torus)
    assert number[torus.constituent_phase == 0] == 0 and (number[torus.constituent_phase > 0] == 1).all()
    assert [order[phase] for phase in torus.constituent_phase[is_fibre]] == ["fibre"]


def test_other_phases_have_numbers_of_their_own_and_nest_by_their_place(coated):
    torus = Torus.of(coated)
    assert fibre_numbers(torus)[0].tolist() == [0, 1, 2]
    assert torus.nesting.tolist() == [0, 2, 1]


def test_a_coating_without_a_fibre_is_a_fibre(tmp_path):
    grid().write(tmp_path / "one.msh")
    torus = Torus.of(replace(read(tmp_path / "one.msh"), phases=("matrix", "coating")))
    number, is_fibre = fibre_numbers(torus)
    assert number.tolist() == [0, 1] and is_fibre.tolist() == [False, True]


@pytest.mark.parametrize(
    "pair, words",
    [
        (["matrix", "glass"], 'the cell has no phase "glass"; it has matrix, fibre, fibre:2'),
        (["matrix", "fibre"], "expected phases that touch"),
    ],
)
def test_pairs_that_the_cell_does_not_have_are_reported(coated, pair, words):
    case = Case.parse(document({"normal_strength": 1.0, "between": pair}))
    (fault,) = cell_remarks.faults(case, coated.phases, *(coated.phase[each] for each in Torus.of(coated).sides[:2]))
    assert fault.startswith("[interface] between = [") and words in fault
