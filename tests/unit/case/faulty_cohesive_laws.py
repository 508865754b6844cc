"""Faulty sections [interface] of laws that soften, each with its faults."""

from unit.case.faulty_bonding import PATH, of_type

SOFTENING = [
    'law = "bilinear"',
    *("normal_stiffness = 100.0", "tangential_stiffness = 100.0", "normal_strength = 1.0"),
    *("tangential_strength = 1.0", "tangential_toughness = 2.0"),
]
BRANCH = ['law = "table"', "tangential_stiffness = 10.0", "tangential_strength = 1.0", "tangential_toughness = 2.0"]

FAULTY_COHESIVE_LAWS: dict[str, tuple[str, tuple[str, ...]]] = {
    "friction_along_the_fibres": (
        of_type("path", PATH, "[interface]", "friction = 0.3", 'axial_friction = "prevented"'),
        ('[interface] axial_friction = "prevented": unknown key; leave it out: debonded faces slip freely along ',),
    ),
    "softening_without_toughness": (
        of_type("path", PATH, "[interface]", *SOFTENING[1:3], 'law = "bilinear"', "normal_strength = 1.0"),
        (
            '[interface] tangential_strength: missing; law = "bilinear" needs it',
            '[interface] normal_toughness: missing; law = "bilinear" needs it',
            '[interface] tangential_toughness: missing; law = "bilinear" needs it',
        ),
    ),
    "toughness_below_the_triangle": (
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 0.0049"),
        ("[interface] normal_toughness = 0.0049: expected at least normal_strength^2 / (2 normal_stiffness) = 0.005",),
    ),
    "infinite_strength_of_a_softening_law": (
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1").replace("th = 1.0", "th = inf", 1),
        ('[interface] normal_strength: law = "bilinear" needs a finite one',),
    ),
    "no_teeth": (
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1", "teeth = 0"),
        ("[interface] teeth = 0: expected an integer at least 1 and at most 10000",),
    ),
    "law_and_criterion": (
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1", 'criterion = "energy"'),
        ("[interface] law, criterion: exclude each other; criterion is the older word for law",),
    ),
    "growth_of_a_softening_law": (
        of_type("path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1", 'growth = "released"'),
        ('[interface] growth = "released": belongs to law = "energy", not "bilinear"; ', "energy of its teeth"),
    ),
    "table_that_hardens": (
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.2, 0.3]", "tractions = [1, 2, 0]"),
        ("[interface] tractions = [1.0, 2.0, 0.0]: expected a softening branch, which falls from its peak to 0",),
    ),
    "branch_of_another_law": (
        of_type(
            "path", PATH, "[interface]", *SOFTENING, "normal_toughness = 1", "openings = [1, 2]", "tractions = [1, 0]"
        ),
        (
            '[interface] openings = [1, 2]: belongs to law = "table", not "bilinear"',
            '[interface] tractions = [1, 0]: belongs to law = "table", not "bilinear"',
        ),
    ),
    "table_of_falling_openings": (
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.1]", "tractions = [1, 0]"),
        ("[interface] openings = [0.1, 0.1]: expected a rising list of numbers above 0",),
    ),
    "table_of_unlike_lengths": (
        of_type("path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.2]", "tractions = [1, 0.5, 0]"),
        ("[interface] openings, tractions: 2 and 3 numbers; expected as many of both",),
    ),
    "table_of_another_stiffness": (
        of_type(
            "path", PATH, "[interface]", *BRANCH, "openings = [0.1, 0.2]", "tractions = [1, 0]", "normal_stiffness = 11"
        ),
        ("[interface] normal_stiffness = 11: expected 10, that of openings and tractions, or none",),
    ),
}
