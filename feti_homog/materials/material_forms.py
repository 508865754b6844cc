"""Define the forms in which a section [material.PHASE] gives the constants and the strength of an elastic phase.

The utilisation of a strength is 1 at failure, and proportional to the stress.  Criteria: maximum principal stress
sigma_1; von Mises; Drucker and Prager, fitted to both uniaxial strengths; for fibres along x3 the largest of
Hashin's four modes (J. Appl. Mech. 47 (1980) 329).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from feti_homog.schema import key, types
from feti_homog.typing import Float

Matrix = tuple[tuple[float, ...], ...]

POSITIVE = types.real(above=0.0)
stress = partial(key, POSITIVE, unit="stress")
MATRIX = types.either(
    "a symmetric 3x3 array of numbers in the order 11, 22, 12, or 6x6 in the order 11, 22, 33, 23, 13, 12",
    *(types.list_of(types.list_of(types.real(), "", count=size), "", count=size) for size in (3, 6)),
)
EXPANSION = types.either("a number or a list of three numbers", types.real(), types.list_of(types.real(), "", count=3))
PER_TEMPERATURE, CONDUCTIVITY_UNIT = "1 / temperature", "conductivity"
thermal = partial(key, unit=PER_TEMPERATURE, default=None)
ONE_EXPANSION = replace(types.real(), expected="a number, or expansion_axial and expansion_transverse in its place")
EXPANSION_PAIR = ("expansion_axial", "expansion_transverse")
"""Keys that are given together, in place of one expansion."""


@dataclass(frozen=True, kw_only=True)
class PhaseStrength:
    """Strength of a phase by one criterion.

    The keys are principal, or von_mises, or tension and compression, or Hashin's six for fibres along x3.
    """

    principal: float | None = stress("Largest principal stress.", default=None)
    von_mises: float | None = stress("Von Mises stress.", default=None)
    tension: float | None = stress("Uniaxial tension, with compression: Drucker and Prager's criterion.", default=None)
    compression: float | None = stress("Uniaxial compression, with tension.", default=None)
    axial_tension: float | None = stress("Tension along x3, with the next five: Hashin's criterion.", default=None)
    axial_compression: float | None = stress("Compression along x3.", default=None)
    axial_shear: float | None = stress("Shear between x3 and the plane.", default=None)
    transverse_tension: float | None = stress("Tension in the plane.", default=None)
    transverse_compression: float | None = stress("Compression in the plane.", default=None)
    transverse_shear: float | None = stress("Shear in the plane.", default=None)


STRENGTH = types.table_of(PhaseStrength, "a table such as {principal = 80.0}", least=1)
UTILISATION = "Strength of the phase, whose utilisation is computed with its largest stresses."


@dataclass(frozen=True, kw_only=True)
class FibreConductivity:
    """Conductivities of a phase that is isotropic in the plane."""

    axial: float = key(POSITIVE, "Along x3.", unit=CONDUCTIVITY_UNIT)
    transverse: float = key(POSITIVE, "In the plane.", unit=CONDUCTIVITY_UNIT)


CONDUCTIVITY = types.either(
    "a table {axial, transverse}, a symmetric 3x3 array of numbers or a number above 0",
    POSITIVE,
    types.table_of(FibreConductivity, ""),
    types.list_of(types.list_of(types.real(), "", count=3), "", count=3),
)
CONDUCTS = "In all directions, by x3 and the plane, or the tensor in material axes; conduction needs no other key."
Conductivity = float | FibreConductivity | Matrix


@dataclass(frozen=True)
class Isotropic:
    """Young's modulus and Poisson's ratio."""

    young: float = stress("Young's modulus.")
    poisson: float = key(types.real(above=-1.0, most=0.5), "Poisson's ratio; 0.5 in plane stress alone.")
    expansion: float | None = thermal(types.real(), "Thermal expansion.")
    strength: PhaseStrength | None = key(STRENGTH, UTILISATION, default=None)
    conductivity: Conductivity | None = key(CONDUCTIVITY, CONDUCTS, unit=CONDUCTIVITY_UNIT, default=None)


@dataclass(frozen=True, kw_only=True)
class Orthotropic:
    """Engineering constants along the material axes 1, 2 and 3 = x3; nu_ij = -eps_j/eps_i under stress along i.

    So nu_ij/E_i = nu_ji/E_j. Plane stress needs E1, E2, nu12, G12; plane strain also E3, nu13, nu23; generalized plane
    strain all constants.
    """

    E1: float = stress("Young's modulus along axis 1.")
    E2: float = stress("Young's modulus along axis 2.")
    E3: float | None = stress("Young's modulus out of the plane; plane strain needs it.", default=None)
    nu12: float = key(types.real(), "Poisson's ratio in the plane; nu12^2 < E1/E2.")
    nu13: float | None = key(types.real(), "Poisson's ratio out of the plane; plane strain needs it.", default=None)
    nu23: float | None = key(types.real(), "Poisson's ratio out of the plane; plane strain needs it.", default=None)
    G12: float = stress("Shear modulus in the plane.")
    G13: float | None = stress("Shear modulus between axis 1 and x3; generalized plane strain needs it.", default=None)
    G23: float | None = stress("Shear modulus between axis 2 and x3; generalized plane strain needs it.", default=None)
    angle: float = key(types.real(), "Direction of axis 1, from x1 towards x2.", unit="degrees", default=0.0)
    expansion: float | tuple[float, ...] | None = thermal(
        EXPANSION, "Thermal expansion, the same in all directions or along axes 1, 2, 3."
    )
    strength: PhaseStrength | None = key(STRENGTH, UTILISATION, default=None)
    conductivity: Conductivity | None = key(CONDUCTIVITY, CONDUCTS, unit=CONDUCTIVITY_UNIT, default=None)


@dataclass(frozen=True, kw_only=True)
class TransverselyIsotropic:
    """Engineering constants of a phase that is isotropic in the plane, such as most fibres.

    Plane stress needs E_transverse and either nu_transverse or G_transverse, plane strain also E_axial and nu_axial,
    generalized plane strain also G_axial.
    """

    E_axial: float | None = stress("Young's modulus along x3; plane strain needs it.", default=None)
    E_transverse: float = stress("Young's modulus in the plane.")
    nu_axial: float | None = key(
        types.real(),
        "Contraction in the plane / strain along x3, under stress along x3; "
        "2 nu_axial^2 < (1 - nu_transverse) E_axial/E_transverse. Plane strain needs it.",
        default=None,
    )
    nu_transverse: float | None = key(
        types.real(above=-1.0, below=1.0), "Poisson's ratio in the plane.", absent="given by G_transverse"
    )
    G_transverse: float | None = stress("Shear modulus in the plane, in place of nu_transverse.", default=None)
    G_axial: float | None = stress(
        "Shear modulus between x3 and the plane; generalized plane strain needs it.", default=None
    )
    expansion: float | None = thermal(ONE_EXPANSION, "Thermal expansion, the same in all directions.")
    expansion_axial: float | None = thermal(types.real(), "Thermal expansion along x3; with expansion_transverse.")
    expansion_transverse: float | None = thermal(types.real(), "Thermal expansion in the plane; with expansion_axial.")
    strength: PhaseStrength | None = key(STRENGTH, UTILISATION, default=None)
    conductivity: Conductivity | None = key(CONDUCTIVITY, CONDUCTS, unit=CONDUCTIVITY_UNIT, default=None)


@dataclass(frozen=True)
class General:
    """The stiffness itself: 3x3 for the plane state of the case, or 6x6 for all plane states.

    x3 is normal to a plane of symmetry: in a 6x6 stiffness, 23 and 13 are coupled only to each other.
    """

    stiffness: Matrix = key(
        MATRIX,
        "The stiffness, symmetric and positive definite; in a 6x6 stiffness, 23 and 13 are coupled only to each other.",
        unit="stress",
    )
    expansion: float | tuple[float, ...] | None = thermal(
        EXPANSION, "Thermal expansion, the same in all directions or along x1, x2, x3."
    )
    strength: PhaseStrength | None = key(STRENGTH, UTILISATION, default=None)
    conductivity: Conductivity | None = key(CONDUCTIVITY, CONDUCTS, unit=CONDUCTIVITY_UNIT, default=None)


@dataclass(frozen=True)
class Conductor:
    """Only the conductivity, for phases whose stiffness is not needed."""

    conductivity: Conductivity = key(CONDUCTIVITY, CONDUCTS, unit=CONDUCTIVITY_UNIT)
    expansion: None = None
    strength: None = None


Elastic = Isotropic | Orthotropic | TransverselyIsotropic | General
Material = Elastic | Conductor
MATERIAL_FORMS: dict[str, type[Any]] = {
    "isotropic": Isotropic,
    "orthotropic": Orthotropic,
    "transversely isotropic": TransverselyIsotropic,
    "general": General,
    "conductor": Conductor,
}
CRITERIA = {
    "maximum principal": ("principal",),
    "von Mises": ("von_mises",),
    "Drucker-Prager": ("tension", "compression"),
    "Hashin": (
        "axial_tension", "axial_compression", "axial_shear", "transverse_tension", "transverse_compression",
        "transverse_shear",
    ),
}  # fmt: skip
"""Criteria with the keys that each criterion needs."""
MODES = ("axial tension", "axial compression", "transverse tension", "transverse compression")  # of Hashin's criterion


def criterion(strength: PhaseStrength) -> str:
    """Return the name of the given criterion; ValueError if keys are missing, or belong to several criteria."""
    names_given = [name for names in CRITERIA.values() for name in names if getattr(strength, name) is not None]
    for title, names in CRITERIA.items():
        if names_given == list(names):
            return title
    groups = "; ".join(f"{', '.join(names)} ({title})" for title, names in CRITERIA.items())
    if len(names_given) == 1 and names_given[0].endswith("tension"):
        groups += f". With {names_given[0]} alone write principal, or add the other keys of its criterion"
    raise ValueError(f"strength: {', '.join(names_given) or 'empty'}: expected the keys of one criterion: {groups}")


def utilisation(strength: PhaseStrength, stress: Float, principal: Float, von_mises: Float) -> Float:
    """Compute utilisations (n, modes), at least 0, of a valid strength: four modes by Hashin, one by other criteria.

    Args:
        stress: (n, 6) in the order [11, 22, 33, 23, 13, 12], x3 along the fibres.
        principal: (n,) largest principal stress.
        von_mises: (n,) von Mises stress.
    """
    limits = {name: float(limit) for name, limit in vars(strength).items() if limit is not None}
    if "principal" in limits:
        ratios = [principal / limits["principal"]]
    elif "von_mises" in limits:
        ratios = [von_mises / limits["von_mises"]]
    elif "tension" in limits:
        # a sigma_vm + b tr sigma, which is 1 under either uniaxial strength.
        tension, compression = 1.0 / limits["tension"], 1.0 / limits["compression"]
        ratios = [(tension + compression) / 2 * von_mises + (tension - compression) / 2 * stress[:, :3].sum(axis=1)]
    else:
        ratios = _hashin(limits, stress)
    return np.asarray(np.maximum(np.stack(ratios, axis=1), 0.0))


def _hashin(limits: Mapping[str, float], stress: Float) -> list[Float]:
    """Compute utilisations (n,) of the `MODES` from strengths `limits`; at most 0 for stresses of the opposite sign.

    A mode fails at a load factor f with a f^2 + b f = 1, and so has the utilisation 1 / f = (b + sqrt(b^2 + 4 a)) / 2.
    """
    S11, S22, S33, S23, S13, S12 = stress.T
    axial, across = np.hypot(S13, S23) / limits["axial_shear"], S11 + S22
    parted = np.hypot(S33 / limits["axial_tension"], axial)
    shear = axial**2 + (S12**2 - S11 * S22) / limits["transverse_shear"] ** 2
    pulled = np.sqrt(np.maximum((across / limits["transverse_tension"]) ** 2 + shear, 0.0))
    doubled, compression = 2 * limits["transverse_shear"], limits["transverse_compression"]
    linear = ((compression / doubled) ** 2 - 1) * across / compression
    pressed = (linear + np.sqrt(linear**2 + 4 * np.maximum((across / doubled) ** 2 + shear, 0.0))) / 2
    return [parted * (S33 > 0), -S33 / limits["axial_compression"], pulled * (across >= 0), pressed * (across < 0)]
