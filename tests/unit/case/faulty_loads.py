"""Case files with faults of loads by name, of [path] and [load], and the lines that must report them."""

from unit.case.faulty_bonding import ARC, PATH, of_type

IN_SPACE = '[analysis] plane = "generalized", not "strain"'
TABLE = "expected a table of strains and stresses such as {S11 = 60.0, S22 = 0.0}"


def path(*lines: str, state: str = "strain") -> str:
    return of_type("path", "[path]", *lines).replace('"strain"', f'"{state}"')


def load(*lines: str, state: str = "strain") -> str:
    return of_type("load", "[load]", *lines).replace('"strain"', f'"{state}"')


# name: (content of the file, words that must stand in its faults)
FAULTY_LOADS: dict[str, tuple[str, tuple[str, ...]]] = {
    "path_of_all_three": (
        path("strain = [1, 0, 0]", "to = {S11 = 1.0}", "waypoints = [{S11 = 1.0}]"),
        ("[path] strain, to, waypoints: exclude each other; give one",),
    ),
    "path_of_strain_and_load": (
        path("strain = [1, 0, 0]", "to = {S11 = 1.0}"),
        ("[path] strain, to: exclude each other; give one",),
    ),
    "path_in_space_of_nothing": (
        path(state="generalized"),
        ("[path] strain, to, waypoints: missing; give one",),
    ),
    "path_of_a_strain_in_space": (
        path("strain = [1, 0, 0]", state="generalized"),
        (
            '[path] strain = [1, 0, 0]: belongs to [analysis] plane = "strain" or "stress", not "generalized"; '
            "use to = {E11 = ...}",
        ),
    ),
    "waypoint_of_a_strain_in_space": (
        path("waypoints = [{S33 = 1.0}, [1, 0, 0]]", state="generalized"),
        (
            "[path] waypoints[1] = [1, 0, 0]: expected a table such as {E11 = 0.01} in "
            '[analysis] plane = "generalized"',
        ),
    ),
    "strain_and_stress_together": (
        path("to = {E11 = 0.1, S11 = 1.0}"),
        ("[path] to.E11, to.S11: exclude each other; give one",),
    ),
    "shear_and_stress_together_in_a_waypoint": (
        path("waypoints = [{S11 = 1.0}, {gamma13 = 0.1, S13 = 1.0}]", state="generalized"),
        ("[path] waypoints[1].gamma13, waypoints[1].S13: exclude each other; give one",),
    ),
    "strain_and_stress_of_a_load": (
        load("to = {gamma12 = 0.1, S12 = 1.0}"),
        ("[load] to.gamma12, to.S12: exclude each other; give one",),
    ),
    "unknown_name_of_a_load": (
        path("to = {s11 = 1.0}"),
        ("[path] to.s11 = 1.0: unknown key; did you mean S11?",),
    ),
    "unknown_name_of_a_waypoint": (
        path("waypoints = [[1, 0, 0], {gama12 = 1.0}]"),
        ("[path] waypoints[1].gama12 = 1.0: unknown key; did you mean gamma12?",),
    ),
    "modulus_as_a_load": (
        load("to = {young = 1.0}"),
        ("[load] to.young = 1.0: unknown key; it belongs to [material.PHASE]",),
    ),
    "load_along_the_fibres_in_the_plane": (
        path("to = {S11 = 1.0, E33 = 0.1}"),
        (f"[path] to.E33 = 0.1: belongs to {IN_SPACE}",),
    ),
    "axial_shear_of_a_sheet": (
        load("to = {S13 = 1.0}", state="stress"),
        ('[load] to.S13 = 1.0: belongs to [analysis] plane = "generalized", not "stress"',),
    ),
    "temperature_in_the_plane": (
        path("waypoints = [{temperature = -100.0}]"),
        (f"[path] waypoints[0].temperature = -100.0: belongs to {IN_SPACE}",),
    ),
    "temperature_without_expansion": (
        path("waypoints = [{S11 = 1.0}, {temperature = -100.0}, {temperature = 0.0}]", state="generalized"),
        (
            "[material.matrix] expansion: missing; [path] waypoints[1].temperature needs it",
            "[material.fibre] expansion: missing; [path] waypoints[1].temperature needs it",
        ),
    ),
    "temperature_of_a_load_without_one_expansion": (
        load("to = {temperature = -100.0}", state="generalized").replace("0.222", "0.222\nexpansion = 1e-6"),
        ("[material.matrix] expansion: missing; [load] to.temperature needs it",),
    ),
    "empty_load_of_a_path": (path("to = {}"), (f"[path] to = {{}}: {TABLE}",)),
    "empty_load": (load("to = {}"), (f"[load] to = {{}}: {TABLE}",)),
    "empty_waypoint": (
        path("waypoints = [{S11 = 1.0}, {}]"),
        (
            "[path] waypoints = [{S11 = 1.0}, {}]: expected a list of strains [E11, E22, gamma12] or of tables such as "
            "{S11 = 60.0}",
        ),
    ),
    "load_is_a_list": (load("to = [1, 0, 0]"), ("[load] to = [1, 0, 0]: expected a table of strains and stresses",)),
    "load_of_a_text": (path('to = {S11 = "60"}'), ('[path] to.S11 = "60": expected a number',)),
    "load_of_a_truth": (load("to = {E11 = true}"), ("[load] to.E11 = true: expected a number",)),
    "load_nan": (path("to = {S11 = nan}"), ("[path] to.S11 = nan: expected a number",)),
    "load_too_large": (
        path("waypoints = [{S11 = 1e101}]"),
        ("[path] waypoints[0].S11 = 1e+101: expected a number; numbers other than 0 have magnitudes",),
    ),
    "load_of_zero": (
        load("to = {E11 = 0.0, S22 = 0}"),
        ("[load] to = {E11 = 0.0, S22 = 0.0}: expected a load other than zero",),
    ),
    "path_to_a_load_of_zero": (
        path("to = {S11 = 0.0}"),
        ("[path] to = {S11 = 0.0}: expected a load other than zero, where the path begins",),
    ),
    "waypoint_of_a_load_of_zero": (
        path("waypoints = [{E22 = 0.0}, {S11 = 1.0}]"),
        ("[path] waypoints[0] = {E22 = 0.0}: expected a load other than zero, where the path begins",),
    ),
    "waypoint_that_names_what_it_is": (
        path("waypoints = [{S11 = 1.0, E22 = 0.1}, {E22 = 0.1, S12 = 0.0}, {S11 = 1.0}]", state="stress"),
        (
            "[path] waypoints[1] = {E22 = 0.1, S12 = 0.0}: expected a load other than waypoints[0]",
            "[path] waypoints[2] = {S11 = 1.0}: expected a load other than waypoints[1]",
        ),
    ),
    "waypoint_of_the_strain_that_a_load_is": (
        path("waypoints = [{E11 = 1.0, E22 = 0.0, gamma12 = 0.0}, [1, 0, 0]]"),
        ("[path] waypoints[1] = [1.0, 0.0, 0.0]: expected a strain other than waypoints[0]",),
    ),
    "increments_too_few_for_loads": (
        path("waypoints = [{S11 = 1.0}, {S11 = 0.0}]", 'method = "increments"', "increments = 1"),
        ("[path] increments = 1: expected at least one for each waypoint",),
    ),
    "no_load": (of_type("load"), ('[load]: missing section; [analysis] type = "load" needs it',)),
    "load_of_nothing": (load(), ("[load] to: missing; expected a table of strains and stresses",)),
    "load_of_a_path": (
        of_type("path", PATH, "[load]", "to = {S11 = 1.0}"),
        ('[load]: belongs to [analysis] type = "load", not "path"',),
    ),
    "path_of_a_load": (
        load("to = {S11 = 1.0}", "[path]", "strain = [1, 0, 0]"),
        ('[path]: belongs to [analysis] type = "path", not "load"',),
    ),
    "load_with_strength": (
        load("to = {S11 = 1.0}", "[interface]", f"debonded = [{ARC}]", "normal_strength = 1.0"),
        ('[interface] normal_strength = 1.0: belongs to [analysis] type = "path" or "envelope", not "load"',),
    ),
    "load_of_bare_interface": (
        load("to = {S11 = 1.0}", "[interface]", "contact = false"),
        ("[interface] debonded: missing; expected a list of arcs",),
    ),
    "axial_strength_of_a_path_in_the_plane": (
        of_type("path", PATH, "[interface]", "axial_strength = 3.0"),
        (f"[interface] axial_strength = 3.0: belongs to {IN_SPACE}",),
    ),
    "many_of_loads": (
        path("waypoints = [{S11 = true, E33 = 1}, {E22 = 1, S22 = 2}, {S1 = 1}]", "to = {S12 = []}"),
        (
            "[path] waypoints[0].S11 = true: expected a number",
            "[path] waypoints[0].E33 = 1: belongs to",
            "[path] waypoints[1].E22, waypoints[1].S22: exclude each other; give one",
            "[path] waypoints[2].S1 = 1: unknown key; did you mean ",
            "[path] to.S12 = []: expected a number",
        ),
    ),
}  # fmt: skip
