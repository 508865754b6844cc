"""Rules of engineers, of bonded fibres: rule of mixtures, Chamis, Halpin and Tsai.

E_A, E_T, nu_A, nu_T: Young's moduli and contractions along and across the fibres; G_A, G_T, k: shear moduli along and
across them and the bulk modulus across them; alpha: expansions; c: fractions; f, m: fibre and matrix.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from feti_homog.materials.estimates.constituents import NOTHING, Estimate, Fibres, bonded, expansions, matrix_fraction
from feti_homog.materials.spatial_constants import TransverselyIsotropic


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

    E, nu and alpha of the phases being the axial ones where T does not say otherwise.  Chamis 1984, for an isotropic
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
