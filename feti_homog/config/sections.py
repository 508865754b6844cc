"""The sections of a case file: which keys they have, what each accepts, and what it means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from feti_homog.config.cell_section import Cell
from feti_homog.config.envelope_section import Envelope
from feti_homog.config.schema import Selector, key
from feti_homog.config.section_values import (
    ARCS,
    FIBRES,
    OPENINGS,
    STATES,
    STIFFNESS,
    STRAIN,
    STRENGTH,
    TOUGHNESS,
    WAYPOINTS,
)
from feti_homog.config.values import POSITIVE_OR_INF, boolean, choice, integer, real, text

Strain = tuple[float, ...]

ANALYSIS_TYPE = Selector("analysis", "type")
PLANE = Selector("analysis", "plane")
METHOD = Selector("path", "method")
CRITERION = Selector("interface", "criterion")

ANGLE_ANALYSIS, PATH_ANALYSIS = ANALYSIS_TYPE.among("angle"), ANALYSIS_TYPE.among("path")
ENVELOPE_ANALYSIS, BREAKING = ANALYSIS_TYPE.among("envelope"), ANALYSIS_TYPE.among("path", "envelope")
BY_ENERGY = CRITERION.among("energy")

OUT_OF_PLANE_STRESSES = ("S33", "S23", "S13")
DRAWN_STRESS = Selector("output", "stress")

STIFFNESSES = ("normal_stiffness", "tangential_stiffness")
STRENGTHS = ("normal_strength", "tangential_strength", "axial_strength")
IN_THE_PLANE, GENERALIZED = PLANE.among("strain", "stress"), PLANE.among("generalized")
BY_EVENTS, BY_INCREMENTS = METHOD.among("events"), METHOD.among("increments")


@dataclass(frozen=True, kw_only=True)
class Analysis:
    """What is computed, and in which plane state."""

    type: str = key(
        choice("stiffness", "angle", "path", "envelope"),
        '"stiffness": the effective stiffness; "angle": the response against the debonding angle, see [angle]; '
        '"path": debonding by the load, see [path]; "envelope": the loads at which debonding begins, see [envelope].',
    )
    plane: str = key(
        choice("strain", "stress", "generalized"),
        'Plane state: "strain" is that of long fibres along x3, "stress" that of a thin sheet; "generalized" is '
        "generalized plane strain: long fibres under all six strains, also along x3.",
    )


@dataclass(frozen=True, kw_only=True)
class Arc:
    """An arc of a fibre's interface that is debonded from the start, any number of them. Its tips stay bonded.

    In type = "angle" the opening is None: [angle] values takes its place.
    """

    fibre: str | tuple[int, ...] = key(
        FIBRES,
        "Which fibres, in the order of the arrangement; of the hexagonal cell 1 is at the corners, 2 in the middle.",
    )
    centre: float = key(
        real(least=-360.0, most=360.0),
        "Direction of the middle of the arc, seen from the centre of the fibre, from x1 towards x2.",
        unit="degrees",
        default=0.0,
    )
    angle: float | None = key(
        real(least=0.0, most=360.0),
        "Whole opening of the arc, measured at the centre of the fibre. 0 is perfect bonding; at 360 nothing holds the "
        "fibre, and its rigid motions are left out.",
        unit="degrees",
        only=ANALYSIS_TYPE.among("stiffness", "path", "envelope"),
    )


@dataclass(frozen=True, kw_only=True)
class InterfaceSection:
    """Bonding of fibres and matrix: what is debonded from the start, and the tractions that debond more. Without this
    section bonding is perfect.

    A strength of None is unlimited.
    """

    contact: bool = key(
        boolean,
        "true: debonded faces do not overlap, they touch without friction. false: they overlap freely.",
        default=True,
    )
    debonded: tuple[Arc, ...] = key(
        ARCS,
        'What is debonded from the start; needed in type = "angle", and in type = "stiffness" unless the cell is a '
        'mesh (there lines in a physical curve "debonded" are debonded too).',
        default=(),
    )
    normal_stiffness: float | None = key(
        STIFFNESS,
        "Normal traction / opening, k_n, of the bonds that hold, in tension and compression.",
        unit="stress / length",
        default=None,
        default_words="inf",
    )
    tangential_stiffness: float | None = key(
        STIFFNESS,
        "Tangential traction / slip, k_t, of the bonds that hold.",
        unit="stress / length",
        default=None,
        default_words="inf",
    )
    axial_stiffness: float | None = key(
        POSITIVE_OR_INF,
        "Traction along the fibre / slip along it, k_a, of the bonds that hold; inf: no slip along it.",
        unit="stress / length",
        default=None,
        default_words="tangential_stiffness",
        only=GENERALIZED,
    )
    normal_strength: float | None = key(
        STRENGTH,
        "R^n: the normal traction at which a bond breaks. A force per area: it does not depend on the mesh.",
        unit="stress",
        default=None,
        default_words="inf",
        only=BREAKING,
    )
    tangential_strength: float | None = key(
        STRENGTH,
        "R^t: the tangential traction at which a bond breaks.",
        unit="stress",
        default=None,
        default_words="inf",
        only=BREAKING,
    )
    axial_strength: float | None = key(
        POSITIVE_OR_INF,
        'R^a: the traction along the fibre at which a bond breaks; inf: it breaks none; in plane = "generalized".',
        unit="stress",
        default=None,
        default_words="tangential_strength",
        only=ENVELOPE_ANALYSIS,
    )
    criterion: str = key(
        choice("max", "quadratic", "energy"),
        'A bond breaks when this reaches 1: "max": the largest of t_n / R^n, |t_t| / R^t and along the fibre '
        '|t_a| / R^a; "quadratic": the root of the sum of their squares; "energy": the energy of its spring / G_c, '
        "see toughness. Compression never breaks a bond.",
        default="max",
        only=BREAKING,
    )
    toughness: float | None = key(
        TOUGHNESS,
        "G_Ic, energy per area. A bond breaks when G_I + G_II = <t_n>^2 / (2 k_n) + t_t^2 / (2 k_t) reaches "
        "G_c = G_Ic (1 + tan^2((1 - mode_sensitivity) psi)), tan^2 psi = G_II / G_I; along the fibre "
        "G_III = t_a^2 / (2 k_a) adds to G_II.",
        unit="stress * length",
        only=BY_ENERGY,
    )
    growth: str = key(
        choice("released", "springs"),
        'Where debonding has begun: "released": a bond beside a broken one breaks when that releases G_c times its '
        'length, which hardly depends on the mesh; "springs": by the energy of its spring, as any other.',
        default="released",
        only=BY_ENERGY,
    )
    mode_sensitivity: float = key(
        real(least=0.0, most=1.0),
        "How much of the toughness in opening holds in shear: 1 all modes have the same, 0 shear alone breaks nothing.",
        default=0.25,
        only=BY_ENERGY,
    )


@dataclass(frozen=True, kw_only=True)
class Angle:
    """Openings of the arcs, one after the other."""

    values: tuple[float, ...] = key(OPENINGS, "Openings of all arcs of [interface] debonded.", unit="degrees")
    strain: Strain | None = key(
        STRAIN,
        "Macroscopic strain, other than zero; by default the three unit strains, which give the effective stiffness.",
        default=None,
        default_words="unit strains",
        only=IN_THE_PLANE,
    )


@dataclass(frozen=True, kw_only=True)
class LoadPath:
    """Macroscopic strains that are gone through, straight from zero to each waypoint. Give strain or waypoints."""

    strain: Strain | None = key(STRAIN, "The strain at the end, other than zero: a single waypoint.", default=None)
    waypoints: tuple[Strain, ...] | None = key(
        WAYPOINTS, "Strains that are gone through one after the other; each differs from the one before.", default=None
    )
    method: str = key(
        choice("events", "increments"),
        '"events": every break at its exact load; "increments": equal load steps.',
        default="events",
    )
    increments: int | None = key(
        integer(least=1, most=1_000_000),
        "Number of load steps of the whole path, at least one for each waypoint.",
        only=BY_INCREMENTS,
    )
    release: str = key(
        choice("all", "worst"),
        'In a step "all" bonds over their strength break at once, or the "worst" first, until none is over.',
        default="all",
        only=BY_INCREMENTS,
    )
    max_events: int = key(
        integer(least=1, most=10**9),
        "Stop after so many events, with exit code 3; --resume with a higher number goes on.",
        default=100_000,
        only=BY_EVENTS,
    )

    @property
    def targets(self) -> tuple[Strain, ...]:
        """The waypoints after the unstrained start."""
        if self.waypoints is not None:
            return self.waypoints
        return () if self.strain is None else (self.strain,)


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Into how many subdomains the bodies are cut. Give one of the two keys, or neither."""

    subdomains: int | None = key(
        integer(least=1, most=1_000_000),
        "Number of subdomains, at least that of the bodies; large bodies are cut to the fastest size.",
        default=None,
        default_words="automatic",
    )
    max_dofs: int | None = key(
        integer(least=100, most=10**9),
        "Bodies are cut such that no subdomain has many more unknowns than this.",
        default=None,
        default_words="automatic",
    )


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is written and drawn."""

    fields: bool = key(boolean, "Write result.h5 and result.xdmf.", default=True)
    states: int | str = key(
        STATES,
        "The points of a path whose fields are written: at most so many, the first, the last, those around the deepest "
        'drops of the stress, up to half, the others evenly between; "peaks": the ends and those around all drops of '
        'more than 1 % of the largest stress; "all". The curve has every point.',
        default=100,
        only=PATH_ANALYSIS,
    )
    pictures: bool = key(boolean, "Draw the PNG files; without fields, the curves alone.", default=True)
    report: bool = key(boolean, "Write report.html: numbers, pictures, curves and states on one page.", default=False)
    stress: str = key(
        choice("auto", "S11", "S22", "S12", *OUT_OF_PLANE_STRESSES),
        'The component drawn; "auto": that of the unit strain. "S33", "S23" and "S13" are drawn in generalized plane '
        "strain.",
        default="auto",
    )
    deformation_scale: float | None = key(
        real(least=0.0),
        "Factor of the displacements drawn; by default such that displacements and openings are seen, and at least 1 "
        "under a given strain.",
        default=None,
        default_words="automatic",
    )
    length_unit: str = key(text, "A label, such as mm; nothing is converted.", default="")
    stress_unit: str = key(text, "A label, such as GPa; nothing is converted.", default="")


SECTIONS: dict[str, type[Any]] = {
    "cell": Cell,
    "analysis": Analysis,
    "interface": InterfaceSection,
    "angle": Angle,
    "path": LoadPath,
    "envelope": Envelope,
    "decomposition": Decomposition,
    "output": Output,
}

GENERALIZED_ANALYSES = ("stiffness", "angle", "envelope")
"""The types of analysis in generalized plane strain."""

SECTIONS_OF_AN_ANALYSIS = {"angle": ANGLE_ANALYSIS, "path": PATH_ANALYSIS, "envelope": ENVELOPE_ANALYSIS}
"""Sections that must be given for one type of analysis, and belong to no other."""
