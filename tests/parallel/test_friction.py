"""Paths of debonded faces with Coulomb friction: an independent prototype, a slow twin, and every law of `verify`."""

import json

import numpy as np
import pytest
from reference.friction import RubbingFaces
from reference.friction_path import FrictionPath
from reference.references import RUBBING_HEATS, RUBBING_STRESSES, RUBBING_WAYPOINTS
from support.loaded_twins import EPOXY_GLASS, LoadedTwin, document, is_end, solved
from support.ranks import PIECES, assert_certified

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
WHOLE = {"debonded": [{"fibre": "all", "angle": 360.0}]}
SOFTENING = {"law": "bilinear", "normal_stiffness": 80.0, "tangential_stiffness": 60.0, "teeth": 3}
SOFTENING |= {"normal_toughness": 4e-5, "tangential_toughness": 6e-5}
TOUGH = {
    f"{mode}_{kind}": x for mode in ("normal", "tangential") for kind, x in (("strength", 0.015), ("toughness", 0.01))
}
PHASES = ({"young": 2790.0, "poisson": 0.33}, {"young": 70800.0, "poisson": 0.22})


@pytest.mark.one_rank
def test_one_fibre_slides_as_in_a_prototype(comm):
    """Stresses at the waypoints within 0.3 % of the largest, heat within 2 % on elements of 1.3."""
    cell = {"geometry": "square", "fibre_radius": 7.5, "mesh_size": 0.08, "interface_size": 0.06, "refine": 1}
    path = {"waypoints": [list(point) for point in RUBBING_WAYPOINTS]}
    found = solved(comm, cell=cell, phases=PHASES, plane="strain", interface=WHOLE | {"friction": 0.2}, path=path)
    points = found.path
    assert sum("[path] no bond of fibre 1 holds: with friction" in remark for remark in found.remarks) == 1
    ends = [point for point in points if is_end(point, len(RUBBING_WAYPOINTS))]
    for point, stress, heat in zip(ends, RUBBING_STRESSES[0.21], RUBBING_HEATS[0.21].value, strict=True):
        np.testing.assert_allclose(point.stress, stress.value, atol=3e-3 * 92.0)
        assert point.friction_heat == pytest.approx(heat, rel=0.02, abs=1e-4)
    work, stored, heat = np.array([[p.work, p.stored, p.friction_heat] for p in points]).T
    assert np.abs(work - stored - heat).max() < 1e-10 * work.max() and (np.diff(heat) >= -1e-14).all()


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("waypoints", "springs"),
    [
        ([{"E11": -0.01}, {"gamma12": 0.02}, {"gamma12": -0.02}, {"E11": 0.004}, {"E11": -0.01}], {}),
        ([{"S11": -0.02}, {"gamma12": 0.03}, {"S11": -0.005, "gamma12": -0.01}], {}),
        ([{"S22": -0.03}, {"S12": 0.006}, {"S12": -0.006}], {"normal_stiffness": 80.0, "tangential_stiffness": 30.0}),
    ],
)
def test_paths_are_those_of_a_slow_twin(comm, waypoints, springs):
    interface = {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 150.0}]} | springs
    case = {"cell": {"mesh_size": 0.3}, "phases": EPOXY_GLASS, "plane": "strain", "path": {"waypoints": waypoints}}
    twin = LoadedTwin(comm, **case, interface=interface)
    expected = on_root(comm, lambda: FrictionPath(RubbingFaces.of(twin.cell, twin.bonded, 0.4)).follow(twin.loads))
    result = solved(comm, **case, interface=interface | {"friction": 0.4})
    assert not any("no bond of" in remark for remark in result.remarks)
    found = result.path
    known = np.array([point.load_factor for point in expected])
    most = max(np.abs(point.state.stress).max() for point in expected)
    assert len(found) > len(waypoints) + 2
    for point in found:
        k = int(np.abs(known - point.load_factor).argmin())
        assert point.load_factor == pytest.approx(known[k], abs=1e-8)
        np.testing.assert_allclose(point.stress, expected[k].state.stress[:3], atol=1e-7 * most)
        assert point.friction_heat == pytest.approx(expected[k].heat, abs=1e-7 * most * 0.01)


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("plane", "law"),
    [("strain", {}), ("generalized", SOFTENING)],
    ids=["strength", "generalized, softening"],
)
def test_breaks_with_friction_obey_every_law_resumed_too(comm, shared_path, plane, law):
    interface = {"normal_strength": 0.05, "tangential_strength": 0.05, "friction": 0.3} | law
    interface |= {"debonded": [{"fibre": 1, "angle": 360.0}, {"fibre": 2, "angle": 90.0}]}
    cell = {"geometry": "random", "fibres": 3, "seed": 3, "fibre_fraction": 0.35, "mesh_size": 0.2}
    path = {"waypoints": [{"S11": -0.05}, {"gamma12": 0.03}, {"gamma12": -0.02}, {"S11": 0.02}]}
    if plane == "generalized":
        cold = {"temperature": -200.0, "E33": 0.0}
        path = {"waypoints": [cold, cold | {"gamma13": 0.02, "gamma12": 0.02}, {"S23": 0.005, "gamma12": -0.04}]}
    asked = document(cell, EPOXY_GLASS, plane, interface, path=path) | {"decomposition": PIECES}
    asked["output"] = {"pictures": False, "states": 6}
    short = asked | {"path": path | {"max_events": 25}}
    with pytest.raises(ConvergenceError):
        run(Case.parse(short), comm, out=shared_path / "out")
    result = run(Case.parse(asked), comm, out=shared_path / "out", resume=True)
    assert sum(point.broke for point in result.path) > 10 and result.path[-1].friction_heat > 0.0
    assert_certified(comm, shared_path / "out")


