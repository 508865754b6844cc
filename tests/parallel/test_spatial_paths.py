"""Paths of long fibres in space: cooling, then load; axial shear; first events, and what does not depend on axes."""

import numpy as np
import pytest
from reference.spatial_forms import about_x3
from support.generalized_phases import CRYSTAL, WOOD
from support.loaded_twins import EPOXY_GLASS, compare_paths, document, is_end, relative, solved
from support.ranks import parallel_assert
from unit.mesh.faulty_meshes import MshFile, grid

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

EXACT = 1e-9
SQUARE, HEXAGONAL = {}, {"geometry": "hexagonal"}
THREE = {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4}
UNLIKE = (WOOD | {"expansion": [4e-5, 6e-5, 2e-5]}, CRYSTAL | {"expansion": [4e-6, 6e-6, -2e-6]})
STRENGTH = {"normal_strength": 0.03, "tangential_strength": 0.04}
ALONG = STRENGTH | {"axial_strength": 0.025}
QUADRATIC = ALONG | {"criterion": "quadratic"}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0, "axial_stiffness": 20.0}
ENERGY = SPRINGS | {"criterion": "energy", "toughness": 1e-5}
ARC = {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 80.0}]}
FREE = {"debonded": [{"fibre": 1, "angle": 360.0}]}
COOLED = {"temperature": -100.0}

CASES = {
    "axial stress": (THREE, EPOXY_GLASS, ALONG, [{"S13": 0.08, "S23": -0.03}]),
    "sheared and pulled": (HEXAGONAL, UNLIKE, QUADRATIC, [{"E11": 0.01, "gamma13": 0.03, "temperature": -50.0}]),
    "strength of springs": (SQUARE, UNLIKE, ALONG | SPRINGS, [{"S23": 0.05, "E33": 0.01, "S11": 0.05}]),
    "energy of springs": (SQUARE, EPOXY_GLASS, ENERGY | {"growth": "springs"}, [{"E11": 0.03, "gamma13": 0.03}]),
    "an arc that cooling clamps": (HEXAGONAL, EPOXY_GLASS, STRENGTH | ARC, [COOLED, {"S11": 0.026}, {"gamma13": 0.05}]),
    "a fibre that only cooling holds": (
        HEXAGONAL,
        EPOXY_GLASS,
        QUADRATIC | FREE,
        [COOLED, {"S11": 0.05}, {"S23": 0.03}],
    ),
    "sheared along to and fro": (
        SQUARE,
        UNLIKE,
        ALONG,
        [COOLED, {"gamma13": 0.02}, {"S13": -0.01}, {"gamma13": -0.03, "E11": 0.02}],
    ),
    "released after cooling": (SQUARE, EPOXY_GLASS, ENERGY, [COOLED, {"S11": 0.03}, {"gamma13": 0.08}]),
}


@pytest.mark.parametrize("name", CASES)
def test_paths_are_those_of_brute_force(comm, name):
    cell, phases, interface, waypoints = CASES[name]
    petsc = {"feti_pc_type": "influence"} if "toughness" in interface else None
    case = {"cell": cell, "phases": phases, "plane": "generalized", "interface": interface, "petsc": petsc}
    result, events = compare_paths(comm, **case, path={"waypoints": waypoints})
    broken = [e.load_factor for e in events if e.broke.any()]
    assert len(broken) > 3 and broken[-1] > 1 - 1 / len(waypoints)
    if "debonded" in interface:
        cooled = next(p for p in result.path if is_end(p, len(waypoints)))
        assert cooled.closed > 0 and cooled.load_factor < broken[0]


def test_debonded_nodes_carry_nothing_along_the_fibre(comm):
    waypoints = [COOLED, {"S11": 0.05, "gamma13": 0.03}]
    case = {"cell": HEXAGONAL, "phases": EPOXY_GLASS, "plane": "generalized", "interface": STRENGTH | ARC | SPRINGS}
    written = document(**case, path={"waypoints": waypoints})
    written["output"] = {"pictures": False, "states": "all"}
    result = run(Case.parse(written), comm, fields=True)
    whole = result.fields.gathered()
    parallel_assert(comm, whole is None or slips_freely(whole.states, result.path))


def slips_freely(states, path):
    """Return whether debonded nodes slip along the fibre without traction, closed ones with pressure, in all states."""
    last = states[-1]
    for state, point in zip(states, path, strict=True):
        debonded = state.status > 0
        assert (debonded.sum(), (state.status == 1).sum()) == (point.open + point.closed, point.closed)
        assert not state.axial_traction[debonded].any()
        assert not state.traction[debonded, 1].any() and not state.traction[state.status == 2].any()
        assert (state.traction[state.status == 1, 0] < EXACT).all()
    assert np.abs(last.axial_jump[last.status > 0]).min() > 0 and np.abs(last.axial_traction).max() > 0
    return bool(any(point.closed for point in path))


def hook(x, y):
    """Return a fibre without any symmetry, in a 4 x 4 grid."""
    return (int(4 * x), int(4 * y)) in {(1, 1), (2, 1), (2, 2)}


def quarter_turned(mesh):
    """Return the mesh turned by 90 degrees."""
    return MshFile({tag: (1.0 - y, x, 0.0) for tag, (x, y, _) in mesh.nodes.items()}, mesh.elements)


@pytest.fixture
def hooks(comm, shared_path):
    """Provide a folder with a cell and the same turned by 90 degrees."""
    if comm.rank == 0:
        grid(hook).write(shared_path / "cell.msh")
        quarter_turned(grid(hook)).write(shared_path / "turned.msh")
    comm.barrier()
    return shared_path


def test_a_cell_turns_with_its_load(comm, hooks):
    """S13 becomes S23, and S23 becomes -S13."""
    turned = tuple(phase | {"angle": phase["angle"] + 90.0} for phase in UNLIKE)
    case = {"plane": "generalized", "interface": ALONG | {"contact": True}}
    ways = [
        ("cell.msh", UNLIKE, [COOLED, {"S13": 0.05, "E11": 0.003}, {"S23": 0.02, "gamma12": 0.01}]),
        ("turned.msh", turned, [COOLED, {"S23": 0.05, "E22": 0.003}, {"S13": -0.02, "gamma12": -0.01}]),
    ]
    one, other = (
        solved(
            comm, hooks, **case, cell={"geometry": "mesh", "file": file}, phases=phases, path={"waypoints": way}
        ).path
        for file, phases, way in ways
    )
    assert len(one) == len(other) > 4 and sum(p.broke > 0 for p in one) > 2
    Q = about_x3(np.pi / 2)
    assert [p.broke for p in one] == [p.broke for p in other]
    assert relative([p.load_factor for p in other], [p.load_factor for p in one]) < EXACT
    expected = np.array([Q @ tensor(p.stress) @ Q.T for p in one])
    assert relative([tensor(p.stress) for p in other], expected) < EXACT


def tensor(stress):
    """(3, 3) of Voigt's [11, 22, 33, 23, 13, 12]."""
    a, b, c, d, e, f = stress
    return np.array([[a, f, e], [f, b, d], [e, d, c]])
