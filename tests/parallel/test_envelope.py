"""Onsets of debonding in a plane of loads, against paths, closed forms and laws, at any number of ranks."""

import csv

import numpy as np
import pytest
from support import torn_cells
from support.envelopes import ENERGY, MAX, QUADRATIC, case_of, envelope, path_onset, torn
from support.ranks import parallel_assert, write_once
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid

from feti_homog import run
from feti_homog.analysis.tip_records import criterion_of
from feti_homog.errors import CaseError
from feti_homog.homogenization.averaging import Homogenization
from feti_homog.interface.contact.coupled_interfaces import CoupledInterfaces
from feti_homog.interface.contact.states import OPEN
from feti_homog.interface.path.onsets import Onset
from feti_homog.report.plots import plot_helpers, response_curves
from feti_homog.results import result_json
from feti_homog.verify.certificate import verify

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

BONDS = {"max": MAX, "quadratic": QUADRATIC, "energy": ENERGY}
RANDOM = {
    "cell": {"geometry": "random", "fibres": 3, "min_gap": 0.1, "seed": 4, "fibre_fraction": 0.4, "mesh_size": 0.2}
}
ARC = {"contact": False, "debonded": [{"fibre": 1, "centre": 20.0, "angle": 50.0}]}


def factors(result):
    return np.array([np.inf if point.factor is None else point.factor for point in result.envelope])


def unit(point, axes, names):
    """Return the load of a direction, with zeros for what is not named."""
    angle, load = np.radians(point.angle), np.zeros(len(names))
    load[[names.index(name) for name in axes]] = np.cos(angle), np.sin(angle)
    return load


@pytest.mark.parametrize(("name", "plane"), [("max", "strain"), ("quadratic", "stress"), ("energy", "strain")])
def test_onsets_are_the_first_events_of_paths(comm, plane, name):
    bonds = BONDS[name]
    result = envelope(comm, plane, bonds, ["E11", "gamma12"], RANDOM, directions=12)
    with torn(comm, plane, bonds, **RANDOM) as cell:
        for point in result.envelope:
            load = unit(point, ["E11", "gamma12"], ["E11", "E22", "gamma12"])
            factor, stress = path_onset(cell, load)
            parallel_assert(comm, abs(point.factor / factor - 1) < 1e-9, f"{point.angle}")
            parallel_assert(comm, np.abs(point.strain - factor * load).max() < 1e-9 * factor)
            parallel_assert(comm, np.abs(point.stress - stress).max() < 1e-9 * np.abs(stress).max())


@pytest.mark.parametrize(
    "bonds", [MAX, ENERGY, ENERGY | {"growth": "springs"}], ids=["strength", "released", "springs"]
)
def test_onsets_beside_an_arc_are_those_of_paths(comm, bonds):
    bonds = bonds | ARC
    result = envelope(comm, "strain", bonds, ["E22", "E11"], RANDOM, directions=8)
    with torn(comm, "strain", bonds, **RANDOM) as cell:
        for point in result.envelope:
            factor, _ = path_onset(cell, unit(point, ["E22", "E11"], ["E11", "E22", "gamma12"]))
            parallel_assert(comm, abs(point.factor / factor - 1) < 1e-9, f"{point.angle}")


def test_in_a_plane_of_stresses_the_other_stress_is_none(comm):
    result = envelope(comm, "stress", QUADRATIC, ["S22", "S12"], RANDOM, directions=8)
    with torn(comm, "stress", QUADRATIC, **RANDOM) as cell:
        for point in result.envelope:
            load = unit(point, ["S22", "S12"], ["S11", "S22", "S12"])
            parallel_assert(comm, np.abs(point.stress - point.factor * load).max() < 1e-12 * point.factor)
            factor, stress = path_onset(cell, point.strain)
            parallel_assert(comm, abs(factor - 1) < 1e-9)
            parallel_assert(comm, np.abs(stress - point.stress).max() < 1e-9 * point.factor)


