"""Estimates by name: rules of engineers, generalized self-consistent shear; bounds for any arrangement.

E_A, E_T, nu_A, nu_T: Young's moduli and contractions along and across the fibres; G_A, G_T, k: shear moduli along and
across them and the bulk modulus across them; alpha: expansions; c: fractions; f, m: fibre and matrix.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from feti_homog.materials.estimates.constituents import (
    NOTHING,
    Estimate,
    Estimates,
    FibreBounds,
    Fibres,
    bonded,
    equivalent_fibre,
    estimate_of,
    expansions,
    matrix_fraction,
    spring_compliances,
)
from feti_homog.materials.estimates.cylinders import (
    Surroundings,
    aligned_cylinders,
    composite_cylinders,
    cylinders_in_matrix,
    mori_tanaka,
)
from feti_homog.materials.spatial_constants import (
    TransverselyIsotropic,
    is_transversely_isotropic,
    transverse_constants,
)


def fibre_bounds(fractions: Sequence[float], phases: Sequence[TransverselyIsotropic]) -> FibreBounds:
    """Bounds of bonded, transversely isotropic phases that are cylinders along x3 of any section.

    `aligned_cylinders` with the least moduli of the phases around, and with the greatest.  Those of nu_A are the values
    of Hill's relation at the bounds of k, so of two phases only.  All but those of G_T hold for square symmetry too.
    Hill 1964, Hashin 1965, Walpole 1969.
    """
    lower, upper = (aligned_cylinders(fractions, phases, _extreme(phases, pick)) for pick in (min, max))
    nu = min(lower.nu_axial, upper.nu_axial), max(lower.nu_axial, upper.nu_axial)
    return FibreBounds(
        E_axial=(lower.E_axial, upper.E_axial),
        nu_axial=nu if len(phases) == 2 else None,
        G_axial=(lower.G_axial, upper.G_axial),
        G_transverse=(lower.G_transverse, upper.G_transverse),
        K_transverse=(lower.K_transverse, upper.K_transverse),
    )


def _extreme(phases: Sequence[TransverselyIsotropic], pick: Callable[[Iterable[float]], float]) -> Surroundings:
    """Return the least or the greatest of each modulus."""
    return Surroundings(
        pick(phase.K_transverse for phase in phases),
        pick(phase.G_transverse for phase in phases),
        pick(phase.G_axial for phase in phases),
    )


def rule_of_mixtures(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Phases in parallel along the fibres, in series across them; any number of phases.

        E_A = sum c E_A,  nu_A = sum c nu_A,  1/E_T = sum c/E_T,  1/G_A = sum c/G_A,  1/G_T = sum c/G_T,
        alpha_A = sum c E_A alpha_A / E_A*,  alpha_T = sum c (alpha_T + nu_A alpha_A) - nu_A* alpha_A*,

    those of the composite with a star; nu_T and k are what these make them: nu_T = E_T/(2 G_T) - 1,
    1/k = 4/E_T - 1/G_T - 4 nu_A^2/E_A.  Voigt 1889, Reuss 1929; the expansions Schapery 1968, of anisotropic fibres
    Hashin 1979.
    """
    if not bonded(fibres):
        return NOTHING
    phases = _phases(matrix, fibres)
    E, nu, expansion_axial, expansion_transverse = _in_parallel(phases)
    E_transverse = 1 / sum(c / x.E_transverse for c, x in phases)
    G = 1 / sum(c / x.G_transverse for c, x in phases)
    return Estimate(
        E_axial=E,
        E_transverse=E_transverse,
        nu_axial=nu,
        nu_transverse=E_transverse / (2 * G) - 1,
        G_axial=1 / sum(c / x.G_axial for c, x in phases),
        G_transverse=G,
        K_transverse=1 / (4 / E_transverse - 1 / G - 4 * nu**2 / E),
        expansion_axial=expansion_axial,
        expansion_transverse=expansion_transverse,
    )


