"""Case files with faults of envelopes, below the words that must report them."""

from support.base_case import ended, faults
from unit.case.faulty_bonding import ARC, PATH, of_type

BONDS = "[interface]\nnormal_strength = 10.0"


def envelope(plane: str, *lines: str, state: str = "strain", bonds: str = BONDS) -> str:
    """Return an envelope in a plane of loads."""
    text = of_type("envelope", bonds, f"[envelope]\nplane = {plane}", *lines)
    return text.replace('"strain"', f'"{state}"')


FAULTY_ENVELOPES: dict[str, str] = {
    **faults(envelope('["S11", "S22"]'), {
        '[envelope] plane = ["S11"]': "expected two different names",
        '[envelope] plane = ["S11", "E22"]': "expected two different names, both of stresses",
        '[envelope] plane = ["S22", "S22"]': "expected two different names",
        '[envelope] plane = ["S22", "S21"]': "expected two different names",
        "[envelope] directions = 3": "expected an integer at least 4",
        "[envelope] temperature = -100.0": 'belongs to [analysis] plane = "generalized", not "strain"',
        "[interface] axial_strength = 3.0": 'belongs to [analysis] plane = "generalized", not "strain"',
    }),
    **faults(ended(f"[interface]\ndebonded = [{ARC}]\n"), {
        "[interface] axial_strength = 3.0": 'belongs to [analysis] type = "path" or "envelope", not "stiffness"',
    }),
    **faults(envelope('["S11", "S33"]', state="generalized"), {
        "[interface] axial_strength = 0": "expected a positive number, or inf",
    }),
    '[envelope]: missing section; [analysis] type = "envelope" needs it': of_type("envelope", BONDS),
    '[envelope]: belongs to [analysis] type = "envelope", not "path"':
        of_type("path", PATH, '[envelope]\nplane = ["S11", "S22"]'),
    '[envelope] plane[1] = "S33": belongs to [analysis] plane = "generalized", not "strain"':
        envelope('["S22", "S33"]'),
    '[envelope] plane[0] = "gamma13": belongs to [analysis] plane = "generalized", not "stress"':
        envelope('["gamma13", "E11"]', state="stress"),
    "[material.matrix] expansion: missing; [envelope] temperature needs it\n"
    "[material.fibre] expansion: missing; [envelope] temperature needs it":
        envelope('["S11", "S33"]', "temperature = -100.0", state="generalized"),
    '[interface]: missing section; [analysis] type = "envelope" needs it':
        of_type("envelope", '[envelope]\nplane = ["S11", "S22"]'),
    '[interface] normal_strength, tangential_strength: missing; [analysis] type = "envelope" needs one':
        envelope('["S11", "S22"]', bonds="[interface]\ncontact = false"),
    "[interface] normal_strength, tangential_strength, axial_strength: missing":
        envelope('["S11", "S33"]', bonds="[interface]\ncontact = false", state="generalized"),
    "[interface] contact: expected false with debonded arcs; [analysis] type = \"envelope\" superposes loads, which "
    "contact forbids: type = \"path\" finds the onset of one load":
        envelope('["S11", "S22"]', bonds=f"{BONDS}\ndebonded = [{ARC}]"),
    "[interface] normal_strength, tangential_strength, axial_strength: missing; ":
        envelope('["S11", "S33"]', bonds="[interface]\naxial_strength = inf", state="generalized"),
    '[interface] axial_stiffness = 3.0: belongs to [analysis] plane = "generalized", not "strain"':
        ended("[interface]\nnormal_stiffness = 3.0\naxial_stiffness = 3.0\n"),
}  # fmt: skip
