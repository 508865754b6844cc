"""Sections [cell] with geometry = "table", or with keys of such cells, that have one fault each."""

from support.base_case import MESH_CELL, TABLE_CELL, cell

# name: (content of the file, words that must stand in its faults)
FAULTY_TABLE_CELLS: dict[str, tuple[str, tuple[str, ...]]] = {
    "table_of_nothing": (
        cell(MESH_CELL[0], 'geometry = "table"'),
        ("[cell] file: missing; expected the name of a .csv file, or fibre_list",),
    ),
    "table_twice": (
        cell(MESH_CELL[0], TABLE_CELL[1] + '\nfile = "t.csv"'),
        ("[cell] file, fibre_list: exclude each other; give one",),
    ),
    "table_in_a_mesh": (
        cell(MESH_CELL[0], 'geometry = "table"\nfile = "cell.msh"'),
        ('[cell] file = "cell.msh": expected the name of a .csv file for geometry = "table"',),
    ),
    "mesh_in_a_table": (
        cell(MESH_CELL[0], 'geometry = "mesh"\nfile = "cell.csv"'),
        ('[cell] file = "cell.csv": expected the name of a .msh',),
    ),
    "no_table": (
        cell(MESH_CELL[0], 'geometry = "table"\nfile = "none.csv"'),
        ('[cell] file = "none.csv": no such file', "none.csv)"),
    ),
    "table_without_height": (
        cell(MESH_CELL[0], TABLE_CELL[1].replace("height = 1.0\n", "")),
        ("[cell] height: missing; fibre_list has no line such as # width = 120, height = 80",),
    ),
    "fibre_of_no_radius": (
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = -0.3")),
        ("[cell] fibre_list: row 1: radius = -0.3: expected a number above 0",),
    ),
    "fibre_misspelt": (
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = 0.3, phas = 1")),
        ("[cell] fibre_list: row 1: phas = 1: unknown key; did you mean phase?",),
    ),
    "fibre_with_a_coating": (
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = 0.3, coating = 0.1")),
        ("[material.coating]: missing section; [cell] has coatings",),
    ),
    "list_of_numbers": (
        cell(MESH_CELL[0], TABLE_CELL[1].replace("[{x = 0.5, y = 0.5, radius = 0.3}]", "[0.5, 0.5, 0.3]")),
        ("[cell] fibre_list = [0.5, 0.5, 0.3]: expected a list of fibres such as {x = 0.5, y = 0.5, radius = 0.3}",),
    ),
    "table_with_a_fraction": (
        cell(MESH_CELL[0], TABLE_CELL[1] + "\nfibre_fraction = 0.3"),
        ('[cell] fibre_fraction = 0.3: belongs to geometry = "square" or "hexagonal" or "random", not "table"',),
    ),
    "height_of_hexagonal": (
        cell("mesh_size", "height = 2.0\nmesh_size"),
        ('[cell] height = 2.0: belongs to geometry = "table", not "hexagonal"',),
    ),
    "window_of_hexagonal": (
        cell("mesh_size", 'window = "cut"\nmesh_size'),
        ('[cell] window = "cut": belongs to geometry = "table", not "hexagonal"',),
    ),
    "unknown_window": (
        cell(MESH_CELL[0], TABLE_CELL[1] + '\nwindow = "open"'),
        ('[cell] window = "open": expected one of "periodic", "cut"',),
    ),
}
