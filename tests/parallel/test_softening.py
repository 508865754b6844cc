"""Interfaces that soften: paths against brute force, a laminate in closed form, limits of the law."""

import re
from contextlib import contextmanager
from itertools import pairwise
from unittest import mock

import numpy as np
import pytest
from reference.closed_forms import lame
from reference.softening_path import SofteningPath, Teeth, exact_stresses
from support.loaded_twins import EPOXY_GLASS, LoadedTwin, document, solved
from support.ranks import write_once
from unit.mesh.faulty_meshes import grid

from feti_homog import Case, run
from feti_homog.analysis import stepped_progress
from feti_homog.errors import ConvergenceError
from feti_homog.feti.exact.followed_response import FollowedResponse
from feti_homog.results import checkpoints
from feti_homog.system.parallel.mpi_errors import on_root
from feti_homog.verify.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

BILINEAR = {
    "law": "bilinear",
    "normal_stiffness": 100.0,
    "tangential_stiffness": 60.0,
    "normal_strength": 0.03,
    "tangential_strength": 0.05,
    "normal_toughness": 2e-5,
    "tangential_toughness": 6e-5,
    "teeth": 4,
}
TOUGH = BILINEAR | {"normal_toughness": 2e-4, "tangential_toughness": 6e-4}
INFLUENCE = {"feti_pc_type": "influence"}
PATHS = {
    "uniaxial": ("strain", {"petsc": INFLUENCE}, [{"E11": 0.03, "S22": 0.0, "S12": 0.004}]),
    "pressed and sheared": ("stress", {"petsc": INFLUENCE}, [{"E11": -0.04, "E22": 0.015, "gamma12": 0.01}]),
    "iterative": ("strain", {}, [{"E11": 0.02, "E22": 0.005, "gamma12": 0.004}]),
    "cycle": (
        "strain",
        {"petsc": INFLUENCE},
        [{"E11": 0.006, "S12": 0.004}, {"E11": -0.004, "S12": 0.0}, {"E11": 0.012, "S12": -0.01}],
    ),
    "faces overlap": (
        "strain",
        {"petsc": INFLUENCE, "interface": TOUGH | {"contact": False}},
        [{"E11": -0.012, "gamma12": 0.03}, {"E11": 0.006, "gamma12": 0.0}, {"E11": -0.008, "gamma12": -0.03}],
    ),
}


def law_of(interface):
    """Return the law of the oracle."""
    kinds = (tuple(interface[f"{mode}_{kind}"] for mode in ("normal", "tangential")) for kind in KINDS)
    return Teeth(*kinds, interface.get("mixing_exponent", 2.0), interface["teeth"])


KINDS = ("stiffness", "strength", "toughness")


def test_a_running_path_shows_how_many_bonds_are_damaged(comm, monkeypatch):
    """From the second event on, at least one bond and at most one bond per broken tooth is damaged."""
    calls = list[tuple[str, float]]()

    @contextmanager
    def shown(progress, label):
        yield lambda share, count, text, known: calls.append(text)

    monkeypatch.setattr(stepped_progress, "shown", shown)
    more = {"petsc": INFLUENCE, "path": {"waypoints": [{"E11": 0.01}]}}
    path = solved(comm, cell={}, phases=EPOXY_GLASS, plane="strain", interface=BILINEAR, **more).path
    begin = re.compile(r"(1 event|\d+ events), (\d+) bonded, (\d+) broken, (\d+) damaged$")
    matches = [begin.match(text) for text in calls]
    assert len(matches) == len(path) and matches[0][1] == "1 event" and int(matches[0][4]) == 0
    softened = np.cumsum([point.softened for point in path])
    for match, before, point in zip(matches[1:], softened[:-1], path[1:], strict=True):
        assert 0 < int(match[4]) + int(match[3]) <= before and int(match[2]) == point.bonded
    assert int(matches[1][4]) == path[0].softened


