"""Compute bounds on composite constants, and the model of aligned cylinders for bounds and estimates.

Stiffnesses of the plane are (3, 3) in Voigt order [11, 22, 12] with engineering shear, in any stress unit.  Phases of
cylinders have Hill's moduli k, l = 2 nu_A k, n = E_A + 4 nu_A^2 k, m = G_T and p = G_A (index A: along the fibres, T:
across), so that under an axial strain e, a change of area theta and a change T of temperature

    s = k theta + l e - b T,  b = 2 k alpha_T + l alpha_A,
    sigma_33 = l theta + n e - g T,  g = 2 l alpha_T + n alpha_A,

where s is the mean of sigma_11 and sigma_22, and alpha_A and alpha_T are the expansions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.materials import engineering_constants
from feti_homog.materials.engineering_constants import TransverseIsotropy
from feti_homog.materials.laws import ISOTROPY
from feti_homog.materials.material_forms import EXPANSION_PAIR, PER_TEMPERATURE
from feti_homog.system.runtime import described, records
from feti_homog.typing import Float

Pair = tuple[float, float]


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bounds on the plane bulk modulus and the shear modulus."""

    bulk: Pair = described("lower and upper bound of the plane bulk modulus", records.STRESS, "(2,)")
    shear: Pair = described("lower and upper bound of the shear modulus", records.STRESS, "(2,)")


@dataclass(frozen=True)
class FibreBounds:
    """Lower and upper bounds on the constants for any arrangement of bonded fibres."""

    E_axial: Pair = described("bounds on Young's modulus along the fibres", records.STRESS, "(2,)")
    nu_axial: Pair | None = described(
        "bounds on the contraction across the fibres under stress along them; null for more than two phases",
        shape="(2,)",
    )
    G_axial: Pair = described("bounds on the shear modulus along the fibres", records.STRESS, "(2,)")
    G_transverse: Pair = described("bounds on the shear modulus across the fibres", records.STRESS, "(2,)")
    K_transverse: Pair = described("bounds on the plane-strain bulk modulus across the fibres", records.STRESS, "(2,)")


@dataclass(frozen=True)
class Springs:
    """The springs around round fibres of equal radius: positive stiffnesses traction / jump, inf if bonded.

    Attributes:
        normal: k_n, for the opening.
        tangential: k_t, for the slip around the fibre.
        axial: k_a, for the slip along the fibre.
        radius: a, in the length unit of the stiffnesses.
    """

    normal: float
    tangential: float
    axial: float
    radius: float

    @property
    def compliances(self) -> tuple[float, float, float]:
        """The compliances 1/(k_n a), 1/(k_t a) and 1/(k_a a)."""
        a = self.radius
        return 1 / (self.normal * a), 1 / (self.tangential * a), 1 / (self.axial * a)


@dataclass(frozen=True)
class Fibres:
    """Round fibres with one phase, one radius and an area fraction; bonding is perfect without `springs`."""

    fraction: float
    constants: TransverseIsotropy
    springs: Springs | None = None


@dataclass(frozen=True)
class Estimate:
    """The constants by one method; None, which is null in results, where the method gives no value."""

    E_axial: float | None = described("Young's modulus along the fibres", records.STRESS)
    E_transverse: float | None = described("Young's modulus across the fibres", records.STRESS)
    nu_axial: float | None = described("contraction across the fibres under stress along them")
    nu_transverse: float | None = described("contraction across the fibres under stress across them")
    G_axial: float | None = described("shear modulus along the fibres", records.STRESS)
    G_transverse: float | None = described("shear modulus across the fibres", records.STRESS)
    K_transverse: float | None = described("bulk modulus across the fibres in plane strain", records.STRESS)
    expansion_axial: float | None = described("expansion along the fibres", PER_TEMPERATURE)
    expansion_transverse: float | None = described("expansion across the fibres", PER_TEMPERATURE)

    @classmethod
    def of(cls, constants: TransverseIsotropy) -> Estimate:
        """Make the estimate with all constants of a material."""
        return cls(**{name: getattr(constants, name) for name in CONSTANTS})


CONSTANTS = tuple(field.name for field in fields(Estimate))
NOTHING = Estimate(**dict.fromkeys(CONSTANTS))


@dataclass(frozen=True)
class Estimates:
    """The constants of a composite, estimated by each method."""

    rule_of_mixtures: Estimate = described("rule of mixtures: Voigt along the fibres, Reuss across them")
    chamis: Estimate = described("Chamis 1984")
    halpin_tsai: Estimate = described("Halpin and Tsai 1969")
    mori_tanaka: Estimate = described("Mori and Tanaka 1973, for aligned cylinders")
    composite_cylinders: Estimate = described("Hashin and Rosen 1964: exact for composite cylinders")
    self_consistent: Estimate = described("Christensen and Lo 1979, generalized self-consistent")


