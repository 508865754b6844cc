"""Remarks of `feti-homog check` on components that no load names."""

import re
import tomllib
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.jobs import ROOT
from unit.case.valid_cases import VALID_CASES
from unit.mesh.faulty_meshes import RIGHT_SIDE, grid

from feti_homog import run
from feti_homog.analysis.description import describe
from feti_homog.case.cases import Case
from feti_homog.homogenization.cell_remarks import case_remarks, warnings
from feti_homog.homogenization.domain_partition import CellSummary


@pytest.mark.parametrize("fraction", [None, 0.3])
def test_another_fraction_than_that_of_a_matched_table_is_reported(fraction):
    content = tomllib.loads((ROOT / "drivers/matched.toml").read_text(encoding="utf-8"))
    del content["sweep"]
    if fraction is not None:
        content["cell"]["fibre_fraction"] = fraction
    found = [line for line in case_remarks(Case.parse(content, ROOT / "drivers")) if "fibre_fraction" in line]
    assert len(found) == (fraction is not None)
    assert all(line.startswith("[cell] fibre_fraction = 0.3: clustered.csv has 0.") for line in found)


@pytest.mark.parametrize(
    ("sizes", "is_remarked"), [({}, True), ({"fibre_radius": 3.0}, False), ({"width": 90.0}, False)]
)
def test_lengths_of_a_matched_cell_are_those_of_its_width(sizes, is_remarked):
    """The fibres of the table have a mean radius of 3.5."""
    content = tomllib.loads((ROOT / "drivers/matched.toml").read_text(encoding="utf-8"))
    del content["sweep"]
    content["cell"] |= sizes
    content["interface"] = {"normal_stiffness": 1.0, "tangential_stiffness": 1.0, "debonded": []}
    case = Case.parse(content, ROOT / "drivers")
    line = f"[cell] width: missing, and therefore 1; fibre_radius = {case.cell.matched.radii.mean():.4g} would give"
    assert any(remark.startswith(line) for remark in case_remarks(case)) == is_remarked


@pytest.mark.parametrize(("boundary", "bound"), [("displacement", "an upper"), ("traction", "a lower")])
def test_conditions_on_sides_bound_the_result(boundary, bound):
    """Given displacements leave less freedom than periodic ones, tractions more."""
    cell, analysis = SimpleNamespace(boundary=boundary), SimpleNamespace(plane="strain")
    (line,) = case_remarks(SimpleNamespace(cell=cell, materials={}, analysis=analysis))
    assert line == f'[cell] boundary = "{boundary}": the result is {bound} bound of the effective one'


def test_an_expansion_of_some_phases_gives_no_thermal_expansion():
    """Without any, nobody expects one; in plane strain no temperature is a load."""
    content = tomllib.loads(VALID_CASES["base"]) | {"analysis": {"type": "stiffness", "plane": "generalized"}}
    assert not case_remarks(Case.parse(content))
    for phase, other in (("matrix", "fibre"), ("fibre", "matrix")):
        materials = content["material"] | {phase: content["material"][phase] | {"expansion": 6e-5}}
        line = f"[material.{other}] expansion: missing; without it the cell has no thermal expansion"
        assert case_remarks(Case.parse(content | {"material": materials})) == (line,)
        plane = {"analysis": {"type": "stiffness", "plane": "strain"}}
        assert not case_remarks(Case.parse(content | {"material": materials} | plane))
    zero = {name: phase | {"expansion": 0.0} for name, phase in content["material"].items()}
    assert not case_remarks(Case.parse(content | {"material": zero}))


@pytest.mark.parametrize("order", [1, 2])
def test_onsets_by_linear_elements_have_a_remark(order):
    content = tomllib.loads(VALID_CASES["base"]) | {"interface": {"normal_strength": 1.0}}
    content |= {"envelope": {"plane": ["S11", "S22"]}, "analysis": {"type": "envelope", "plane": "strain"}}
    content["cell"]["order"] = order
    assert ["onsets err more" in line for line in case_remarks(Case.parse(content))] == [True] * (order == 1)


