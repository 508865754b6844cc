"""The length along which bonds break by energy, and the warning of elements that do not resolve it."""

import re
from pathlib import Path

import numpy as np
import pytest
import support.cases
from mpi4py import MPI
from support.whole_meshes import coarse_mesh
from unit.mesh.faulty_meshes import grid

from feti_homog.analysis.description import describe
from feti_homog.case import cases
from feti_homog.homogenization import cell_remarks
from feti_homog.mesh import Torus

# Glass and epoxy in MPa and micrometres, G_Ic = 2 J/m2, fibres of 7.5 micrometres: Tavara and others, Eng. Anal. Bound.
# Elem. 35 (2011) 207. k_n = 2025 has the strength 90 MPa and the length 0.77 micrometres.
GLASS, EPOXY = {"young": 70800.0, "poisson": 0.22}, {"young": 2790.0, "poisson": 0.33}
CELL = {"geometry": "square", "fibre_fraction": 0.4, "fibre_radius": 7.5, "mesh_size": 0.05}

DOCUMENT = {
    "material": {"matrix": EPOXY, "fibre": GLASS, "coating": {"young": 1e4, "poisson": 0.3}},
    "analysis": {"type": "path", "plane": "strain"},
    "path": {"strain": [0.02, 0.0, 0.0]},
}


def longest_edge(mesh):
    torus = Torus.of(mesh)
    ends = mesh.points[torus.low_copies(torus.is_outline)]
    return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).max()


def case_of(normal_stiffness=2025.0, criterion="energy", plane="strain", folder=".", **cell):
    cell = {name: value for name, value in cell.items() if value is not None}
    bond = {"normal_stiffness": normal_stiffness, "tangential_stiffness": normal_stiffness / 4}
    own = {"criterion": criterion} | ({"toughness": 2.0} if criterion == "energy" else {})
    sections = {"material": {"matrix": EPOXY, "fibre": GLASS}, "interface": bond | own, "path": DOCUMENT["path"]}
    return support.cases.case_of(cell if "file" in cell else CELL | cell, folder, plane, **sections)


def warnings(case):
    mesh = coarse_mesh(case, MPI.COMM_SELF)
    return cell_remarks.warnings(case, mesh.width, longest_edge(mesh), np.array([7.5, np.nan]))


@pytest.mark.parametrize(
    ("stiffness", "plane", "length"), [(2025.0, "strain", 0.773), (900.0, "strain", 1.739), (2025.0, "stress", 0.689)]
)
def test_the_length_is_that_of_the_matrix_and_the_strength(stiffness, plane, length):
    """E' G_Ic / sigma_c^2 with sigma_c = 90 or 60 MPa, E' = 2790 / (1 - 0.33^2) or 2790."""
    strength = {2025.0: 90.0, 900.0: 60.0}[stiffness]
    modulus = 2790.0 / (1 - 0.33**2) if plane == "strain" else 2790.0
    found, traction, _ = cell_remarks.process_zone(case_of(stiffness, plane=plane))
    assert traction == pytest.approx(strength, rel=1e-12)
    assert found == pytest.approx(modulus * 2.0 / strength**2, rel=1e-12) and found == pytest.approx(length, abs=5e-4)


@pytest.mark.parametrize(("size", "edges"), [(None, 48), (0.01, 4 * 57)])
def test_the_longest_edge_is_a_chord(size, edges):
    """The circle in quarters, each of as many edges as its length takes: the cell is 21.02 micrometres wide."""
    found = longest_edge(coarse_mesh(case_of(interface_size=size), MPI.COMM_SELF))
    assert found == pytest.approx(2 * 7.5 * np.sin(np.pi / edges), rel=1e-9)


def test_long_elements_are_warned_of():
    (line,) = warnings(case_of())
    assert line == (
        '[interface] law = "energy": elements on the interface are up to 0.981 long; the process zone '
        "is E' G_Ic / sigma_c^2 = 0.773 long for sigma_c = sqrt(2 k_n G_Ic) = 90, elements should be at most half "
        "as long: set interface_size = 0.018 (or mesh_size, of all elements), or refine = 2"
    )
    (refined,) = warnings(case_of(refine=1))
    assert "up to 0.491 long after refine = 1" in refined and "interface_size = 0.036" in refined


