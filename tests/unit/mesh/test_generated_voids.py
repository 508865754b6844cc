"""Voids in tables, random cells and hollow fibres: the mesh around them, fibres that stay as they were, faults."""

import fibre_statistics
import numpy as np
import pytest
import tomli_w
from mpi4py import MPI
from pattern_statistics import smallest_gap
from support import cases
from support.circular_cells import cell as circular
from support.generated_meshes import generate
from support.void_cells import write_voids

from feti_homog import run
from feti_homog.commands import listed_fibres
from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh import Torus
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.microstructure.fibre_pattern import FibrePattern

MATRIX = {"young": 3.0, "poisson": 0.35}
RANDOM = {"geometry": "random", "fibres": 12, "fibre_fraction": 0.4, "seed": 3}
ROWS = [
    {"x": 0.0, "y": 0.0, "radius": 0.15, "phase": "void"},
    {"x": 0.5, "y": 0.5, "radius": 0.2},
    {"x": 0.9, "y": 0.45, "radius": 0.1, "phase": "void"},
]


def case_of(tmp_path, cell, *phases):
    material = {"matrix": MATRIX} | {phase: {"young": 70.0, "poisson": 0.2} for phase in phases or ("fibre",)}
    return cases.case_of(cell, tmp_path, material=material)


