"""Fibres and the springs of their interfaces, of which estimates are made; records of estimates and bounds."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

from feti_homog.materials.forms import PER_TEMPERATURE
from feti_homog.materials.spatial_constants import TransverselyIsotropic, transverse_constants
from feti_homog.system.runtime.records import STRESS, described

Pair = tuple[float, float]


@dataclass(frozen=True)
class Springs:
    """An elastic interface of round fibres of one radius: tractions over jumps, positive; infinite is bonded.

    Attributes:
        normal: k_n, of the opening.
        tangential: k_t, of the slip around the fibre.
        axial: k_a, of the slip along it.
        radius: a, in the unit of length of the stiffnesses.
    """

    normal: float
    tangential: float
    axial: float
    radius: float


@dataclass(frozen=True)
class Fibres:
    """Fibres of one material, and of one radius if they are on springs: their share of the cell, and constants."""

    fraction: float
    constants: TransverselyIsotropic
    springs: Springs | None = None


@dataclass(frozen=True)
class Estimate:
    """Constants by one method; null where it gives none."""

    E_axial: float | None = described("Young's modulus along the fibres", STRESS)
    E_transverse: float | None = described("Young's modulus across the fibres", STRESS)
    nu_axial: float | None = described("contraction across the fibres under stress along them")
    nu_transverse: float | None = described("contraction across the fibres under stress across them")
    G_axial: float | None = described("shear modulus along the fibres", STRESS)
    G_transverse: float | None = described("shear modulus across the fibres", STRESS)
    K_transverse: float | None = described("bulk modulus across the fibres in plane strain", STRESS)
    expansion_axial: float | None = described("expansion along the fibres", PER_TEMPERATURE)
    expansion_transverse: float | None = described("expansion across the fibres", PER_TEMPERATURE)


@dataclass(frozen=True)
class Estimates:
    """Constants by each method."""

    rule_of_mixtures: Estimate = described("rule of mixtures: Voigt along the fibres, Reuss across them")
    chamis: Estimate = described("Chamis 1984")
    halpin_tsai: Estimate = described("Halpin and Tsai 1969")
    mori_tanaka: Estimate = described("Mori and Tanaka 1973, of aligned cylinders")
    composite_cylinders: Estimate = described("Hashin and Rosen 1964: exact of composite cylinders")
    self_consistent: Estimate = described("Christensen and Lo 1979, generalized self-consistent")


@dataclass(frozen=True)
class FibreBounds:
    """Lower and upper bounds of the constants of any arrangement of bonded fibres."""

    E_axial: Pair = described("of Young's modulus along the fibres", STRESS, "(2,)")
    nu_axial: Pair | None = described(
        "of the contraction across the fibres under stress along them; null of more than two phases", shape="(2,)"
    )
    G_axial: Pair = described("of the shear modulus along the fibres", STRESS, "(2,)")
    G_transverse: Pair = described("of the shear modulus across the fibres", STRESS, "(2,)")
    K_transverse: Pair = described("of the bulk modulus across the fibres in plane strain", STRESS, "(2,)")


CONSTANTS = tuple(field.name for field in dataclasses.fields(Estimate))
NOTHING = Estimate(**dict.fromkeys(CONSTANTS))


def estimate_of(constants: TransverselyIsotropic) -> Estimate:
    """Return the estimate that has all of these constants."""
    return Estimate(**{name: getattr(constants, name) for name in CONSTANTS})


def matrix_fraction(fibres: Sequence[Fibres]) -> float:
    return 1 - sum(family.fraction for family in fibres)


def bonded(fibres: Sequence[Fibres]) -> bool:
    return all(family.springs is None for family in fibres)


def expansions(phase: TransverselyIsotropic) -> tuple[float, float] | None:
    """Axial and transverse expansion, if the phase has both."""
    if phase.expansion_axial is None or phase.expansion_transverse is None:
        return None
    return phase.expansion_axial, phase.expansion_transverse


def equivalent_fibre(family: Fibres, matrix: TransverselyIsotropic) -> TransverselyIsotropic:
    """Return the bonded fibre that does for the matrix what one on springs does.

    The field is uniform far away.

    E_axial, nu_axial and the expansions stay;

        1/k_e = 1/k + 2/(k_n a),  1/p_e = 1/p + 1/(k_a a),
        1/m_e = 1/m + (x (q_n + q_t) + 12 q_n q_t) / (x + 3 (q_n + q_t)),  x = 1/m + 2/k + 1/m_m,  q_i = 1/(k_i a),

    with the bulk modulus k, the shear moduli m across and p along the fibre, and m_m of the matrix.  k_e and p_e are
    those in a composite cylinder too (Hashin 1990); m_e is not, for shear across a coated fibre is not uniform in it.
    """
    fibre, springs = family.constants, family.springs
    if springs is None:
        return fibre
    normal, tangential, axial = spring_compliances(springs)
    k, m, total = fibre.K_transverse, fibre.G_transverse, normal + tangential
    x = 1 / m + 2 / k + 1 / matrix.G_transverse
    bulk = 1 / (1 / k + 2 * normal)
    shear = 1 / (1 / m + (x * total + 12 * normal * tangential) / (x + 3 * total))
    E_transverse, nu_transverse = transverse_constants(fibre.E_axial, fibre.nu_axial, bulk, shear)
    return dataclasses.replace(
        fibre,
        E_transverse=E_transverse,
        nu_transverse=nu_transverse,
        G_axial=1 / (1 / fibre.G_axial + axial),
        G_transverse=shear,
        K_transverse=bulk,
    )


def spring_compliances(springs: Springs) -> tuple[float, float, float]:
    """1/(k_n a), 1/(k_t a), 1/(k_a a)."""
    a = springs.radius
    return 1 / (springs.normal * a), 1 / (springs.tangential * a), 1 / (springs.axial * a)