@dataclass(frozen=True)
class ConductivityEstimates:
    """Closed-form conductivities for phases isotropic in the plane.  Bounds are None with interface conductances."""

    axial: float = described("along the fibres: the mean, which is exact", "conductivity")
    wiener: Pair | None = described(
        "bounds across bonded fibres in any arrangement: harmonic and arithmetic mean", "conductivity", "(2,)"
    )
    hashin_shtrikman: Pair | None = described(
        "bounds across bonded fibres, for a cell that is isotropic in the plane", "conductivity", "(2,)"
    )
    maxwell: float | None = described(
        "estimate across round fibres: Maxwell 1873, with conductances Hasselman and Johnson 1987", "conductivity"
    )


def dispersed(fractions: ArrayLike, values: ArrayLike, reference: float) -> float:
    """Return the modulus 1 / sum c/(p + p0) - p0 of cylinders with fractions c and moduli p in a medium with p0."""
    return float(1 / np.sum(np.asarray(fractions, float) / (np.asarray(values, float) + reference)) - reference)


def voigt(fractions: ArrayLike, stiffnesses: ArrayLike) -> Float:
    """Return Voigt's upper bound sum c_i C_i, (m, m), from fractions (n,) and stiffnesses (n, m, m)."""
    return np.asarray(np.einsum("i,ijk->jk", np.asarray(fractions, float), np.asarray(stiffnesses, float)))


def reuss(fractions: ArrayLike, stiffnesses: ArrayLike) -> Float:
    """Return Reuss's lower bound (sum c_i C_i^-1)^-1, (m, m), from fractions (n,) and stiffnesses (n, m, m)."""
    return np.asarray(np.linalg.inv(voigt(fractions, np.linalg.inv(np.asarray(stiffnesses, dtype=float)))))


def is_isotropic(stiffness: ArrayLike) -> bool:
    """Return whether a plane stiffness is isotropic, up to rounding."""
    return engineering_constants.anisotropy(stiffness) < ISOTROPY


def hashin_shtrikman(fractions: ArrayLike, stiffnesses: Sequence[ArrayLike]) -> Bounds:
    """Bound the plane moduli of an isotropic composite from fractions (n,) and isotropic stiffnesses (n, 3, 3).

    k* = (sum c_i/(k_i + mu0))^-1 - mu0, mu* = (sum c_i/(mu_i + h0))^-1 - h0, h0 = k0 mu0/(k0 + 2 mu0) with bulk moduli
    k_i and shear moduli mu_i; k0, mu0 are the least moduli for the lower bound, the greatest for the upper (Hashin
    1965, Walpole 1969). The bound on k holds for square symmetry, too.  Raises ValueError if a phase is not isotropic.
    """
    if not all(map(is_isotropic, stiffnesses)):
        raise ValueError("the Hashin-Shtrikman bounds hold for isotropic phases")
    c = np.asarray(fractions, dtype=float)
    bulk, shear = np.array([engineering_constants.isotropic_part(stiffness) for stiffness in stiffnesses]).T

    def bounds(k0: float, mu0: float) -> tuple[float, float]:
        h0 = k0 * mu0 / (k0 + 2 * mu0)
        return dispersed(c, bulk, mu0), dispersed(c, shear, h0)

    lower, upper = bounds(bulk.min(), shear.min()), bounds(bulk.max(), shear.max())
    return Bounds(bulk=(lower[0], upper[0]), shear=(lower[1], upper[1]))


