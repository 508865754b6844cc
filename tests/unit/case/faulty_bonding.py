"""Case files with faults of imperfect bonding, and the lines that must report them."""

from support.base_case import BASE, changed, ended


def of_type(name: str, *sections: str) -> str:
    return changed(('"stiffness"', f'"{name}"'), end="\n".join(sections) + "\n")


def debonded(arc: str, *lines: str) -> str:
    """Return a load path with one arc."""
    return of_type("path", PATH, "[interface]", f"debonded = [{arc}]", *lines)


ARC = "{fibre = 1, angle = 60}"
PATH = "[path]\nstrain = [0.2, 0, 0]"
ANGLE = "[angle]\nvalues = [0, 30]"
BARE_ARC = "[interface]\ndebonded = [{fibre = 1}]"


# name: (content of the file, words that must stand in its faults)
SPRINGS = "normal_stiffness = 10.0\ntangential_stiffness = 5.0"

FAULTY_BONDINGS: dict[str, tuple[str, tuple[str, ...]]] = {
    # [interface]
    "interface_is_a_number": (
        "interface = 3\n" + BASE,
        ("interface = 3: expected a section [interface]",),
    ),
    "interface_in_vain": (
        ended("[interface]\ncontact = false\n"),
        ("[interface] debonded: missing; expected a list of arcs {fibre, centre, angle}, or []",),
    ),
    "contact_is_text": (
        of_type("path", PATH, "[interface]", 'contact = "yes"'),
        ('[interface] contact = "yes": expected true or false',),
    ),
    "strength_of_stiffness": (
        ended(f"[interface]\ndebonded = [{ARC}]\nnormal_strength = 10.0\n"),
        ('[interface] normal_strength = 10.0: belongs to [analysis] type = "path" or "envelope", not "stiffness"',),
    ),
    "criterion_of_angle": (
        of_type("angle", ANGLE, BARE_ARC, 'criterion = "max"'),
        ('[interface] criterion = "max": belongs to [analysis] type = "path" or "envelope", not "angle"',),
    ),
    "strength_zero": (
        of_type("path", PATH, "[interface]", "normal_strength = 0.0"),
        ("[interface] normal_strength = 0.0: expected a traction above 0, or inf",),
    ),
    "strength_negative": (
        of_type("path", PATH, "[interface]", "tangential_strength = -inf"),
        ("[interface] tangential_strength = -inf: expected a traction above 0, or inf",),
    ),
    "strength_is_nan": (
        of_type("path", PATH, "[interface]", "tangential_strength = nan"),
        ("[interface] tangential_strength = nan: expected a traction above 0, or inf",),
    ),
    "unknown_criterion": (
        of_type("path", PATH, "[interface]", 'criterion = "mohr"'),
        ('[interface] criterion = "mohr": expected one of "max", "quadratic"',),
    ),
    "energy_of_glue": (
        of_type("path", PATH, "[interface]", 'criterion = "energy"', "toughness = 1.0"),
        (
            '[interface] normal_stiffness: missing; law = "energy" needs it',
            '[interface] tangential_stiffness: missing; law = "energy" needs it',
        ),
    ),
    "energy_and_a_strength": (
        of_type(
            "path", PATH, "[interface]", SPRINGS, 'criterion = "energy"', "toughness = 1.0", "normal_strength = 1.0"
        ),
        ('[interface] normal_strength = 1.0: belongs to law = "max" or "quadratic" or "bilinear" or ',),
    ),
    "energy_without_toughness": (
        of_type("path", PATH, "[interface]", SPRINGS, 'criterion = "energy"'),
        ("[interface] toughness: missing; expected",),
    ),
    "toughness_of_a_strength": (
        of_type("path", PATH, "[interface]", SPRINGS, "toughness = 1.0"),
        ("[interface] toughness = 1.0: belongs to ",),
    ),
    "growth_of_a_strength": (
        of_type("path", PATH, "[interface]", 'growth = "springs"'),
        ('[interface] growth = "springs": belongs to ',),
    ),
    "mode_sensitivity_above_one": (
        of_type(
            "path", PATH, "[interface]", SPRINGS, 'criterion = "energy"', "toughness = 1", "mode_sensitivity = 1.5"
        ),
        ("[interface] mode_sensitivity = 1.5: expected",),
    ),
    "scatter_without_shape": (
        of_type("path", PATH, "[interface]", "scatter = {seed = 1}"),
        ("[interface] scatter.shape: missing; expected a number at least 1 and at most 1000",),
    ),
    "scatter_is_a_number": (
        of_type("path", PATH, "[interface]", "scatter = 8"),
        ("[interface] scatter = 8: expected a table such as {shape = 8.0, seed = 1}",),
    ),
    "scatter_of_stiffness": (
        ended(f"[interface]\ndebonded = [{ARC}]\nscatter = {{shape = 8.0}}\n"),
        ("[interface] scatter = {shape = 8.0}: belongs to [analysis] type = ",),
    ),
    "stiffness_zero": (
        of_type("path", PATH, "[interface]", "normal_stiffness = 0.0"),
        ("[interface] normal_stiffness = 0.0: expected",),
    ),
    "strength_mistyped": (
        of_type("path", PATH, "[interface]", "normal_strenght = 1.0"),
        ("[interface] normal_strenght = 1.0: unknown key; did you mean normal_strength?",),
    ),
    "debonded_is_a_table": (
        ended(f"[interface]\ndebonded = {ARC}\n"),
        ("[interface] debonded = ", "expected a list of arcs {fibre, centre, angle}"),
    ),
    "debonded_is_a_list_of_numbers": (
        ended("[interface]\ndebonded = [60]\n"),
        ("[interface] debonded = [60]: expected a list of arcs {fibre, centre, angle}",),
    ),
    "arc_of_no_fibre": (
        debonded("{angle = 60}"),
        ("[interface] debonded[0].fibre: missing; expected the number of a fibre, counted from 1, a list of ",),
    ),
    "arc_of_fibre_zero": (debonded("{fibre = 0, angle = 60}"), ("[interface] debonded[0].fibre = 0: expected the",)),
    "arc_of_no_fibres": (debonded("{fibre = [], angle = 60}"), ("[interface] debonded[0].fibre = []: expected the",)),
    "arc_of_every_fibre": (
        debonded('{fibre = "every", angle = 60}'),
        ('[interface] debonded[0].fibre = "every": expected the', 'a list of numbers, or "all"'),
    ),
    "arc_of_fibre_true": (
        debonded("{fibre = [1, true], angle = 60}"),
        ("[interface] debonded[0].fibre = [1, true]: expected the number of a fibre",),
    ),
    "arc_without_angle": (
        debonded(f"{ARC}, {{fibre = 2}}"),
        ("[interface] debonded[1].angle: missing; expected a number at least 0 and at most 360",),
    ),
    "arc_too_wide": (
        debonded("{fibre = 1, angle = 361}"),
        ("[interface] debonded[0].angle = 361: expected a number at least 0 and at most 360",),
    ),
    "arc_centre_in_radians": (
        debonded('{fibre = 1, angle = 60, centre = "pi"}'),
        ('[interface] debonded[0].centre = "pi": expected a number at least -360 and at most 360',),
    ),
    "arc_american": (
        debonded("{fibre = 1, angle = 60, center = 10}"),
        ("[interface] debonded[0].center = 10: unknown key; did you mean centre?",),
    ),
    "arc_with_angle_of_angle": (
        of_type("angle", ANGLE, "[interface]", f"debonded = [{ARC}]"),
        ('debonded[0].angle = 60: belongs to [analysis] type = "stiffness" or "path" or "load" or "envelope", ',),
    ),
    # [angle]
    "no_angle": (of_type("angle", BARE_ARC), ('[angle]: missing section; [analysis] type = "angle" needs it',)),
    "angle_of_stiffness": (ended(f"{ANGLE}\n"), ('[angle]: belongs to [analysis] type = "angle", not "stiffness"',)),
    "angle_of_no_arc": (
        of_type("angle", ANGLE),
        ('[interface] debonded: missing; [analysis] type = "angle" needs a list of arcs',),
    ),
    "angle_of_empty_list": (
        of_type("angle", ANGLE, "[interface]", "debonded = []"),
        ('[interface] debonded: missing; [analysis] type = "angle" needs a list of arcs',),
    ),
    "no_values": (
        of_type("angle", BARE_ARC, "[angle]"),
        ("[angle] values: missing; expected a rising list of numbers from 0 to 360",),
    ),
    "values_fall": (
        of_type("angle", BARE_ARC, "[angle]", "values = [0, 60, 60]"),
        ("[angle] values = [0, 60, 60]: expected a rising list of numbers from 0 to 360",),
    ),
    "values_too_large": (
        of_type("angle", BARE_ARC, "[angle]", "values = [0, 361]"),
        ("[angle] values = [0, 361]: expected a rising list",),
    ),
    "values_empty": (
        of_type("angle", BARE_ARC, "[angle]", "values = []"),
        ("[angle] values = []: expected a rising list",),
    ),
    "angle_strain_of_two": (
        of_type("angle", BARE_ARC, ANGLE, "strain = [0, 1]"),
        ("[angle] strain = [0, 1]: expected a list of three numbers [E11, E22, gamma12]",),
    ),
    "angle_strain_zero": (
        of_type("angle", BARE_ARC, ANGLE, "strain = [0, 0, 0]"),
        ("[angle] strain: expected a strain other than zero",),
    ),
    "angle_strain_in_space": (
        of_type("angle", BARE_ARC, ANGLE, "strain = [0, 0, 1]").replace('"strain"', '"generalized"'),
        ('[angle] strain = [0, 0, 1]: belongs to [analysis] plane = "strain" or "stress", not "generalized"',),
    ),
    # [path]
    "no_path": (of_type("path"), ('[path]: missing section; [analysis] type = "path" needs it',)),
    "path_of_angle": (
        of_type("angle", BARE_ARC, ANGLE, PATH),
        ('[path]: belongs to [analysis] type = "path", not "angle"',),
    ),
    "path_of_nothing": (of_type("path", "[path]"), ("[path] strain, to, waypoints: missing; give one",)),
    "path_of_both": (
        of_type("path", PATH, "waypoints = [[1, 0, 0]]"),
        ("[path] strain, waypoints: exclude each other; give one",),
    ),
    "path_to_zero": (
        of_type("path", "[path]\nstrain = [0, 0.0, 0]"),
        ("[path] strain = [0.0, 0.0, 0.0]: expected a strain other than zero",),
    ),
    "path_strain_nan": (
        of_type("path", "[path]\nstrain = [nan, 0, 0]"),
        ("[path] strain = [NaN, 0, 0]: expected a list of three numbers",),
    ),
    "waypoints_flat": (
        of_type("path", "[path]\nwaypoints = [1, 0, 0]"),
        ("[path] waypoints = [1, 0, 0]: expected a list of strains [E11, E22, gamma12]",),
    ),
    "waypoints_empty": (of_type("path", "[path]\nwaypoints = []"), ("[path] waypoints = []: expected a list of",)),
    "waypoints_begin_at_zero": (
        of_type("path", "[path]\nwaypoints = [[0, 0, 0], [1, 0, 0]]"),
        ("[path] waypoints[0] = [0.0, 0.0, 0.0]: expected a strain other than zero, where the path begins",),
    ),
    "waypoints_repeated": (
        of_type("path", "[path]\nwaypoints = [[1, 0, 0], [1, 0, 0]]"),
        ("[path] waypoints[1] = [1.0, 0.0, 0.0]: expected a strain other than waypoints[0]",),
    ),
    "unknown_method": (
        of_type("path", PATH, 'method = "event"'),
        ('[path] method = "event": expected one of "events", "increments"',),
    ),
    "increments_of_events": (
        of_type("path", PATH, "increments = 50"),
        ('[path] increments = 50: belongs to method = "increments", not "events"',),
    ),
    "release_of_events": (
        of_type("path", PATH, 'release = "worst"'),
        ('[path] release = "worst": belongs to method = "increments", not "events"',),
    ),
    "max_events_of_increments": (
        of_type("path", PATH, 'method = "increments"', "increments = 5", "max_events = 5"),
        ('[path] max_events = 5: belongs to method = "events", not "increments"',),
    ),
    "no_increments": (
        of_type("path", PATH, 'method = "increments"'),
        ("[path] increments: missing; expected an integer at least 1",),
    ),
    "increments_zero": (
        of_type("path", PATH, 'method = "increments"', "increments = 0"),
        ("[path] increments = 0: expected an integer at least 1",),
    ),
    "increments_too_few": (
        of_type("path", "[path]\nwaypoints = [[1, 0, 0], [0, 0, 0]]", 'method = "increments"', "increments = 1"),
        ("[path] increments = 1: expected at least one for each waypoint",),
    ),
    "unknown_release": (
        of_type("path", PATH, 'method = "increments"', "increments = 5", 'release = "one"'),
        ('[path] release = "one": expected one of "all", "worst"',),
    ),
    "max_events_zero": (
        of_type("path", PATH, "max_events = 0"),
        ("[path] max_events = 0: expected an integer at least 1",),
    ),
    "one_state": (
        of_type("path", PATH, "[output]", "states = 1"),
        ('[output] states = 1: expected "all", "peaks" or an integer at least 2',),
    ),
    "unknown_states": (
        of_type("path", PATH, "[output]", 'states = "none"'),
        ('[output] states = "none": expected "all", "peaks" or an integer at least 2',),
    ),
    "states_are_a_truth": (
        of_type("path", PATH, "[output]", "states = true"),
        ('[output] states = true: expected "all", "peaks" or an integer at least 2',),
    ),
    "states_of_a_stiffness": (
        ended("[output]\nstates = 10\n"),
        ('[output] states = 10: belongs to [analysis] type = "path", not "stiffness"',),
    ),
    "key_of_path": (
        ended("[output]\nwaypoints = []\n"),
        ("[output] waypoints = []: unknown key; it belongs to [path]",),
    ),
    "key_of_arc": (
        of_type("path", PATH, "centre = 3"),
        ("[path] centre = 3: unknown key; it belongs to an arc of [interface] debonded",),
    ),
    "many_of_interface": (
        debonded("{fibre = 0, angle = 400}, {fibres = 1, angle = 10}", "normal_strength = -1", "mu = 0.3", "cone = 8"),
        (
            "[interface] debonded[0].fibre = 0: ",
            "[interface] debonded[0].angle = 400: ",
            "[interface] debonded[1].fibres = 1: unknown key; it belongs to [cell]",
            "[interface] debonded[1].fibre: missing; ",
            "[interface] normal_strength = -1: ",
            "[interface] mu = 0.3: unknown key; did you mean friction?",
            "[interface] cone = 8: unknown key; Coulomb's cone of both shears is round, so no path is straight",
        ),
    ),
}
