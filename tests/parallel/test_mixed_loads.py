"""Equilibria under strains, stresses and a temperature, against the condensed cell, stiffness and compliance."""

import numpy as np
import pytest
from support.generalized_phases import CRYSTAL, WOOD
from support.loaded_twins import EPOXY_GLASS, LoadedTwin, loads_of, relative, solved
from unit.mesh.faulty_meshes import grid, node

from feti_homog.errors import ConvergenceError

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

TWIN, EXACT = 1e-8, 1e-9
ARCS = {"debonded": [{"fibre": "all", "centre": 20.0, "angle": 80.0}]}
WHOLE = {"debonded": [{"fibre": 1, "angle": 360.0}, {"fibre": 2, "centre": -70.0, "angle": 120.0}]}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
KINDS = {
    "bonded": None,
    "free faces": ARCS | {"contact": False},
    "free fibre": WHOLE | {"contact": False},
    "contact": ARCS,
    "free fibre in contact": WHOLE,
    "springs": SPRINGS,
    "springs in contact": WHOLE | SPRINGS,
}
COMBINED = ("bonded", "free fibre", "free fibre in contact", "springs in contact")
CELLS = {"hexagonal": {"geometry": "hexagonal"}, "quadratic": {"geometry": "hexagonal", "order": 2, "mesh_size": 0.5}}
IN_PLANE = {
    "pulled": {"E11": 0.01, "S22": 0.0, "S12": 0.02},
    "pressed": {"S11": -0.3, "E22": 0.002, "gamma12": 0.01},
    "stresses": {"S11": -0.1, "S22": 0.2, "S12": 0.05},
}
IN_SPACE = {
    "cooled": {"E11": 0.01, "S22": 0.1, "gamma13": 0.02, "S33": -0.1, "temperature": -100.0},
    "pressed": {"S11": -0.3, "E33": 0.01, "S23": 0.1, "gamma12": 0.01, "temperature": 50.0},
    "stresses": {"S11": 0.2, "S22": -0.3, "S13": 0.1},
}
UNLIKE = (WOOD | {"expansion": [4e-5, 6e-5, 2e-5]}, CRYSTAL | {"expansion": [4e-6, 6e-6, -2e-6]})


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("plane", "kind"),
    [*(("strain", kind) for kind in COMBINED), ("stress", "contact"), ("stress", "springs")],
)
def test_plane_equilibria_are_those_of_the_condensed_cell(comm, plane, kind):
    quadratic = (plane, kind) == ("stress", "contact")
    loads = {"pressed": IN_PLANE["pressed"]} if quadratic else IN_PLANE
    cell = CELLS["quadratic" if quadratic else "hexagonal"]
    compare(comm, loads, cell=cell, phases=EPOXY_GLASS, plane=plane, interface=KINDS[kind])


@pytest.mark.one_rank
@pytest.mark.parametrize("kind", COMBINED)
def test_equilibria_in_space_are_those_of_the_condensed_cell(comm, kind):
    case = {"cell": CELLS["hexagonal"], "phases": UNLIKE, "plane": "generalized", "interface": KINDS[kind]}
    if "springs" not in kind:
        compare(comm, IN_SPACE, **case)
        return
    case["interface"] = KINDS[kind] | {"axial_stiffness": 7.0}
    compare(comm, IN_SPACE, **case)
    pressed = {"pressed": IN_SPACE["pressed"]}
    compare(comm, pressed, **(case | {"cell": CELLS["quadratic"], "phases": EPOXY_GLASS}))


@pytest.mark.one_rank
@pytest.mark.parametrize("bonding", [None, ARCS], ids=["bonded", "contact"])
def test_stresses_that_rounding_misses_are_no_result(comm, bonding):
    """Fibres of such stiffness expand: what is left of the stresses are differences of numbers 1e10 times as large."""
    stiff = EPOXY_GLASS[0], EPOXY_GLASS[1] | {"young": 1e14}
    case = {"cell": CELLS["hexagonal"], "plane": "generalized", "interface": bonding}
    case["load"] = {"to": {"S11": 1e-3, "temperature": -50.0}}
    assert solved(comm, phases=EPOXY_GLASS, **case).checks.stress < EXACT
    with pytest.raises(ConvergenceError, match=r"check stress: .*expected at most"):
        solved(comm, phases=stiff, **case)


def compare(comm, loads, **case):
    """Compare the results with the oracle, whose stress is that of the other oracles under its last strain."""
    twin, closed, state = LoadedTwin(comm, **case, load={"to": next(iter(loads.values()))}), 0, None
    for to in loads.values():
        written = case | {"load": {"to": to}}
        load = loads_of(written)[0]
        found, state = solved(comm, **written).load, twin.equilibrium(load)
        m = len(found.strain)
        assert relative(found.strain, state.strain[:m]) < TWIN
        assert relative(found.stress, state.stress[:m]) < TWIN
        assert found.stored == pytest.approx(state.stored, rel=TWIN)
        assert found.stored_in_springs == pytest.approx(state.in_springs, rel=TWIN, abs=1e-14)
        assert found.closed == state.closed.sum()
        assert found.temperature == (load.values[6] if m == 6 else None)
        prescribed = np.where(load.by_stress[:m], found.stress, found.strain)
        assert np.abs(prescribed - load.values[:m]).max() < EXACT * np.abs(load.values[:m]).max()
        closed += found.closed
    if comm.rank == 0:
        assert relative(stress_under(twin, state.strain), state.stress) < EXACT
    debonded = case["interface"] is not None and "debonded" in case["interface"]
    assert (closed > 0) == (debonded and case["interface"].get("contact", True))


