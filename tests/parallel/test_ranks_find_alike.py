"""Results on several ranks, each with interface nodes, are those of one rank alone: every number of result.json."""

from collections import defaultdict

import numpy as np
import pytest
from mpi4py import MPI
from support.ranks import PIECES
from support.verified_results import CARBON, MATRIX, WARM, document

from feti_homog import Case, run
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.usefixtures("shared_interfaces")]

# What the solver took, and what is left of its errors.
OF_THE_RUN = {"version", "date", "solver", "timings", "memory", "checks", "iterations"}
ALIKE = 1e-6


def numbers(content, name=""):
    """Name and value of all that is in a document, names without the places in lists."""
    if isinstance(content, dict):
        pairs = [(f"{name}.{key}", value) for key, value in content.items() if key not in OF_THE_RUN]
    elif isinstance(content, list | tuple | np.ndarray):
        pairs = [(name, value) for value in content]
    else:
        return [(name, content)]
    return [number for key, value in pairs for number in numbers(value, key)]


def by_name(content):
    found = defaultdict(list)
    for name, value in numbers(content):
        found[name].append(value)
    return found


def assert_alike(comm, kind, **more):
    if comm.size == 1:
        pytest.skip("one rank is alone")
    case = document(kind) | {"decomposition": PIECES, "petsc": {"feti_ksp_rtol": 1e-11}} | more
    found = by_name(run(Case.parse(case), comm).document)
    alone = on_root(comm, lambda: by_name(run(Case.parse(case), MPI.COMM_SELF).document))
    assert found.keys() == alone.keys()
    for name, expected in alone.items():
        if all(isinstance(value, float) for value in expected):
            assert len(found[name]) == len(expected), name
            error = np.abs(np.array(found[name]) - expected).max()
            assert error <= ALIKE * np.abs(expected).max(), f"{name}: {error:.1e}"
        else:
            assert found[name] == expected, name


def test_a_path_of_several_legs_by_released_energy(comm):
    assert_alike(comm, "energy")


def test_a_path_of_two_pairs_of_phases(comm):
    assert_alike(comm, "pairs")


def test_increments_of_strains_and_stresses(comm):
    assert_alike(comm, "uneven steps")


def test_debonding_angles(comm):
    assert_alike(comm, "loaded angle")


def test_unit_loads_beside_an_arc(comm):
    assert_alike(comm, "overlap")


def test_envelopes(comm):
    for kind in ("envelope", "envelope by energy"):
        assert_alike(comm, kind)


def test_bonds_that_cooling_alone_breaks(comm):
    """One fibre has the first bond, though bonds of all are over their strength."""
    envelope = {"plane": ["S22", "S12"], "directions": 4, "temperature": -1e5}
    cell = {"geometry": "random", "fibres": 3, "fibre_fraction": 0.3, "min_gap": 0.1, "mesh_size": 0.2, "seed": 2}
    assert_alike(comm, "envelope in space", envelope=envelope, cell=cell)


def test_one_load_with_contact(comm):
    assert_alike(comm, "load with contact")


def test_elements_that_an_accuracy_asks_for_and_their_tips(comm):
    assert_alike(comm, "overlap", cell={"geometry": "square", "fibre_fraction": 0.4, "accuracy": 3e-2})


def test_coated_fibres_in_space(comm):
    """Compare derivatives too."""
    cell = {"geometry": "hexagonal", "fibre_fraction": 0.3, "coating": 0.2, "mesh_size": 0.2, "order": 2}
    material = {"matrix": WARM, "coating": MATRIX, "fibre": CARBON}
    assert_alike(comm, "spatial", cell=cell, material=material, output={"sensitivities": True})


def test_a_path_in_space_by_steps(comm):
    assert_alike(comm, "cooled by steps")


def test_bonds_that_soften(comm):
    assert_alike(comm, "softening")


def test_faces_that_rub(comm):
    assert_alike(comm, "friction")


def test_slip_along_the_fibres(comm):
    assert_alike(comm, "axial energy")


def test_a_debonded_conductor_with_resistance(comm):
    assert_alike(comm, "conductance")


def test_springs_beside_faces_that_touch(comm):
    assert_alike(comm, "springs")
