"""Friction against closed forms and the slow twin: laminates, first slip, limits of mu, breaks, free fibres."""

import numpy as np
import pytest
from reference.closed_forms import first_slip, lame, rubbing_bond, rubbing_laminate
from reference.friction import RubbingFaces
from reference.friction_path import FrictionPath
from support.loaded_twins import EPOXY_GLASS, LoadedTwin, document, is_end, solved
from support.ranks import assert_certified, write_once
from unit.mesh.faulty_meshes import grid

from feti_homog import Case, run
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]
WHOLE = {"debonded": [{"fibre": "all", "angle": 360.0}]}
GLASS_EPOXY = ({"young": 2790.0, "poisson": 0.33}, {"young": 70800.0, "poisson": 0.22})
PRESSED = [[-0.01, -0.004, 0.0], [-0.01, -0.004, 0.02], [-0.01, -0.004, -0.02]]


def at_ends(points, legs):
    return [point for point in points if is_end(point, legs)]


def test_a_laminate_closes_its_parallelogram(comm, shared_path):
    """Bonds that nothing holds; ten cycles between the same stresses, with the heat of the area of each."""
    write_once(comm, grid(lambda x, y: 0.25 < x < 0.5), shared_path / "strip.msh")
    phases = ({"young": 2.0, "poisson": 0.299}, {"young": 5.0, "poisson": 0.222})
    moduli = np.array([[sum(np.array(lame(phase)) * (1, 2)), lame(phase)[1]] for phase in phases])
    across, shear = 1.0 / (np.array([0.75, 0.25]) @ (1.0 / moduli))
    shears = [0.0, *[0.02, -0.02] * 10]
    interface = {"friction": 0.3, "normal_strength": 1e-9, "tangential_strength": 1e-9}
    case = {"cell": {"geometry": "mesh", "file": "strip.msh"}, "phases": phases, "plane": "strain"}
    path = {"waypoints": [[-0.01, 0.0, gamma] for gamma in shears]}
    points = at_ends(solved(comm, shared_path, **case, interface=interface, path=path).path, len(shears))
    stress, heat = rubbing_laminate(across, shear, 0.3, -0.01, shears)
    np.testing.assert_allclose([p.stress[2] for p in points], stress, atol=1e-10 * stress.max())
    np.testing.assert_allclose([p.friction_heat for p in points], heat, atol=1e-10 * heat.max())


def test_bonds_of_a_laminate_rub_with_their_damaged_share(comm, shared_path):
    """The first of two teeth, cycles, and where the second breaks them: stress, heat and certificate."""
    write_once(comm, grid(lambda x, y: 0.25 < x < 0.5), shared_path / "strip.msh")
    phases = ({"young": 2.0, "poisson": 0.299}, {"young": 5.0, "poisson": 0.222})
    compliance = np.array([0.75, 0.25]) @ (1.0 / np.array([lame(phase)[1] for phase in phases]))
    K, first, rho = 2.0, 0.01, 4.0
    kinds = ("normal", "tangential")
    law = {f"{kind}_{what}": value for kind in kinds for what, value in (
        ("stiffness", K), ("strength", K * first), ("toughness", rho * K * first**2 / 2),
    )}  # fmt: skip
    interface = law | {"law": "bilinear", "teeth": 2, "friction": 0.3, "friction_on_damage": True}
    damage = rho * (rho**0.5 - 1) / (rho**0.5 * (rho - 1))
    shears = [0.0, *[0.06, -0.05] * 3, 0.15]
    case = {"cell": {"geometry": "mesh", "file": "strip.msh"}, "phases": phases, "plane": "strain"}
    path = {"waypoints": [[-0.01, 0.0, gamma] for gamma in shears]}
    asked = document(**case, interface=interface, path=path)
    asked["output"] = {"pictures": False, "states": "all"}
    path = run(Case.parse(asked, shared_path), comm, out=shared_path / "out").path
    *points, last = at_ends(path, len(shears))
    bound = -0.3 * last.stress[0]
    stress, heat = rubbing_bond(compliance, 2.0, K, damage, bound, shears[:-1])
    np.testing.assert_allclose([p.stress[2] for p in points], stress, atol=1e-10 * stress.max())
    np.testing.assert_allclose([p.friction_heat for p in points], heat, atol=1e-10 * heat.max())
    assert points[-1].damaged_share > 0.0 and heat[-1] > 2 * heat[1] > 0.0
    slip, (broken,) = first * rho**0.75, [p for p in path if p.broke]
    held = compliance * ((1 - damage) * K * slip + damage * bound)
    assert broken.strain[2] == pytest.approx(held + 2 * slip, rel=1e-9) and last.stress[2] == pytest.approx(bound)
    assert_certified(comm, shared_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.25, 0.5])