def test_an_unloaded_cell_keeps_slips_and_resumes_between_changes(comm, shared_path):
    """Certified at no stress; resumed, the path has the points of the whole one, and from known points its checks."""
    waypoints = [{"E11": -0.01, "E22": -0.01}, {"gamma12": 0.06}, {"gamma12": -0.06}]
    waypoints += [{"S11": 0.0, "S22": 0.0, "S12": 0.0}]
    interface, path = WHOLE | {"friction": 0.3}, {"waypoints": [*waypoints, {"S11": 0.02}]}
    asked = document({"mesh_size": 0.2}, EPOXY_GLASS, "strain", interface, path=path)
    asked["output"] = {"pictures": False, "states": "all"}
    whole = run(Case.parse(asked), comm).path
    short, checks = Case.parse(asked | {"path": path | {"max_events": 7}}), []
    for resume in (False, True):
        with pytest.raises(ConvergenceError):
            run(short, comm, out=shared_path / "out", resume=resume)
        checks.append(on_root(comm, lambda: json.loads((shared_path / "out" / "result.json").read_text())["checks"]))
    assert checks[1] == checks[0] and "kkt_friction" in checks[0]
    found = run(Case.parse(asked), comm, out=shared_path / "out", resume=True).path
    np.testing.assert_allclose([p.load_factor for p in found], [p.load_factor for p in whole], atol=1e-9)
    assert found[-1].friction_heat > 0.0
    assert_certified(comm, shared_path / "out")


@pytest.mark.one_rank
@pytest.mark.parametrize(("bonds", "rubs"), [
    ({}, False), (WHOLE, True), (SOFTENING | TOUGH | {"friction_on_damage": True}, True), (SOFTENING | TOUGH, False),
])  # fmt: skip
def test_friction_without_debonding_or_damage_is_remarked(comm, bonds, rubs):
    interface, path = {"friction": 0.3} | bonds, {"waypoints": [{"E11": -0.01}, {"E11": 0.01}]}
    result = run(Case.parse(document({"mesh_size": 0.3}, EPOXY_GLASS, "strain", interface, path=path)), comm)
    line = "[interface] friction: without effect, for no face is debonded and no bond breaks"
    assert (line in result.remarks) is not rubs


@pytest.mark.one_rank
def test_a_fibre_that_is_loose_in_its_bonded_coating_is_remarked(comm):
    cell, coated = {"mesh_size": 0.3, "coating": 0.2}, dict(zip(("matrix", "fibre"), EPOXY_GLASS, strict=True))
    asked = document(cell, EPOXY_GLASS, "strain", {}, path={"to": {"gamma12": 0.01}})
    asked["material"] = coated | {"coating": EPOXY_GLASS[0]}
    asked["interface"] = [
        WHOLE | {"between": ["fibre", "coating"], "friction": 0.3},
        {"between": ["coating", "matrix"], "normal_strength": 1e3, "tangential_strength": 1e3},
    ]
    assert any("no bond of fibre 1 holds" in remark for remark in run(Case.parse(asked), comm).remarks)


@pytest.mark.one_rank
def test_a_leg_through_no_load_ends_at_its_waypoint(comm):
    """Where the faces close at no temperature, tractions of rounding become zero, but not the rest of the way."""
    interface = {"normal_strength": 20.0, "tangential_strength": 30.0, "friction": 0.3}
    interface["debonded"] = [{"fibre": 1, "angle": 120.0}]
    path = {"waypoints": [{"temperature": 79.3}, {"gamma12": 0.01}, {"gamma12": 0.0}, {"temperature": -51.7}]}
    points = solved(
        comm, cell={"mesh_size": 0.2}, phases=EPOXY_GLASS, plane="generalized", interface=interface, path=path
    ).path
    ends = [point for point in points if is_end(point, 4)]
    assert [(p.temperature, p.strain[-1]) for p in ends] == [
        (79.3, ends[0].strain[-1]),
        (79.3, 0.01),
        (79.3, 0.0),
        (-51.7, 0.0),
    ]


