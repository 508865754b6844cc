"""Sections [cell] with a fault in the accuracy or the size of elements that they ask for."""

from support.base_case import MESH_CELL, cell

# name: (content of the file, words that must stand in its faults)
FAULTY_SIZES: dict[str, tuple[str, tuple[str, ...]]] = {
    "accuracy_and_mesh_size": (
        cell("mesh_size = 0.05", "mesh_size = 0.05\naccuracy = 1e-3"),
        ("[cell] accuracy, mesh_size: exclude each other; accuracy chooses the sizes",),
    ),
    "accuracy_and_fine_tips": (
        cell("mesh_size = 0.05", "refine = 0\naccuracy = 1e-3\ntip_size = 1e-3"),
        ("[cell] accuracy, tip_size, refine: exclude each other",),
    ),
    "element_size": (
        cell("mesh_size = 0.05", "element_size = 0.01"),
        ("[cell] element_size = 0.01: unknown key; give mesh_size and refine: elements have the size mesh_size / 2^",),
    ),
    "element": (
        cell("mesh_size = 0.05", 'element = "displacement"'),
        ('[cell] element = "displacement": unknown key; leave it out: quadratic elements of isotropic phases have a ',),
    ),
    "accuracy_beyond_the_tolerance_of_the_solver": (
        cell("mesh_size = 0.05", "accuracy = 1e-8"),
        ("[cell] accuracy = 1e-08: expected a number at least 1e-07 and at most 0.1",),
    ),
    "accuracy_check": (
        cell("mesh_size = 0.05", 'accuracy = 1e-3\naccuracy_check = "repeat"'),
        ('[cell] accuracy_check = "repeat": unknown key; leave it out: a remark names the mesh that would do',),
    ),
    "accuracy_of_a_users_mesh": (
        cell(MESH_CELL[0], MESH_CELL[1] + "\naccuracy = 1e-3"),
        ('[cell] accuracy = 0.001: belongs to geometry = "square"',),
    ),
    "accuracy_of_linear_elements_that_nearly_lock": (
        cell("mesh_size = 0.05", "accuracy = 1e-7\norder = 1").replace("0.299", "0.45"),
        ("[cell] accuracy = 1e-07: would need elements split 12 times, more than 8",),
    ),
}
