"""Largest stresses of the phases: uniform cells have the macroscopic stress, and any number of ranks finds the same."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import FIBRE, MATRIX, case_of
from support.ranks import write_once
from unit.mesh.faulty_meshes import grid

from feti_homog import run
from feti_homog.materials import voigt
from feti_homog.report.text import summary

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

CELL = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.15, "refine": 1}
LOAD = {"S11": 30.0, "S22": -12.0, "S33": 5.0, "S23": 7.0, "S13": -9.0, "S12": 11.0}
AXES = {"axial_tension": 40.0, "axial_compression": 25.0, "axial_shear": 20.0, "transverse_tension": 50.0,
        "transverse_compression": 90.0, "transverse_shear": 30.0}  # fmt: skip
MEASURES = ("principal", "von_mises", "hydrostatic", "utilisation")


def result_of(comm, load, order=1, plane="generalized", fibre=FIBRE, strengths=(None, None), cell=CELL, **more):
    materials = {
        name: material if limit is None else material | {"strength": limit}
        for (name, material), limit in zip({"matrix": MATRIX, "fibre": fibre}.items(), strengths, strict=True)
    }
    sections = {"material": materials, "load": {"to": load} if load else None, "petsc": {}} | more
    return run(case_of({"order": order} | cell, plane=plane, **sections), comm, fields=True)


def phases_of(*of_run, **more):
    return {phase.phase: phase for phase in result_of(*of_run, **more).phase_stresses}


def factors(result):
    """Return the printed load factor of each phase."""
    *_, table = summary.phase_tables(result.document)
    names = [column.name for column in table.columns]
    return {row[0]: row[names.index("load factor")] for row in table.rows if "load factor" in names}


@pytest.mark.one_rank
@pytest.mark.parametrize(("load", "heads"), [({"S11": 30.0}, ["at S11"]), ({"S11": 30.0, "S12": 1.0}, [])], ids=str)
def test_the_stress_at_which_a_phase_fails_stands_beside_the_factor(comm, load, heads):
    """A uniform cell under S11 alone reaches its strength at S11 = 100; "von Mises" of a cell in plane stress."""
    result = result_of(comm, load, plane="stress", fibre=MATRIX, strengths=({"von_mises": 100.0}, None))
    *_, used = summary.phase_tables(result.document)
    assert [column.name for column in used.columns if column.name.startswith("at S")] == heads
    expected = [100.0] if heads else [*factors(result).values()]
    assert [row[-1] for row in used.rows] == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("order", [1, 2])
def test_a_uniform_cell_has_the_macroscopic_stress(comm, order):
    found = phases_of(comm, LOAD, order, fibre=MATRIX, strengths=({"principal": 100.0}, AXES))
    S11, S22, S33, S23, S13, S12 = LOAD.values()
    tensor = np.array([[S11, S12, S13], [S12, S22, S23], [S13, S23, S33]])
    deviator = tensor - np.trace(tensor) / 3 * np.eye(3)
    assert set(found) == {"matrix", "fibre"}
    for phase in found.values():
        np.testing.assert_allclose(phase.principal, np.linalg.eigvalsh(tensor)[-1:], rtol=1e-8)
        np.testing.assert_allclose(phase.von_mises, [np.sqrt(1.5 * (deviator**2).sum())], rtol=1e-8)
        np.testing.assert_allclose(phase.hydrostatic, [np.trace(tensor) / 3], rtol=1e-8)
    np.testing.assert_allclose(found["matrix"].utilisation, found["matrix"].principal / 100.0)
    axial = (S13**2 + S23**2) / 20.0**2
    modes = (S33 / 40.0) ** 2 + axial, ((S11 + S22) / 50.0) ** 2 + (S12**2 - S11 * S22) / 30.0**2 + axial
    np.testing.assert_allclose(found["fibre"].utilisation, [np.sqrt(max(modes))], rtol=1e-8)


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_stresses_out_of_the_plane_count(comm, plane):
    found = phases_of(comm, {"S11": 30.0, "S22": -12.0}, plane=plane, fibre=MATRIX)["matrix"]
    S33 = MATRIX["poisson"] * 18.0 if plane == "strain" else 0.0
    np.testing.assert_allclose(found.hydrostatic, [(18.0 + S33) / 3], rtol=1e-8)
    np.testing.assert_allclose(found.von_mises, voigt.von_mises(np.array([[30.0, -12.0, 0.0]]), S33), rtol=1e-8)


def angular(x, y):
    """Return whether a place is in a fibre of three squares, which nothing maps onto itself."""
    return (0.25 < x < 0.75 and 0.25 < y < 0.5) or (0.25 < x < 0.5 and 0.25 < y < 0.75)


@pytest.mark.one_rank
def test_a_moved_and_a_turned_cell_have_the_same_stresses(comm, shared_path):
    """On the torus, by a quarter and a half of the cell; by a quarter turn, which swaps S11 and S22."""
    base = grid(angular)
    turned = replace(base, nodes={tag: (1.0 - y, x, z) for tag, (x, y, z) in base.nodes.items()})
    moved = grid(lambda x, y: angular((x - 0.25) % 1.0, (y - 0.5) % 1.0))
    load = {"S11": 30.0, "S22": -12.0, "S12": 11.0}
    back = {
        "base": lambda place: place,
        "moved": lambda place: (place - [0.25, 0.5]) % 1.0,
        "turned": lambda place: np.stack([place[:, 1], 1.0 - place[:, 0]], axis=1),
    }
    found = {}
    for name, mesh in (("base", base), ("moved", moved), ("turned", turned)):
        write_once(comm, mesh, shared_path / f"{name}.msh")
        cell = {"geometry": "mesh", "file": str(shared_path / f"{name}.msh"), "order": 2, "refine": 1}
        asked = load if name != "turned" else {"S11": -12.0, "S22": 30.0, "S12": -11.0}
        found[name] = phases_of(comm, asked, plane="strain", strengths=({"von_mises": 50.0}, None), cell=cell)
    for name, phases in found.items():
        for phase, stresses in phases.items():
            for measure in MEASURES[: 4 if phase == "matrix" else 3]:
                expected = found["base"][phase]
                value, place = getattr(stresses, measure), getattr(stresses, f"{measure}_at")
                np.testing.assert_allclose(value, getattr(expected, measure), rtol=1e-8)
                np.testing.assert_allclose(back[name](place), getattr(expected, f"{measure}_at"), atol=1e-6)


def test_all_ranks_find_values_and_positions_of_one(comm):
    """Interfaces keep the fibre a subdomain of its own; the load is skew, so that no two positions are alike."""
    if comm.size == 1:
        pytest.skip("one rank is alone")
    load, interface = {"E11": 0.01, "gamma12": 0.004}, {"normal_stiffness": 2000.0, "tangential_stiffness": 900.0}
    together = phases_of(comm, load, 2, interface=interface)
    alone = phases_of(MPI.COMM_SELF, load, 2, interface=interface)
    for phase, one in zip(together.values(), alone.values(), strict=True):
        for name in ("principal", "von_mises", "hydrostatic"):
            np.testing.assert_allclose(getattr(phase, name), getattr(one, name), rtol=1e-6)
            offset = getattr(phase, f"{name}_at") - getattr(one, f"{name}_at")
            np.testing.assert_allclose(offset - np.round(offset), 0.0, atol=1e-9)


def test_stresses_rise_beside_tips_and_corners(comm):
    def remarks(cell, **more):
        return " ".join(run(case_of(cell, **more), comm, fields=True).remarks)

    arc = {"interface": {"debonded": [{"fibre": "all", "centre": 0.0, "angle": 90.0}]}}
    assert "beside tips of debonding rise without limit with finer elements" in remarks(CELL, **arc)
    two = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.3}
    for angle in (90.0, 360.0):  # one fibre of two: without any bond it has no tips
        arc = {"interface": {"debonded": [{"fibre": 1, "centre": 0.0, "angle": angle}]}}
        assert ("beside tips of debonding" in remarks(two, **arc)) == (angle < 360.0)
    assert "rise without limit" not in remarks(CELL)
    square = {"x": 0.5, "y": 0.5, "radius": 0.3, "sides": 4}
    table = {"geometry": "table", "width": 1.0, "height": 1.0, "mesh_size": 0.2}
    assert "beside corners of phases rise without limit" in remarks(table | {"fibre_list": [square]})


def test_only_tips_in_one_rigid_interface_raise_stresses(comm):
    """A coated fibre has two interfaces: one may part all around, or have springs."""
    cell = {"geometry": "square", "fibre_fraction": 0.3, "mesh_size": 0.15, "coating": 0.1}
    materials = {"matrix": MATRIX, "coating": MATRIX, "fibre": FIBRE}
    springs = {"normal_stiffness": 100.0, "tangential_stiffness": 100.0}
    for angle, bond, has_tips in ((360.0, {}, False), (90.0, {}, True), (90.0, springs, False)):
        inside = {"between": ["fibre", "coating"], "debonded": [{"fibre": "all", "angle": angle}]} | bond
        bonds = [inside, {"between": ["coating", "matrix"], "debonded": []}]
        remarks = " ".join(run(case_of(cell, material=materials, interface=bonds), comm, fields=True).remarks)
        assert ("beside tips of debonding" in remarks) == has_tips, remarks


def test_a_soft_phase_keeps_its_stresses_and_a_free_fibre_has_none(comm):
    soft, softer = (
        phases_of(comm, {"E11": 0.01}, fibre=FIBRE | {"young": young}, plane="strain")["fibre"]
        for young in (1e-3, 1e-9)
    )
    np.testing.assert_allclose(softer.von_mises, 1e-6 * soft.von_mises, rtol=1e-3)
    free = {"interface": {"contact": False, "debonded": [{"fibre": "all", "centre": 0.0, "angle": 360.0}]}}
    assert phases_of(comm, {"E11": 0.01}, plane="strain", **free)["fibre"].von_mises == 0.0


@pytest.mark.one_rank
def test_unit_loads_together_have_the_stresses_of_each_alone(comm):
    more = {"fibre": FIBRE | {"young": 20.0}, "strengths": ({"tension": 8.0, "compression": 12.0}, AXES)}
    together = phases_of(comm, None, 2, **more, analysis={"type": "stiffness", "plane": "generalized"})
    for number, load in enumerate(together["matrix"].state):
        strains = dict.fromkeys(voigt.SPATIAL_STRAINS, 0.0) | {load: 1.0}
        for name, alone in phases_of(comm, strains, 2, **more).items():
            for measure in MEASURES:
                value = getattr(together[name], measure)[number]
                np.testing.assert_allclose(value, getattr(alone, measure)[0], rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize(
    ("load", "mode", "strength"),
    [
        ({"S33": 2.0}, "axial tension", "axial_tension"),
        ({"S33": -2.0}, "axial compression", "axial_compression"),
        ({"S11": 2.0}, "transverse tension", "transverse_tension"),
        ({"S22": -2.0}, "transverse compression", "transverse_compression"),
    ],
)
def test_a_uniform_cell_fails_at_the_strength_of_its_mode(comm, load, mode, strength):
    result = result_of(comm, load, fibre=MATRIX, strengths=({"von_mises": 70.0}, AXES))
    assert result.phase_stresses[1].mode == (mode,) and result.phase_stresses[0].mode is None
    expected = {"matrix": 70.0 / 2.0, "fibre": AXES[strength] / 2.0}
    assert factors(result) == pytest.approx(expected, rel=1e-8)


def test_at_its_load_factor_each_phase_has_the_utilisation_one(comm):
    load, limits = {"S11": 3.0, "S13": -2.0, "E33": 1e-4}, ({"tension": 40.0, "compression": 60.0}, AXES)
    result = result_of(comm, load, strengths=limits)
    for phase, factor in factors(result).items():
        again = phases_of(comm, {name: factor * value for name, value in load.items()}, strengths=limits)[phase]
        assert again.utilisation == pytest.approx(1.0, rel=1e-8)
        assert again.mode == next(each.mode for each in result.phase_stresses if each.phase == phase)


def test_a_path_says_where_a_phase_passes_its_strength_before_the_peak(comm):
    matrix = {"matrix": MATRIX | {"strength": {"tension": 4.0, "compression": 6.0}}, "fibre": FIBRE}
    alone = result_of(comm, {"E11": 1e-3, "E22": 0.0, "gamma12": 0.0}, plane="strain", material=matrix)
    factor, (S11, *_) = factors(alone)["matrix"], alone.load.stress
    path = {"path": {"strain": [0.2, 0.0, 0.0]}, "material": matrix}
    for strength, passes in ((10.0, True), (1.0, False)):
        more = {"interface": {"normal_strength": strength, "tangential_strength": strength}}
        said = " ".join(result_of(comm, None, plane="strain", **path, **more).remarks)
        assert ("the utilisation reaches 1" in said) == passes
        if passes:
            assert f"about S11 = {factor * S11:.4g}, E11 = {factor * 1e-3:.4g}, before the peak" in said


@pytest.mark.parametrize(
    ("load", "analysis", "is_proportional"),
    [
        ({"temperature": -10.0, "S11": 0.0}, "load", True),
        ({"temperature": -10.0, "S11": 1.0}, "load", False),
        ({"S11": 1.0}, "path", False),
    ],
)
def test_only_loads_in_proportion_have_factors(comm, load, analysis, is_proportional):
    warm = {"strength": {"von_mises": 70.0}, "expansion": 1e-5}
    materials = {"matrix": MATRIX | warm, "fibre": FIBRE | warm | {"expansion": 2e-5}}
    more = {"analysis": {"type": analysis, "plane": "generalized"}, "material": materials}
    path = {"path": {"to": load}, "interface": {"normal_strength": 1e6}} if analysis == "path" else {}
    result = result_of(comm, None if path else load, **more, **path)
    assert (set(factors(result)) == {"matrix", "fibre"}) == is_proportional