@pytest.mark.parametrize("remedy", [{"interface_size": 0.018}, {"mesh_size": 0.018}, {"refine": 2}])
def test_what_the_warning_asks_for_is_enough(remedy):
    assert warnings(case_of(**remedy)) == []
    assert warnings(case_of(refine=1, interface_size=0.036)) == []


def test_the_warning_replaces_an_accuracy():
    cell = {name: value for name, value in CELL.items() if name != "mesh_size"} | {"accuracy": 0.03}
    (line,) = warnings(cases.parse(case_of().resolved() | {"cell": cell}, Path()))
    form = r"set mesh_size = (\S+) and refine = (\S+) for accuracy, and interface_size = (\S+) "
    size, refine, interface_size = re.search(form, line).groups()
    assert warnings(case_of(mesh_size=float(size), refine=int(refine), interface_size=float(interface_size))) == []


def test_conductors_have_no_such_length():
    document = {"cell": CELL, "analysis": {"type": "conductivity"}, "interface": {"conductance": 1.0}}
    document["material"] = {phase: {"conductivity": 1.0} for phase in ("matrix", "fibre")}
    assert warnings(cases.parse(document, Path())) == []


def test_other_bonds_have_no_such_length():
    assert (
        cell_remarks.process_zone(case_of(criterion="max")) == (np.inf, np.inf, 0)
        and warnings(case_of(criterion="max")) == []
    )


COHESIVE = {
    "law": "bilinear", "normal_stiffness": 1e5, "tangential_stiffness": 4e4, "normal_strength": 40.0,
    "tangential_strength": 60.0, "normal_toughness": 0.05, "tangential_toughness": 0.09,
}  # fmt: skip


def test_the_warning_of_a_ratio_gives_the_stiffness_that_ends_it():
    """1e5 (0.05 / 0.09) (60 / 40)^2 = 125000."""
    for stiffness, words in ((4e4, ["expected 125000,"]), (125e3, [])):
        bond = COHESIVE | {"tangential_stiffness": stiffness}
        found = warnings(cases.parse(case_of(coating=None).resolved() | {"interface": bond}, Path()))
        assert [word for word in ("expected 125000,",) for line in found if word in line] == words


@pytest.mark.parametrize("shear", [0.09, 0.3], ids=["shear is shorter", "opening is shorter"])
def test_the_zone_is_that_of_the_shorter_mode_of_the_weakest_pair(shear):
    """Lengths G / R^2 of pure modes: of one pair 0.05 / 40^2 and 0.09 or 0.3 / 60^2, of the other ten times.

    The modulus is that of the matrix, or of the coating if it is on the weak pair.
    """
    weak = COHESIVE | {"tangential_toughness": shear}
    tough = weak | {"normal_toughness": 0.5, "tangential_toughness": 10 * shear}
    epoxy, coating = 2790.0 / (1 - 0.33**2), 1e4 / (1 - 0.3**2)
    for pairs, modulus in (((weak,), epoxy), ((weak, tough), epoxy), ((tough, weak), coating)):
        between = (["coating", "matrix"], ["fibre", "coating"])
        interfaces = [own | {"between": pair} for own, pair in zip(pairs, between, strict=False)]
        document = DOCUMENT | {"interface": interfaces, "cell": CELL | {"coating": 0.1}}
        found, _, number = cell_remarks.process_zone(cases.parse(document, Path()))
        assert found == pytest.approx(modulus * min(0.05 / 40.0**2, shear / 60.0**2))
        assert pairs[number] is weak


@pytest.mark.parametrize(("factor", "zones"), [(10.0, 1), (100.0, 0)])
def test_bonds_that_hold_have_no_zone(factor, zones):
    """Strong bonds with the least toughness, N^2 / (2 k), have the shortest zone, if they can break at all."""
    strong = COHESIVE | {f"{mode}_strength": factor * COHESIVE[f"{mode}_strength"] for mode in ("normal", "tangential")}
    for mode in ("normal", "tangential"):
        strong[f"{mode}_toughness"] = strong[f"{mode}_strength"] ** 2 / (2 * strong[f"{mode}_stiffness"])
    pairs = ((COHESIVE, ["coating", "matrix"]), (strong, ["fibre", "coating"]))
    sections = {"interface": [bond | {"between": pair} for bond, pair in pairs], "cell": CELL | {"coating": 0.1}}
    lines = cell_remarks.warnings(cases.parse(DOCUMENT | sections, Path()), 20.0, 0.02, np.array([7.5]))
    assert sum("elements on the interface are up to 0.02 long" in line for line in lines) == zones