def test_one_arrangement_has_no_scatter_in_its_errors():
    content = tomllib.loads(VALID_CASES["base"])
    random = content | {"cell": {"geometry": "random", "fibres": 5, "fibre_fraction": 0.4, "seed": 7}}
    (line,) = case_remarks(Case.parse(random))
    assert line.startswith('[cell] geometry = "random": errors are those of its mesh')
    other = Case.parse(random | {"cell": random["cell"] | {"seed": 8}})
    assert case_remarks(other) == (line,)  # the cases of a sweep have one remark
    assert not case_remarks(Case.parse(random | {"output": {"mesh_error": False}})) + case_remarks(Case.parse(content))
    loaded = random | {"analysis": {"type": "load", "plane": "strain"}, "load": {"to": {"E11": 0.01}}}
    assert not case_remarks(Case.parse(loaded))


@pytest.mark.parametrize("key", [{"teeth": 3}, {"softening_tolerance": 0.15}, {}], ids=str)
def test_teeth_that_exceed_the_peak_are_a_warning_however_they_are_chosen(key):
    """W_0 = N^2 / (2 K): the opening of tooth j is rho^(j / n) of the onset, rho = 2 K G / N^2; n follows from rho."""
    law = {"law": "bilinear", "normal_stiffness": 1000.0, "normal_strength": 0.06, "normal_toughness": 1e-4}
    law |= {name.replace("normal", "tangential"): value for name, value in law.items() if name != "law"}
    content = tomllib.loads(VALID_CASES["base"]) | {"interface": law | key, "path": {"to": {"E11": 0.003}}}
    case = Case.parse(content | {"analysis": {"type": "path", "plane": "strain"}})
    rho, found = 2 * 1000.0 * 1e-4 / 0.06**2, [line for line in warnings(case, 1.0, 1e-9, np.zeros(0))]
    counts = [int(re.search(r": (\d+) teeth a bond", line)[1]) for line in case_remarks(case)]
    assert len(counts) == ("teeth" not in key) and len(found) == bool(key)
    lines = [*case_remarks(case), *case_remarks(case, bonds=70)]
    events = [int(number) for line in lines for number in re.findall(r"up to (\d+) events", line)]
    assert events == [70 * count for count in counts]
    excess = rho ** (1 / (2 * (counts or [3])[0])) - 1.0
    assert all(f"exceeds the peak traction by {excess:.1%}" in line for line in found) and (found or excess <= 0.02)
    onsets = content | {"analysis": {"type": "envelope", "plane": "strain"}, "envelope": {"plane": ["S11", "S22"]}}
    onsets.pop("path")  # onsets do not depend on teeth
    assert not warnings(Case.parse(onsets), 1.0, 1e-9, np.zeros(0))


