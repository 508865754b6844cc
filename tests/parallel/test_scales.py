"""Interfaces, springs and components that are orders of magnitude apart: each by its own measure.

Beside what is far stiffer a soft inclusion feels imposed displacements, so that its tractions are as small as its
stiffness, and what divides them by strengths or roots of toughness of that size does not depend on it.
"""

from dataclasses import dataclass

import numpy as np
import pytest
from support import torn_cells
from support.cases import case_of
from support.loads import strains

from feti_homog import run
from feti_homog.errors import ConvergenceError
from feti_homog.feti.dual_solution import ActiveJumps
from feti_homog.feti.exact.exact_inverse import ExactInverse
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import BONDED, OPEN
from feti_homog.interface.laws.energy import ReleasedEnergy, SpringEnergy
from feti_homog.interface.loads import Load
from feti_homog.interface.path.path_following import events
from feti_homog.interface.path.path_points import unloaded

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

FIBRES = [
    {"x": 0.27, "y": 0.25, "radius": 0.18, "phase": "fibre"},
    {"x": 0.73, "y": 0.75, "radius": 0.18, "phase": "fibre:2"},
]
STIFF_ARC, SOFT_ARC = ({"debonded": [{"fibre": f, "centre": a, "angle": 60.0}]} for f, a in ((1, 90.0), (2, 0.0)))
SPRINGS = {"criterion": "energy", "normal_stiffness": 20.0, "tangential_stiffness": 5.0, "mode_sensitivity": 0.25}


