"""Case files with faults of imperfect bonding, below the words that must report them."""

from support.base_case import BASE, changed, ended, faults


def of_type(name: str, *sections: str) -> str:
    return changed(('"stiffness"', f'"{name}"'), end="\n".join(sections) + "\n")


def debonded(arc: str, *lines: str) -> str:
    """Return a load path with one arc."""
    return of_type("path", PATH, "[interface]", f"debonded = [{arc}]", *lines)


ARC = "{fibre = 1, angle = 60}"
ONE_OF_ALL = 'expected one of "max", "quadratic", "energy", "bilinear", "exponential", "table"'
PATH = "[path]\nstrain = [0.2, 0, 0]"
ANGLE = "[angle]\nvalues = [0, 30]"
BARE_ARC = "[interface]\ndebonded = [{fibre = 1}]"
SPRINGS = "normal_stiffness = 10.0\ntangential_stiffness = 5.0"

FAULTY_BONDINGS: dict[str, str] = {
    **faults(of_type("path", PATH), {
        '[interface] contact = "yes"': "expected true or false",
        "[interface] normal_strength = 0.0": "expected a traction above 0, or inf",
        "[interface] tangential_strength = -inf": "expected a traction above 0, or inf",
        "[interface] tangential_strength = nan": "expected a traction above 0, or inf",
        '[interface] criterion = "mohr"': 'expected one of "max", "quadratic"',
        '[interface] law = "CZM"': f"{ONE_OF_ALL}; did you mean bilinear or exponential?",
        '[interface] law = "cohesive zone"': f"{ONE_OF_ALL}; did you mean bilinear or exponential?",
        '[interface] law = "Mohr-Coulomb"': f"{ONE_OF_ALL}; did you mean max or quadratic?",
        '[interface] law = "strength"': f"{ONE_OF_ALL}; did you mean max or quadratic?",
        '[interface] law = "bilinar"': f"{ONE_OF_ALL}; did you mean bilinear?",
        '[interface] growth = "springs"': "belongs to ",
        "[interface] scatter = 8": "expected a table such as {shape = 8.0, seed = 1}",
        "[interface] normal_stiffness = 0.0": "expected",
        "[interface] normal_strenght = 1.0": "unknown key; did you mean normal_strength?",
        '[path] method = "event"': 'expected one of "events", "increments"',
        "[path] increments = 50": 'belongs to method = "increments", not "events"',
        '[path] release = "worst"': 'belongs to method = "increments", not "events"',
        "[path] max_events = 0": "expected an integer at least 1",
        "[output] states = 1": 'expected "all", "peaks" or an integer at least 2',
        '[output] states = "none"': 'expected "all", "peaks" or an integer at least 2',
        "[output] states = true": 'expected "all", "peaks" or an integer at least 2',
        "[path] centre = 3": "unknown key; it belongs to an arc of [interface] debonded",
    }),
    **faults(ended(f"[interface]\ndebonded = [{ARC}]\n"), {
        "[interface] normal_strength = 10.0": 'belongs to [analysis] type = "path" or "envelope", not "stiffness"',
        "[interface] scatter = {shape = 8.0}": "belongs to [analysis] type = ",
    }),
    **faults(of_type("angle", BARE_ARC, ANGLE), {
        '[interface] criterion = "max"': 'belongs to [analysis] type = "path" or "envelope", not "angle"',
        "[angle] values = [0, 60, 60]": "expected a rising list of numbers from 0 to 360",
        "[angle] values = [0, 361]": "expected a rising list",
        "[angle] values = []": "expected a rising list",
        "[angle] strain = [0, 1]": "expected a list of three numbers [E11, E22, gamma12]",
    }),
    **faults(of_type("path", PATH, "[interface]", SPRINGS, 'criterion = "energy"', "toughness = 1"), {
        "[interface] normal_strength = 1.0": 'belongs to law = "max" or "quadratic" or "bilinear" or ',
    }),
    **faults(of_type("path", PATH, "[interface]", SPRINGS), {
        "[interface] toughness = 1.0": "belongs to ",
    }),
    **faults(of_type("path", PATH, "[interface]", SPRINGS, 'criterion = "energy"', "toughness = 1"), {
        "[interface] mode_sensitivity = 1.5": "expected",
    }),
    **faults(BASE, {
        "[interface] debonded = {fibre = 1, angle = 60}": "expected a list of arcs {fibre, centre, angle}",
        "[interface] debonded = [60]": "expected a list of arcs {fibre, centre, angle}",
        "[output] states = 10": 'belongs to [analysis] type = "path", not "stiffness"',
        "[output] waypoints = []": "unknown key; it belongs to [path]",
    }),
    **faults(of_type("path", "[path]"), {
        "[path] waypoints = [1, 0, 0]": "expected a list of strains [E11, E22, gamma12]",
        "[path] waypoints = []": "expected a list of",
    }),
    **faults(of_type("path", PATH, 'method = "increments"', "increments = 5"), {
        "[path] max_events = 5": 'belongs to method = "events", not "increments"',
        '[path] release = "one"': 'expected one of "all", "worst"',
    }),
    **faults(of_type("path", PATH, 'method = "increments"'), {
        "[path] increments = 0": "expected an integer at least 1",
    }),
    "interface = 3: expected a section [interface]": "interface = 3\n" + BASE,
    "[interface] debonded: missing; expected a list of arcs {fibre, centre, angle}, at most 10000 of them, or []":
        ended("[interface]\ncontact = false\n"),
    '[interface] normal_stiffness: missing; law = "energy" needs it\n'
    '[interface] tangential_stiffness: missing; law = "energy" needs it':
        of_type("path", PATH, "[interface]", 'criterion = "energy"', "toughness = 1.0"),
    "[interface] toughness: missing; expected": of_type("path", PATH, "[interface]", SPRINGS, 'criterion = "energy"'),
    "[interface] scatter.shape: missing; expected a number at least 1 and at most 1000":
        of_type("path", PATH, "[interface]", "scatter = {seed = 1}"),
    "[interface] debonded[0].fibre: missing; expected the number of a fibre, a list of ":
        debonded("{angle = 60}"),
    "[interface] debonded[0].fibre = 0: expected the": debonded("{fibre = 0, angle = 60}"),
    "[interface] debonded[0].fibre = []: expected the": debonded("{fibre = [], angle = 60}"),
    '[interface] debonded[0].fibre = "every": expected the number of a fibre, a list of numbers':
        debonded('{fibre = "every", angle = 60}'),
    "[interface] debonded[0].fibre = [1, true]: expected the number of a fibre":
        debonded("{fibre = [1, true], angle = 60}"),
    "[interface] debonded[1].angle: missing; expected a number at least 0 and at most 360":
        debonded(f"{ARC}, {{fibre = 2}}"),
    "[interface] debonded[0].angle = 361: expected a number at least 0 and at most 360":
        debonded("{fibre = 1, angle = 361}"),
    '[interface] debonded[0].centre = "pi": expected a number at least -360 and at most 360':
        debonded('{fibre = 1, angle = 60, centre = "pi"}'),
    "[interface] debonded[0].center = 10: unknown key; did you mean centre?":
        debonded("{fibre = 1, angle = 60, center = 10}"),
    'debonded[0].angle = 60: belongs to [analysis] type = "stiffness" or "path" or "load" or "envelope" or "co':
        of_type("angle", ANGLE, "[interface]", f"debonded = [{ARC}]"),
    '[angle]: missing section; [analysis] type = "angle" needs it': of_type("angle", BARE_ARC),
    '[angle]: belongs to [analysis] type = "angle", not "stiffness"': ended(f"{ANGLE}\n"),
    '[interface] debonded: missing; [analysis] type = "angle" needs a list of arcs': of_type("angle", ANGLE),
    '[interface] debonded: missing; [analysis] type = "angle" needs a list of':
        of_type("angle", ANGLE, "[interface]", "debonded = []"),
    "[angle] values: missing; expected a rising list of numbers from 0 to 360": of_type("angle", BARE_ARC, "[angle]"),
    "[angle] strain: expected a strain other than zero": of_type("angle", BARE_ARC, ANGLE, "strain = [0, 0, 0]"),
    '[angle] strain = [0, 0, 1]: belongs to [analysis] plane = "strain" or "stress", not "generalized"':
        of_type("angle", BARE_ARC, ANGLE, "strain = [0, 0, 1]").replace('"strain"', '"generalized"'),
    '[path]: missing section; [analysis] type = "path" needs it': of_type("path"),
    '[path]: belongs to [analysis] type = "path", not "angle"': of_type("angle", BARE_ARC, ANGLE, PATH),
    "[path] strain, to, waypoints: missing; give": of_type("path", "[path]"),
    "[path] strain, waypoints: exclude each other; give one": of_type("path", PATH, "waypoints = [[1, 0, 0]]"),
    "[path] to.sigma1 = 9.0: unknown key; did you mean S11?\n[path] to.tau_12 = 1.0: unknown key; did you mean S12?":
        of_type("path", "[path]\nto = {sigma1 = 9.0, tau_12 = 1.0}"),
    "[path] strain = [0.0, 0.0, 0.0]: expected a strain other than zero":
        of_type("path", "[path]\nstrain = [0, 0.0, 0]"),
    "[path] strain = [NaN, 0, 0]: expected a list of three numbers": of_type("path", "[path]\nstrain = [nan, 0, 0]"),
    "[path] waypoints[0] = [0.0, 0.0, 0.0]: expected a strain other than zero, where the path begins":
        of_type("path", "[path]\nwaypoints = [[0, 0, 0], [1, 0, 0]]"),
    "[path] waypoints[1] = [1.0, 0.0, 0.0]: expected a strain other than waypoints[0":
        of_type("path", "[path]\nwaypoints = [[1, 0, 0], [1, 0, 0]]"),
    "[path] increments: missing; expected an integer at least 1": of_type("path", PATH, 'method = "increments"'),
    "[path] increments = 1: expected at least one for each waypoint":
        of_type("path", "[path]\nwaypoints = [[1, 0, 0], [0, 0, 0]]", 'method = "increments"', "increments = 1"),
    "[interface] debonded[0].fibre = 0: \n"
    "[interface] debonded[0].angle = 400: \n"
    "[interface] debonded[1].fibres = 1: unknown key; it belongs to [cell]\n"
    "[interface] debonded[1].fibre: missing; \n"
    "[interface] normal_strength = -1: \n"
    "[interface] mu = 0.3: unknown key; did you mean friction?\n"
    "[interface] cone = 8: unknown key; Coulomb's cone of both shears is round, so no path is straight":
        debonded("{fibre = 0, angle = 400}, {fibres = 1, angle = 10}", "normal_strength = -1", "mu = 0.3", "cone = 8"),
}  # fmt: skip