def test_compression_breaks_no_bond_that_only_tension_breaks(comm):
    result = envelope(comm, "strain", {"normal_strength": 1.0}, ["E11", "E22"], directions=8)
    squeezed = [point for point in result.envelope if point.angle == 225.0]
    parallel_assert(comm, [point.factor for point in squeezed] == [None] and squeezed[0].fibre is None)
    parallel_assert(comm, all(point.normal == pytest.approx(1.0) for point in result.envelope if point.factor))


STRIP = {"cell": {"geometry": "mesh", "file": "strip.msh"}}
ALONG = {"axial_strength": 1.5}
IN_SPACE = {"max": MAX | ALONG, "quadratic": QUADRATIC | ALONG, "energy": ENERGY | {"axial_stiffness": 200.0}}
EXPANDING = {
    "material": {
        "matrix": {"young": 3.0, "poisson": 0.35, "expansion": 6e-5},
        "fibre": {
            "E_axial": 200.0, "E_transverse": 15.0, "nu_axial": 0.25, "nu_transverse": 0.3, "G_axial": 20.0,
            "expansion_axial": -1e-6, "expansion_transverse": 1e-5,
        },
    }
}  # fmt: skip


def share(bonds, stress):
    """Utilisation of a plane normal to x1 under [S11, S12, S13]."""
    pull, shear, along = max(stress[0], 0.0), abs(stress[1]), abs(stress[2])
    if bonds.get("criterion") != "energy":
        limits = bonds["normal_strength"], bonds["tangential_strength"], bonds["axial_strength"]
        shares = np.array([pull, shear, along]) / limits
        return np.sqrt(shares @ shares) if bonds.get("criterion") == "quadratic" else shares.max()
    stiffnesses = bonds["normal_stiffness"], bonds["tangential_stiffness"], bonds["axial_stiffness"]
    energies = np.array([pull, shear, along]) ** 2 / (2 * np.array(stiffnesses))
    psi = np.arctan2(np.sqrt(energies[1] + energies[2]), np.sqrt(energies[0]))
    return np.sqrt(energies.sum() / (bonds["toughness"] * (1 + np.tan(0.75 * psi) ** 2)))


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("name", "axes", "temperature"),
    [
        *(("max", ["S11", "S13"], -3.0), ("quadratic", ["S11", "S13"], -3.0), ("energy", ["S12", "S13"], None)),
        *(("quadratic", ["gamma13", "E33"], None), ("energy", ["gamma13", "E33"], -3.0)),
    ],
    ids=str,
)
def test_bonds_of_a_laminate_bear_the_macroscopic_stress(comm, strip, name, axes, temperature):
    bonds = IN_SPACE[name]
    own = {} if temperature is None else {"temperature": temperature}
    result = envelope(comm, "generalized", bonds, axes, STRIP | EXPANDING, strip, directions=12, **own)
    for point in result.envelope:
        load, stress = unit(point, axes, [*(SPATIAL[0]), *SPATIAL[1]]), point.stress
        if point.factor is None:
            parallel_assert(comm, axes[0] != "S12" and share(bonds, load[[6, 11, 10]]) < 1e-6)
            continue
        named = np.concatenate([point.strain, point.stress])[load != 0]
        parallel_assert(comm, np.abs(named - point.factor * load[load != 0]).max() < 1e-9 * point.factor)
        parallel_assert(comm, abs(share(bonds, stress[[0, 5, 4]]) - 1) < 1e-9, f"{point}")


SPATIAL = (["E11", "E22", "E33", "gamma23", "gamma13", "gamma12"], ["S11", "S22", "S33", "S23", "S13", "S12"])