@pytest.mark.one_rank
@pytest.mark.parametrize(("seed", "mesh_size", "friction"), [(0, 0.12, 0.3), (2, 0.14, 0.8)])
def test_a_load_passes_through_zero(comm, seed, mesh_size, friction):
    """Where loose fibres have lost all tractions at once, and the next leg begins from faces at all their limits."""
    cell = {"geometry": "random", "fibre_fraction": 0.4, "fibres": 5, "seed": seed, "mesh_size": mesh_size}
    interface = {"normal_strength": 20.0, "tangential_strength": 30.0, "friction": friction}
    path = {"waypoints": [{"E11": strain} for strain in (0.012, -0.012, 0.012, -0.012)]}
    points = solved(comm, cell=cell, phases=PHASES, plane="strain", interface=interface, path=path).path
    assert points[-1].load_factor == 1.0
    energies = np.array([[p.work, p.stored, p.dissipated, p.friction_heat] for p in points])
    work, *parts = energies.T
    assert np.abs(work - sum(parts)).max() < 1e-10 * energies.max() and (np.diff(energies[:, 3]) >= -1e-14).all()


@pytest.mark.one_rank
def test_increments_reach_zero_load(comm):
    """Where no face of the loose fibres carries a force, and slips may have any direction."""
    cell = {"geometry": "random", "fibre_fraction": 0.3, "fibres": 8, "seed": 4, "mesh_size": 0.12}
    interface = {"normal_strength": 25.0, "tangential_strength": 30.0, "friction": 1.2}
    waypoints = [
        {"E11": 0.01, "S22": -20.0},
        {"E11": -0.01, "S22": 0.0},
        {"gamma12": 0.02},
        {"E11": 0.0, "gamma12": 0.0},
    ]
    path = {"waypoints": waypoints, "method": "increments", "increments": 80}
    phases = ({"young": 3000.0, "poisson": 0.35}, {"young": 70000.0, "poisson": 0.22})
    points = solved(comm, cell=cell, phases=phases, plane="strain", interface=interface, path=path).path
    assert points[-1].load_factor == 1.0
    assert np.abs(points[-1].stress).max() < 1e-9 * max(np.abs(point.stress).max() for point in points)


@pytest.mark.parametrize(("friction", "under_pressure"), [({}, 1), ({"friction": 0.3}, 0)], ids=["smooth", "friction"])
def test_a_fibre_that_nothing_touches_moves_freely_and_one_under_pressure_turns(comm, friction, under_pressure):
    case = {"cell": {"mesh_size": 0.3}, "phases": EPOXY_GLASS, "plane": "strain", "interface": WHOLE | friction}
    waypoints = [{"E11": sign * 0.01, "E22": sign * 0.01} for sign in (1, -1)]
    points = solved(comm, **case, path={"waypoints": waypoints}).path
    assert [p.free_motions for p in points if is_end(p, 2)] == [3, under_pressure]


@pytest.mark.one_rank
def test_increments_come_near_to_events_and_obey_every_law(comm, shared_path):
    """Loops of a debonded fibre beside bonds that soften and rub."""
    waypoints = [{"E11": -0.01, "E22": -0.006}, {"gamma12": 0.03}, {"gamma12": -0.03}, {"gamma12": 0.01}]
    interface = SOFTENING | {"friction": 0.3, "friction_on_damage": True, "normal_strength": 0.06}
    interface |= {"tangential_strength": 0.06, "debonded": [{"fibre": 1, "angle": 200.0}]}
    case = {"cell": {"mesh_size": 0.3}, "phases": EPOXY_GLASS, "plane": "strain", "interface": interface}
    exact = solved(comm, **case, path={"waypoints": waypoints}).path
    asked = document(**case, path={"waypoints": waypoints, "method": "increments", "increments": 16})
    asked["output"] = {"pictures": False, "states": 9}
    found = run(Case.parse(asked), comm, out=shared_path / "out").path
    known, other = (np.array([[*p.stress, p.friction_heat] for p in path if is_end(p, 4)]) for path in (exact, found))
    assert (np.abs(other - known).max(axis=0) < 0.15 * np.abs(known).max(axis=0)).all()
    assert sum(p.softened for p in exact) > 5
    assert_certified(comm, shared_path / "out")
