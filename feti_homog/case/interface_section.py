"""Define the section [interface]: initially debonded arcs, and bonds that hold or break."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from feti_homog.case import section_values as kinds
from feti_homog.case.bond_laws import DEFAULT, LAWS, REGISTRY
from feti_homog.schema import key, types

T = TypeVar("T")
pair_key = partial(key, by_pair=True)
"""Return a key in which several [[interface]] sections may differ; they agree in all other keys."""


@dataclass(frozen=True, kw_only=True)
class Arc:
    """An arc of a fibre's interface that is debonded from the start. Its tips stay bonded.

    In type = "angle" the opening is None: [angle] values has the openings.
    """

    fibre: str | tuple[int, ...] = key(
        kinds.FIBRES,
        "Which fibres, in the order of the arrangement; of the hexagonal cell 1 is at the corners, 2 in the middle.",
    )
    centre: float = key(
        types.real(least=-360.0, most=360.0),
        "Direction of the middle of the arc, seen from the centre of the fibre, from x1 towards x2.",
        unit="degrees",
        default=0.0,
    )
    angle: float | None = key(
        types.real(least=0.0, most=360.0),
        "Whole opening of the arc, measured at the centre of the fibre. 0 is perfect bonding; at 360 nothing holds the "
        "fibre, and its rigid motions are left out.",
        unit="degrees",
        only=kinds.ANALYSIS_TYPE.among("stiffness", "path", "load", "envelope", "conductivity"),
    )


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Scatter of strengths from fibre to fibre: a factor of Weibull's distribution with mean 1 for each fibre."""

    shape: float = key(
        types.real(least=1.0, most=1000.0),
        "Weibull modulus m. Strengths have the coefficient of variation sqrt(Gamma(1 + 2/m) / Gamma(1 + 1/m)^2 - 1), "
        "about 1.2 / m: 0.23 of m = 5, 0.15 of 8, 0.06 of 20.",
    )
    seed: int = key(
        kinds.SEED,
        "Seed of the factors: with it fibre N has the same factor in any cell and mesh, on any number of ranks.",
        default=0,
    )


ARCS = types.list_of(types.table_of(Arc, ""), "a list of arcs {fibre, centre, angle}", most=types.MOST_ROWS)