@pytest.mark.one_rank
@pytest.mark.parametrize("name", PATHS)
def test_paths_are_those_of_brute_force(comm, name):
    plane, others, waypoints = PATHS[name]
    case = {"cell": {}, "phases": EPOXY_GLASS, "plane": plane, "interface": BILINEAR} | others
    case |= {"path": {"waypoints": waypoints} if len(waypoints) > 1 else {"to": waypoints[0]}}
    result, twin = solved(comm, **case), LoadedTwin(comm, **case)

    def followed():
        path = SofteningPath(twin.cell, law_of(case["interface"]))
        return path.follow(twin.loads, 12), path.fracture

    events, fracture = on_root(comm, followed)
    points = [p for p in result.path if p.broke + p.softened or abs(p.load_factor * len(waypoints) % 1) < 1e-9]
    assert len(points) == len(events) > 20
    size = np.abs([e.state.stress for e in events]).max()
    energy = max(e.state.stored for e in events)
    for k, (point, event) in enumerate(zip(points, events, strict=True)):
        assert point.broke + point.softened == event.broke.sum()
        assert point.load_factor == pytest.approx(event.load_factor, rel=1e-8)
        np.testing.assert_allclose(point.stress, event.state.stress, atol=1e-8 * size)
        assert point.dissipated == pytest.approx(event.dissipated, abs=1e-8 * energy)
        taken = fracture[sum(bool(e.broke.any()) for e in events[:k])]
        assert point.fracture_energy == pytest.approx(taken, rel=1e-8, abs=1e-12 * energy)
    _check_the_energy_book(result.path)


@pytest.mark.one_rank
def test_teeth_converge_to_the_law(comm):
    """Compare with the exact law by small steps of the strain; so tough an interface has no snap-back."""
    tough = BILINEAR | {"normal_toughness": 4e-4, "tangential_toughness": 8e-4}
    case = {"cell": {}, "phases": EPOXY_GLASS, "plane": "strain", "petsc": INFLUENCE, "path": {"to": {"E11": 0.03}}}
    case["path"]["to"] |= {"E22": 0.0, "gamma12": 0.0}
    twin, steps = LoadedTwin(comm, interface=tough, **case), 40
    exact = on_root(comm, lambda: exact_stresses(twin.cell, law_of(tough), twin.loads[0], steps))[:, 0]
    errors = []
    for teeth in (5, 10, 20):
        rising = solved(comm, interface=tough | {"teeth": teeth}, **case).rising_strain()
        found = np.interp(np.arange(1, steps + 1) / steps * 0.03, rising["E11"], rising["S11"])
        errors.append(np.sqrt(np.mean((found - exact) ** 2)) / exact.max())
    assert exact[-1] < 0.7 * steps * exact[0]
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(2.0, rel=0.35)
    assert errors[-1] < 0.02


def falsify(path):
    """Scale multipliers of the last of the teeth, which F lambda did not confirm; returns the number of its event."""
    signature, *contents = [content for _, content in checkpoints.records(path)]
    events = [*map(checkpoints.unpacked, contents)]
    last = max(number for number, event in enumerate(events) if event["path"][5] > 0)
    assert np.isnan(events[last]["alpha"]).all() and not events[last]["confirmed"] and last > 0
    events[last]["lam"] *= 1.0 + 1e-3
    records = [checkpoints.record(checkpoints.packed(event)) for event in events]
    path.write_bytes(checkpoints.begin(signature.decode()) + b"".join(records))
    return last