def test_a_fibre_in_a_medium_slips_first_where_the_formula_has_it(comm, friction):
    """One fibre in a cell of 60 radii: s / q within 0.5 %."""
    cell = {"fibre_fraction": np.pi / 60**2, "mesh_size": 0.2, "interface_size": 0.0024, "order": 2, "refine": 1}
    load, _ = first_slip(*GLASS_EPOXY, friction)
    waypoints = [{"S11": -1.0, "S22": -1.0}, {"S11": -1.0 + 2 * load, "S22": -1.0 - 2 * load}]
    interface = WHOLE | {"friction": friction}
    case = {"cell": cell, "phases": GLASS_EPOXY, "plane": "strain", "interface": interface}
    points = solved(comm, **case, path={"waypoints": waypoints}).path
    slipped = next(p for p in points if p.load_factor > 0.5)
    assert slipped.stress[0] + 1.0 == pytest.approx(load, rel=5e-3)


OPENED = [[-0.01, -0.004, 0.01], [0.01, 0.01, -0.02]]
COLD = {"temperature": -300.0, "E33": 0.0}
STRENGTHS = {"normal_strength": 0.03, "tangential_strength": 0.035}
PATHS = {
    # Of the first rates one set of statuses balances all but the turning of the fibre.
    "one fibre": ({"mesh_size": 0.081}, GLASS_EPOXY, WHOLE | {"friction": 0.2}, PRESSED),
    "fibres that come free": ({"geometry": "hexagonal"}, EPOXY_GLASS, WHOLE | {"friction": 0.3}, OPENED),
    "loads that pass zero": ({}, EPOXY_GLASS, WHOLE | {"friction": 0.3}, [[0, 0, 0.01], [0, 0, -0.01], [0, 0, 0.01]]),
    # Slips stay, and no forces.
    "unloaded": (
        {"geometry": "hexagonal"},
        EPOXY_GLASS,
        WHOLE | {"friction": 0.3},
        [[-0.01, -0.01, 0.01], [0, 0, 0], [-0.01, -0.004, 0], [0, 0, 0]],
    ),
    "opened and pressed again": (
        {},
        EPOXY_GLASS,
        {"normal_strength": 0.02, "tangential_strength": 0.03, "friction": 0.5},
        [[-0.01, 0, 0], [-0.01, 0, 0.05], [-0.01, 0, -0.05], [0.02, 0, 0], [-0.01, 0, 0]],
    ),
    "breaks": ({"bodies": "plane"}, EPOXY_GLASS, STRENGTHS | {"friction": 0.4}, PRESSED),
    "breaks on springs": (
        {"geometry": "hexagonal"},
        EPOXY_GLASS,
        STRENGTHS | {"friction": 0.8, "normal_stiffness": 40.0, "tangential_stiffness": 15.0},
        [[-0.006, -0.003, 0.004], [-0.006, -0.003, 0.03], [-0.008, -0.002, -0.03]],
    ),
    # Clamped by cooling; shears along the fibres break bonds, too.
    "generalized": (
        {},
        EPOXY_GLASS,
        STRENGTHS | {"friction": 0.4, "axial_strength": 0.03},
        [COLD, COLD | {"S22": -0.02, "gamma13": 0.004}, COLD | {"gamma12": 0.03, "S23": 0.002}, {"gamma12": -0.02}],
    ),
    "generalized, on springs": (
        {"geometry": "hexagonal"},
        EPOXY_GLASS,
        STRENGTHS | {"friction": 0.3, "normal_stiffness": 40.0, "tangential_stiffness": 15.0},
        [COLD, COLD | {"gamma13": 0.02, "gamma12": 0.02}, COLD | {"gamma12": -0.03, "S13": -0.01}],
    ),
}


