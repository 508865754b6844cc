"""Case files with faults of envelopes, and the lines that must report them."""

from support.base_case import ended
from unit.case.faulty_bonding import ARC, PATH, of_type

BONDS = "[interface]\nnormal_strength = 10.0"


def envelope(plane: str, *lines: str, state: str = "strain", bonds: str = BONDS) -> str:
    """Return an envelope in a plane of loads."""
    text = of_type("envelope", bonds, f"[envelope]\nplane = {plane}", *lines)
    return text.replace('"strain"', f'"{state}"')


# name: (content of the file, words that must stand in its faults)
FAULTY_ENVELOPES: dict[str, tuple[str, tuple[str, ...]]] = {
    "no_envelope": (
        of_type("envelope", BONDS),
        ('[envelope]: missing section; [analysis] type = "envelope" needs it',),
    ),
    "envelope_of_path": (
        of_type("path", PATH, '[envelope]\nplane = ["S11", "S22"]'),
        ('[envelope]: belongs to [analysis] type = "envelope", not "path"',),
    ),
    "envelope_of_one_name": (envelope('["S11"]'), ('[envelope] plane = ["S11"]: expected two different names',)),
    "envelope_of_mixed_names": (
        envelope('["S11", "E22"]'),
        ('[envelope] plane = ["S11", "E22"]: expected two different names, both of stresses',),
    ),
    "envelope_of_a_name_twice": (
        envelope('["S22", "S22"]'),
        ('[envelope] plane = ["S22", "S22"]: expected two different names',),
    ),
    "envelope_of_an_unknown_name": (
        envelope('["S22", "S21"]'),
        ('[envelope] plane = ["S22", "S21"]: expected two different names',),
    ),
    "envelope_along_the_fibres": (
        envelope('["S22", "S33"]'),
        ('[envelope] plane[1] = "S33": belongs to [analysis] plane = "generalized", not "strain"',),
    ),
    "envelope_along_the_fibres_of_a_sheet": (
        envelope('["gamma13", "E11"]', state="stress"),
        ('[envelope] plane[0] = "gamma13": belongs to [analysis] plane = "generalized", not "stress"',),
    ),
    "envelope_of_few_directions": (
        envelope('["S11", "S22"]', "directions = 3"),
        ("[envelope] directions = 3: expected an integer at least 4",),
    ),
    "envelope_temperature_in_the_plane": (
        envelope('["S11", "S22"]', "temperature = -100.0"),
        ('[envelope] temperature = -100.0: belongs to [analysis] plane = "generalized", not "strain"',),
    ),
    "envelope_temperature_without_expansion": (
        envelope('["S11", "S33"]', "temperature = -100.0", state="generalized"),
        (
            "[material.matrix] expansion: missing; [envelope] temperature needs it",
            "[material.fibre] expansion: missing; [envelope] temperature needs it",
        ),
    ),
    "envelope_without_bonds": (
        of_type("envelope", '[envelope]\nplane = ["S11", "S22"]'),
        ('[interface]: missing section; [analysis] type = "envelope" needs it',),
    ),
    "envelope_without_strength": (
        envelope('["S11", "S22"]', bonds="[interface]\ncontact = false"),
        ('[interface] normal_strength, tangential_strength: missing; [analysis] type = "envelope" needs one',),
    ),
    "envelope_in_space_without_strength": (
        envelope('["S11", "S33"]', bonds="[interface]\ncontact = false", state="generalized"),
        ("[interface] normal_strength, tangential_strength, axial_strength: missing; ",),
    ),
    "envelope_with_contact": (
        envelope('["S11", "S22"]', bonds=f"{BONDS}\ndebonded = [{ARC}]"),
        ("[interface] contact: expected false with debonded arcs; ",),
    ),
    "axial_strength_in_the_plane": (
        envelope('["S11", "S22"]', bonds=f"{BONDS}\naxial_strength = 3.0"),
        ('[interface] axial_strength = 3.0: belongs to [analysis] plane = "generalized", not "strain"',),
    ),
    "axial_strength_of_stiffness": (
        ended(f"[interface]\ndebonded = [{ARC}]\naxial_strength = 3.0\n"),
        ('[interface] axial_strength = 3.0: belongs to [analysis] type = "path" or "envelope", not "stiffness"',),
    ),
    "axial_strength_zero": (
        envelope('["S11", "S33"]', bonds=f"{BONDS}\naxial_strength = 0", state="generalized"),
        ("[interface] axial_strength = 0: expected a positive number, or inf",),
    ),
    "axial_strength_infinite_and_no_other": (
        envelope('["S11", "S33"]', bonds="[interface]\naxial_strength = inf", state="generalized"),
        ("[interface] normal_strength, tangential_strength, axial_strength: missing; ",),
    ),
    "axial_stiffness_in_the_plane": (
        ended("[interface]\nnormal_stiffness = 3.0\naxial_stiffness = 3.0\n"),
        ('[interface] axial_stiffness = 3.0: belongs to [analysis] plane = "generalized", not "strain"',),
    ),
}
