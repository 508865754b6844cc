"""Loads beyond what debonded faces carry: paths end at the limit, by closed forms and by a linear programme."""

import json

import numpy as np
import pytest
from reference.closed_forms import lame
from support.layered_meshes import layers
from support.loaded_twins import document, solved
from support.parted_columns import Columns
from support.ranks import assert_certified, write_once

from feti_homog import Case, run
from feti_homog.errors import ConvergenceError, NotCarriedError
from feti_homog.system.parallel.mpi_errors import on_root

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
PHASES = ({"young": 1.0, "poisson": 0.3}, {"young": 5.0, "poisson": 0.2})
WHOLE = {"debonded": [{"fibre": "all", "angle": 360.0}]}
EVENTS, INCREMENTS = {}, {"method": "increments", "increments": 6}
FREE = "nothing carries more: the faces slide freely"


@pytest.fixture
def laminate(comm, shared_path):
    write_once(comm, layers("MFFM", 0), shared_path / "cell.msh")
    return {"cell": {"geometry": "mesh", "file": "cell.msh"}, "phases": PHASES, "plane": "strain"}


def reached(comm, folder, asked):
    """Return the points of a path that does not reach its load, and its faults.  Collective."""
    with pytest.raises(ConvergenceError) as error:
        run(Case.parse(asked, folder), comm, out=folder / "out")
    return on_root(comm, lambda: json.loads((folder / "out" / "result.json").read_text())), str(error.value)


@pytest.mark.parametrize(
    ("bonds", "method"),
    [(WHOLE, INCREMENTS), ({"normal_strength": 1e-4, "tangential_strength": 1e-4}, EVENTS)],
    ids=["parted, increments", "weak, events"],
)
def test_a_laminate_carries_mu_times_its_pressure(comm, shared_path, laminate, method, bonds):
    """Resumed, it has the same points, and none of a leg behind the limit; its certificate holds."""
    interface, waypoints = bonds | {"friction": 0.5}, [{"S11": -0.01}, {"S12": 0.008}, {"S12": 0.0}]
    asked = document(**laminate, interface=interface, path={"waypoints": waypoints} | method)
    asked["output"] = {"pictures": False, "states": "all"}
    result, words = reached(comm, shared_path, asked)
    last = result["path"][-1]
    flexibility = np.mean([1.0 / lame(phase)[1] for phase in PHASES])
    assert result["status"] == "not converged" and FREE in words and "S11 -0.01, S12 0.005;" in words
    np.testing.assert_allclose(last["stress"], [-0.01, 0.0, 0.005], atol=1e-10)
    assert last["strain"][2] == pytest.approx(0.005 * flexibility, rel=1e-8) and last["friction_heat"] < 1e-15
    assert_certified(comm, shared_path / "out")
    with pytest.raises(ConvergenceError):
        run(Case.parse(asked, shared_path), comm, out=shared_path / "out", resume=True)
    again = on_root(comm, lambda: json.loads((shared_path / "out" / "result.json").read_text()))
    assert [point["stress"] for point in again["path"]] == [point["stress"] for point in result["path"]]


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("load", "method"),
    [({"S11": 0.01}, EVENTS), ({"S12": 0.01}, INCREMENTS), ({"S11": -0.01, "S12": 0.006}, EVENTS)],
    ids=str,
)
def test_parted_layers_carry_no_load_from_the_beginning(comm, shared_path, laminate, load, method):
    with pytest.raises(NotCarriedError, match="nothing carries more"):
        solved(comm, shared_path, **laminate, interface=WHOLE | {"friction": 0.5}, path={"to": load} | method)


@pytest.mark.parametrize("name", ["S13", "S23"])
def test_faces_that_are_free_along_the_fibres_carry_no_shear_along_them(comm, shared_path, laminate, name):
    """Layers normal to x1 carry S23 and no S13."""
    path = {"waypoints": [{"S11": -0.01}, {name: 0.001}]}
    case = laminate | {"plane": "generalized"}
    asked = document(**case, interface=WHOLE | {"friction": 0.5}, path=path)
    if name == "S23":
        assert run(Case.parse(asked, shared_path), comm).path[-1].stress[3] == pytest.approx(0.001)
        return
    result, words = reached(comm, shared_path, asked)
    assert FREE in words and [point["load_factor"] for point in result["path"]] == [0.5]


def test_the_last_load_that_is_carried_is_carried(comm, shared_path, laminate):
    """At the limit itself the strain is one of many; back from there the faces stick."""
    waypoints = [{"S11": -0.01}, {"S12": 0.005}, {"S12": -0.005}, {"S12": 0.0}]
    case = laminate | {"interface": WHOLE | {"friction": 0.5}, "path": {"waypoints": waypoints}}
    points = solved(comm, shared_path, **case).path
    flexibility = np.mean([1.0 / lame(phase)[1] for phase in PHASES])
    ends = [point for point in points if (4 * point.load_factor) % 1 == 0]
    np.testing.assert_allclose([p.strain[2] / flexibility for p in ends], [0, 0.005, -0.005, 0], atol=1e-12)
    assert all(p.friction_heat < 1e-15 for p in points)


@pytest.mark.one_rank
@pytest.mark.parametrize(("seed", "loose"), [(0, True), (1, False), (2, True)])
def test_columns_carry_the_shear_of_a_linear_programme(comm, shared_path, seed, loose):
    """Layers and loose blocks at 0.5 to 2 times their capacity, either sign, with unlike mu, by events and steps."""
    rng = np.random.default_rng(seed)
    columns, stress = Columns.random(rng, loose), -0.01
    capacity = columns.largest_shear(stress)
    if not loose:
        assert capacity == pytest.approx(-stress * min(columns.coefficients))
    write_once(comm, columns.mesh(), shared_path / "cell.msh")
    sign = rng.choice([-1.0, 1.0])
    for factor, method in ((rng.uniform(0.5, 0.99), EVENTS), (rng.uniform(1.01, 2.0), EVENTS), (1.3, INCREMENTS)):
        asked = columns.case(stress, sign * factor * capacity, method)
        if factor < 1.0:
            found = run(Case.parse(asked, shared_path), comm).path[-1].stress[2]
        else:
            result, words = reached(comm, shared_path, asked)
            found, factor = result["path"][-1]["stress"][2], 1.0
            assert FREE in words
        assert found == pytest.approx(sign * factor * capacity, rel=1e-8)