@dataclass(frozen=True, kw_only=True)
class InterfaceSection:
    """Bonding of fibres and matrix: arcs debonded from the start, and tractions at which further bonds break.

    Without this section bonding is perfect. Several sections [[interface]], one per pair of phases, must have the same
    contact, scatter, and law with its teeth, branch and growth.

    None stands for an unlimited strength.
    """

    contact: bool = key(
        types.boolean,
        "true: debonded faces may touch, with friction if a coefficient is given, but not overlap. false: they "
        "overlap freely.",
        default=True,
        only=kinds.MECHANICAL,
    )
    friction: float = pair_key(
        types.real(least=0.0),
        "Coulomb's coefficient mu of debonded faces: they stick while |t_t| < mu |t_n|, and slide at that traction. "
        "The load is controlled from the first leg on, without snap-back. Cells too large for influence columns are "
        "refused. Increments are implicit steps, whose stresses and heat tend to those of events. Along the fibres "
        "debonded faces slip freely: Coulomb's cone of both shears is round, so no path would be straight between "
        "changes of status.",
        default=0.0,
        only=kinds.PATH_ANALYSIS,
    )
    friction_on_damage: bool = pair_key(
        types.boolean,
        "true: friction also acts on the damaged fraction of unbroken bonds, under their full pressure. false: only on "
        "broken bonds.",
        default=False,
        only=(kinds.PATH_ANALYSIS, kinds.SOFTENING),
    )
    debonded: tuple[Arc, ...] = pair_key(
        ARCS,
        'Arcs debonded from the start; required for type = "angle", and for type = "stiffness" unless the cell is a '
        'mesh (whose lines in a physical curve "debonded" are debonded, too).',
        default=(),
    )
    normal_stiffness: float | None = pair_key(
        kinds.STIFFNESS,
        "Normal traction / opening, k_n: of bonds that hold in tension and compression, of broken faces in contact.",
        unit="stress / length",
        absent="inf",
        only=kinds.MECHANICAL,
    )
    tangential_stiffness: float | None = pair_key(
        kinds.STIFFNESS,
        "Tangential traction / slip, k_t, of the bonds that hold.",
        unit="stress / length",
        absent="inf",
        only=kinds.MECHANICAL,
    )
    axial_stiffness: float | None = pair_key(
        types.POSITIVE_OR_INF,
        "Traction along the fibre / slip along it, k_a, of the bonds that hold; inf: no slip along it.",
        unit="stress / length",
        absent="tangential_stiffness",
        only=kinds.GENERALIZED,
    )
    conductance: float | None = pair_key(
        kinds.CONDUCTANCE,
        "Flux / jump of the temperature, h, of the bonds that hold: 1 / Kapitza's resistance. Debonded faces insulate.",
        unit="conductivity / length",
        absent="inf",
        only=kinds.CONDUCTIVITY,
    )
    normal_strength: float | None = pair_key(
        kinds.STRENGTH,
        "R^n: the normal traction at which a bond breaks, or N: at which its damage begins. A force per area: it does "
        "not depend on the mesh.",
        unit="stress",
        absent="inf",
        only=(kinds.BREAKING, kinds.BY_STRENGTH),
    )
    tangential_strength: float | None = pair_key(
        kinds.STRENGTH,
        "R^t: the tangential traction at which a bond breaks, or S: at which its damage begins; of cohesive laws along "
        "the fibre, too.",
        unit="stress",
        absent="inf",
        only=(kinds.BREAKING, kinds.BY_STRENGTH),
    )
    axial_strength: float | None = pair_key(
        types.POSITIVE_OR_INF,
        "R^a: the traction along the fibre at which a bond breaks; inf: it breaks none.",
        unit="stress",
        absent="tangential_strength",
        only=(kinds.BREAKING, kinds.GENERALIZED, kinds.BY_AXIAL_STRENGTH),
    )
    law: str | None = key(
        types.choice(*LAWS),
        "The law of the bonds. A bond breaks when this reaches 1: "
        + "; ".join(f'"{law.name}": {law.description}' for law in REGISTRY if not law.softens)
        + ". Or it softens under damage, until nothing is left: "
        + "; ".join(f'"{law.name}": {law.description}' for law in REGISTRY if law.softens)
        + '. Compression neither breaks nor damages a bond. With teeth = 1 a cohesive law is "energy" with growth = '
        '"springs" in pure modes.',
        absent="criterion",
        only=kinds.BREAKING,
    )
    criterion: str = key(
        types.choice(*LAWS),
        'The older word for law, with the same values: criterion = "energy" is law = "energy".',
        default=DEFAULT,
        only=kinds.BREAKING,
    )
    normal_toughness: float | None = pair_key(
        kinds.TOUGHNESS,
        "G_n, the energy per area that a bond takes in pure opening: 1 to 1e12 times N^2 / (2 normal_stiffness).",
        unit="stress * length",
        default=None,
        only=(kinds.BREAKING, kinds.SOFTENING),
    )
    tangential_toughness: float | None = pair_key(
        kinds.TOUGHNESS,
        "G_t, the energy per area in pure shear. At the share B of shear in the energy of undamaged springs damage "
        "begins at (t_n / N)^2 + (t_t / S)^2 = 1 and takes G_n + (G_t - G_n) B^mixing_exponent.",
        unit="stress * length",
        default=None,
        only=(kinds.BREAKING, kinds.SOFTENING),
    )
    mixing_exponent: float = pair_key(
        types.real(least=0.5, most=100.0),
        "Exponent of Benzeggagh and Kenane's toughness, whose slope over the mode angle has no bound below 0.5.",
        default=2.0,
        only=(kinds.BREAKING, kinds.SOFTENING),
    )
    teeth: int | None = key(
        types.integer(least=1, most=10_000),
        "Steps of damage; each is an event. Any number takes the energy of the law.",
        absent="as few as softening_tolerance allows",
        only=(kinds.BREAKING, kinds.SOFTENING),
    )
    softening_tolerance: float = key(
        types.real(above=0.0, most=1.0),
        "By how much of the peak traction the first tooth may exceed it.",
        default=0.02,
        only=(kinds.BREAKING, kinds.SOFTENING),
    )
    openings: tuple[float, ...] | None = key(
        kinds.NUMBERS_ABOVE,
        "The softening branch in pure opening: rising openings, the first at the peak, which the line of the "
        "normal_stiffness reaches (by default its traction / its opening), the last with no traction.",
        unit="length",
        default=None,
        only=(kinds.BREAKING, kinds.BY_TABLE),
    )
    tractions: tuple[float, ...] | None = key(
        kinds.NUMBERS_ABOVE,
        "Tractions at the openings, falling to 0. In other modes the branch is stretched to their toughness.",
        unit="stress",
        default=None,
        only=(kinds.BREAKING, kinds.BY_TABLE),
    )
    toughness: float | None = pair_key(
        kinds.TOUGHNESS,
        "G_Ic, energy per area. A bond breaks when G_I + G_II = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t) reaches "
        "G_c = G_Ic (1 + tan^2((1 - mode_sensitivity) psi)), tan^2 psi = G_II / G_I; along the fibre "
        "G_III = t_a^2 / (2 k_a) adds to G_II.",
        unit="stress * length",
        only=kinds.BY_ENERGY,
    )
    growth: str = key(
        types.choice("released", "springs"),
        'Where debonding has begun: "released": a bond beside a broken one breaks when that releases G_c times its '
        'length, which hardly depends on the mesh; "springs": by the energy of its spring, as any other.',
        default="released",
        only=kinds.BY_ENERGY,
        instead="no growth: a law that softens takes the energy of its teeth, at tips too",
    )
    mode_sensitivity: float = pair_key(
        types.real(least=0.0, most=1.0),
        "How much of the toughness in opening holds in shear: 1 all modes have the same, 0 shear alone breaks nothing.",
        default=0.25,
        only=kinds.BY_ENERGY,
    )
    scatter: Scatter | None = key(
        types.table_of(Scatter, "a table such as {shape = 8.0, seed = 1}"),
        "Strengths that differ from fibre to fibre: each fibre has a random factor f of mean 1, by which all strengths "
        "of its interfaces are multiplied, and toughnesses by f^2; stiffnesses stay, and so does the length of the "
        "process zone. Strengths and toughness of this section are then those of a mean fibre, f = 1. The column "
        "strength of a table of fibres gives factors too; both are multiplied.",
        absent="none",
        only=kinds.BREAKING,
    )
    between: tuple[str, str] | None = pair_key(
        kinds.PAIR,
        "The two phases whose interfaces these are, in any order; pairs that no section names never part. Needed where "
        "there are several sections [[interface]].",
        absent="the matrix and all others",
    )


def interface_tables(document: Mapping[str, Any]) -> list[Any]:
    """Return all [interface] sections of a document as a list."""
    given = document.get("interface", [])
    return given if isinstance(given, list) else [given]


def labelled(sections: Sequence[T]) -> list[tuple[str, T]]:
    """Return the interface sections with their labels in messages, which begin at 1."""
    return [(f"interface {number}" if len(sections) > 1 else "interface", s) for number, s in enumerate(sections, 1)]