@pytest.mark.parametrize(
    ("keys", "remarked"),
    [
        ({"normal_strength": 50.0}, True),
        ({"law": "bilinear", "normal_strength": 50.0, "normal_toughness": 2.0}, True),
        ({"law": "energy", "toughness": 2.0}, True),
        (None, False),
    ],
    ids=str,
)
def test_springs_of_bonds_that_soften_the_cell_are_remarked(keys: Any, remarked: bool) -> None:
    """At the limit that the remark names, bonds take less than 10 % of C11; at a fiftieth of it, more than half."""
    cell = {"geometry": "hexagonal", "fibre_fraction": 0.6, "fibre_radius": 0.008, "mesh_size": 0.1}
    materials = {"matrix": {"young": 3500.0, "poisson": 0.35}, "fibre": {"young": 72000.0, "poisson": 0.22}}

    def with_springs(normal: float, tangential: float) -> list[str]:
        springs = {"normal_stiffness": normal, "tangential_stiffness": tangential}
        both = {name.replace("normal", "tangential"): value for name, value in (keys or {}).items()}
        more = {"path": {"strain": [0.01, 0.0, 0.0]}} if keys else {}
        interface = springs | (keys or {}) | ({} if keys and "toughness" in keys else both)
        case = case_of(cell, material=materials, interface=interface, **more)
        lines = describe(case, MPI.COMM_SELF).splitlines()
        return [line for line in lines if line.startswith("remark     [interface]") and "k r / E'" in line]

    def C11(stiffness: float | None) -> float:
        springs = {"normal_stiffness": stiffness, "tangential_stiffness": stiffness}
        more = {} if stiffness is None else {"interface": springs}
        stiffnesses = run(case_of(cell, material=materials, **more), MPI.COMM_SELF).effective_stiffness
        assert stiffnesses is not None
        return float(stiffnesses[0, 0])

    lines = with_springs(1e8, 4e5)
    assert len(lines) == remarked and not with_springs(1e8, 1e8)
    if remarked:
        assert "tangential_stiffness = 400000: k r / E' = 0.8" in lines[0] and "unit" not in lines[0]
        assert with_springs(1e3, 1e8)[0].endswith("check the unit of length")
        limit = float(re.search(r"Turon et al. \(2007\) advise at least (\S+)", lines[0])[1])
        assert 0.9 < C11(limit) / C11(None) < 0.99 and C11(limit / 50.0) < 0.5 * C11(None)


@pytest.mark.parametrize(
    ("curve", "sections", "expected"),
    [
        (None, {}, []),
        ("debonded", {"interface": {}}, []),
        (None, {"interface": {"normal_stiffness": 1.0}}, []),
        (None, {"interface": {}}, ["[interface]: nothing is debonded, and no bond is elastic: the bonding is perfect"]),
        ("debonded", {}, ['the curve "debonded" of the mesh is bonded: there is no [interface]']),
        (
            "Debonded",
            {"interface": {}},
            ['cell.msh: physical curve "Debonded": not used', "[interface]: nothing is debonded"],
        ),
    ],
    ids=str,
)
def test_bonding_that_a_mesh_does_not_have_is_remarked(curve, sections, expected, tmp_path):
    mesh = grid() if curve is None else grid().with_curve(RIGHT_SIDE, curve)
    mesh.write(tmp_path / "cell.msh")
    case = case_of({"geometry": "mesh", "file": "cell.msh"}, tmp_path, **sections)
    lines = describe(case, MPI.COMM_SELF).splitlines()
    found = [line.removeprefix("remark     ") for line in lines if line.startswith("remark")]
    assert len(found) == len(expected) and all(map(str.startswith, found, expected)), found
    rates = ["[interface] fibre 1: no energy release rates at tips, which only circles have"]  # known after the solve
    assert list(run(case, MPI.COMM_SELF).remarks) == found + rates * (curve == "debonded" and bool(sections))


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (1000, r"(\d+) were made: METIS makes no more from \d+ coarse triangles; a smaller mesh_size gives more"),
        (1, r"(\d+) were made: each of the 3 bodies is at least one"),
        (3, None),
    ],
)
def test_another_number_of_subdomains_than_asked_for_is_remarked(asked, words):
    content = tomllib.loads(VALID_CASES["base"].replace("mesh_size = 0.05", "mesh_size = 0.3"))
    case = Case.parse(content | {"decomposition": {"subdomains": asked}})
    lines = describe(case, MPI.COMM_SELF).splitlines()
    result = run(case, MPI.COMM_SELF)
    found = [line for line in lines if line.startswith("remark     [decomposition]")]
    assert [line.removeprefix("remark     ") for line in found] == [r for r in result.remarks if "[decomp" in r]
    assert len(found) == (words is not None)
    for line in found:
        assert int(re.search(f"subdomains = {asked}: {words}$", line)[1]) == result.solver.subdomains != asked


