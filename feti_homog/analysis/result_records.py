"""Define the records of points, tips and mesh errors in result.json, which are fields of `result.Result`.

Strains are [E11, E22, gamma12], in generalized plane strain [E11, E22, E33, gamma23, gamma13, gamma12].  Stresses are
[S11, S22, S12] or [S11, S22, S33, S23, S13, S12].  Stresses and energies per cell area have the unit of the moduli.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from feti_homog.materials import voigt
from feti_homog.system.runtime import described, records
from feti_homog.typing import Float

EITHER, EITHER_STIFFNESS = "(3,) or (6,)", "(3, 3) or (6, 6)"
ENERGY = "stress times length"
CONDUCTIVITY = "conductivity"
PER_DEGREE = f"{records.STRESS} per unit of temperature"
TEMPERATURE = "change of temperature, in generalized plane strain with expansions"
DEBONDED_LENGTH, KEPT = "debonded length of each fibre's interface", "only at points whose fields `states` keeps"
DEBONDED_ANGLE = (
    "the same in degrees of arc, `debonded_length` / radius; for a fibre that is not round, or whose coating has an "
    "interface too, 360 times the debonded share of its interfaces"
)

OWN_SECTION = "number, from 1, of its [[interface]] section; absent if there is only one section"
OF_STRAINS: dict[str, Any] = {"components": voigt.STRAINS, "spatial_components": voigt.SPATIAL_STRAINS}
OF_STRESSES: dict[str, Any] = {"components": voigt.STRESSES, "spatial_components": voigt.SPATIAL_STRESSES}
DEBONDED_SHARES = "the same share for each [[interface]] section, in order; absent if there is only one section"


@dataclass(frozen=True, kw_only=True, eq=False)  # arrays have no single answer to "equal"
class MeshErrors:
    """The mesh errors of a stiffness or conductivity, estimated by the difference of recovered and element stresses."""

    effective_stiffness: Float | None = described("error of each entry", records.STRESS, EITHER_STIFFNESS, default=None)
    effective_stiffness_compression: Float | None = described(
        "the same under minus the unit strains, with contact", records.STRESS, EITHER_STIFFNESS, default=None
    )
    effective_conductivity: Float | None = described("error of each entry", CONDUCTIVITY, "(3, 3)", default=None)
    thermal_stress: Float | None = described("error of each entry", PER_DEGREE, "(6,)", default=None)
    thermal_stress_compression: Float | None = described(
        "the same under minus a unit of temperature, with contact", PER_DEGREE, "(6,)", default=None
    )
    thermal_expansion: Float | None = described("error of each entry", "1 / temperature", "(6,)", default=None)
    constants: Mapping[str, float] = described(
        "errors of moduli and constants, each in its unit", entries={"NAME": "error of one constant, such as `E1`"}
    )
    energy: float = described("relative error of the strain energy, the largest under any strain")


@dataclass(frozen=True, eq=False)  # arrays have no single answer to "equal"
class Tips:
    """The t tips at a path point, sorted by fibre, interface and direction.

    A tip is an intact bond next to a broken bond.  Its driving energy per area, which compares with the toughness
    G_c(psi), is the energy of its spring or, where `growth` is "released", the energy that its break would release.
    """

    fibre: tuple[int, ...] = described("number of the fibre of each tip")
    angle: Float = described(
        "direction from the fibre's centre; of the normal, if the fibre has no centre", records.DEGREES, "(t,)"
    )
    G_I: Float = described("energy release rate in opening, with G_II / G_I = tan^2 psi", ENERGY, "(t,)")
    G_II: Float = described("energy release rate in shear", ENERGY, "(t,)")
    psi: Float = described("mode of its traction: 0 opens, 90 shears", records.DEGREES, "(t,)")
    interface: tuple[int, ...] | None = described(OWN_SECTION, default=None)


@dataclass(frozen=True, kw_only=True, eq=False)
class TipRates:
    """The energy release rates at tips of debonded arcs, at constant macroscopic strain and temperature.

    Only round fibres have rates.  The t rows, each for a load and a tip, are sorted by load, fibre, interface and
    direction.
    """

    load: tuple[str, ...] = described(
        "load: a unit strain `E11`, ..., minus a unit strain `-E11`, ..., the given `strain`, or `load` with stresses"
    )
    fibre: tuple[int, ...] = described("number of the fibre")
    angle: Float = described("direction of the tip from the fibre's centre", records.DEGREES, "(t,)")
    G: Float = described("energy released per area of growing debonding", ENERGY, "(t,)")
    G_I: Float = described("its part in opening", ENERGY, "(t,)")
    G_II: Float = described("its part in shear", ENERGY, "(t,)")
    G_III: Float | None = described("along the fibre, in generalized plane strain", ENERGY, "(t,)", default=None)
    psi: Float = described("its mode, tan^2 psi = (G_II + G_III) / G_I: 0 opens, 90 shears", records.DEGREES, "(t,)")
    length: Float = described("length behind the tip at which rigid bonds separate the modes", records.LENGTH, "(t,)")
    interface: tuple[int, ...] | None = described(OWN_SECTION, default=None)


@dataclass(frozen=True, kw_only=True)
class AnglePoint:
    """The response at one debonding angle."""

    angle: float = described("opening of the arcs without an angle of their own", records.DEGREES)
    stiffness: Float | None = described(
        "L^ef, if no strain is given",
        records.STRESS,
        EITHER_STIFFNESS,
        voigt.STIFFNESSES,
        spatial_components=voigt.SPATIAL_STIFFNESSES,
        default=None,
    )
    thermal_stress: Float | None = described(
        "stress under a unit of temperature at no strain, in generalized plane strain",
        PER_DEGREE,
        "(6,)",
        tuple(f"thermal_{name}" for name in voigt.SPATIAL_STRESSES),
        default=None,
    )
    strain: Float | None = described("macroscopic strain that is given", "", "(3,)", voigt.STRAINS, default=None)
    stress: Float | None = described("stress under this strain", records.STRESS, "(3,)", voigt.STRESSES, default=None)
    stored: float | None = described("energy under this strain, per area of the cell", records.STRESS, default=None)
    stored_in_springs: float | None = described("part of `stored` in elastic bonds", records.STRESS, default=None)
    mesh_error: float | None = described(
        "estimated relative mesh error of the strain energy; without a given strain, the largest", default=None
    )
    debonded_share: float = described("debonded share of the length of all interfaces")
    debonded_shares: Float | None = described(DEBONDED_SHARES, "", "(i,)", default=None)
    debonded_length: Float = described(DEBONDED_LENGTH, records.LENGTH, "(f,)")
    debonding_angle: Float = described(DEBONDED_ANGLE, records.DEGREES, "(f,)")
    tips: TipRates | None = described("energy release rates at the tips of its arcs", default=None)
    bonded: int = described("bonded interface nodes; without a given strain, under gamma12, as the next two")
    open: int = described("debonded interface nodes without contact")
    closed: int = described("debonded interface nodes in contact")
    iterations: int = described("Krylov iterations")


@dataclass(frozen=True, kw_only=True)
class PathPoint:
    """One point of a path: a break, a contact change, the end of a leg, or an increment."""

    load_factor: float = described("position on the whole path, 0 to 1, every leg taking the same share")
    strain: Float = described("macroscopic strain", "", EITHER, **OF_STRAINS)
    stress: Float = described(
        "macroscopic stress: at an event before bonds break, at an increment after they broke",
        records.STRESS,
        EITHER,
        **OF_STRESSES,
    )
    temperature: float | None = described(TEMPERATURE, default=None)
    mark: str | None = described(
        "`first softening`, `first break`, `peak` or `largest so far`, `after the peak` (branch of the valley after "
        "it) or `end`, several joined by `and`",
        default=None,
    )
    broke: int = described("bonds that break at this event, or broke in the step to this increment")
    softened: int | None = described("with softening: bonds that lose a tooth here but hold", default=None)
    free_motions: int = described("rigid motions of fibres that no interface force resists")
    stored: float = described("elastic energy stored per area of the cell", records.STRESS)
    stored_in_springs: float = described("part of `stored` in elastic bonds", records.STRESS)
    mesh_error: float | None = described(
        "estimated relative mesh error of `stored` at fixed damage, at the points that `states` chooses", default=None
    )
    work: float = described(
        "work of the loads, with a temperature, so far per area of the cell: `stored` + `dissipated`, with friction + "
        "`friction_heat`",
        records.STRESS,
    )
    dissipated: float = described("energy lost to breaks so far per cell area, along all equilibria", records.STRESS)
    dissipated_strain_controlled: float = described("the same if the load only rises on the first leg", records.STRESS)
    friction_heat: float | None = described(
        "frictional heat so far per area of the cell; `work` is the sum of `stored`, `dissipated` and this heat",
        records.STRESS,
        default=None,
    )
    fracture_energy: float | None = described(
        "toughness of the bonds that the load broke so far, each in the mode in which it broke, times their lengths, "
        "per area of the cell; only for bonds that break by energy",
        records.STRESS,
        default=None,
    )
    dissipation_ratio: float | None = described(
        "`dissipated` / `fracture_energy`, once a bond has broken; 1 if breaks lose only the toughness", default=None
    )
    debonded_share: float = described("debonded share of the length of all interfaces")
    debonded_shares: Float | None = described(DEBONDED_SHARES, "", "(i,)", default=None)
    damaged_share: float | None = described("with softening: share of damaged bonds that hold", default=None)
    debonded_length: Float | None = described(f"{DEBONDED_LENGTH}, {KEPT}", records.LENGTH, "(f,)", default=None)
    debonding_angle: Float | None = described(f"{DEBONDED_ANGLE}; {KEPT}", records.DEGREES, "(f,)", default=None)
    tips: Tips | None = described("tips, if bonds break by energy, at points of `states` in [output]", default=None)
    bonded: int = described("bonded interface nodes")
    open: int = described("debonded interface nodes without contact")
    closed: int = described("debonded interface nodes in contact")
    iterations: int = described("Krylov iterations")


@dataclass(frozen=True, kw_only=True)
class Peak:
    """The largest stress on a path before the deepest fall of the stress, and landmarks before it.

    The stress component is conjugate to the largest strain that changes on the leg where damage begins under stress.
    If only the temperature changes, it is the component with the largest stress.
    """

    stress_name: str = described("name of the component")
    strain_name: str = described("name of its strain")
    stress: float | None = described(
        "largest stress up to the deepest fall, or at any point without a fall; absent, with its strain, event and "
        "`dissipated`, if no stress acts",
        records.STRESS,
        default=None,
    )
    strain: float | None = described("macroscopic strain at the peak", default=None)
    event: int | None = described("number of its point in `path`, from 0", default=None)
    first_break_stress: float | None = described("stress where the first bonds break", records.STRESS, default=None)
    first_break_strain: float | None = described("strain there", default=None)
    first_break_event: int | None = described("number of that point", default=None)
    first_break_fibre: int | None = described("fibre of the most utilised bond there, from 1", default=None)
    first_break_angle: float | None = described("direction of that bond from the centre", records.DEGREES, default=None)
    first_softening_stress: float | None = described("stress where first bonds soften", records.STRESS, default=None)
    first_softening_strain: float | None = described("strain there", default=None)
    first_softening_event: int | None = described("number of that point", default=None)
    first_softening_fibre: int | None = described("fibre of the most utilised bond there, from 1", default=None)
    first_softening_angle: float | None = described("direction of that bond", records.DEGREES, default=None)
    fibre: int | None = described("fibre of the most utilised bond at the peak, from 1", default=None)
    angle: float | None = described("direction of that bond from the centre", records.DEGREES, default=None)
    stress_left: float | None = described(
        "stress in the valley of the fall, on a path of one leg with a load that only rises; with friction "
        "approximate, by branches through zero; absent if the stress never falls by 1 % as bonds break",
        records.STRESS,
        default=None,
    )
    event_left: int | None = described("number of the point on whose branch the valley is", default=None)
    so_far: bool = described(
        "true if the path ends before such a fall: not a peak, since a longer path may go higher", default=False
    )
    dissipated: float | None = described(
        "energy lost to breaks before the peak, per area of the cell", records.STRESS, default=None
    )


@dataclass(frozen=True, kw_only=True)
class LoadPoint:
    """The equilibrium under one load, with prescribed debonded faces."""

    strain: Float = described("macroscopic strain", "", EITHER, **OF_STRAINS)
    stress: Float = described("macroscopic stress", records.STRESS, EITHER, **OF_STRESSES)
    temperature: float | None = described(TEMPERATURE, default=None)
    free_motions: int = described("rigid motions of fibres that no interface force resists")
    stored: float = described("elastic energy stored per area of the cell", records.STRESS)
    stored_in_springs: float = described("part of `stored` in elastic bonds", records.STRESS)
    mesh_error: float | None = described("estimated relative mesh error of `stored`", default=None)
    debonded_share: float = described("debonded share of the length of all interfaces")
    debonded_shares: Float | None = described(DEBONDED_SHARES, "", "(i,)", default=None)
    debonded_length: Float = described(DEBONDED_LENGTH, records.LENGTH, "(f,)")
    debonding_angle: Float = described(DEBONDED_ANGLE, records.DEGREES, "(f,)")
    tips: TipRates | None = described("energy release rates at the tips of its arcs", default=None)
    bonded: int = described("bonded interface nodes")
    open: int = described("debonded interface nodes without contact")
    closed: int = described("debonded interface nodes in contact")
    iterations: int = described("Krylov iterations")


@dataclass(frozen=True, kw_only=True)
class EnvelopePoint:
    """The debonding onset in one direction of a plane of stresses or strains; without onset, only `angle` is set."""

    angle: float = described("direction of the load in the plane, from the first axis to the second", records.DEGREES)
    factor: float | None = described(
        "load at onset, in the unit of the axes: their values are `factor` times cosine and sine of `angle`; 0 if the "
        "change of temperature alone breaks a bond",
        default=None,
    )
    strain: Float | None = described("macroscopic strain at onset", "", EITHER, **OF_STRAINS, default=None)
    stress: Float | None = described("macroscopic stress at onset", records.STRESS, EITHER, **OF_STRESSES, default=None)
    fibre: int | None = described("number of the fibre whose bond breaks first", default=None)
    interface: int | None = described(OWN_SECTION, default=None)
    bond_angle: float | None = described(
        "direction of that bond from the fibre's centre; of the normal, if the fibre has no centre",
        records.DEGREES,
        default=None,
    )
    normal: float | None = described("share of the normal strength that the bond uses", default=None)
    tangential: float | None = described("share of the tangential strength", default=None)
    axial: float | None = described("share of the strength along the fibre", default=None)
    psi: float | None = described(
        "mode of a bond that breaks by energy: 0 opens, 90 shears, along the fibre too", records.DEGREES, default=None
    )