def aligned_cylinders(
    fractions: Sequence[float], phases: Sequence[TransverseIsotropy], surroundings: tuple[float, float, float]
) -> TransverseIsotropy:
    """Estimate the constants of cylinders in a reference medium under equal far fields.

    With fractions c, `surroundings` (k0, m0, p0), x_i = k_i + m0, h0 = k0 m0/(k0 + 2 m0), and * for the composite,

        1/(k* + m0) = sum c/x,  1/(m* + h0) = sum c/(m + h0),  1/(p* + p0) = sum c/(p + p0),
        l* = (k* + m0) L,  L = sum c l/x,  n* = sum c (n - l^2/x) + l* L,
        b* = (k* + m0) B,  B = sum c b/x,  g* = sum c (g - l b/x) + l* B,

    because s + m0 theta is equal in all cylinders, also under a change of temperature (Hill 1964, Hashin 1965, Walpole
    1969).  Expansions are None unless all phases have both.
    """
    c, (k0, m0, p0) = np.asarray(fractions, dtype=float), surroundings
    k, nu, E, m, p = np.array(
        [[x.K_transverse, x.nu_axial, x.E_axial, x.G_transverse, x.G_axial] for x in phases], dtype=float
    ).T
    across, along, x = 2 * nu * k, E + 4 * nu**2 * k, k + m0  # l, n and x
    h = k0 * m0 / (k0 + 2 * m0)
    stiff = 1 / np.sum(c / x)  # k* + m0
    bulk, shear = stiff - m0, dispersed(c, m, h)
    mean = np.sum(c * across / x)  # L
    coupling = stiff * mean
    poisson = coupling / (2 * bulk)
    young = np.sum(c * (along - across**2 / x)) + coupling * mean - coupling**2 / bulk
    elastic = engineering_constants.elastic_constants(young, poisson, dispersed(c, p, p0), shear, bulk)
    table: dict[str, Any] = {name: float(value) for name, value in elastic.items()} | dict.fromkeys(EXPANSION_PAIR)
    if None not in (free := [expansions(phase) for phase in phases]):
        axial, transverse = np.array(free, dtype=float).T
        b, g = 2 * k * transverse + across * axial, 2 * across * transverse + along * axial
        B = np.sum(c * b / x)
        stresses = [B / np.sum(c / x), np.sum(c * (g - across * b / x)) + coupling * B]
        area, length = np.linalg.solve([[bulk, coupling], [coupling, young + coupling**2 / bulk]], stresses)
        table |= zip(EXPANSION_PAIR, (float(length), float(area / 2)), strict=True)
    return TransverseIsotropy(**table, deviation=0.0)


def expansions(phase: TransverseIsotropy) -> Pair | None:
    """Return the axial and transverse expansions; None unless the phase has both."""
    if phase.expansion_axial is None or phase.expansion_transverse is None:
        return None
    return phase.expansion_axial, phase.expansion_transverse


def equivalent_fibre(family: Fibres, matrix: TransverseIsotropy) -> TransverseIsotropy:
    """Return the bonded fibre that replaces a fibre on springs, under a uniform far field; without springs, the fibre.

    E_axial, nu_axial and the expansions remain, and

        1/k_e = 1/k + 2/(k_n a),  1/p_e = 1/p + 1/(k_a a),
        1/m_e = 1/m + (x (q_n + q_t) + 12 q_n q_t) / (x + 3 (q_n + q_t)),  x = 1/m + 2/k + 1/m_m,  q_i = 1/(k_i a),

    with the bulk modulus k, the shear moduli m across and p along the fibre, and m_m for the matrix.  k_e and p_e hold
    in a composite cylinder too (Hashin 1990); m_e does not, because shear in a coated fibre is not uniform.
    """
    fibre, springs = family.constants, family.springs
    if springs is None:
        return fibre
    normal, tangential, axial = springs.compliances
    k, m, total = fibre.K_transverse, fibre.G_transverse, normal + tangential
    x = 1 / m + 2 / k + 1 / matrix.G_transverse
    bulk = 1 / (1 / k + 2 * normal)
    shear = 1 / (1 / m + (x * total + 12 * normal * tangential) / (x + 3 * total))
    G_axial = 1 / (1 / fibre.G_axial + axial)
    table = engineering_constants.elastic_constants(fibre.E_axial, fibre.nu_axial, G_axial, shear, bulk)
    return replace(fibre, **table)


def fibre_bounds(fractions: Sequence[float], phases: Sequence[TransverseIsotropy]) -> FibreBounds:
    """Bound the constants of bonded, transversely isotropic cylinders along x3, with any section.

    The bounds are `aligned_cylinders` in a medium with the least, or the greatest, moduli of the phases.  Bounds on
    nu_A follow from the bounds on k by Hill's relation for two phases, and are None for more.  All bounds except the
    bounds on G_T also hold for square symmetry.  Hill 1964, Hashin 1965, Walpole 1969.
    """

    def extreme(pick: Callable[[Iterable[float]], float]) -> tuple[float, float, float]:
        k, m = pick(phase.K_transverse for phase in phases), pick(phase.G_transverse for phase in phases)
        return k, m, pick(phase.G_axial for phase in phases)

    lower, upper = (aligned_cylinders(fractions, phases, extreme(pick)) for pick in (min, max))
    names = [field.name for field in fields(FibreBounds)]
    pairs: dict[str, Any] = {name: (getattr(lower, name), getattr(upper, name)) for name in names}
    nu = min(lower.nu_axial, upper.nu_axial), max(lower.nu_axial, upper.nu_axial)
    return FibreBounds(**pairs | {"nu_axial": nu if len(phases) == 2 else None})