def stress_under(twin, strain):
    """Solve the programme in all displacements."""
    programme, springs, contact = twin.cell.programme, twin.springs, twin.cell.contact
    if twin.cell.d == 3:
        return programme.stress(strain, twin.bonded, contact, springs)
    if springs is None:
        return programme.solve(strain, twin.bonded, contact).stress
    return programme.solve_elastic(strain, twin.bonded, contact, springs[:2]).stress


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("plane", "kind"),
    [("stress", "springs"), ("generalized", "free faces")],
)
def test_a_single_stress_strains_the_cell_by_its_compliance(comm, plane, kind):
    phases = UNLIKE if plane == "generalized" else EPOXY_GLASS
    case = {"cell": CELLS["hexagonal"], "phases": phases, "plane": plane, "interface": KINDS[kind]}
    secants = solved(comm, **case, stiffness=None)
    S = np.linalg.inv(secants.effective_stiffness)
    names = ("S11", "S22", "S33", "S23", "S13", "S12") if plane == "generalized" else ("S11", "S22", "S12")
    for j in (0, len(names) - 1, len(names) - 2):
        load = solved(comm, **case, load={"to": {names[j]: 2.0}}).load
        assert relative(load.strain, 2.0 * S[:, j]) < EXACT
        assert load.stored == pytest.approx(2.0 * S[j, j], rel=EXACT)
    # A given strain with no stress beside it: the modulus is one over the compliance.
    load = solved(comm, **case, load={"to": {"E11": 0.01}}).load
    assert load.stress[0] == pytest.approx(0.01 / S[0, 0], rel=EXACT)
    assert np.abs(load.stress[1:]).max() < EXACT * load.stress[0]
    if plane == "generalized":
        load = solved(comm, **case, load={"to": {"temperature": -50.0}}).load
        assert relative(load.strain, -50.0 * secants.thermal_expansion) < EXACT
        assert np.abs(load.stress).max() < EXACT * 50.0 * np.abs(secants.thermal_stress).max()


def test_a_strain_of_an_arc_releases_what_its_column_of_the_stiffness_does(comm):
    case = {"cell": CELLS["hexagonal"], "phases": EPOXY_GLASS, "plane": "strain", "interface": KINDS["free faces"]}
    columns = solved(comm, **case, stiffness=None).tips
    own = [k for k, load in enumerate(columns.load) if load == "E22"]
    under = solved(comm, **case, load={"to": {"E11": 0.0, "E22": 2.0, "gamma12": 0.0}}).load.tips
    assert len(own) == len(under.G) > 2
    assert relative(under.G, 4.0 * columns.G[own]) < EXACT
    # The stress of the same state, given instead, is the same state.
    S = np.linalg.inv(solved(comm, **case, stiffness=None).effective_stiffness)
    stress = np.linalg.solve(S, [0.0, 2.0, 0.0])
    by_stress = solved(comm, **case, load={"to": dict(zip(("S11", "S22", "S12"), stress.tolist(), strict=True))})
    assert relative(by_stress.load.tips.G, under.G) < 1e-7


@pytest.fixture
def cut(comm, shared_path):
    """Provide a folder with a laminate normal to x1 whose layers are debonded on one side."""
    if comm.rank == 0:
        side = [(node(2, j), node(2, j + 1)) for j in range(4)]
        grid(lambda x, y: 0.25 < x < 0.5).with_curve(side).write(shared_path / "cut.msh")
    comm.barrier()
    return shared_path


LAMINATE = {"cell": {"geometry": "mesh", "file": "cut.msh"}, "phases": EPOXY_GLASS}


@pytest.mark.parametrize(
    ("plane", "contact", "to"),
    [
        ("strain", True, {"S11": 1.0, "E22": 0.01}),
        ("strain", False, {"S11": -1.0}),
        ("generalized", True, {"S12": 1.0}),
        ("generalized", True, {"S13": 1.0}),
    ],
    ids=str,
)
def test_what_nothing_carries_is_reported(comm, cut, plane, contact, to):
    with pytest.raises(ConvergenceError, match="carries"):
        solved(comm, cut, **LAMINATE, plane=plane, interface={"contact": contact}, load={"to": to})


@pytest.mark.parametrize("to", [{"S11": -1.0}, {"S22": 1.0}, {"S11": -0.2, "E22": 0.01}], ids=str)
def test_a_cut_laminate_carries_pressure_and_pull_along_its_layers(comm, cut, to):
    case = LAMINATE | {"plane": "strain", "load": {"to": to}}
    bonded = solved(comm, cut, **(case | {"cell": {"geometry": "mesh", "file": "cut.msh"}}), interface=None)
    found = solved(comm, cut, **case, interface={"contact": True})
    assert relative(found.load.stress, bonded.load.stress) < EXACT
    assert found.load.strain[1] == pytest.approx(bonded.load.strain[1], rel=EXACT)
    # Without pressure the layers may part.
    pressed = to.get("S11", 0.0) < 0.0
    assert not pressed or relative(found.load.strain, bonded.load.strain) < EXACT
