"""Register the bond laws: their names in a case, their keys, and their descriptions.

Two classes with the same name, `implementation`, implement a law: runs use the class in `interface/laws`, and checks of
results use the class in `verify`, with its own formulas.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from feti_homog.schema import wording


@dataclass(frozen=True)
class BondLawEntry:
    """A bond law of a case.

    Attributes:
        name: value of [interface] law or criterion.
        implementation: module and class of both implementations, as "module.Class".
        keys: keys of [interface] that this law has, but not all other laws.
        needs: keys that this law requires.
        limits: strength keys; bonds can break if one is finite. Empty if the law always has a limit.
        description: for the reference: the utilisation that is 1 when a bond breaks, or the kind of softening.
        symbols: labels in pictures: symbol, key, and whether the unit is a stress.
        softens: whether the spring compliance grows with damage before a bond breaks.
    """

    name: str
    implementation: str
    keys: tuple[str, ...]
    description: str
    symbols: tuple[tuple[str, str, bool], ...]
    needs: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    softens: bool = False

    def missing(self, name: str, table: Mapping[str, Any], _: object) -> str:
        """Return the end of the fault line for a table without the required key `name`, in most cases with advice."""
        fault = f": missing; law = {wording.toml_value(self.name)} needs it"
        if (normal := name.replace("tangential", "normal")) != name:
            value = f" = {wording.toml_value(table[normal])}" if normal in table else ""
            return f"{fault}, such as {normal}{value}"
        if name == COHESIVE[0] and "between" in table:
            return f"{fault}; bonds that hold have {' = inf, '.join(COHESIVE[:2])} = inf, and no other constants"
        hint = "100 E / r, E of the matrix, r of the fibres" if self.softens else "s^2 / (2 toughness) of a strength s"
        return f"{fault}, such as {hint}" if name == STIFFNESSES[0] else fault


STIFFNESSES = ("normal_stiffness", "tangential_stiffness")
STRENGTHS = ("normal_strength", "tangential_strength", "axial_strength")
OF_SOFTENING = ("mixing_exponent", "teeth", "softening_tolerance")
COHESIVE = (*STRENGTHS[:2], "normal_toughness", "tangential_toughness")
TANGENTIAL = ("tangential_stiffness", "tangential_strength", "tangential_toughness")
BRANCH = ("openings", "tractions")
"""Keys of cohesive laws: COHESIVE and OF_SOFTENING belong to all of them, BRANCH only to the law "table"."""
OF_STRENGTHS = tuple((rf"R^\mathrm{{{name[0]}}}", name, True) for name in STRENGTHS)

REGISTRY = (
    *(
        BondLawEntry(name, f"strength.{name.capitalize()}Strength", STRENGTHS, words, OF_STRENGTHS, limits=STRENGTHS)
        for name, words in (
            ("max", "the largest of t_n / R^n, |t_t| / R^t and, along the fibre, |t_a| / R^a"),
            ("quadratic", "the root of the sum of the squares of these ratios"),
        )
    ),
    BondLawEntry(
        "energy",
        "energy.SpringEnergy",
        ("toughness", "growth", "mode_sensitivity"),
        "the energy of the bond's spring / G_c, see toughness",
        ((r"G_\mathrm{Ic}", "toughness", False),),
        needs=STIFFNESSES,
    ),
    *(
        BondLawEntry(
            name,
            f"softening.{name.capitalize()}Law",
            (*COHESIVE, *OF_SOFTENING, *branch),
            description,
            tuple(zip(("N", "S", r"G_\mathrm{n}", r"G_\mathrm{t}"), COHESIVE, (True, True, False, False), strict=True)),
            needs=needs,
            softens=True,
        )
        for name, description, needs, branch in (
            ("bilinear", "linear softening", (*STIFFNESSES, *COHESIVE), ()),
            ("exponential", "exponential softening", (*STIFFNESSES, *COHESIVE), ()),
            ("table", "softening by openings and tractions", (*TANGENTIAL, *BRANCH), BRANCH),
        )
    ),
)
LAWS = {entry.name: entry for entry in REGISTRY}
DEFAULT = REGISTRY[0].name


def laws_with(key: str) -> tuple[str, ...]:
    """Return the names of the bond laws with the [interface] key `key`."""
    return tuple(entry.name for entry in REGISTRY if key in entry.keys)