@pytest.mark.parametrize("falsified", [False, True])
def test_a_path_goes_on_where_it_was_ended(comm, shared_path, falsified):
    """The checkpoint carries the damage: the rest of the path is that of a run without a break.

    An event that does not hold is found again, and so are those after it.
    """
    written = document({}, EPOXY_GLASS, "strain", BILINEAR, INFLUENCE, path={"waypoints": PATHS["cycle"][2]})
    whole = run(Case.parse(written), comm).path
    known = len(whole) // 2
    written["path"]["max_events"] = known
    with pytest.raises(ConvergenceError, match="max_events"):
        run(Case.parse(written), comm, out=shared_path / "out")
    if falsified:
        known = on_root(comm, falsify, shared_path / "out" / "checkpoint" / "events")
    del written["path"]["max_events"]
    result = run(Case.parse(written), comm, out=shared_path / "out", resume=True)
    assert result.resumed == known and len(result.path) == len(whole)
    for found, expected in zip(result.path, whole, strict=True):
        assert (found.broke, found.softened) == (expected.broke, expected.softened)
        np.testing.assert_allclose(found.stress, expected.stress, atol=1e-12)
        np.testing.assert_allclose(found.damaged_share, expected.damaged_share)


def test_a_wrong_answer_does_not_outlive_the_next_confirmation(comm):
    """Multipliers that follow softening bonds get an error at every tooth, which F lambda alone would never see."""
    case = {"cell": {"mesh_size": 0.3}, "phases": EPOXY_GLASS, "plane": "strain", "petsc": INFLUENCE}
    case |= {"interface": BILINEAR, "path": {"waypoints": [{"E11": 0.03}]}}
    soften = FollowedResponse.soften

    def distorted(self, *arguments):
        done = soften(self, *arguments)
        self.answer = self.answer * (1.0 + 1e-3)
        return done

    with mock.patch.object(FollowedResponse, "soften", distorted), pytest.raises(ConvergenceError, match="columns"):
        solved(comm, **case)


@pytest.mark.one_rank
def test_increments_count_bonds_that_soften_once(comm, shared_path):
    """Bonds that lose several teeth in a step are one each: states before and after have as many."""
    path = {"waypoints": [{"E11": 0.012, "gamma12": 0.004}], "method": "increments", "increments": 3}
    written = document({}, EPOXY_GLASS, "strain", TOUGH, INFLUENCE, path=path)
    written["output"] |= {"fields": True, "states": "all"}
    result = run(Case.parse(written), comm, out=shared_path / "out")
    assert sum(point.softened for point in result.path) > 4
    certificate = on_root(comm, verify, shared_path / "out")
    assert certificate.holds, certificate


MOOSE = {
    "law": "bilinear",
    "normal_stiffness": 100.0,
    "tangential_stiffness": 100.0,
    "normal_strength": 1.0,
    "tangential_strength": 1.0,
    "normal_toughness": 0.05,
    "tangential_toughness": 0.1,
}
BRANCH = {"openings": [0.01, 0.05, 0.12, 0.2], "tractions": [1.0, 0.25, 0.0, 0.0]}
TABLE = {name: MOOSE[name] for name in MOOSE if name[:6] != "normal"} | {"law": "table"} | BRANCH
STRETCH = (0.05 - 0.005) / 1.0


