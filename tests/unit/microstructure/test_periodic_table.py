"""Cells of tables do not depend on origin, unit or order of rows; faulty tables are refused."""

from dataclasses import replace

import numpy as np
import pytest
from support.cases import case_of
from support.generated_meshes import generate

from feti_homog.case.cell_section import Cell
from feti_homog.errors import MOST_FAULTS, MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.mesh_fibres import fibre_circles
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.microstructure.fibre_table import table_of

CELLS = {
    "square": Cell(geometry="square", fibre_fraction=0.7, mesh_size=0.1),
    "hexagonal": Cell(geometry="hexagonal", fibre_fraction=0.6, mesh_size=0.1),
    "random": Cell(geometry="random", fibre_fraction=0.5, fibres=20, radius_spread=0.3, seed=2, mesh_size=0.1),
}


def table(centres, radii, size, corner=(None, None), phases=None):
    names = phases or ["fibre"] * len(radii)
    rows = [
        {"x": float(x), "y": float(y), "radius": float(r), "phase": name}
        for (x, y), r, name in zip(centres, radii, names, strict=True)
    ]
    sides = {"width": size[0], "height": size[1], "left": corner[0], "bottom": corner[1]}
    return replace(table_of(rows, "t.csv"), **sides)


def cell_of(fibres):
    return Cell(geometry="table", table=fibres, mesh_size=0.1)


@pytest.mark.parametrize("name", CELLS)
def test_the_table_of_a_cell_gives_its_mesh(name):
    built = arrange(CELLS[name])
    fibres = table(built.centres, built.radii, (built.width, built.height), (0.0, 0.0))
    mesh, expected = generate(cell_of(fibres)), generate(CELLS[name])
    assert np.array_equal(mesh.triangles, expected.triangles) and np.array_equal(mesh.phase, expected.phase)
    assert np.abs(mesh.points - expected.points).max() < 1e-14


@pytest.mark.parametrize("name", CELLS)
def test_origin_units_and_order_of_rows_do_not_matter(name):
    built = arrange(CELLS[name])
    size = np.array([built.width, built.height])
    expected = generate(cell_of(table(built.centres, built.radii, size.tolist())))
    order = np.random.default_rng(0).permutation(len(built.radii))
    moved = 137.3 * ((built.centres + np.array([0.21, 0.73])) % size) + np.array([1e3, -2e3])
    unit = 137.3 * size
    mesh = generate(cell_of(table(moved[order], 137.3 * built.radii[order], unit.tolist())))
    assert np.array_equal(mesh.triangles, expected.triangles)
    assert np.abs(mesh.points / 137.3 - expected.points).max() < 1e-9
    circles = fibre_circles(Torus.of(mesh))[1:]
    assert circles[:, 2] == pytest.approx(137.3 * built.radii[order], rel=1e-8)
    apart = circles[:, None, :2] - circles[:, :2]
    wanted = moved[order][:, None] - moved[order]
    assert np.abs((apart - wanted + unit / 2) % unit - unit / 2).max() < 1e-6


def test_a_side_that_would_touch_a_disc_is_moved():
    arrangement = arrange(cell_of(table([[0.2, 0.5], [0.7, 0.7]], [0.2, 0.2], (1.0, 1.0), (0.0, 0.0))))
    apart = arrangement.centres[1] - arrangement.centres[0] - [0.5, 0.2]
    assert np.abs(apart - np.round(apart)).max() < 1e-9
    touching = arrangement.centres[:, None] + [[0.2], [-0.2]]
    assert np.abs(touching - np.round(touching)).min() > 0.02


def test_rows_a_period_apart_are_one_fibre():
    """At a side two, at a corner four; the number of the fibre is that of its first row."""
    centres = [[0.5, 0.5], [0.0, 0.0], [1.0, 0.0], [0.0, 1.001], [1.0, 1.0], [1.02, 0.5], [0.02, 0.5], [0.5, 0.0]]
    fibres = table(centres, [0.2] * 8, (1.0, 1.0), (0.0, 0.0), ["a", "b", "b", "b", "b", "c", "c", "d"])
    arrangement = arrange(cell_of(fibres))
    assert arrangement.phase == ("a", "b", "c", "d") and len(arrangement.radii) == 4
    assert arrangement.phases == ("matrix", "a", "b", "c", "d")


