"""Case files with a fault, or several.

Each table maps the words that must stand in the lines about faults, a line for each, to the content of a file.
"""

from support.base_case import BASE, MESH_CELL, RANDOM, TABLE_CELL, cell, changed, ended, faults, fraction
from unit.case.faulty_materials import FAULTY_MATERIALS

NOT_TOML: dict[str, str] = {
    "not TOML: Expected '=' after a key in a key/value pair (at line 4": cell("mesh_size = 0.05", "mesh_size 0.05"),
    "not TOML: Expected one statement a line (at line 4": cell("mesh_size = 0.05", "mesh_size = 0.05 coating = 0.1"),
    "not TOML: Unterminated string (at line 18, the end": ended('[output]\nlength_unit = """'),
    "not TOML: Cannot overwrite a value (at line 5": cell("mesh_size = 0.05", "mesh_size = 0.05\nmesh_size = 0.1"),
    '"mesh_size = 0.1"; mesh_size is given twice': cell("mesh_size = 0.05", "mesh_size = 0.05\nmesh_size = 0.1"),
    '"mesh_size = 3 mm"; numbers have no unit, and a decimal point': cell("mesh_size = 0.05", "mesh_size = 3 mm"),
    '"mesh_size = 0,05"; numbers have no unit, and a decimal point': cell("mesh_size = 0.05", "mesh_size = 0,05"),
    '"mesh_size = small"; text needs quotation marks': cell("mesh_size = 0.05", "mesh_size = small"),
    'has its keys in quotation marks: "cell.refine"': ended("[sweep]\ncell = [{order = 1}]\ncell.refine = [0, 1]\n"),
    "not TOML: Cannot declare ('cell',) twice (at line 17": ended("[cell]\n"),
    "not TOML": cell("0.05", "1" * 5000),
}  # fmt: skip

