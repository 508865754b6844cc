"""Word messages about a case: values and keys as in TOML, and hints for unknown names."""

import difflib
import json
import re
from collections.abc import Collection, Iterable, Mapping

LONGEST_VALUE = 60  # characters of a value in a message
# Names of quantities in other programs and textbooks, in lower case, and keys of this program for them.
SYNONYMS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("e", "youngs_modulus", "young_modulus", "modulus"), ("young", "E1", "shape")),
    **dict.fromkeys(("nu", "v", "poisson_ratio", "poissons_ratio"), ("poisson", "nu12")),
    **dict.fromkeys(("g", "shear_modulus"), ("G12", "G_axial")),
    **dict.fromkeys(("alpha", "cte", "thermal_expansion"), ("expansion", "expansion_axial", "expansion_transverse")),
    **dict.fromkeys(("strength", "bond_strength"), ("normal_strength", "tangential_strength", "max", "quadratic")),
    **dict.fromkeys(("tensile_strength", "xt", "compressive_strength", "xc"), ("normal_strength", "strength")),
    "shear_strength": ("tangential_strength", "strength"),
    **dict.fromkeys(("mu", "coefficient_of_friction", "friction_coefficient"), ("friction",)),
    **dict.fromkeys(("k", "kn", "k_n", "stiffness"), ("normal_stiffness", "tangential_stiffness", "conductivity")),
    **dict.fromkeys(("gc", "g_c", "gic", "fracture_energy", "griffith", "lefm"), ("toughness", "energy")),
    **dict.fromkeys(("cohesive", "czm", "cohesive_zone", "softening"), ("bilinear", "exponential")),
    **dict.fromkeys(("brittle", "mohr", "mohr_coulomb", "coulomb"), ("max", "quadratic")),
    **dict.fromkeys(("dt", "delta_t", "deltat", "temp"), ("temperature",)),
    **{f"{s}{end}": (f"S{i}{i}",) for i in "123" for s in ("s", "sig", "sigma", "sigma_") for end in (i, i + i)},
    **{f"{e}{end}": (f"E{i}{i}",) for i in "123" for e in ("eps", "epsilon", "epsilon_") for end in (i, i + i)},
    **{f"{tau}{ij}": (f"S{ij}",) for ij in ("12", "13", "23") for tau in ("tau", "tau_", "sigma", "sigma_")},
    "radius": ("fibre_radius",),
    **dict.fromkeys(("vf", "fraction", "volume_fraction", "fibre_volume_fraction"), ("fibre_fraction",)),
}
# Quantities and former keys without a key in this program, each with a hint.
ABSENT = {
    **dict.fromkeys(("g", "mu"), "it follows from young and poisson"),
    **dict.fromkeys(("strength", "peak"), 'strengths are in [material.PHASE] and [interface], peaks in type = "path"'),
    **dict.fromkeys(("diameter", "fibre_diameter", "fiber_diameter"), "give the radius (in [cell] fibre_radius)"),
    **{f"e{ij}": f"expected a shear strain as gamma{ij} = 2 E{ij}" for ij in (12, 13, 23)},
    "cone": "Coulomb's cone of both shears is round, so no path is straight between changes",
    "axial_friction": "leave it out: debonded faces slip freely along the fibres",
    "accuracy_check": "leave it out: a remark names the mesh that would do",
    "element": "leave it out: quadratic elements of isotropic phases have a pressure of their own",
    "element_size": "give mesh_size and refine: elements have the size mesh_size / 2^refine",
}


def toml_value(value: object) -> str:
    """Write a value nearly as in TOML, in one line of at most LONGEST_VALUE characters."""
    line = _line(value)
    return line if len(line) <= LONGEST_VALUE else line[: LONGEST_VALUE - 3] + "..."


def _line(value: object) -> str:
    """Write a value nearly as in TOML, in one line."""
    if isinstance(value, dict):
        return f"{{{', '.join(f'{toml_key(str(name))} = {_line(entry)}' for name, entry in value.items())}}}"
    if isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        return f"[{', '.join(map(_line, value))}]"
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, default=str, ensure_ascii=not str(value).isprintable())


def toml_key(name: str) -> str:
    """Return a key as in TOML, in quotes unless bare, cut off after LONGEST_VALUE characters."""
    return name if re.fullmatch(rf"[A-Za-z0-9_-]{{1,{LONGEST_VALUE}}}", name) else toml_value(name)


def dotted_key(path: Iterable[str]) -> str:
    """Join the keys of nested tables as in TOML: a.b.c."""
    return ".".join(map(toml_key, path))


def suggestion(name: str, known: Collection[str], owners: Mapping[str, str]) -> str:
    """Return a hint for an unknown name: a synonym, a reason for its absence, its section, the closest or all names.

    `known` are the valid names, and `owners` maps every key of the file to its sections, in words.
    """
    word = re.sub("[ -]", "_", name.lower())
    synonyms = SYNONYMS.get(word, ())
    if keys := [key for key in synonyms if key in known]:
        return f"did you mean {' or '.join(keys)}?"
    if word in ABSENT:
        return ABSENT[word]
    for key in (name, *synonyms):
        if key in owners:
            return f"{'it' if key == name else key} belongs to {owners[key]}"
    if nearest := difflib.get_close_matches(name, known, n=1):
        return f"did you mean {toml_key(nearest[0])}?"
    return "expected one of " + ", ".join(map(toml_key, known))


def limit_in_words(limit: float, value: float, digits: int) -> str:
    """Write a limit with the fewest digits, at least `digits`, that keep it at or below the refused `value`."""
    texts = (f"{limit:.{count}g}" for count in range(digits, 18))
    return next((text for text in texts if value >= float(text)), repr(limit))
