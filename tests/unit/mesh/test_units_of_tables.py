"""A table in another unit of length has the mesh of the cell, to the last element."""

import numpy as np
import pytest
from support.generated_meshes import generate

from feti_homog.case import cases

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
    document = {
        "cell": {"geometry": "table"} | cell,
        "material": {phase: {"young": 3.0, "poisson": 0.3} for phase in ("matrix", "fibre")},
        "analysis": {"type": "stiffness", "plane": "strain"},
    }
    return generate(cases.parse(document, folder).cell)


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
