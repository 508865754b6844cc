"""The generalized self-consistent estimate: a fibre in its share of matrix, in the composite itself."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from feti_homog.materials.estimates.constituents import (
    NOTHING,
    Estimate,
    Fibres,
    equivalent_fibre,
    estimate_of,
    spring_compliances,
)
from feti_homog.materials.estimates.cylinders import cylinders_in_matrix
from feti_homog.materials.spatial_constants import TransverselyIsotropic, transverse_constants


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
    """Return the shear modulus m* of the medium in which a coated fibre under shear across it has the energy of the
    medium.

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
