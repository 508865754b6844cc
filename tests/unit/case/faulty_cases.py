"""Case files with one fault each (or as many as stated), and the line that must report it."""

from support.base_case import BASE, MESH_CELL, RANDOM, cell, changed, ended, fraction
from unit.case.faulty_materials import FAULTY_MATERIALS

# name: (content of the file, words that must stand in its faults)
FAULTY_CASES: dict[str, tuple[str, tuple[str, ...]]] = {
    "sweep_is_no_section": (f"sweep = 3\n{BASE}", ("sweep = 3: expected a section [sweep]",)),
    # the file
    "empty": ("", ("[cell]: missing section", "[material]: missing section", "[analysis]: missing section")),
    "syntax": (cell("mesh_size = 0.05", "mesh_size 0.05"), ("not TOML", "line 4")),
    "syntax_unclosed": (ended('[output]\nlength_unit = """'), ("not TOML", "line 18, the end")),
    "key_twice": (cell("mesh_size = 0.05", "mesh_size = 0.05\nmesh_size = 0.1"), ("not TOML", "line 5")),
    "section_twice": (ended("[cell]\n"), ("not TOML", "line 17")),
    "number_too_long": (cell("0.05", "1" * 5000), ("not TOML",)),
    # sections
    "no_cell": (BASE[BASE.index("[material.matrix]") :], ("[cell]: missing section",)),
    "no_material": (
        cell(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], ""),
        ("[material]: missing section",),
    ),
    "no_analysis": (BASE[: BASE.index("[analysis]")], ("[analysis]: missing section",)),
    "unknown_section": (ended("[anlysis]\n"), ("[anlysis]: unknown section; did you mean analysis?",)),
    "strange_section": (ended('["a\\nb"]\n'), ('["a\\nb"]: unknown section; expected one of cell, analysis',)),
    "cell_is_a_number": (
        "cell = 3\n" + BASE[BASE.index("[material.matrix]") :],
        ("cell = 3: expected a section [cell]",),
    ),
    "cell_is_an_array": (cell("[cell]", "[[cell]]"), ("expected a section [cell]",)),
    "material_is_a_number": (
        "material = 3\n" + BASE.replace(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], ""),
        ("material = 3: expected sections [material.matrix], [material.fibre]",),
    ),
    "key_before_sections": ("refine = 2\n" + BASE, ("refine: unknown key; it belongs to [cell]",)),
    "name_is_a_number": ("name = 3\n" + BASE, ("name = 3: expected a text",)),
    # [cell]
    "unknown_key": (
        cell("mesh_size", "mesh_sise"),
        ("[cell] mesh_sise = 0.05: unknown key; did you mean mesh_size?",),
    ),
    "american_key": (
        cell("fibre_fraction", "fiber_fraction"),
        (
            "[cell] fiber_fraction = 0.4: unknown key; did you mean fibre_fraction?",
            "[cell] fibre_fraction: missing",
        ),
    ),
    "key_of_other_section": (
        cell("mesh_size", "subdomains = 3\nmesh_size"),
        ("it belongs to [decomposition]",),
    ),
    "no_geometry": (cell('geometry = "hexagonal"\n', ""), ("[cell] geometry: missing; expected one of",)),
    "unknown_geometry": (
        cell('"hexagonal"', '"hexagon"'),
        ('[cell] geometry = "hexagon": expected one of "square"',),
    ),
    "geometry_is_a_number": (cell('"hexagonal"', "6"), ("[cell] geometry = 6: expected one of",)),
    "no_fraction": (
        cell("fibre_fraction = 0.4\n", ""),
        ("[cell] fibre_fraction: missing; expected a number",),
    ),
    "fraction_zero": (
        fraction("0.0"),
        ("[cell] fibre_fraction = 0.0: expected a number above 0 and below 1",),
    ),
    "fraction_above_one": (
        fraction("40"),
        ("[cell] fibre_fraction = 40: expected a number above 0 and below 1",),
    ),
    "fraction_is_text": (fraction('"0.4"'), ('[cell] fibre_fraction = "0.4": expected a number',)),
    "fraction_is_true": (fraction("true"), ("[cell] fibre_fraction = true: expected a number",)),
    "fraction_is_nan": (fraction("nan"), ("[cell] fibre_fraction = nan: expected a number",)),
    "fraction_is_infinite": (fraction("-inf"), ("[cell] fibre_fraction = -inf: expected a number",)),
    "fraction_is_a_date": (
        fraction("2026-01-01"),
        ('[cell] fibre_fraction = "2026-01-01": expected a number',),
    ),
    "fibres_touch": (fraction("0.91"), ("[cell] fibre_fraction = 0.91: expected less than 0.9069", "touch")),
    "fibres_touch_in_square": (
        changed(('"hexagonal"', '"square"'), ("= 0.4", "= 0.79")),
        ("[cell] fibre_fraction = 0.79: expected less than 0.7854", "touch"),
    ),
    "mesh_size_zero": (
        cell("= 0.05", "= 0"),
        ("[cell] mesh_size = 0: expected a number at least 0.0001 and at most 0.5",),
    ),
    "mesh_size_huge": (cell("= 0.05", f"= 1{'0' * 400}"), ("[cell] mesh_size = 1000000",)),
    "interface_size_zero": (
        cell("= 0.05", "= 0.05\ninterface_size = 0"),
        ("[cell] interface_size = 0: expected a number at least 1e-05 and at most 0.5",),
    ),
    "interface_size_above_mesh_size": (
        cell("= 0.05", "= 0.05\ninterface_size = 0.06"),
        ("[cell] interface_size = 0.06: expected at most mesh_size, which is 0.05",),
    ),
    "interface_size_above_the_default_mesh_size": (
        cell("mesh_size = 0.05", "interface_size = 0.1"),
        ("[cell] interface_size = 0.1: expected at most mesh_size, which is 0.05",),
    ),
    "interface_size_of_a_mesh": (
        changed((MESH_CELL[0], MESH_CELL[1] + "\ninterface_size = 0.01")),
        ('[cell] interface_size = 0.01: belongs to geometry = "square" or "hexagonal" or "random" or "table", not',),
    ),
    "tip_size_above_mesh_size": (
        cell("= 0.05", "= 0.05\ntip_size = 0.06"),
        ("[cell] tip_size = 0.06: expected at most mesh_size, which is 0.05",),
    ),
    "tip_size_above_interface_size": (
        cell("= 0.05", "= 0.05\ninterface_size = 0.02\ntip_size = 0.03"),
        ("[cell] tip_size = 0.03: expected at most interface_size, which is 0.02",),
    ),
    "refine_negative": (
        cell("mesh_size", "refine = -1\nmesh_size"),
        ("[cell] refine = -1: expected an integer at least 0",),
    ),
    "refine_too_large": (
        cell("mesh_size", "refine = 9\nmesh_size"),
        ("[cell] refine = 9: expected", "at most 8"),
    ),
    "refine_is_real": (
        cell("mesh_size", "refine = 2.0\nmesh_size"),
        ("[cell] refine = 2.0: expected an integer",),
    ),
    "order_three": (
        cell("mesh_size", "order = 3\nmesh_size"),
        ("[cell] order = 3: expected an integer at least 1 and at most 2",),
    ),
    "unknown_bodies": (
        cell("mesh_size", 'bodies = "tours"\nmesh_size'),
        ('[cell] bodies = "tours": expected one of "torus", "plane"',),
    ),
    "fibres_of_hexagonal": (
        cell("mesh_size", "fibres = 50\nmesh_size"),
        ('[cell] fibres = 50: belongs to geometry = "random", not "hexagonal"',),
    ),
    "file_of_hexagonal": (
        cell("mesh_size", 'file = "cell.msh"\nmesh_size'),
        ('[cell] file = "cell.msh": belongs to geometry = "table" or "mesh", not "hexagonal"',),
    ),
    "random_without_fibres": (
        cell('"hexagonal"', '"random"'),
        ("[cell] fibres: missing; expected an integer",),
    ),
    "random_too_dense": (
        changed(('geometry = "hexagonal"\n', RANDOM + "min_gap = 0.5\n"), ("= 0.4", "= 0.5")),
        ("[cell] fibre_fraction = 0.5: expected less than 0.4031", "no circles min_gap apart are denser"),
    ),
    "random_negative_gap": (
        changed(('geometry = "hexagonal"\n', RANDOM + "min_gap = -0.1\n")),
        ("[cell] min_gap = -0.1: expected a number at least 0",),
    ),
    "random_negative_seed": (
        changed(('geometry = "hexagonal"\n', RANDOM + "seed = -1\n")),
        ("[cell] seed = -1: expected an integer at least 0",),
    ),
    "mesh_without_file": (
        cell('"hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05', '"mesh"'),
        ("[cell] file: missing; expected the name of a .msh, .inp, .vtu, .vtk or .mesh file",),
    ),
    "mesh_not_there": (
        cell('"hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05', '"mesh"\nfile = "none.msh"'),
        ('[cell] file = "none.msh": no such file', "none.msh)"),
    ),
    "mesh_is_no_msh": (
        cell('"hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05', '"mesh"\nfile = "cell.geo"'),
        ('[cell] file = "cell.geo": expected the name of a .msh, .inp, .vtu, .vtk or .mesh file',),
    ),
    "mesh_with_fraction": (
        cell('"hexagonal"', '"mesh"'),
        ('[cell] fibre_fraction = 0.4: belongs to geometry = "square" or "hexagonal" or "random", not',),
    ),
    # [analysis], [decomposition], [output]
    "no_type": (cell('type = "stiffness"\n', ""), ('[analysis] type: missing; expected one of "stiffness"',)),
    "unknown_type": (
        cell('"stiffness"', '"stifness"'),
        ('[analysis] type = "stifness": expected one of "stiffness"',),
    ),
    "unknown_plane": (
        cell('"strain"', '"plane strain"'),
        ('[analysis] plane = "plane strain": expected one of "strain", "stress", "generalized"',),
    ),
    "no_plane": (
        cell('plane = "strain"\n', ""),
        ('[analysis] plane: missing; expected one of "strain", "stress"',),
    ),
    "no_subdomains": (
        ended("[decomposition]\nsubdomains = 0\n"),
        ("[decomposition] subdomains = 0: expected an integer at least 1",),
    ),
    "max_dofs_small": (
        ended("[decomposition]\nmax_dofs = 3\n"),
        ("[decomposition] max_dofs = 3: expected an integer at least 100",),
    ),
    "two_decompositions": (
        ended("[decomposition]\nsubdomains = 4\nmax_dofs = 1000\n"),
        ("[decomposition] subdomains, max_dofs: exclude each other; give one",),
    ),
    "pictures_is_a_number": (
        ended("[output]\npictures = 1\n"),
        ("[output] pictures = 1: expected true or false",),
    ),
    "unknown_stress": (
        ended('[output]\nstress = "S21"\n'),
        ('[output] stress = "S21": expected one of "auto", "S11", "S22", "S12", "S33", "S23", "S13"',),
    ),
    "a_stress_out_of_the_plane": (
        ended('[output]\nstress = "S33"\n'),
        ('[output] stress = "S33": belongs to [analysis] plane = "generalized", not "strain"',),
    ),
    "unit_of_two_lines": (
        ended('[output]\nstress_unit = "G\\nPa"\n'),
        ('[output] stress_unit = "G\\nPa": expected a text in one line',),
    ),
    "scale_negative": (
        ended("[output]\ndeformation_scale = -1\n"),
        ("[output] deformation_scale = -1: expected a number at least 0",),
    ),
    "two_sizes": (
        cell("mesh_size = 0.05", "mesh_size = 0.05\nwidth = 2.0\nfibre_radius = 1.0"),
        ("[cell] width, fibre_radius: exclude each other; give one",),
    ),
    "width_zero": (
        cell("mesh_size = 0.05", "mesh_size = 0.05\nwidth = 0.0"),
        ("[cell] width = 0.0: expected a number at least 1e-09 and at most 1e+09",),
    ),
    # [petsc]
    "petsc_dash": (
        ended("[petsc]\n-feti_ksp_rtol = 1e-8\n"),
        ("[petsc] -feti_ksp_rtol = 1e-08: expected the option's name without its dash",),
    ),
    "petsc_without_prefix": (
        ended("[petsc]\nksp_rtol = 1e-8\n"),
        ("[petsc] ksp_rtol = 1e-08: expected the prefix feti_",),
    ),
    "petsc_without_effect": (
        ended("[petsc]\nlog_view = true\n"),
        ("[petsc] log_view = true: expected the prefix feti_; PETSc's own options are for the command line",),
    ),
    "petsc_array": (
        ended("[petsc]\nfeti_ksp_rtol = [1e-8]\n"),
        ("[petsc] feti_ksp_rtol = [1e-08]: expected a text, a number, true or false",),
    ),
    "petsc_nested": (
        ended("[petsc.feti]\nksp_rtol = 1e-8\n"),
        ("[petsc] feti = ", "expected the prefix feti_"),
    ),
    # several at once
    "many": (
        changed(("0.4", "4"), ("88.0", '"88"'), ('"strain"', '"strian"'), end="[ouput]\n[petsc]\nlogview = true\n"),
        (
            "[cell] fibre_fraction = 4: ",
            '[material.matrix] young = "88": ',
            '[analysis] plane = "strian": ',
            "[ouput]: unknown section; did you mean output?",
            "[petsc] logview = true: ",
        ),
    ),
} | FAULTY_MATERIALS