@pytest.mark.parametrize("first", [["coating", "matrix"], ["fibre", "coating"]])
def test_the_warning_has_the_traction_of_the_pair_with_the_shortest_zone(first):
    """E' / (2 k_n) and sqrt(2 k_n G_Ic) of k_n = 2025, though the softer springs have the larger toughness."""
    pairs = {"coating-matrix": (2025.0, 2.0), "fibre-coating": (900.0, 8.0)}
    names = sorted(pairs, key=lambda name: name.split("-") != first)
    interfaces = [
        {"criterion": "energy", "normal_stiffness": k, "tangential_stiffness": k, "toughness": G, "between": pair}
        for pair, (k, G) in ((name.split("-"), pairs[name]) for name in names)
    ]
    case = cases.parse(DOCUMENT | {"interface": interfaces, "cell": CELL | {"coating": 0.1}}, Path())
    line = cell_remarks.warnings(case, 20.0, 50.0, np.array([7.5]))[0]
    assert "for sigma_c = sqrt(2 k_n G_Ic) = 90, " in line and f"= {2790.0 / (1 - 0.33**2) / 4050:.3g} long" in line
    assert line.startswith(f"[interface {names.index('coating-matrix') + 1}] law")


@pytest.mark.parametrize("tolerance", [0.02, 0.2])
def test_teeth_above_the_peak_traction_are_warned_of_in_any_section(tolerance):
    pairs = ((), (["coating", "matrix"],), (["coating", "matrix"], ["fibre", "coating"]))
    for between in pairs:
        bond = COHESIVE | {"softening_tolerance": tolerance}
        bonds = [bond | {"between": pair} for pair in between] or bond
        case = cases.parse(DOCUMENT | {"interface": bonds, "cell": CELL | {"coating": 0.1}}, Path())
        lines = [line for line in cell_remarks.warnings(case, 20.0, 1e-3, np.array([7.5])) if "first tooth" in line]
        assert len(lines) == (tolerance > 0.05), between


@pytest.mark.parametrize("factor", [1e-3, 0.1, 1.0, 100.0, 1e4])
def test_a_toughness_in_another_unit_is_doubted(factor):
    """E' G / s^2 in shear is 0.078 micrometres long, 0.0104 radii; ratios below 0.01 or above 100 are unlikely."""
    bond = COHESIVE | {f"{mode}_toughness": factor * COHESIVE[f"{mode}_toughness"] for mode in ("normal", "tangential")}
    bond |= {f"{mode}_stiffness": 1e5 * max(1.0, 1 / factor) for mode in ("normal", "tangential")}
    case = cases.parse(case_of(coating=None).resolved() | {"interface": bond}, Path())
    lines = [line for line in warnings(case) if "fibre radii: is the unit of toughness" in line]
    ratio = factor * 2790.0 / (1 - 0.33**2) * 0.09 / 60.0**2 / 7.5
    assert [f"the strength s = 60 ({ratio:.2g} fibre radii" in line for line in lines] == [True] * (
        not 0.01 <= ratio <= 100.0
    )
    assert len(lines) == (factor in (1e-3, 0.1, 1e4)) and all("the process zone is E' G / s^2 = " in n for n in lines)


def test_a_mesh_of_ones_own_is_refined(tmp_path):
    grid().write(tmp_path / "grid.msh")
    (line,) = warnings(case_of(geometry="mesh", file="grid.msh", normal_stiffness=1e5, folder=tmp_path))
    assert "up to 0.25 long" in line and line.endswith("set refine = 5 or a finer mesh")
    assert warnings(case_of(geometry="mesh", file="grid.msh", normal_stiffness=1e5, refine=5, folder=tmp_path)) == []


def test_check_tells_of_it():
    lines = describe(case_of(), MPI.COMM_SELF).splitlines()
    assert [line.startswith('warning    [interface] law = "energy": elements') for line in lines].count(True) == 1
    assert "warning" not in describe(case_of(refine=2), MPI.COMM_SELF)