@pytest.mark.parametrize(
    ("name", "release"),
    [
        *(("fibres that come free", "all"), ("breaks on springs", "all"), ("breaks on springs", "worst")),
        ("generalized", "worst"),
    ],
)
def test_increments_are_those_of_the_twin(comm, name, release):
    """Implicit steps with given bounds of friction, by quadratic programmes."""
    cell, phases, interface, waypoints = PATHS[name]
    plane = "generalized" if name.startswith("generalized") else "strain"
    case = {"cell": cell, "phases": phases, "plane": plane}
    steps = 4 * len(waypoints)
    twin = LoadedTwin(comm, **case, interface=interface, path={"waypoints": waypoints})

    def followed():
        faces = RubbingFaces.of(twin.cell, twin.bonded, interface["friction"])
        return FrictionPath(faces, twin.cell, twin._law).increments(twin.loads, steps, release == "worst")

    known = on_root(comm, followed)
    path = {"waypoints": waypoints, "method": "increments", "increments": steps, "release": release}
    found = solved(comm, **case, interface=interface, path=path).path
    assert [p.broke for p in found] == [int(p.broke.sum()) for p in known]
    most, energy = max(np.abs(p.state.stress).max() for p in known), max(p.stored for p in known)
    for point, other in zip(found, known, strict=True):
        np.testing.assert_allclose(point.stress, other.state.stress[: len(point.stress)], atol=1e-7 * most)
        energies = (point.work, point.stored, point.friction_heat, point.dissipated)
        expected = (other.work, other.stored, other.heat, other.dissipated)
        np.testing.assert_allclose(energies, expected, atol=1e-7 * energy)
    assert found[-1].friction_heat > 0.0


@pytest.mark.parametrize("name", PATHS)
def test_paths_are_those_of_the_twin(comm, name):
    """Bonds break in one order at the same loads, with the same energies."""
    cell, phases, interface, waypoints = PATHS[name]
    plane = "generalized" if name.startswith("generalized") else "strain"
    case = {"cell": cell, "phases": phases, "plane": plane, "path": {"waypoints": waypoints}}
    twin, legs = LoadedTwin(comm, **case, interface=interface), len(waypoints)

    def followed():
        faces = RubbingFaces.of(twin.cell, twin.bonded, interface["friction"])
        return FrictionPath(faces, twin.cell, twin._law).follow(twin.loads)

    every = on_root(comm, followed)
    behind = [*(p.load_factor for p in every[1:]), np.inf]
    # What changes at the end of a leg comes before it.
    last = [p.load_factor < after - 1e-12 for p, after in zip(every, behind, strict=True)]
    known = [p for p, is_last in zip(every, last, strict=True) if p.broke.any() or (is_end(p, legs) and is_last)]
    found = [p for p in solved(comm, **case, interface=interface).path if p.broke or is_end(p, legs)]
    assert [p.broke for p in found] == [int(p.broke.sum()) for p in known]
    most, energy = max(np.abs(p.state.stress).max() for p in known), max(p.stored for p in known)
    for point, other in zip(found, known, strict=True):
        assert point.load_factor == pytest.approx(other.load_factor, abs=1e-8)
        np.testing.assert_allclose(point.stress, other.state.stress[: len(point.stress)], atol=1e-8 * most)
        energies = (point.work, point.stored, point.friction_heat, point.dissipated)
        expected = (other.work, other.stored, other.heat, other.dissipated)
        np.testing.assert_allclose(energies, expected, atol=1e-8 * energy)
    assert found[-1].friction_heat > 0.0