@pytest.mark.one_rank
@pytest.mark.parametrize("stiffness", [None, np.inf, 40.0])
def test_a_single_fibre_in_axial_shear(comm, stiffness):
    """t_a = 2 S13 cos / (1 + G_m / G_f + G_m / (k_a a)) on a fibre of radius a in much matrix."""
    sections = {
        "cell": {"geometry": "square", "fibre_fraction": 0.002, "mesh_size": 0.1, "interface_size": 0.004, "order": 2}
    }
    bonds = {"normal_strength": 5.0, "tangential_strength": 4.0, "axial_strength": 3.0}
    springs = {} if stiffness is None else {"tangential_stiffness": 7.0, "axial_stiffness": stiffness}
    result = envelope(comm, "generalized", bonds | springs, ["S13", "S23"], sections, directions=4)
    radius, matrix, fibre = np.sqrt(0.002 / np.pi), 88.0 / 2.598, 200.0 / 2.444
    soft = matrix / ((stiffness or np.inf) * radius)
    expected = 3.0 * (1 + matrix / fibre + soft) / 2
    parallel_assert(comm, np.abs(factors(result) / expected - 1).max() < 5e-3, f"{factors(result)} {expected}")
    parallel_assert(comm, all(point.axial == pytest.approx(1.0) for point in result.envelope))


def test_bonds_that_nothing_along_the_fibres_breaks(comm):
    """Axial shear has no other traction; the strength around the fibres is not that along them."""
    strengths = {"normal_strength": 5.0, "tangential_strength": 4.0, "axial_strength": np.inf}
    result = envelope(comm, "generalized", strengths, ["S13", "S23"], {}, directions=4)
    parallel_assert(comm, all(point.factor is None for point in result.envelope))


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("bonds", "axes"),
    [
        (IN_SPACE["max"], ["S22", "S33"]),
        (IN_SPACE["quadratic"], ["E11", "gamma23"]),
        (IN_SPACE["energy"], ["S22", "S33"]),
        (IN_SPACE["energy"] | ARC, ["E11", "gamma23"]),
    ],
    ids=[*IN_SPACE, "tips"],
)
def test_cooled_cells_are_at_their_strength_at_onset(comm, bonds, axes):
    """A solve under the strain and temperature at onset has the utilisation 1, and less before."""
    cooling = -300.0 if "debonded" in bonds else -2000.0
    sections = RANDOM | EXPANDING
    result = envelope(comm, "generalized", bonds, axes, sections, directions=6, temperature=cooling)
    with torn(comm, "generalized", bonds, **sections) as cell:
        largest = [direct_utilisation(cell, point.strain, cooling) for point in result.envelope if point.factor]
        parallel_assert(comm, len(largest) == 6 and np.abs(np.array(largest) - 1).max() < 1e-9, f"{largest}")
        at_rest = np.zeros(6) if axes[0] == "E11" else cooling * result.thermal_expansion
        parallel_assert(comm, 0.02 < direct_utilisation(cell, at_rest, cooling) < 1)


def test_a_tip_in_space_releases_what_its_break_does(comm):
    """u^2 G_c l is what the energy of the cell falls by at constant strain, in the plane and along the fibres."""
    bonds, strain = ENERGY | ARC | {"axial_stiffness": 200.0}, np.array([0.7, 0.4, 0.2, 0.9, -1.1, 0.5])
    with torn(comm, "generalized", bonds, **RANDOM) as cell:
        plane, axial = Homogenization(cell, False), Homogenization(cell.axial, False)
        status = np.where(cell.debonded(None), OPEN, 0).astype(np.int8)
        bonds, loaded = torn_cells.bonds(status), CoupledInterfaces(plane.interface, axial.interface)
        law = criterion_of(cell)
        onset, here = Onset.of(law, loaded, bonds), law.in_state(loaded, bonds)
        node = np.flatnonzero(here.number >= 0)
        energy, traction = cell_energy(plane, axial, strain, status)
        foretold = (
            onset.utilisation(traction[node], node) ** 2 * law.fracture_toughness(traction[node]) * here.tips.length
        )
        owned = [(rank, k) for rank, count in enumerate(comm.allgather(len(node))) for k in range(count)]
        parallel_assert(comm, len(owned) >= 2)
        for rank, k in owned:
            broken = status.copy()
            broken[node[k : k + 1] if comm.rank == rank else []] = OPEN
            lost = energy - cell_energy(plane, axial, strain, broken)[0]
            parallel_assert(comm, comm.rank != rank or abs(foretold[k] / lost - 1) < 1e-8)


