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
"""Make a key that may have a value for each [[interface]] section; all other keys have one value."""
IF_SOFTENING, IF_BY_TABLE = (kinds.BREAKING, kinds.SOFTENING), (kinds.BREAKING, kinds.BY_TABLE)
WITH_BOTH = 'law = "bilinear" for strengths with toughnesses'
strength_key = partial(
    pair_key, kinds.STRENGTH, unit="stress", absent="inf", only=(kinds.BREAKING, kinds.BY_STRENGTH), instead=WITH_BOTH
)
stiffness_key = partial(pair_key, kinds.STIFFNESS, unit="stress / length", absent="inf", only=kinds.MECHANICAL)
toughness_key = partial(pair_key, kinds.TOUGHNESS, unit="stress * length", default=None, only=IF_SOFTENING)
branch_key = partial(key, kinds.NUMBERS_ABOVE, default=None, only=IF_BY_TABLE)


@dataclass(frozen=True, kw_only=True)
class Arc:
    """An arc of a fibre's interface that is debonded from the start. Its tips stay bonded.

    With type = "angle", `angle` is None: [angle] values gives the openings.
    """

    fibre: str | tuple[int, ...] = key(
        kinds.FIBRES,
        "The fibres, as `feti-homog fibres` numbers them; in the hexagonal cell, 1 is at the corners, 2 in the middle.",
    )
    centre: float = key(
        types.real(least=-360.0, most=360.0),
        "Direction from the centre of the fibre to the middle of the arc, from x1 towards x2.",
        unit="degrees",
        default=0.0,
    )
    angle: float | None = key(
        types.real(least=0.0, most=360.0),
        "Angle from end to end of the arc, measured at the centre of the fibre. 0: perfect bonding. 360: the fibre is "
        "free, and its rigid-body motions are removed.",
        unit="degrees",
        only=kinds.ANALYSIS_TYPE.among("stiffness", "path", "load", "envelope", "conductivity"),
    )


@dataclass(frozen=True, kw_only=True)
class Scatter:
    """Scatter from fibre to fibre: Weibull factors f with mean 1 multiply strengths, and f^2 toughnesses."""

    shape: float = key(
        types.real(least=1.0, most=1000.0),
        "Weibull modulus m. Strengths have the coefficient of variation sqrt(Gamma(1 + 2/m) / Gamma(1 + 1/m)^2 - 1), "
        "about 1.2 / m: 0.23 for m = 5, 0.15 for 8, 0.06 for 20.",
    )
    seed: int = key(
        kinds.SEED,
        "Seed of the factors. One seed gives fibre N one factor in any cell and mesh, on any number of ranks.",
        default=0,
    )


ARCS = types.list_of(types.table_of(Arc, ""), "a list of arcs {fibre, centre, angle}", most=types.MOST_ROWS)


