"""Work of the loads on paths: what is not stored is lost in breaks, and without breaks nothing is."""

from itertools import pairwise

import numpy as np
import pytest
from support.loaded_twins import EPOXY_GLASS, is_end, relative, solved

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

EXACT = 1e-9
HEXAGONAL = {"geometry": "hexagonal"}
STRENGTH = {"normal_strength": 0.03, "tangential_strength": 0.04}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
ARC = {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 120.0}, {"fibre": 2, "angle": 360.0}]}
WAYPOINTS = {
    "strain": [{"E11": 0.012}, {"S11": -0.04}, {"S11": 0.03, "S12": 0.02}],
    "generalized": [{"temperature": -100.0}, {"S11": 0.03}, {"temperature": 20.0}, {"gamma13": 0.02, "S11": -0.02}],
}


def energies(path):
    """(p, 3) work, stored and dissipated."""
    return np.array([[p.work, p.stored, p.dissipated] for p in path])


def conjugates(path):
    """(p, m) strains and stresses."""
    return np.array([p.strain for p in path]), np.array([p.stress for p in path])


@pytest.mark.parametrize(("plane", "springs"), [("strain", SPRINGS), ("generalized", {})])
def test_work_is_stored_or_lost(comm, plane, springs):
    interface, waypoints = STRENGTH | springs, WAYPOINTS[plane]
    case = {"cell": HEXAGONAL, "phases": EPOXY_GLASS, "plane": plane, "interface": interface}
    path = solved(comm, **case, path={"waypoints": waypoints}).path
    assert sum(p.broke for p in path) > 3 and any(p.closed for p in path)
    work, stored, lost = energies(path).T
    assert np.abs(work - stored - lost).max() < EXACT * np.abs(work).max()
    assert lost[-1] > 0.02 * work.max() and (np.diff(lost) >= 0).all()
    assert all(p.dissipated_strain_controlled >= p.dissipated * (1 - EXACT) for p in path)
    if plane != "generalized":
        # Between points at which nothing breaks the response is straight.
        E, S = conjugates(path)
        own = [(k + 1, 0.5 * (S[k] + S[k + 1]) @ (E[k + 1] - E[k])) for k, p in enumerate(path[:-1]) if not p.broke]
        assert own and all(abs(work[k] - work[k - 1] - dW) < EXACT * np.abs(work).max() for k, dW in own)


@pytest.mark.one_rank
@pytest.mark.parametrize("plane", ["strain", "generalized"])
def test_a_path_back_without_breaks_is_the_way_there(comm, plane):
    """To no load and back, or the elastic strain of it: through contact, at no net work."""
    start = [{"temperature": -60.0}] if plane == "generalized" else []
    along = {"S13": 0.01} if plane == "generalized" else {}
    away = dict.fromkeys(("S11", *along), 0.0)
    waypoints = [*start, {"S11": 0.03, **along}, away, {"S11": 0.03, **along}, {"E11": 0.0}, {"S11": 0.03, **along}]
    cell, arcs = ({}, {"debonded": ARC["debonded"][:1]}) if start else (HEXAGONAL, ARC)
    case = {"cell": cell, "phases": EPOXY_GLASS, "plane": plane, "interface": STRENGTH | arcs}
    path = solved(comm, **case, path={"waypoints": waypoints}).path
    first = len(start) + 1
    ends = {round(p.load_factor * len(waypoints)): p for p in path if not p.broke and is_end(p, len(waypoints))}
    loaded = [ends[k] for k in (first, first + 2, first + 4)]
    assert sum(p.broke for p in path) > 0
    assert not any(p.broke for p in path if p.load_factor > first / len(waypoints))
    most = np.abs(energies(path)).max()
    for before, after in pairwise(loaded):
        assert np.abs(np.subtract(*energies([before, after]))).max() < EXACT * most
        assert relative(after.strain, before.strain) < EXACT and relative(after.stress, before.stress) < EXACT
        assert (after.open, after.closed) == (before.open, before.closed)


@pytest.mark.one_rank
def test_a_cycle_without_breaks_closes(comm):
    waypoints = [
        {"S11": -0.02, "S22": 0.01},
        {"S11": 0.03},
        {"S13": 0.02, "temperature": -40.0},
        {"S11": -0.03, "S22": 0.02},
        {"S13": 0.0, "S11": -0.02, "S22": 0.01, "temperature": 0.0},
    ]
    case = {"cell": HEXAGONAL, "phases": EPOXY_GLASS, "plane": "generalized", "interface": ARC}
    path = solved(comm, **case, path={"waypoints": waypoints}).path
    assert len(path) > len(waypoints) and not any(p.broke for p in path)
    first, last = (next(p for p in way if is_end(p, len(waypoints))) for way in (path, path[::-1]))
    most = energies(path).max()
    assert last.work == pytest.approx(first.work, abs=EXACT * most) and last.dissipated == 0.0
    assert relative(last.strain, first.strain) < EXACT and last.closed == first.closed
    assert max(p.closed for p in path) > min(p.closed for p in path)


@pytest.mark.one_rank
def test_cooling_a_free_cell_does_no_work_but_on_the_temperature(comm):
    """The work of the temperature is the stored energy: phases that expand alike store none."""
    alike = tuple(phase | {"expansion": 2e-5} for phase in EPOXY_GLASS)
    waypoints = [{"temperature": -100.0}, {"S11": 0.01}]
    paths = [
        solved(
            comm, cell={}, phases=phases, plane="generalized", interface=STRENGTH, path={"waypoints": waypoints}
        ).path
        for phases in (alike, EPOXY_GLASS)
    ]
    (free, pulled), (stressed, _) = paths
    assert relative(free.strain, -2e-3 * np.array([1, 1, 1, 0, 0, 0])) < EXACT
    assert abs(free.work) < EXACT * pulled.work and abs(free.stored) < EXACT * pulled.work
    E, S = conjugates([free, pulled])
    assert pulled.work == pytest.approx(0.5 * S[1] @ (E[1] - E[0]), rel=EXACT)
    assert stressed.stored > 0 and stressed.work == pytest.approx(stressed.stored, rel=EXACT)