# Laws that soften.
SOFTENING = [
    'law = "bilinear"',
    *("normal_stiffness = 100.0", "tangential_stiffness = 100.0", "normal_strength = 1.0"),
    *("tangential_strength = 1.0", "tangential_toughness = 2.0"),
]
BRANCH = ['law = "table"', "tangential_stiffness = 10.0", "tangential_strength = 1.0", "tangential_toughness = 2.0"]

FAULTY_COHESIVE_LAWS: dict[str, str] = {
    **faults(of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1"), {
        "[interface] normal_toughness = 0.0049": "expected at least normal_strength^2 / (2 normal_stiffness) = 0.005",
        "[interface] normal_stiffness = 1e+99": "expected at most 5e+11; the damage of stiffer springs has no digits",
        "[interface] teeth = 0": "expected an integer at least 1 and at most 10000",
        '[interface] growth = "released"':
            'belongs to law = "energy", not "bilinear"; use no growth: a law that softens dissipates the energy of',
    }),
    '[interface] axial_friction = "prevented": unknown key; leave it out: debonded faces slip freely along ':
        of_type("path", PATH, "[interface]", "friction = 0.3", 'axial_friction = "prevented"'),
    '[interface] tangential_strength: missing; law = "bilinear" needs it, such as normal_strength = 1.0\n'
    '[interface] normal_toughness: missing; law = "bilinear" needs it\n'
    '[interface] tangential_toughness: missing; law = "bilinear" needs it':
        of_type("path", PATH, "[interface]", *SOFTENING[1:3], 'law = "bilinear"', "normal_strength = 1.0"),
    '[interface] normal_stiffness: missing; law = "bilinear" needs it, such as 100 E / r, E of the matrix, r of\n'
    '[interface] tangential_stiffness: missing; law = "bilinear" needs it, such as normal_stiffness':
        of_type("path", PATH, "[interface]", *SOFTENING[:1], *SOFTENING[3:], "normal_toughness = 1.0"),
    '[interface] toughness = 2.0: belongs to law = "energy", not "max"; use normal_ and tangential_toughness: ':
        of_type("path", PATH, "[interface]", "normal_strength = 1.0", "toughness = 2.0"),
    '[interface] normal_strength = 1.0: belongs to law = "max" or "quadratic" or "bilinear" or "exponential" or '
    '"table", not "energy"; use law = "bilinear" for strengths with toughnesses\n'
    '[interface] normal_stiffness: missing; law = "energy" needs it, such as s^2 / (2 toughness) of a strength s':
        of_type("path", PATH, "[interface]", 'law = "energy"', "tangential_stiffness = 1.0", "normal_strength = 1.0",
                "toughness = 2.0"),
    '[interface] normal_strength: law = "bilinear" needs a finite one':
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1").replace("th = 1.0", "th = inf", 1),
    "[interface] law, criterion: exclude each other; criterion is the older word for law":
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1", 'criterion = "energy"'),
    "[interface] tractions = [1.0, 2.0, 0.0]: expected a softening branch, which falls from its peak to 0":
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.2, 0.3]", "tractions = [1, 2, 0]"),
    '[interface] openings = [1, 2]: belongs to law = "table", not "bilinear"\n'
    '[interface] tractions = [1, 0]: belongs to law = "table", not "bilinear"':
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1\nopenings = [1, 2]\ntractions = [1, 0]"),
    "[interface] openings = [0.1, 0.1]: expected a rising list of numbers above 0":
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.1]", "tractions = [1, 0]"),
    "[interface] openings, tractions: 2 and 3 numbers; expected as many of both":
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.2]", "tractions = [1, 0.5, 0]"),
    "[interface] normal_stiffness = 11: expected 1, as from openings and tractions, or no value":
        of_type("path", PATH, "[interface]", *BRANCH, "normal_stiffness = 11\nopenings = [1, 2]\ntractions = [1, 0]"),
}  # fmt: skip