@dataclass(frozen=True, kw_only=True)
class InterfaceSection:
    """Bonding of fibres and matrix: arcs debonded from the start, and tractions at which further bonds break.

    Without this section bonding is perfect. Several sections [[interface]], one per pair of phases, must have the same
    contact, scatter, and law with its teeth, branch and growth.

    None stands for an unlimited strength, stiffness or conductance.
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
        "Coulomb's coefficient mu of debonded faces: they stick while |t_t| < mu |t_n|, and slide at |t_t| = mu |t_n|. "
        "Paths with friction are load-controlled throughout, without snap-back, and cells too large for influence "
        "columns are refused. Increments are implicit steps, whose stresses and dissipated heat tend to the values of "
        "events. Debonded faces slip freely along the fibres: Coulomb's cone of both shears is round, so that no path "
        "would be straight between changes of status.",
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
    normal_stiffness: float | None = stiffness_key(
        "Stiffness k_n = normal traction / opening: of unbroken bonds, and of broken faces in contact."
    )
    tangential_stiffness: float | None = stiffness_key("Stiffness k_t = tangential traction / slip, of unbroken bonds.")
    axial_stiffness: float | None = pair_key(
        types.POSITIVE_OR_INF,
        "Stiffness k_a = traction / slip along the fibre, of unbroken bonds; inf: no slip along the fibre.",
        unit="stress / length",
        absent="tangential_stiffness",
        only=kinds.GENERALIZED,
    )
    conductance: float | None = pair_key(
        kinds.CONDUCTANCE,
        "Conductance h = flux / temperature jump of unbroken bonds: 1 / Kapitza's resistance. Debonded faces insulate.",
        unit="conductivity / length",
        absent="inf",
        only=kinds.CONDUCTIVITY,
    )
    normal_strength: float | None = strength_key(
        "R^n: normal traction at which a bond breaks; with a law that softens, N: normal traction at which its damage "
        "begins. A force per area: it does not depend on the mesh. With a law that softens, inf in both strengths "
        "and no other constants: the bonds hold, with 1e4 times the normal constants of another [[interface]]."
    )
    tangential_strength: float | None = strength_key(
        "R^t: tangential traction at which a bond breaks; with a law that softens, S: traction in the plane and along "
        "the fibre at which its damage begins."
    )
    axial_strength: float | None = pair_key(
        types.POSITIVE_OR_INF,
        "R^a: traction along the fibre at which a bond breaks; inf: this traction breaks no bond.",
        unit="stress",
        absent="tangential_strength",
        only=(kinds.BREAKING, kinds.GENERALIZED, kinds.BY_AXIAL_STRENGTH),
    )
    law: str | None = key(
        types.choice(*LAWS),
        "The law of the bonds. A bond breaks when its utilisation reaches 1: "
        + "; ".join(f'"{law.name}": {law.description}' for law in REGISTRY if not law.softens)
        + ". Cohesive laws soften with damage, until no traction is left: "
        + "; ".join(f'"{law.name}": {law.description}' for law in REGISTRY if law.softens)
        + ". Compression neither breaks nor damages a bond. In pure modes, a cohesive law with teeth = 1 equals "
        '"energy" with growth = "springs".',
        absent="criterion",
        only=kinds.BREAKING,
    )
    criterion: str = key(
        types.choice(*LAWS),
        'The older name of law, with the same values: criterion = "energy" means law = "energy".',
        default=DEFAULT,
        only=kinds.BREAKING,
    )
    normal_toughness: float | None = toughness_key(
        "G_n: energy per area that breaks a bond in pure opening, 1 to 1e12 times N^2 / (2 normal_stiffness)."
    )
    tangential_toughness: float | None = toughness_key(
        "G_t: energy per area in pure shear. In mixed modes, damage begins at (t_n / N)^2 + (t_t / S)^2 = 1, and the "
        "energy is G_n + (G_t - G_n) B^mixing_exponent; B is the share of shear in the energy of undamaged springs."
    )
    mixing_exponent: float = pair_key(
        types.real(least=0.5, most=100.0),
        "Exponent of Benzeggagh and Kenane's toughness, see tangential_toughness; below 0.5 its slope has no bound.",
        default=2.0,
        only=IF_SOFTENING,
    )
    teeth: int | None = key(
        types.integer(least=1, most=10_000),
        "Number of damage steps, each of which is an event. Any number absorbs the energy of the law, "
        "but few lose more energy in jumps. Replaces softening_tolerance.",
        absent="as few as softening_tolerance allows",
        only=IF_SOFTENING,
    )
    softening_tolerance: float = key(
        types.real(above=0.0, most=1.0),
        "Largest relative excess of the first tooth over the peak traction.",
        default=0.02,
        only=IF_SOFTENING,
    )
    openings: tuple[float, ...] | None = branch_key(
        "Rising openings of the softening branch in pure opening: the first at the peak, on the line of "
        "normal_stiffness (by default, first traction / first opening), the last at zero traction.",
        unit="length",
    )
    tractions: tuple[float, ...] | None = branch_key(
        "Tractions at the openings, falling to 0. In other modes the branch is stretched to the toughness of the mode.",
        unit="stress",
    )
    toughness: float | None = pair_key(
        kinds.TOUGHNESS,
        "G_Ic: energy per area. A bond breaks when G_I + G_II = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t) reaches "
        "G_c = G_Ic (1 + tan^2((1 - mode_sensitivity) psi)), tan^2 psi = G_II / G_I; along the fibre "
        "G_III = t_a^2 / (2 k_a) adds to G_II.",
        unit="stress * length",
        only=kinds.BY_ENERGY,
        instead='normal_ and tangential_toughness: law = "bilinear" has both, with stiffnesses and strengths of both',
    )
    growth: str = key(
        types.choice("released", "springs"),
        'How debonds grow. "released": a bond beside a broken bond breaks when this releases G_c times its length, '
        'nearly independent of the mesh. "springs": every bond breaks by the energy of its spring.',
        default="released",
        only=kinds.BY_ENERGY,
        instead="no growth: a law that softens dissipates the energy of its teeth, at tips too",
    )
    mode_sensitivity: float = pair_key(
        types.real(least=0.0, most=1.0),
        "How the toughness depends on the mode. 1: all modes have the same toughness; 0: shear alone breaks no bond.",
        default=0.25,
        only=kinds.BY_ENERGY,
    )
    scatter: Scatter | None = key(
        types.table_of(Scatter, "a table such as {shape = 8.0, seed = 1}"),
        "Strengths that differ from fibre to fibre: each fibre has a random factor f of mean 1, which multiplies all "
        "strengths of its interfaces; f^2 multiplies their toughnesses. Stiffnesses do not change, nor does the length "
        "of the process zone. This section then describes a fibre with f = 1. Factors in the column strength of a "
        "fibre table multiply f.",
        absent="none",
        only=kinds.BREAKING,
    )
    between: tuple[str, str] | None = pair_key(
        kinds.PAIR,
        "The two phases on both sides of the interfaces, in any order; pairs that no section names never separate. "
        "Required if there are several sections [[interface]].",
        absent="the matrix and all other phases",
    )


def interface_tables(document: Mapping[str, Any]) -> list[Any]:
    """Return the [interface] sections of a document, unchecked, as a list; [] without any."""
    given = document.get("interface", [])
    return given if isinstance(given, list) else [given]


def labelled(sections: Sequence[T]) -> list[tuple[str, T]]:
    """Return pairs (label, section) for messages: the label is "interface", or "interface 1" and so on for several."""
    return [(f"interface {number}" if len(sections) > 1 else "interface", s) for number, s in enumerate(sections, 1)]