def chamis(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Return the simplified equations of Chamis; one kind of fibres.

        E_A, nu_A: rule of mixtures,  M = M_m / (1 - sqrt(c) (1 - M_m/M_f)) for M = E_T, G_A, G_T,
        nu_T = E_T/(2 G_T) - 1,  alpha_A = (c E_f alpha_f + (1 - c) E_m alpha_m)/E_A,
        alpha_T = sqrt(c) alpha_Tf + (1 - sqrt(c)) (alpha_Tm + c nu_m E_f/E_A alpha_m),

    E, nu and alpha of the phases being the axial ones where T does not occur.  Chamis 1984, for an isotropic
    matrix.
    """
    if len(fibres) != 1 or not bonded(fibres):
        return NOTHING
    fibre, c = fibres[0].constants, fibres[0].fraction
    root = math.sqrt(c)

    def mean(of_matrix: float, of_fibre: float) -> float:
        return of_matrix / (1 - root * (1 - of_matrix / of_fibre))

    E, nu, expansion_axial, _ = _in_parallel(_phases(matrix, fibres))
    E_transverse = mean(matrix.E_transverse, fibre.E_transverse)
    G = mean(matrix.G_transverse, fibre.G_transverse)
    expansion = None
    if (of_fibre := expansions(fibre)) and (of_matrix := expansions(matrix)):
        restrained = c * matrix.nu_axial * fibre.E_axial / E * of_matrix[0]
        expansion = root * of_fibre[1] + (1 - root) * (of_matrix[1] + restrained)
    return Estimate(
        E_axial=E,
        E_transverse=E_transverse,
        nu_axial=nu,
        nu_transverse=E_transverse / (2 * G) - 1,
        G_axial=mean(matrix.G_axial, fibre.G_axial),
        G_transverse=G,
        K_transverse=None,
        expansion_axial=expansion_axial,
        expansion_transverse=expansion,
    )


def halpin_tsai(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Return the equations of Halpin and Tsai; one kind of fibres.

        E_A, nu_A: rule of mixtures,  M = M_m (1 + xi eta c)/(1 - eta c),  eta = (M_f - M_m)/(M_f + xi M_m),

    with xi = 2 for E_T, 1 for G_A, k_m/(k_m + 2 G_m) for G_T and G_m/k_m for k, G_m being that across the fibres.
    E_T is fitted and the others are not, so that E_T/(2 G_T) - 1 may exceed 1: no nu_T is given.
    Halpin and Kardos 1976.
    """
    if len(fibres) != 1 or not bonded(fibres):
        return NOTHING
    fibre, c = fibres[0].constants, fibres[0].fraction

    def mean(of_matrix: float, of_fibre: float, xi: float) -> float:
        eta = (of_fibre - of_matrix) / (of_fibre + xi * of_matrix)
        return of_matrix * (1 + xi * eta * c) / (1 - eta * c)

    k, G = matrix.K_transverse, matrix.G_transverse
    E, nu, *_ = _in_parallel(_phases(matrix, fibres))
    return dataclasses.replace(
        NOTHING,
        E_axial=E,
        E_transverse=mean(matrix.E_transverse, fibre.E_transverse, 2),
        nu_axial=nu,
        G_axial=mean(matrix.G_axial, fibre.G_axial, 1),
        G_transverse=mean(G, fibre.G_transverse, k / (k + 2 * G)),
        K_transverse=mean(k, fibre.K_transverse, G / k),
    )


def _phases(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> list[tuple[float, TransverselyIsotropic]]:
    return [(matrix_fraction(fibres), matrix), *((family.fraction, family.constants) for family in fibres)]


def _in_parallel(
    phases: Sequence[tuple[float, TransverselyIsotropic]],
) -> tuple[float, float, float | None, float | None]:
    """E_A, nu_A, alpha_A and alpha_T of the rule of mixtures; no alpha if a phase has none."""
    E, nu = sum(c * x.E_axial for c, x in phases), sum(c * x.nu_axial for c, x in phases)
    axial = transverse = 0.0
    for c, phase in phases:
        if (strains := expansions(phase)) is None:
            return E, nu, None, None
        axial += c * phase.E_axial * strains[0] / E
        transverse += c * (strains[1] + phase.nu_axial * strains[0])
    return E, nu, axial, transverse - nu * axial


def self_consistent(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Christensen and Lo's estimate; one kind of fibres, on springs too.

    k, E_A, nu_A, G_A and the expansions are those of `composite_cylinders`, G_T is that of `transverse_shear`;
    E_T and nu_T follow.  Christensen and Lo 1979; springs, of fibres of equal radius, Hashin 1990.
    """
    if len(fibres) != 1:
        return NOTHING
    x = cylinders_in_matrix(matrix, fibres)
    G = transverse_shear(matrix, fibres[0])
    E_transverse, nu_transverse = transverse_constants(x.E_axial, x.nu_axial, x.K_transverse, G)
    return dataclasses.replace(estimate_of(x), E_transverse=E_transverse, nu_transverse=nu_transverse, G_transverse=G)


def transverse_shear(matrix: TransverselyIsotropic, family: Fibres) -> float:
    """Return the shear modulus m* of the medium that a coated fibre does not change.

    Under shear across it the coated fibre has the energy of the medium.

    On a circle, u_1 + i u_2 and the resultant F = phi + z conj(phi') + conj(psi) of Muskhelishvili's potentials have
    two harmonics, exp(-i t) and exp(3 i t).  In the medium phi has no term 1/z, as the energies are equal, and so
    2 m* u = -F there (Eshelby).  Through the matrix, with P = F + 2 m u, kappa_m = 1 + 2 m/k and m, k its moduli,

        P_1 ~ 1/r,  P_3 ~ r^3,  F_1 - (3 P_3 + P_1)/(kappa_m + 1) ~ r,  F_3 - (P_3 - P_1)/(kappa_m + 1) ~ 1/r^3,

    and at the fibre 2 m u = V F (`_compliance`).  With two unknowns y at the fibre, P = A y and F = B y at the outer
    radius, where P = (1 - m/m*) F: det(A - (1 - m/m*) B) = 0, Christensen and Lo's quadratic, has one positive root m*,
    for V is indefinite as a homogeneous cylinder's is.
    """
    c, m = family.fraction, matrix.G_transverse
    ratio, w, v, d = _compliance(family, matrix)
    beta = 1 / (2 + 2 * m / matrix.K_transverse)  # 1/(kappa_m + 1)
    # Columns: the amplitudes of F_1 at the fibre over r and of P_3 at the outer radius; no power of c is negative.
    P = np.array([[c * (ratio - 1), c**2 * v], [0, 1]])
    inner = np.array([
        [ratio - (ratio - 1) * beta, -(3 + v) * c * beta],
        [c**2 * ((ratio - 1) * beta - w), c**3 * (d - (1 - v) * beta)],
    ])  # fmt: skip
    F = inner + beta * np.array([[1, 3], [-1, 1]]) @ P
    rest = P - F
    mixed = rest[0, 0] * F[1, 1] + F[0, 0] * rest[1, 1] - rest[0, 1] * F[1, 0] - F[0, 1] * rest[1, 0]
    roots = np.roots([np.linalg.det(rest), mixed, np.linalg.det(F)])  # of m*/m
    return float(m * roots.real.max())


def _compliance(family: Fibres, matrix: TransverselyIsotropic) -> tuple[float, float, float, float]:
    """Return the effect of a fibre on the matrix: m_e/m, (m_e/m) V31/(1 + V33), V13/(1 + V33), 1/(1 + V33).

    A homogeneous fibre has V = diag(-m/m_f, m/m_f + 2 m/k_f); springs with q_i = 1/(k_i a) add
    m [[-(q_n + q_t), 3 (q_n - q_t)], [-(q_n - q_t), 3 (q_n + q_t)]].  m_e, that of `equivalent_fibre`, has
    m/m_e = V13 V31/(1 + V33) - V11.
    """
    fibre, springs, m = family.constants, family.springs, matrix.G_transverse
    normal, tangential, _ = (0.0, 0.0, 0.0) if springs is None else spring_compliances(springs)
    total, difference = m * (normal + tangential), m * (normal - tangential)
    d = 1 / (1 + m / fibre.G_transverse + 2 * m / fibre.K_transverse + 3 * total)
    ratio = equivalent_fibre(family, matrix).G_transverse / m
    return ratio, -difference * d * ratio, 3 * difference * d, d


METHODS: Mapping[str, Callable[[TransverselyIsotropic, Sequence[Fibres]], Estimate]] = {
    "rule_of_mixtures": rule_of_mixtures,
    "chamis": chamis,
    "halpin_tsai": halpin_tsai,
    "mori_tanaka": mori_tanaka,
    "composite_cylinders": composite_cylinders,
    "self_consistent": self_consistent,
}


def estimates(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimates:
    """Return the estimates of each method for fibres in a matrix.

    The rule of mixtures and Mori and Tanaka's estimate are defined for any kinds of fibres, the others for one; on
    springs the last three.  No method gives a constant if a phase is not transversely isotropic about x3, nor an
    expansion if a phase has none.
    """
    if not all(map(is_transversely_isotropic, [matrix, *(family.constants for family in fibres)])):
        return Estimates(**dict.fromkeys(METHODS, NOTHING))
    return Estimates(**{name: method(matrix, fibres) for name, method in METHODS.items()})