FAULTY = {
    "overlap": (([[0.3, 0.5], [0.45, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: overlap by 0.05"),
    "touch": (([[0.3, 0.5], [0.5, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: touch"),
    "nearly touch": (([[0.3, 0.5], [0.500001, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: touch"),
    "one in the other": (([[0.5, 0.5], [0.45, 0.5]], [0.3, 0.1]), {}, "rows 1 and 2: overlap by 0.35"),
    "over the side": (([[0.05, 0.5], [0.9, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: overlap by 0.05 across the border"),
    "over the corner": (([[0.05, 0.05], [0.95, 0.95]], [0.1, 0.1]), {}, "rows 1 and 2: overlap by 0.0586 across"),
    "one place": (([[0.3, 0.5], [0.3, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: are at one place"),
    "nearly one place": (([[0.3, 0.5], [0.3005, 0.5]], [0.1, 0.1]), {}, "rows 1 and 2: are at one place"),
    "images of two radii": (([[0.0, 0.5], [1.0, 0.5]], [0.1, 0.12]), {}, "rows 1 and 2: are images of one fibre"),
    "images of two phases": (
        ([[0.0, 0.5], [1.0, 0.5]], [0.1, 0.1]),
        {"phases": ["a", "b"]},
        "rows 1 and 2: are images of one fibre, a period apart; expected one shape, phase and strength",
    ),
    "outside at the left": (
        ([[-0.3, 0.5], [0.5, 0.5]], [0.1, 0.1]),
        {"corner": (0.0, 0.0)},
        "row 1: x = -0.3: lies outside the cell, of width 1",
    ),
    "outside above": (
        ([[5.5, 5.5], [5.5, 6.3]], [0.1, 0.1]),
        {"corner": (5.0, 5.0)},
        "row 2: y = 6.3: lies outside the cell, of height 1",
    ),
    "too small a cell": (([[0.0, 0.5], [1.5, 0.5]], [0.1, 0.1]), {}, "row 2: x = 1.5: lies outside the cell"),
    "too large": (([[0.5, 0.5]], [0.5]), {}, "row 1: radius = 0.5: expected from 1e-06 to below 0.5 in this cell"),
    "too small": (([[0.5, 0.5]], [1e-7]), {}, "row 1: radius = 1e-07: expected from 1e-06 to below 0.5 in this cell"),
}


@pytest.mark.parametrize("name", FAULTY)
def test_faults_name_the_rows(name):
    (centres, radii), words, line = FAULTY[name]
    with pytest.raises(MeshError) as error:
        arrange(cell_of(table(centres, radii, (1.0, 1.0), **words)))
    assert error.value.faults[0].startswith(f"[cell] t.csv: {line}")
    across = [fault for fault in error.value.faults if "across the border" in fault]
    assert len(error.value.faults) == (2 if across else 1)


def test_every_overlap_is_reported_until_there_are_many():
    centres = np.stack([np.arange(50) / 50, np.full(50, 0.5)], axis=1)
    with pytest.raises(MeshError) as error:
        arrange(cell_of(table(centres, np.full(50, 0.011), (1.0, 1.0))))
    assert len(error.value.faults) == MOST_FAULTS + 1
    assert error.value.faults[-1] == "and 31 more faults"


LENGTHS = ("x", "y", "radius", "a", "b")
COLUMNS = (*LENGTHS, "angle", "sides", "corner")
# Of each the width, the height, the size of elements, and the rows.
TABLES = {
    "the height has other digits": (1.0251, 0.8715, 0.2067, [
        {"x": 0.7158, "y": 0.747, "radius": 0.1678},
        {"x": 0.1035, "y": 0.0592, "a": 0.1429, "b": 0.1067, "angle": 71.0},
        {"x": 0.0379, "y": 0.5099, "radius": 0.186, "sides": 3, "corner": 0.6, "angle": 29.4},
    ]),
    "a side passes through a centre": (0.8626, 0.8458, 0.5, [
        {"x": 0.2, "y": 0.3, "radius": 0.12},
        {"x": 0.63, "y": 0.55, "radius": 0.14},
    ]),
    "two corners are as far": (1.0198, 0.811, 0.4, [
        {"x": 0.2854, "y": 0.2479, "a": 0.15, "b": 0.105, "angle": 30.0},
        {"x": 0.6934, "y": 0.6429, "a": 0.15, "b": 0.105, "angle": 30.0},
    ]),
}  # fmt: skip
PLACED = (1.0251, 0.8715, 0.12, [
    {"x": 0.3158, "y": 0.417, "radius": 0.2278, "sides": 5, "corner": 0.6, "angle": 29.4},
    {"x": 0.7635, "y": 0.4592, "a": 0.1429, "b": 0.1067, "angle": 71.0},
])  # fmt: skip


def of_unit(rows, unit):
    return [{name: unit * value if name in LENGTHS else value for name, value in row.items()} for row in rows]


def mesh(cell, folder):
    return generate(case_of({"geometry": "table"} | cell, folder).cell)


def listed(width, height, size, rows, unit, folder):
    """Return the mesh of a table in the case file."""
    cell = {"width": unit * width, "height": unit * height, "fibre_list": of_unit(rows, unit), "mesh_size": size}
    return mesh(cell, folder)


def placed(width, height, size, rows, unit, folder):
    """Return the mesh of a table in a file that has the place of the cell."""
    lines = [f"# width = {unit * width!r}, height = {unit * height!r}, left = 0, bottom = 0", ",".join(COLUMNS)]
    lines += [",".join(str(row.get(name, "")) for name in COLUMNS) for row in of_unit(rows, unit)]
    (folder / "table.csv").write_text("\n".join(lines))
    return mesh({"file": "table.csv", "mesh_size": size}, folder)


UNITS = 3.0, 0.17436714994531674, 7.7e-5, 12345.678


@pytest.mark.parametrize("name", [*TABLES, "a place"])
def test_a_table_in_another_unit_has_one_mesh(name, tmp_path):
    made, table = (listed, TABLES[name]) if name in TABLES else (placed, PLACED)
    one = made(*table, 1.0, tmp_path)
    for unit in UNITS:
        other = made(*table, unit, tmp_path)
        assert np.array_equal(one.triangles, other.triangles), unit
        assert np.abs(other.points / unit - one.points).max() < 1e-12