@pytest.fixture
def strip(comm, shared_path):
    """Provide a function that runs a strip of fibre, a quarter of a cell of width 1, to a strain; M* of the cell."""
    write_once(comm, grid(lambda x, y: 0.25 < x < 0.5), shared_path / "strip.msh")
    phases = ({"young": 2.0, "poisson": 0.299}, {"young": 5.0, "poisson": 0.222})

    def stretched(interface, to):
        cell, petsc = {"geometry": "mesh", "file": "strip.msh"}, INFLUENCE
        case = {"phases": phases, "plane": "strain", "interface": interface, "petsc": petsc, "path": {"to": to}}
        return solved(comm, shared_path, cell=cell, **case)

    moduli = np.array([sum(np.array(lame(phase)) * (1, 2)) for phase in phases])
    return stretched, 1.0 / (np.array([0.75, 0.25]) @ (1.0 / moduli))


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("interface", "branch", "energy"),
    [
        (MOOSE, lambda x: np.interp(x, [0.01, 0.1], [1.0, 0.0]), 0.05),
        (MOOSE | {"law": "exponential"}, lambda x: np.exp(-(x - 0.01) / STRETCH), 0.05),
        (TABLE, lambda x: np.interp(x, BRANCH["openings"], BRANCH["tractions"]), 0.03875),
    ],
    ids=["bilinear", "exponential", "table"],
)
def test_a_laminate_follows_its_law_through_snap_back(comm, strip, interface, branch, energy):
    """S = M* (E - 2 jump / W): what the law takes is exact, points are about the curve, and the loss tends to it."""
    run_strip, modulus = strip
    excess = []
    for teeth in (10, 20):
        path = run_strip(interface | {"teeth": teeth}, {"E11": 1.0, "E22": 0.0, "gamma12": 0.0}).path
        S, E = np.array([p.stress[0] for p in path]), np.array([p.strain[0] for p in path])
        assert len(path) == teeth + 1 and abs(S[-1]) < 1e-9 and (np.diff(E[:-1]) < 0.0).any()
        jump = (E - S / modulus)[:-1] / 2
        # Each tooth is above the branch where it breaks, and after it below.
        assert (S[:-1] >= branch(jump) * (1 - 1e-9)).all()
        after = (S / E)[1:-1]
        slope = 2.0 / (1.0 / after - 1.0 / modulus)
        assert (slope * jump[:-1] <= branch(jump[:-1]) * (1 + 1e-9)).all()
        assert path[-1].fracture_energy == pytest.approx(2 * energy, rel=1e-12)
        _check_the_energy_book(path)
        excess.append(path[-1].dissipation_ratio - 1.0)
    assert excess[0] > excess[1] > 0.0 and excess[0] / excess[1] == pytest.approx(2.0, rel=0.35)


@pytest.mark.one_rank
@pytest.mark.parametrize("to", [{"E11": 3.0, "E22": 0.0, "gamma12": 0.0}, {"E11": 0.0, "E22": 0.0, "gamma12": 5.0}])
def test_limits_of_the_law(comm, strip, to):
    """One tooth is the energy criterion on springs, the least toughness a strength on them.

    The largest numbers are neither.
    """
    run_strip, _ = strip
    springs = {name: MOOSE[name] for name in ("normal_stiffness", "tangential_stiffness")}
    strengths = {name: MOOSE[name] for name in ("normal_strength", "tangential_strength")}
    by_energy = springs | {"criterion": "energy", "growth": "springs", "toughness": 0.05, "mode_sensitivity": 0.5}
    strong = {name: 1e9 * value for name, value in MOOSE.items() if "str" in name or "tough" in name} | springs
    strong |= {"law": "bilinear", "normal_toughness": 1e18, "tangential_toughness": 1e18, "teeth": 2}
    least = {"normal_toughness": 0.005, "tangential_toughness": 0.005, "teeth": 1}
    pairs = [(MOOSE | {"teeth": 1}, by_energy), (MOOSE | least, springs | strengths), (strong, springs)]
    for softening, other in pairs:
        found, expected = run_strip(softening, to).path, run_strip(other, to).path
        assert len(found) == len(expected)
        for one, two in zip(found, expected, strict=True):
            assert one.load_factor == pytest.approx(two.load_factor, rel=1e-9)
            np.testing.assert_allclose(one.stress, two.stress, atol=1e-9)
            assert one.dissipated == pytest.approx(two.dissipated, abs=1e-9)


def _check_the_energy_book(path):
    """Where nothing breaks the work is that of the mean stress on the mean strain, on straight lines."""
    largest, work = max(p.stored for p in path), 0.0
    for before, after in pairwise(path):
        if before.broke + before.softened == 0:
            work = (after.strain - before.strain) @ (after.stress + before.stress) / 2
            assert after.work - before.work == pytest.approx(work, abs=1e-9 * largest)
        assert after.work == pytest.approx(after.stored + after.dissipated, abs=1e-9 * largest)
        assert after.dissipated >= before.dissipated - 1e-12 * largest