def cell_energy(plane, axial, strain, status):
    """Return the energy of the cell under a strain (6,), and the tractions (k, 3)."""
    pairs = ((plane, strain[[0, 1, 5, 2]]), (axial, strain[[4, 3]]))
    found = [
        each.respond(loads[None], torn_cells.bonds(status), [np.zeros(each.cell.solver.rows)])[0]
        for each, loads in pairs
    ]
    traction = np.hstack([each.interface.traction(r.state.solution) for (each, _), r in zip(pairs, found, strict=True)])
    return sum(r.stored for r in found) * plane.cell.summary.area, traction


def direct_utilisation(cell, strain, temperature):
    """Return the largest utilisation of all bonds, from solves under a strain and a change of temperature."""
    plane, axial = Homogenization(cell, False), Homogenization(cell.axial, False)
    bonds = torn_cells.bonds(np.where(cell.debonded(None), OPEN, 0).astype(np.int8))
    pairs = ((plane, [*strain[[0, 1, 5, 2]], temperature]), (axial, strain[[4, 3]]))
    found = [
        each.interface.traction(
            each.respond(np.array([loads]), bonds, [np.zeros(each.cell.solver.rows)])[0].state.solution
        )
        for each, loads in pairs
    ]
    onset = Onset.of(criterion_of(cell), CoupledInterfaces(plane.interface, axial.interface), bonds)
    used = onset.utilisation(np.hstack(found), np.arange(len(bonds.status)))
    return max(cell.comm.allgather(float(used.max(initial=0.0))))


def test_cooling_alone_may_break_bonds(comm):
    result = envelope(comm, "generalized", MAX, ["S22", "S12"], EXPANDING, directions=5, temperature=-1e5)
    parallel_assert(comm, (factors(result) == 0.0).all())
    line = (
        "[envelope] temperature = -100000: it breaks bonds alone, so that all loads at onset are 0; expected a smaller"
    )
    parallel_assert(comm, any(remark.startswith(line) for remark in result.remarks))
    parallel_assert(comm, all(not point.stress.any() for point in result.envelope))
    places = {(point.fibre, point.bond_angle) for point in result.envelope}
    parallel_assert(comm, len(places) == 1)


def test_its_files_are_written_and_hold_what_they_say(comm, shared_path):
    asked = {"plane": ["S22", "S13"], "directions": 8}
    output = {"fields": True, "pictures": False, "report": False}
    result = run(case_of("generalized", MAX | ALONG, envelope=asked, output=output), comm, out=shared_path)
    if comm.rank == 0:
        with (shared_path / "envelope.csv").open() as stream:
            rows = list(csv.DictReader(stream))
        assert [float(row["factor"]) for row in rows] == [point.factor for point in result.envelope]
        assert [float(row["S13"]) for row in rows] == [point.stress[4] for point in result.envelope]
        curves = response_curves.drawn(read := result_json.read(shared_path))
        drawn = [name for name, curve in curves.items() if curve(read, plot_helpers.PLAIN) is not None]
        assert drawn == ["envelope"]
        certificate = verify(shared_path)
        assert certificate.holds and "onset" in certificate.text, certificate.text
    comm.barrier()


def test_a_curve_of_the_mesh_that_may_close_is_refused(comm, shared_path):
    write_once(comm, grid().with_curve(RIGHT_SIDE), shared_path / "strip.msh")
    with pytest.raises(CaseError, match=r"contact: expected false with a debonded curve.*: type = .path. finds"):
        envelope(comm, "strain", MAX, ["S11", "S12"], STRIP, shared_path, directions=4)