FAULTY_CASES = {
    **faults(BASE, {
        "[cell] subdomains = 3": "unknown key; it belongs to [decomposition]",
        '[cell] geometry = "hexagon"': 'expected one of "square"',
        "[cell] geometry = 6": "expected one of",
        "[cell] fibre_fraction = 0.0": "expected a number above 0 and below 1",
        "[cell] fibre_fraction = 40": "expected a number above 0 and below 1",
        '[cell] fibre_fraction = "0.4"': "expected a number",
        "[cell] fibre_fraction = true": "expected a number",
        "[cell] fibre_fraction = nan": "expected a number",
        "[cell] fibre_fraction = -inf": "expected a number",
        "[cell] fibre_fraction = 0.91": 'expected less than 0.9069 for geometry = "hexagonal": there the fibres touch',
        "[cell] mesh_size = 0": "expected a number at least 0.0001 and at most 0.5",
        "[cell] interface_size = 0": "expected a number at least 1e-05 and at most 0.5",
        "[cell] interface_size = 0.06": "expected at most mesh_size, which is 0.05",
        "[cell] tip_size = 0.06": "expected at most mesh_size, which is 0.05",
        "[cell] fibre_diameter = 7.0": "unknown key; give the radius (in [cell] fibre_radius)",
        "[cell] radius = 3.5": "unknown key; did you mean fibre_radius?",
        "[cell] refine = -1": "expected an integer at least 0",
        "[cell] refine = 9": "expected an integer at least 0 and at most 8",
        "[cell] refine = 2.0": "expected an integer",
        "[cell] order = 3": "expected an integer at least 1 and at most 2",
        '[cell] bodies = "tours"': 'expected one of "torus", "plane"',
        "[cell] fibres = 50": 'belongs to geometry = "random", not "hexagonal"',
        '[cell] file = "cell.msh"': 'belongs to geometry = "table" or "mesh" or "pixels", not "hexagonal"',
        '[analysis] type = "stifness"': 'expected one of "stiffness"',
        '[analysis] type = "strength"': 'expected one of "stiffness", "angle", "path", "load", "envelope", '
            '"conductivity"; strengths are in [material.PHASE] and [interface], peaks in type = "path"',
        "[analysis] strength = 60.0": "unknown key; strengths are in [material.PHASE] and [interface], peaks in type =",
        "[analysis] delta_T = -100.0": "unknown key; temperature belongs to [envelope] or a load of [path] to or",
        '[analysis] plane = "plane strain"': 'expected one of "strain", "stress", "generalized"',
        "[decomposition] subdomains = 0": "expected an integer at least 1",
        "[decomposition] max_dofs = 3": "expected an integer at least 100",
        "[output] pictures = 1": "expected true or false",
        '[output] stress = "S21"': 'expected one of "auto", "S11", "S22", "S12", "S33", "S23", "S13"',
        '[output] stress = "S33"': 'belongs to [analysis] plane = "generalized", not "strain"',
        '[output] stress_unit = "G\\nPa"': "expected a string in one line",
        "[output] deformation_scale = -1": "expected a number at least 0",
        "[cell] width = 0.0": "expected a number at least 1e-09 and at most 1e+09",
        "[petsc] ksp_rtol = 1e-08": "expected the prefix feti_",
        "[petsc] log_view = true": "expected the prefix feti_; PETSc's own options are for the command line",
        "[petsc] feti_ksp_rtol = [1e-08]": "expected a string, a number, true or false",
        "[petsc] feti = {ksp_rtol = 1e-08}": "expected the prefix feti_",
    }),
    **faults(changed(MESH_CELL), {
        "[cell] interface_size = 0.01": 'belongs to geometry = "square" or "hexagonal" or "random" or "table", not',
        '[cell] boundary = "free"': 'expected one of "periodic", "displacement", "traction"',
        '[cell] file = "none.msh"': "no such file",
        '[cell] file = "cell.geo"': "expected the name of a .msh, .inp, .vtu, .vtk or .mesh file",
    }),
    **faults(changed(('geometry = "hexagonal"\n', RANDOM)), {
        "[cell] min_gap = -0.1": "expected a number at least 0",
        "[cell] seed = -1": "expected an integer at least 0",
    }),
    "sweep = 3: expected a section [sweep]": f"sweep = 3\n{BASE}",
    "[cell]: missing section\n[material]: missing section\n[analysis]: missing section": "",
    "[cell]: missing section": BASE[BASE.index("[material.matrix]") :],
    "[material]: missing section": cell(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], ""),
    "[analysis]: missing section": BASE[: BASE.index("[analysis]")],
    "[anlysis]: unknown section; did you mean analysis?": ended("[anlysis]\n"),
    '["a\\nb"]: unknown section; expected one of cell, analysis': ended('["a\\nb"]\n'),
    "cell = 3: expected a section [cell]": "cell = 3\n" + BASE[BASE.index("[material.matrix]") :],
    "expected a section [cell]": cell("[cell]", "[[cell]]"),
    "material = 3: expected sections [material.matrix], [material.fibre]":
        "material = 3\n" + BASE.replace(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], ""),
    "refine: unknown key; it belongs to [cell]": "refine = 2\n" + BASE,
    "name = 3: expected a string": "name = 3\n" + BASE,
    "[cell] mesh_sise = 0.05: unknown key; did you mean mesh_size?": cell("mesh_size", "mesh_sise"),
    "[cell] fiber_fraction = 0.4: unknown key; did you mean fibre_fraction?\n[cell] fibre_fraction: missing":
        cell("fibre_fraction", "fiber_fraction"),
    "[cell] geometry: missing; expected one of": cell('geometry = "hexagonal"\n', ""),
    "[cell] fibre_fraction: missing; expected a number": cell("fibre_fraction = 0.4\n", ""),
    '[cell] fibre_fraction = "2026-01-01": expected a number': fraction("2026-01-01"),
    '[cell] fibre_fraction = 0.79: expected less than 0.7854 for geometry = "square": there the fibres touch':
        changed(('"hexagonal"', '"square"'), ("= 0.4", "= 0.79")),
    "[cell] mesh_size = 1000000": cell("= 0.05", f"= 1{'0' * 400}"),
    "[cell] interface_size = 0.1: expected at most mesh_size, which is 0.05":
        cell("mesh_size = 0.05", "interface_size = 0.1"),
    "[cell] tip_size = 0.03: expected at most interface_size, which is 0.02":
        cell("= 0.05", "= 0.05\ninterface_size = 0.02\ntip_size = 0.03"),
    "[cell] fibres: missing; expected an integer": cell('"hexagonal"', '"random"'),
    '[cell] fibre_fraction = 0.5: expected less than 0.4031 for geometry = "random": no circles min_gap apart are':
        changed(('geometry = "hexagonal"\n', RANDOM + "min_gap = 0.5\n"), ("= 0.4", "= 0.5")),
    '[cell] boundary = "traction": belongs to [analysis] type = "stiffness" or "conductivity", not "path"':
        changed(MESH_CELL, ("[material.m", 'boundary = "traction"\n[material.m'), ('"stiffness"', '"path"'),
                end="[path]\nstrain = [0.1, 0.0, 0.0]\n"),
    '[cell] boundary: excludes repair = "snap" and smooth = true, whose sides match':
        changed(MESH_CELL, ("[material.m", 'boundary = "displacement"\nrepair = "snap"\n[material.m')),
    "[cell] file: missing; expected the name of a .msh, .inp, .vtu, .vtk or .mesh file":
        cell('"hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05', '"mesh"'),
    '[cell] fibre_fraction = 0.4: belongs to geometry = "square" or "hexagonal" or "random", not':
        cell('"hexagonal"', '"mesh"'),
    '[analysis] type: missing; expected one of "stiffness"': cell('type = "stiffness"\n', ""),
    '[analysis] plane: missing; expected one of "strain", "stress"': cell('plane = "strain"\n', ""),
    "[decomposition] subdomains, max_dofs: exclude each other; give one":
        ended("[decomposition]\nsubdomains = 4\nmax_dofs = 1000\n"),
    "[cell] width, fibre_radius: exclude each other; give one":
        cell("mesh_size = 0.05", "mesh_size = 0.05\nwidth = 2.0\nfibre_radius = 1.0"),
    "[petsc] -feti_ksp_rtol = 1e-08: expected the option's name without its dash":
        ended("[petsc]\n-feti_ksp_rtol = 1e-8\n"),
    "[cell] fibre_fraction = 4: \n"
    '[material.matrix] young = "88": \n'
    '[analysis] plane = "strian": \n'
    "[ouput]: unknown section; did you mean output?\n"
    "[petsc] logview = true: ":
        changed(("0.4", "4"), ("88.0", '"88"'), ('"strain"', '"strian"'), end="[ouput]\n[petsc]\nlogview = true\n"),
} | NOT_TOML | FAULTY_MATERIALS  # fmt: skip