@pytest.mark.parametrize(("moved", "warns"), [(0.0, 0), (2e-14, 0), (1e-9, 1)])
@pytest.mark.parametrize("unit", [1.0, 1e-6])
def test_only_moves_beyond_rounding_are_warnings(moved: float, warns: int, unit: float) -> None:
    summary: Any = SimpleNamespace(snapped=moved * unit, width=2.0 * unit, height=unit)
    assert len(CellSummary.warnings(summary)) == warns


@pytest.mark.parametrize(("name", "more"), [("hexagonal", {}), ("two_fibres", {}), ("hexagonal", {"refine": 1}),
                                            ("two_fibres", {"order": 2})])  # fmt: skip
def test_straight_edges_of_a_users_mesh_have_the_remark_of_generated_cells(name, more):
    """The lost area is the area of the outlines in the result minus the area of the meshed fibres."""
    phase = {"young": 3.0, "poisson": 0.3}
    materials = dict.fromkeys(["matrix", "fibre", *(["fibre:2"] if name == "two_fibres" else [])], phase)
    result = run(case_of({"geometry": "mesh", "file": f"{name}.msh"} | more, ROOT / "meshes", material=materials))
    axes = [(f.radius, f.radius) if f.semi_axes is None else f.semi_axes for f in result.fibres]
    round_fraction = sum(np.pi * a * b for a, b in axes) / result.cell.area
    lost = 1.0 - result.cell.fibre_fraction / round_fraction
    assert (lost > 0.005) == (not more)
    text = f"[cell] order = 1: polygons have {lost:.1%} less area than round fibres; refine, or order = 2"
    assert [remark for remark in result.remarks if "order" in remark] == [text] * (not more)


def test_a_matrix_within_a_fibre_is_remarked():
    """The fibre around the matrix has no radius."""
    for exchanged in (False, True):
        names = ("matrix", "fibre")[:: -1 if exchanged else 1]
        cell = {"geometry": "mesh", "file": "square.msh", "phases": dict(zip(("matrix", "fibre"), names, strict=True))}
        lines = describe(case_of(cell, ROOT / "meshes"), MPI.COMM_SELF).splitlines()
        assert any("are its phase and another exchanged?" in line for line in lines) == exchanged
        assert any(re.match("fibres .*mean radius .*, fraction", line) for line in lines) != exchanged


@pytest.mark.parametrize("boundary", ["displacement", "traction"])
def test_sides_without_images_do_not_exchange_phases(boundary):
    cell = {"geometry": "mesh", "file": "square.msh", "boundary": boundary}
    assert "exchanged" not in describe(case_of(cell, ROOT / "meshes"), MPI.COMM_SELF)


def test_a_debonded_curve_between_phases_without_an_interface_is_remarked(tmp_path):
    mesh = grid().with_curve(RIGHT_SIDE)
    for tag in (11, 12):
        mesh = mesh.with_element(tag, 2, 3, mesh.elements[tag][3])
    replace(mesh, names=mesh.names | {3: "fibre:2"}).write(tmp_path / "cell.msh")
    phase, springs = {"young": 1.0, "poisson": 0.3}, {"normal_stiffness": 1e3, "tangential_stiffness": 1e3}
    materials = dict.fromkeys(["matrix", "fibre", "fibre:2"], phase)

    def described(*pairs: list[str]) -> str:
        interface = [springs | {"between": pair} for pair in pairs]
        cell = {"geometry": "mesh", "file": "cell.msh"}
        return describe(case_of(cell, tmp_path, material=materials, interface=interface), MPI.COMM_SELF)

    words = 'the curve "debonded" of the mesh is bonded between fibre and matrix: no [[interface]] joins them'
    assert f"remark     {words}" in described(["fibre", "fibre:2"]).splitlines()
    assert words not in described(["fibre", "fibre:2"], ["matrix", "fibre"])