def two_inclusions(softness, stiff, soft, unit=1.0, young=10.0, **analysis):
    """Return a stiff and a soft fibre, with the interfaces `stiff` and `soft`; `unit` is that of their moduli."""
    return case_of(
        {"geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.2, "fibre_list": FIBRES},
        material={
            "matrix": {"young": unit, "poisson": 0.3},
            "fibre": {"young": young * unit, "poisson": 0.2},
            "fibre:2": {"young": young * softness * unit, "poisson": 0.2},
        },
        interface=[stiff | {"between": ["matrix", "fibre"]}, soft | {"between": ["matrix", "fibre:2"]}],
        petsc={"feti_influence_columns": 10},  # the reference cell is made anew, so that rows come back to it
        output={"fields": False, "pictures": False},
        **analysis,
    )


def test_interfaces_far_apart_break_at_the_same_loads(comm):
    """On springs far stiffer than the soft fibre, what breaks release is as small as its stiffness."""

    def path(softness):
        bonds = (SPRINGS | STIFF_ARC | {"toughness": 3e-4}, SPRINGS | SOFT_ARC | {"toughness": 1e-4 * softness})
        to = {"E11": 0.05, "E22": 0.02, "gamma12": 0.02}
        return run(two_inclusions(softness, *bonds, path={"to": to}), comm).path

    expected, found = path(1e-8), path(1e-13)
    assert len(found) == len(expected) > 15
    for one, other in zip(found, expected, strict=True):
        assert one.load_factor == pytest.approx(other.load_factor, rel=3e-6)
        assert (one.broke, one.open, one.closed) == (other.broke, other.open, other.closed)
    assert min(found[-1].debonded_length) > 2 * 0.18 * np.pi / 3


@pytest.mark.parametrize("what", ["fibre", "springs"])
def test_a_soft_inclusion_touches_where_any_does(comm, what):
    """Neither the forces of a stiff fibre nor the body beside soft springs are a scale of its forces."""

    def load(softness):
        bonds = [{"debonded": [{"fibre": f, "centre": 30.0, "angle": 240.0}]} for f in (1, 2)]
        if what == "springs":
            own, softness = {"normal_stiffness": softness, "tangential_stiffness": softness}, 1.0
            bonds = [bond | own for bond in bonds]
        return run(
            two_inclusions(softness, *bonds, load={"to": {"E11": -0.01, "E22": 0.02, "gamma12": 0.01}}), comm
        ).load

    expected, found = load(1e-5), load(1e-12)
    assert (found.open, found.closed) == (expected.open, expected.closed) and found.closed > 3 < found.open


@pytest.mark.parametrize("bond", ["strength", "energy"])
def test_onsets_of_a_soft_inclusion_do_not_depend_on_its_softness(comm, bond):
    def onsets(softness):
        own = {
            "strength": {"normal_strength": 0.01 * softness, "tangential_strength": 0.02 * softness},
            "energy": SPRINGS | {"growth": "springs", "toughness": 1e-6 * softness**2},
        }[bond]
        strong = {"normal_strength": 1e6, "tangential_strength": 1e6} if bond == "strength" else SPRINGS | {
            "growth": "springs", "toughness": 1e6}  # fmt: skip
        return run(two_inclusions(softness, strong, own, envelope={"plane": ["S11", "S12"], "directions": 8}), comm)

    expected, found = onsets(1e-6).envelope, onsets(1e-11).envelope
    for one, other in zip(found, expected, strict=True):
        assert one.fibre == other.fibre == 2
        assert one.factor == pytest.approx(other.factor, rel=1e-4)


# A matrix whose stiffness along x1 is 1e9 times its shear stiffness.
STIFF_ALONG = {"stiffness": np.diag([1e9, 2.0, 3.0, 1.0, 1.0, 1.0]).tolist()}


@pytest.mark.parametrize("bonded", [True, False])
def test_a_component_far_softer_than_another_carries_its_stress(comm, bonded):
    """Uniform, so the strains are the stresses over the stiffnesses."""
    strain = np.array(run(loaded_along(bonded), comm).load.strain)
    assert strain == pytest.approx([1e-3, 0.0, 0.01, 0.0, 0.0, 0.01], rel=1e-6, abs=1e-9)


def loaded_along(bonded):
    """Return a uniform cell, with its fibre glued or bonded, under stresses that are far apart."""
    return case_of(
        {"geometry": "square", "fibre_fraction": 0.3, "mesh_size": 0.3},
        plane="generalized",
        material={"matrix": STIFF_ALONG, "fibre": STIFF_ALONG},
        load={"to": {"S11": 1e6, "S12": 0.01, "E22": 0.0, "S33": 0.03}},
        interface=None if bonded else {"debonded": []},
        petsc={},
    )


def test_a_stress_that_is_missed_beside_a_far_larger_one_is_no_result(comm, monkeypatch):
    superposed = ActiveJumps.superposed

    def lose_the_third(jumps, solutions, factors, d):
        return superposed(jumps, solutions, factors * (np.arange(len(factors)) != 2), d)

    monkeypatch.setattr(ActiveJumps, "superposed", lose_the_third)
    with pytest.raises(ConvergenceError, match="check stress"):
        run(loaded_along(True), comm)


# Springs so soft that neither fibre nor matrix feels them: the jumps are those without bonds, but for rigid motions.

STRAIN, TOUGHNESS, SENSITIVITY, RATIO = np.array([1.0, 0.2, 0.3]), 1e-4, 0.25, 0.25


@dataclass(frozen=True)
class RigidFibre:
    """One round fibre on springs, with faces that may overlap.

    They part by `jump` (k, 2), normal and tangential, where nothing holds them.
    """

    jump: np.ndarray
    arm: np.ndarray
    normal: np.ndarray
    length: np.ndarray

    @property
    def tangent(self):
        return self.normal[:, ::-1] * [-1.0, 1.0]

    def load_factors(self, count):
        """Load factors of the first breaks, in units in which the normal stiffness is 1."""
        around = np.argsort(np.arctan2(*self.arm.T[::-1]))
        bonded, found = np.ones(len(around), bool), []
        while len(found) < count:
            used = self.used(bonded, around)
            found.append(1.0 / used.max())
            bonded &= used < used.max() * (1 - 1e-6)
        return np.array(found)

    def used(self, bonded, around):
        """(k,) the root of the energy of each bond over its toughness."""
        turned = self.arm[:, ::-1] * [-1.0, 1.0]
        motions = np.stack(
            [np.column_stack([a, (a * turned).sum(axis=1)]) for a in (self.normal, self.tangent)], axis=1
        ).reshape(-1, 3)
        W = np.repeat(bonded * self.length, 2) * np.tile([1.0, RATIO], len(bonded))
        H = np.diag(W) - (W[:, None] * motions) @ np.linalg.solve(motions.T * W @ motions, motions.T * W)
        force = (H @ self.jump.ravel()).reshape(-1, 2)
        t_n, t_t = (force / self.length[:, None]).T
        opening, shear = np.maximum(t_n, 0.0) ** 2 / 2, t_t**2 / (2 * RATIO)
        energy, psi = opening + shear, np.arctan2(np.sqrt(shear), np.sqrt(opening))
        broken = ~bonded[around]
        for i in around[bonded[around] & (np.roll(broken, 1) | np.roll(broken, -1))]:
            block = H[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
            energy[i] = force[i] @ np.linalg.solve(block, force[i]) / 2 / self.length[i]
        return bonded * np.sqrt(energy / TOUGHNESS) * np.cos((1 - SENSITIVITY) * psi)


def softly_held(comm, stiffness, young, count, **cell):
    """Return the first load factors of a path of one fibre on springs of this stiffness, and its cell."""
    base = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.2, "matrix": {"young": 1.0, "poisson": 0.3}}
    # One subdomain of each body on any number of ranks: beside forces between pieces of the matrix, those of the
    # springs would be rounding.
    case = base | {"fibre": {"young": young, "poisson": 0.2}, "decomposition": {"subdomains": 2}} | cell
    petsc = {"feti_pc_type": "influence", "feti_dual_operator": "explicit"}
    cell = torn_cells.tear(comm, springs=(stiffness, RATIO * stiffness), petsc=petsc, **case)
    loaded = CoupledInterfaces(torn_cells.interface(cell, False))
    springs = SpringEnergy(stiffness, RATIO * stiffness, TOUGHNESS * stiffness, SENSITIVITY)
    begin = unloaded(loaded, torn_cells.bonds(np.full(len(loaded.nodes.row), BONDED, np.int8)))
    law = ReleasedEnergy(**vars(springs), influence=cell.solver.exact_inverse)
    points = events(loaded, law, strains(STRAIN[None]), begin)
    return np.array([point.load_factor for point, _ in zip(points, range(count), strict=False)]), cell


@pytest.mark.parametrize(("stiffness", "young"), [(1e-6, 1e6), (1e-9, 1e6), (1e-12, 1.0), (1e-16, 10.0), (1e-16, 1e5)])
def test_soft_springs_break_as_between_rigid_bodies(comm, stiffness, young):
    found, cell = softly_held(comm, stiffness, young, 6)
    interface = torn_cells.interface(cell, False)
    nodes, parted = interface.nodes, np.full(len(interface.nodes.row), OPEN, np.int8)
    jump = interface.jump(interface.linear(Load.strain(STRAIN), torn_cells.bonds(parted), np.zeros(cell.solver.rows)))
    each = (jump, nodes.points, nodes.normal, nodes.length)
    jump, points, normal, length = (np.concatenate(comm.allgather(x)) for x in each)
    expected = RigidFibre(jump, points - points.mean(axis=0), normal, length).load_factors(6)
    np.testing.assert_allclose(found, expected, rtol=max(1e-8, 10 * stiffness))


def test_springs_too_soft_beside_a_cut_fibre_are_refused(comm):
    pieces = {"geometry": "hexagonal", "decomposition": {"subdomains": 12}}
    assert len(softly_held(comm, 1e-4, 1.0, 2, **pieces)[0]) == 2
    with pytest.raises(ConvergenceError, match=r'growth = "released": rounding hides .*e-03 .* at most 1e-06'):
        softly_held(comm, 1e-6, 1e6, 2, **pieces)
    with pytest.raises(ConvergenceError, match=r"springs (are )?too soft beside"):
        softly_held(comm, 1e-16, 1e6, 2, **pieces)


def test_soft_springs_break_alike_beside_a_glued_stiff_fibre(comm):
    """Its forces are found on the side of the matrix, theirs on that of the fibre."""

    def path(k):
        own, stiff = ({"normal_stiffness": own, "tangential_stiffness": RATIO * own} for own in (k, 1e8))
        law = {"criterion": "energy", "mode_sensitivity": SENSITIVITY}
        bonds = law | stiff | {"toughness": 1e9}, law | own | {"toughness": TOUGHNESS * k}
        case = two_inclusions(1e-6, *bonds, young=1e6, path={"to": {"E11": 0.2, "gamma12": 0.1}})
        return [point.load_factor for point in run(case, comm).path]

    expected, found = path(1e-6), path(1e-12)
    assert found == pytest.approx(expected, rel=3e-5) and len(found) > 10


def test_units_of_stress_change_neither_loads_nor_the_number_of_reference_cells(comm, monkeypatch):
    def path(unit):
        made, factor, follow = [], ExactInverse._factor, ExactInverse._follow
        monkeypatch.setattr(ExactInverse, "_factor", lambda *arguments: made.append(factor(*arguments)))
        # Nothing is followed: each state has a reference cell of its own.
        monkeypatch.setattr(ExactInverse, "_follow", lambda *arguments: arguments[-1] == 0.0 and follow(*arguments))
        bond = SPRINGS | {"normal_stiffness": 20.0 * unit, "tangential_stiffness": 5.0 * unit, "toughness": 1e-4 * unit}
        legs = {"waypoints": [{"E11": 0.03, "E22": 0.01}, {"E11": -0.01, "E22": 0.03, "gamma12": 0.03}]}
        found = run(two_inclusions(0.1, bond | STIFF_ARC, bond | SOFT_ARC, unit=unit, path=legs), comm).path
        monkeypatch.undo()
        return len(made), [point.load_factor for point in found]

    expected, loads = path(1.0)
    for unit in (1e-12, 1e9):
        made, found = path(unit)
        assert made == expected and made > 5
        assert found == pytest.approx(loads, rel=1e-9)
