"""Onsets of envelopes are the first events of paths of the same strains, stresses and change of temperature."""

from contextlib import contextmanager

import numpy as np
import pytest
from petsc4py import PETSc
from support import cases, torn_cells
from support.cases import relative_error
from support.ranks import PIECES, parallel_assert

from feti_homog import run
from feti_homog.analysis.tip_records import criterion_of
from feti_homog.homogenization import unit_cell
from feti_homog.interface.contact.contact_problem import ContactProblem
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, OPEN
from feti_homog.interface.loads import Load
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded
from feti_homog.system.petsc.options_database import case_options
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

EXACT = 1e-9
ALONG = {"normal_strength": 0.02, "tangential_strength": 0.03, "axial_strength": 0.015}
SPRINGS = {"normal_stiffness": 60.0, "tangential_stiffness": 25.0, "axial_stiffness": 40.0}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 4e-6}
BONDS = {"max": ALONG, "quadratic": ALONG | {"criterion": "quadratic"}, "energy": ENERGY}
# Tips of debonding, whose faces do not touch.
BESIDE_AN_ARC = ENERGY | {"contact": False, "debonded": [{"fibre": 1, "centre": 20.0, "angle": 50.0}]}
AXES = [("S22", "S12"), ("S33", "S11"), ("S22", "S13"), ("E11", "E33"), ("E22", "gamma23"), ("gamma13", "gamma23")]
STRAINS = ("E11", "E22", "E33", "gamma23", "gamma13", "gamma12")
STRESSES = ("S11", "S22", "S33", "S23", "S13", "S12")


def case_of(bonds, axes, temperature):
    """Return an envelope in eight directions of two axes."""
    cooling = {"temperature": temperature} if temperature else {}
    return cases.case_of(
        {"geometry": "random", "fibres": 2, "min_gap": 0.1, "seed": 1, "radius_spread": 0.3, "fibre_fraction": 0.4,
         "mesh_size": 0.3},
        plane="generalized",
        material={
            "matrix": {"young": 3.0, "poisson": 0.35, "expansion": 6e-5},
            "fibre": {"young": 70.0, "poisson": 0.2, "expansion": 5e-6},
        },
        interface=bonds,
        envelope={"plane": list(axes), "directions": 8} | cooling,
        petsc={"feti_ksp_rtol": 1e-12, "feti_pc_type": "influence"},
        decomposition=PIECES,
    )  # fmt: skip


@contextmanager
def torn(comm, case):
    """Provide the torn cell of a case. Collective."""
    PETSc.garbage_cleanup(comm)
    with case_options(case.petsc):
        cell = unit_cell.tear(case, comm, Progress(comm, quiet=True))
        yield cell
        cell.destroy()


def load(names, of_stresses, values, temperature):
    """Return the load with these values of the strains, or stresses, and no other of its kind."""
    given = dict(zip(STRESSES if of_stresses else STRAINS, values, strict=True)) | {"temperature": temperature}
    pairs = dict(zip(STRAINS, STRESSES, strict=True))
    by_stress = np.array([of_stresses and name != "temperature" for name in names])
    return Load(np.array([given[pairs[n] if s else n] for n, s in zip(names, by_stress, strict=True)]), by_stress)


def first_break(cell, axes, values, temperature):
    """Strain and stress (6,) of the first event of the path, and the share of its leg.  Collective.

    The path goes to these values (2,) of the axes, after a change of temperature if there is one.
    """
    size = np.array([cell.summary.width, cell.summary.height])
    contact = cell.case.interface.contact
    loaded = CoupledInterfaces(
        ContactProblem(cell.solver, contact, size), ContactProblem(cell.axial.solver, False, size)
    )
    of_stresses, whole = axes[0] in STRESSES, np.zeros(6)
    whole[[(STRESSES if of_stresses else STRAINS).index(name) for name in axes]] = values
    legs = [load(loaded.loads, of_stresses, np.zeros(6), temperature)] if temperature else []
    legs.append(load(loaded.loads, of_stresses, whole, temperature))
    status = np.where(cell.debonded(None), OPEN, BONDED).astype(np.int8)
    points = events(loaded, criterion_of(cell, grows=True), legs, unloaded(loaded, torn_cells.bonds(status)))
    point = next(point for point in points if point.broke)
    state = loaded.macroscopic(point.state.solutions).scaled(point.scale)
    order = [loaded.loads.index(name) for name in STRAINS]
    return state.strain[order], state.stress[order], point.load_factor * len(legs) - len(legs) + 1


@pytest.mark.parametrize(
    ("bonds", "temperature"),
    [(ALONG, 0.0), (BONDS["quadratic"], -20.0), (ENERGY, -20.0), (BESIDE_AN_ARC, 0.0)],
    ids=[*BONDS, "tips"],
)
def test_onsets_are_the_first_events_of_mixed_paths(comm, bonds, temperature):
    number, chosen = 0, AXES[:: 1 if bonds is ALONG else 2]
    with torn(comm, case_of(bonds, chosen[0], temperature)) as cell:
        for axes in chosen:
            case = case_of(bonds, axes, temperature)
            # Opposite directions differ by contact and by the sign of tractions: every other one, of other axes the
            # others.
            for onset in [point for point in run(case, comm).envelope if point.factor][number % 2 :: 2]:
                # Breaks at 0.8 of a leg.
                angle = np.radians(onset.angle)
                values = onset.factor / 0.8 * np.array([np.cos(angle), np.sin(angle)])
                strain, stress, share = first_break(cell, axes, values, temperature)
                parallel_assert(comm, share == pytest.approx(0.8, rel=EXACT))
                parallel_assert(comm, relative_error(strain, onset.strain) < EXACT)
                parallel_assert(comm, relative_error(stress, onset.stress) < EXACT)
                number += 1
    assert number >= 9
