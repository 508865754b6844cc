"""Registry of bond laws: their names in a case, their keys, and their descriptions.

Two classes with the same name implement a law, `implementation`: in `interface/laws`, which runs use, and in
`verify`, which checks results by its own formulas.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class BondLawEntry:
    """Bond law as a case names it.

    Attributes:
        name: value of [interface] law, or criterion.
        implementation: "module.Class".
        keys: keys of [interface] that belong to this law and others that list them.
        needs: keys of all laws that must be given with this one.
        limits: keys; one at least must be finite for any bond to break; none if the law always has a limit.
        description: describes, for the key `law`, the utilisation that reaches 1 when a bond breaks, or the softening.
        symbols: that label the law in pictures: symbol, key, and whether its unit is a stress.
        softens: spring compliance grows before a bond parts.
        has_process_zone: elements must resolve the length along which bonds break.
    """

    name: str
    implementation: str
    keys: tuple[str, ...]
    description: str
    symbols: tuple[tuple[str, str, bool], ...]
    needs: tuple[str, ...] = ()
    limits: tuple[str, ...] = ()
    softens: bool = False
    has_process_zone: bool = False


STIFFNESSES = ("normal_stiffness", "tangential_stiffness")
STRENGTHS = ("normal_strength", "tangential_strength", "axial_strength")
OF_SOFTENING = ("mixing_exponent", "teeth", "softening_tolerance")
COHESIVE = (*STRENGTHS[:2], "normal_toughness", "tangential_toughness")
BRANCH = ("openings", "tractions")
"""Keys of one cohesive law: the numbers of all of them, and the softening branch of a table."""
OF_STRENGTHS = ((r"R^\mathrm{n}", "normal_strength", True), (r"R^\mathrm{t}", "tangential_strength", True))

REGISTRY = (
    *(
        BondLawEntry(name, f"strength.{name.capitalize()}Strength", STRENGTHS, words, OF_STRENGTHS, limits=STRENGTHS)
        for name, words in (
            ("max", "the largest of t_n / R^n, |t_t| / R^t and along the fibre |t_a| / R^a"),
            ("quadratic", "the root of the sum of their squares"),
        )
    ),
    BondLawEntry(
        "energy",
        "energy.SpringEnergy",
        ("toughness", "growth", "mode_sensitivity"),
        "the energy of its spring / G_c, see toughness",
        ((r"G_\mathrm{Ic}", "toughness", False),),
        needs=STIFFNESSES,
        has_process_zone=True,
    ),
    *(
        BondLawEntry(
            name,
            f"softening.{name.capitalize()}Law",
            (*COHESIVE, *OF_SOFTENING, *(BRANCH if name == "table" else ())),
            description,
            ((r"N", "normal_strength", True), (r"S", "tangential_strength", True)),
            needs=needs,
            softens=True,
            has_process_zone=True,
        )
        for name, description, needs in (
            ("bilinear", "a cohesive law, softening in a straight line", (*STIFFNESSES, *COHESIVE)),
            ("exponential", "softening exponentially", (*STIFFNESSES, *COHESIVE)),
            ("table", "softening by openings and tractions", (*STIFFNESSES[1:], *COHESIVE[1::2], *BRANCH)),
        )
    ),
)
LAWS = {entry.name: entry for entry in REGISTRY}
DEFAULT = REGISTRY[0].name


def laws_with(key: str) -> tuple[str, ...]:
    """Law names to which a key of [interface] belongs."""
    return tuple(entry.name for entry in REGISTRY if key in entry.keys)