# Accuracy and sizes of elements.
FAULTY_SIZES: dict[str, str] = {
    **faults(changed(MESH_CELL), {
        "[cell] accuracy = 0.001": 'belongs to geometry = "square"',
    }),
    "[cell] accuracy, mesh_size: exclude each other; accuracy chooses the sizes":
        cell("mesh_size = 0.05", "mesh_size = 0.05\naccuracy = 1e-3"),
    "[cell] accuracy, tip_size, refine: exclude each other":
        cell("mesh_size = 0.05", "refine = 0\naccuracy = 1e-3\ntip_size = 1e-3"),
    "[cell] element_size = 0.01: unknown key; give mesh_size and refine: elements have the size mesh_size / 2^":
        cell("mesh_size = 0.05", "element_size = 0.01"),
    '[cell] element = "displacement": unknown key; leave it out: quadratic elements of isotropic phases have a ':
        cell("mesh_size = 0.05", 'element = "displacement"'),
    "[cell] accuracy = 1e-08: expected a number at least 1e-07 and at most 0.1":
        cell("mesh_size = 0.05", "accuracy = 1e-8"),
    '[cell] accuracy_check = "repeat": unknown key; leave it out: a remark names the mesh that would do':
        cell("mesh_size = 0.05", 'accuracy = 1e-3\naccuracy_check = "repeat"'),
    "[cell] accuracy = 1e-07: would need elements split 12 times, more than 8":
        cell("mesh_size = 0.05", "accuracy = 1e-7\norder = 1").replace("0.299", "0.45"),
}  # fmt: skip

# geometry = "table", or keys of such cells.
FAULTY_TABLE_CELLS: dict[str, str] = {
    **faults(changed(MESH_CELL), {
        '[cell] file = "cell.csv"': "expected the name of a .msh",
    }),
    **faults(changed(TABLE_CELL), {
        "[cell] fibre_list = [0.5, 0.5, 0.3]": "expected a list of fibres such as {x = 0.5, y = 0.5, radius = 0.3}",
        "[cell] fibre_fraction = 0.3": 'belongs to geometry = "square" or "hexagonal" or "random", not "table"',
        '[cell] window = "open"': 'expected one of "periodic", "cut"',
    }),
    **faults(BASE, {
        "[cell] height = 2.0": 'belongs to geometry = "table", not "hexagonal"',
        '[cell] window = "cut"': 'belongs to geometry = "table" or "pixels", not "hexagonal"',
    }),
    "[cell] file: missing; expected the name of a .csv file, or fibre_list": cell(MESH_CELL[0], 'geometry = "table"'),
    "[cell] file, fibre_list: exclude each other; give one": cell(MESH_CELL[0], TABLE_CELL[1] + '\nfile = "t.csv"'),
    '[cell] file = "cell.msh": expected the name of a .csv file for geometry = "table"':
        cell(MESH_CELL[0], 'geometry = "table"\nfile = "cell.msh"'),
    '[cell] file = "none.csv": no such file': cell(MESH_CELL[0], 'geometry = "table"\nfile = "none.csv"'),
    "[cell] height: missing; fibre_list has no line such as # width = 120, height = 80":
        cell(MESH_CELL[0], TABLE_CELL[1].replace("height = 1.0\n", "")),
    "[cell] fibre_list: row 1: radius = -0.3: expected a number above 0":
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = -0.3")),
    "[cell] fibre_list: row 1: phas = 1: unknown key; did you mean phase?":
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = 0.3, phas = 1")),
    "[material.coating]: missing section; [cell] has coatings":
        cell(MESH_CELL[0], TABLE_CELL[1].replace("radius = 0.3", "radius = 0.3, coating = 0.1")),
}  # fmt: skip