def table(rows, **keys):
    return {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": rows, "mesh_size": 0.08} | keys


@pytest.mark.parametrize("coating", [None, 0.1])
@pytest.mark.parametrize(("radius", "count"), [(0.5, 7), (1.0, 2), (3.0, 1)])
def test_random_voids_have_their_fraction_and_keep_the_gap(radius, count, coating):
    found = arrange(circular(fibres=12, gap=0.05, coating=coating, voids=0.06, void_radius=radius))
    assert found.fibres == 12 and found.phase[12:] == ("void",) * count
    assert np.pi * (found.radii[12:] ** 2).sum() == pytest.approx(0.06, abs=1e-14)
    assert np.pi * (found.radii[:12] ** 2).sum() == pytest.approx(0.4, abs=1e-14)
    grown = FibrePattern(1.0, 1.0, found.centres, found.outer_radii, periodic=True)
    assert smallest_gap(grown) >= 0.05 * 2 * found.radii[:12].mean() * (1 - 1e-9)
    assert coating is None or (np.all(found.coated[:12]) and not found.coated[12:].any())


def test_no_voids_leave_a_cell_as_it_is():
    plain, none = arrange(circular(seed=5)), arrange(circular(seed=5, voids=0.0, void_radius=2.0))
    assert np.array_equal(plain.centres, none.centres) and plain.phase == none.phase


def test_voids_are_holes_whose_edges_lie_on_their_circles():
    mesh = generate(circular(fibres=8, fraction=0.3, voids=0.08, void_radius=0.7, size=0.04, seed=2))
    expected = arrange(circular(fibres=8, fraction=0.3, voids=0.08, void_radius=0.7, seed=2))
    assert Torus.of(mesh).voids == len(expected.radii) - 8 > 1 and mesh.phases == ("matrix", "fibre")
    assert 1 - areas(mesh.points, mesh.triangles).sum() == pytest.approx(0.08, rel=0.06)
    torus = Torus.of(mesh)
    ends = mesh.points[torus.low_copies(torus.at_void)].reshape(-1, 2)
    away = (ends[:, None] - expected.centres[8:] + 0.5) % 1.0 - 0.5
    assert np.abs(np.linalg.norm(away, axis=2) - expected.radii[8:]).min(axis=1).max() < 1e-12
    assert np.unique(mesh.triangles).tolist() == list(range(len(mesh.points)))


def test_fibres_of_a_table_are_numbered_as_if_there_were_no_voids(tmp_path):
    found = arrange(case_of(tmp_path, table(ROWS)).cell)
    assert found.phase == ("fibre", "void", "void") and found.radii == pytest.approx([0.2, 0.15, 0.1])
    mesh = generate(case_of(tmp_path, table(ROWS)).cell)
    assert sorted(set(mesh.precedence.tolist())) == [0, 1] and Torus.of(mesh).voids == 2


def test_a_cell_of_voids_alone(tmp_path):
    only = [row for row in ROWS if row.get("phase")]
    mesh = generate(case_of(tmp_path, table(only), "matrix").cell)
    assert mesh.phases == ("matrix",) and Torus.of(mesh).voids == 2


@pytest.mark.parametrize("cell", [RANDOM | {"voids": 0.05}, table(ROWS)], ids=["random", "table"])
def test_the_table_of_a_cell_with_voids_gives_it_again(tmp_path, cell):
    case = case_of(tmp_path, cell)
    (tmp_path / "case.toml").write_text(_toml(case))
    (tmp_path / "again.csv").write_text(listed_fibres.table(tmp_path / "case.toml"))
    again = {"geometry": "table", "file": "again.csv", "mesh_size": case.cell.mesh_size}
    one, other = (generate(each) for each in (case.cell, case_of(tmp_path, again).cell))
    assert Torus.of(one).voids == Torus.of(other).voids > 0
    if cell["geometry"] == "random":
        assert np.abs(one.points - other.points).max() < 1e-12 and np.array_equal(one.triangles, other.triangles)
        assert fibre_statistics.pattern(tmp_path / "case.toml", None).count == 12
        window = fibre_statistics.pattern(tmp_path / "again.csv", None)
        assert (window.count, window.fibre_fraction) == (12, pytest.approx(0.4))


def _toml(case):
    document = {k: v for k, v in case.resolved().items() if k in ("cell", "material", "analysis")}
    return tomli_w.dumps(document)


@pytest.mark.parametrize(("cell", "fault"), [
    (RANDOM | {"voids": 0.6}, "[cell] voids = 0.6: expected true for a mesh, or a number at least 0 and at most 0.5"),
    (RANDOM | {"voids": -0.1}, "[cell] voids = -0.1: expected true for a mesh, or a number at least 0 and at most 0.5"),
    (RANDOM | {"void_radius": 0.5}, "[cell] void_radius: belongs to voids, which is missing"),
    (RANDOM | {"voids": 0.1, "void_radius": 0.01},
     "[cell] void_radius = 0.01: expected a number at least 0.05 and at most 20"),
    ({"geometry": "square", "fibre_fraction": 0.4, "voids": 0.1},
     '[cell] voids = 0.1: belongs to geometry = "random" or "mesh", not "square"'),
    (RANDOM | {"voids": True}, "[cell] voids = true: expected a number at least 0 and at most 0.5"),
    ({"geometry": "mesh", "file": __file__.replace(".py", ".msh"), "voids": 0.1},
     "[cell] voids = 0.1: expected true or false: the mesh gives the voids"),
    (table([ROWS[0] | {"coating": 0.1}, ROWS[1]]), "[cell] fibre_list: row 1: coating = 0.1: a void has none"),
    (table([ROWS[0] | {"radius": -0.1}]), "[cell] fibre_list: row 1: radius = -0.1: expected a number above 0"),
])  # fmt: skip
def test_faults_of_keys(tmp_path, cell, fault):
    with pytest.raises(CaseError) as caught:
        case_of(tmp_path, cell)
    assert fault in caught.value.faults


def test_voids_with_a_material_or_without_room_are_refused(tmp_path):
    with pytest.raises(CaseError, match=r"\[material.void\]: unknown phase"):
        case_of(tmp_path, table(ROWS), "fibre", "void")
    with pytest.raises(MeshError, match=r"fibre_fraction = 0.5, voids = 0.4 with min_gap = 0.05 and fibres = 16"):
        arrange(circular(fraction=0.5, gap=0.05, voids=0.4))


@pytest.mark.parametrize(("rows", "fault"), [
    ([ROWS[0], {"x": 0.3, "y": 0.0, "radius": 0.2}], "rows 1 and 2: overlap by 0.05"),
    ([ROWS[0], {"x": 0.3, "y": 0.0, "radius": 0.15, "phase": "void"}], "rows 1 and 2: touch"),
    ([ROWS[0], {"x": 1.0, "y": 1.0, "radius": 0.15}], "rows 1 and 2: are images of one fibre, a period apart"),
    ([ROWS[0], ROWS[0]], "rows 1 and 2: are at one place"),
    ([ROWS[1], {"x": 0.5, "y": 0.5, "radius": 0.1, "phase": "void"}], "rows 1 and 2: are at one place"),
    ([ROWS[1], {"x": 0.3, "y": 2.0, "radius": 0.1, "phase": "void"}], "row 2: y = 2: lies outside the cell"),
])  # fmt: skip
def test_faults_of_places(tmp_path, rows, fault):
    with pytest.raises(MeshError) as caught:
        arrange(case_of(tmp_path, table(rows)).cell)
    assert any(fault in line for line in caught.value.faults)


@pytest.mark.slow
def test_the_folder_of_a_result_has_the_table_of_its_case(tmp_path):
    case = case_of(tmp_path, RANDOM | {"fibres": 3, "voids": 0.05, "mesh_size": 0.2})
    (tmp_path / "case.toml").write_text(_toml(case))
    run(case, MPI.COMM_SELF, out=tmp_path / "run")
    assert listed_fibres.table(tmp_path / "run") == listed_fibres.table(tmp_path / "case.toml")
    assert fibre_statistics.pattern(tmp_path / "run", None).count == 3


def test_voids_of_a_users_mesh_are_not_listed(tmp_path):
    """Its fibres have statistics all the same."""
    write_voids(tmp_path / "cell.msh", voids=[0], **RANDOM | {"fibres": 3, "mesh_size": 0.1})
    (tmp_path / "case.toml").write_text(
        _toml(case_of(tmp_path, {"geometry": "mesh", "file": "cell.msh", "voids": True}))
    )
    with pytest.raises(CaseError, match=r"a table lacks voids of images and meshes; result\.json lists"):
        listed_fibres.table(tmp_path / "case.toml")
    assert fibre_statistics.pattern(tmp_path / "case.toml", None).count == 2


def test_a_void_is_no_fibre_that_can_debond(tmp_path):
    case = case_of(tmp_path, table(ROWS)).replace({"interface": {"debonded": [{"fibre": 2, "angle": 60.0}]}})
    with pytest.raises(CaseError, match=r"debonded\[0\].fibre = 2: expected at most 1; the cell has 1 fibres"):
        run(case, MPI.COMM_SELF)


TUBE = {"x": 0.0, "y": 0.0, "radius": 0.2, "inner_radius": 0.12}
OVAL = {"x": 0.5, "y": 0.1, "a": 0.16, "b": 0.08, "angle": 30.0}


@pytest.mark.parametrize("more", [[], [OVAL]], ids=["circles", "ellipses"])
def test_a_hollow_fibre_is_a_ring_around_a_void(tmp_path, more):
    coated = {"x": 0.5, "y": 0.5, "radius": 0.2, "coating": 0.2}
    rows = [coated, TUBE, {"x": 0.05, "y": 0.5, "radius": 0.15, "phase": "void"}, *more]
    mesh = generate(case_of(tmp_path, table(rows, mesh_size=0.03), "fibre", "coating").cell)
    torus, found = Torus.of(mesh), areas(mesh.points, mesh.triangles)
    assert torus.voids == 2 and mesh.phases == ("matrix", "fibre", "coating")
    own = (mesh.precedence == 2) & (mesh.phase == 1)
    assert found[own].sum() == pytest.approx(np.pi * (0.2**2 - 0.12**2), rel=0.02)
    assert 1 - found.sum() == pytest.approx(np.pi * (0.12**2 + 0.15**2), rel=0.02)
    tube = np.unique(torus.constituent[own])
    assert len(tube) == 1 and fibre_circles(torus)[tube[0], 2] == pytest.approx(0.2)


@pytest.mark.parametrize(("row", "words"), [
    (TUBE | {"inner_radius": 0.2}, "expected inner_radius / radius from 0.05 to 0.98, or 0"),
    (TUBE | {"inner_radius": 0.001}, "expected inner_radius / radius from 0.05 to 0.98, or 0"),
    (TUBE | {"inner_radius": -0.1}, "inner_radius = -0.1: expected a number at least 0"),
    (TUBE | {"coating": 0.1}, "has an inner_radius and a coating; give one"),
    (TUBE | {"phase": "void"}, "inner_radius = 0.12: a void has none"),
    (OVAL | {"inner_radius": 0.05}, "has an inner_radius, which only round fibres may have"),
])  # fmt: skip
def test_faults_of_hollow_fibres(tmp_path, row, words):
    with pytest.raises(CaseError) as caught:
        case_of(tmp_path, table([row, OVAL]), "fibre", *["coating"] * ("coating" in row))
    assert caught.value.faults[0].endswith(f"row 1: {words}")
