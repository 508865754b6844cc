"""Paths that return to zero stress: what is left is rounding of the tractions before, and their scale is its scale."""

import shutil
from dataclasses import asdict

import h5py
import numpy as np
import pytest
from support.falsifications import broken
from support.ranks import assert_certified, parallel_assert

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

GPA = 1e-9
LOOSE = {"debonded": [{"fibre": "all", "centre": 0.0, "angle": 360.0}]}
HALF = {"debonded": [{"fibre": "all", "centre": 0.0, "angle": 120.0}]}
RUBS, STEPS = {"friction": 0.3}, {"method": "increments", "increments": 6}
SHEAR = [{"gamma12": 0.015}, {"gamma12": 0.0}]
CASES = {
    "shear": (LOOSE | RUBS, SHEAR, {}),
    "pull": (LOOSE | RUBS, [{"E11": 0.01, "gamma12": 0.0}, {"E11": 0.0}], {}),
    "push": (HALF | RUBS, [{"E11": -0.01}, {"S11": 0.0}], {}),
    "stress": (LOOSE | RUBS, [{"S12": 10e6}, {"S12": 0.0}], {}),
    "parted steps": (HALF | RUBS, [{"E11": 0.01}, {"E11": 0.0}], STEPS),
    "small steps beyond": (LOOSE | RUBS, [*SHEAR, {"gamma12": 1e-7}], STEPS),
    "beyond": (LOOSE | RUBS, [*SHEAR, {"gamma12": 1e-7}], {}),
    "without friction": (LOOSE, SHEAR, {}),
    "steps without friction": (HALF, [{"S22": -10e6}, {"S22": 0.0}], STEPS),
    "cooled": (HALF, [{"temperature": -50.0}, {"temperature": 0.0}], {}),
    "rubbing and cooled": (HALF | RUBS, [{"temperature": -50.0}, SHEAR[0], {"gamma12": 0.0, "temperature": 0.0}], {}),
}


def case(kind, unit=1.0, mesh_size=0.3):
    """Return a case with stresses in `unit` Pa."""
    interface, waypoints, path = CASES[kind]
    is_cooled = "temperature" in waypoints[0]
    phases = {"matrix": (2790e6, 0.33, 60e-6), "fibre": (70800e6, 0.22, 5e-6)}
    names = ("young", "poisson", "expansion")[: 2 + is_cooled]
    loads = [{name: value * (unit if name[0] == "S" else 1.0) for name, value in load.items()} for load in waypoints]
    return Case.parse({
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "fibre_radius": 7.5, "mesh_size": mesh_size},
        "material": {
            name: dict(zip(names, (young * unit, *others), strict=False)) for name, (young, *others) in phases.items()
        },
        "analysis": {"type": "path", "plane": "generalized" if is_cooled else "strain"},
        "interface": interface,
        "path": {"waypoints": loads} | path,
        "decomposition": {"subdomains": 12},
        "output": {"pictures": False, "states": "all"},
    })  # fmt: skip


@pytest.mark.one_rank
@pytest.mark.parametrize("kind", [kind for kind in CASES if kind != "beyond"])
def test_a_path_that_returns_to_zero_stress_is_done(comm, shared_path, kind):
    # On this mesh of one rank rounding is larger than the limits of verify.
    fine = {"mesh_size": 0.08} if kind == "shear" and comm.size == 1 else {}
    result = run(case(kind, **fine), comm, out=shared_path)
    assert result.status == "done"
    largest, last = (max(np.abs(point.stress).max() for point in points) for points in (result.path, result.path[-1:]))
    assert last <= 1e-4 * largest if "beyond" in kind else last <= max(1e-12 * largest, 1e-3)
    assert_certified(comm, shared_path)
    of_units = [asdict(checks) for checks in (result.checks, run(case(kind, GPA, **fine), comm).checks)]
    errors = np.array([[error or 0.0 for error in checks.values()] for checks in of_units])
    np.testing.assert_allclose(*errors, rtol=0.0, atol=1e-9)


def test_a_path_goes_on_from_zero_stress(comm, shared_path):
    """The last event of the checkpoint, at zero stress, holds, and its scale is that of the whole path."""
    whole = run(case("beyond"), comm, out=shared_path / "whole")
    count = 1 + [round(3 * point.load_factor, 9) for point in whole.path].index(2.0)
    with pytest.raises(ConvergenceError, match="max_events"):
        run(case("beyond").replace({"path.max_events": count}), comm, out=shared_path / "parts")
    resumed = run(case("beyond"), comm, out=shared_path / "parts", resume=True)
    assert resumed.resumed == count and resumed.status == "done" and resumed.checks == whole.checks
    stress, expected = (np.array([point.stress for point in result.path]) for result in (resumed, whole))
    np.testing.assert_allclose(stress, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    assert_certified(comm, shared_path / "parts")


@pytest.mark.parametrize(("component", "laws"), [(0, {"tension", "free faces"}), (1, {"free faces"})])
def test_a_traction_at_zero_stress_is_seen(comm, shared_path, component, laws):
    """A ten thousandth of the largest traction on the path, on a face that bears nothing any more."""
    run(case("shear"), comm, out=shared_path / "out")

    def falsified():
        shutil.copytree(shared_path / "out", shared_path / "other")
        with h5py.File(shared_path / "other" / "result.h5", "r+") as file:
            states = [file[f"state/{number}"] for number in sorted(map(int, file["state"]))]
            traction, closed = states[-1]["traction"][()], np.flatnonzero(states[-1]["status"][()] == 1)
            traction[closed[0], component] += 1e-4 * max(np.abs(state["traction"][()]).max() for state in states)
            states[-1]["traction"][...] = traction
        return broken(shared_path / "other") - {"files"}

    found = on_root(comm, falsified)
    parallel_assert(comm, laws & found and "equilibrium" in found, str(found))
