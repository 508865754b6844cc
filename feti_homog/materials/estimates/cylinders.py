"""Aligned circular cylinders: Mori and Tanaka's estimate, Hashin and Rosen's composite cylinders.

Phases have Hill's moduli k, l = 2 nu_A k, n = E_A + 4 nu_A^2 k, m = G_T and p = G_A, so that under an axial strain e, a
change of area theta and a change of temperature T

    s = k theta + l e - b T,  b = 2 k alpha_T + l alpha_A,
    sigma_33 = l theta + n e - g T,  g = 2 l alpha_T + n alpha_A,

s being the mean of sigma_11 and sigma_22.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from feti_homog.materials.estimates.constituents import (
    NOTHING,
    Estimate,
    Fibres,
    equivalent_fibre,
    estimate_of,
    expansions,
    matrix_fraction,
)
from feti_homog.materials.spatial_constants import TransverselyIsotropic, transverse_constants
from feti_homog.typing import Float


@dataclass(frozen=True)
class Surroundings:
    """Moduli of the material in which every cylinder is thought to lie.

    Attributes:
        bulk, transverse, axial: k0, m0, p0.
    """

    bulk: float
    transverse: float
    axial: float


def aligned_cylinders(
    fractions: Sequence[float], phases: Sequence[TransverselyIsotropic], around: Surroundings
) -> TransverselyIsotropic:
    """Return the estimate in which every phase is a cylinder in the same surroundings k0, m0, p0.

    All have the same far field.

    With x_i = k_i + m0 and h0 = k0 m0/(k0 + 2 m0),

        1/(k* + m0) = sum c/x,  1/(m* + h0) = sum c/(m + h0),  1/(p* + p0) = sum c/(p + p0),
        l* = (k* + m0) L,  L = sum c l/x,  n* = sum c (n - l^2/x) + l* L,
        b* = (k* + m0) B,  B = sum c b/x,  g* = sum c (g - l b/x) + l* B,

    for s + m0 theta is the same in all cylinders.  Hill 1964, Hashin 1965, Walpole 1969; b and g by the same steps.
    """
    c = np.asarray(fractions, dtype=float)
    k, nu, E, m, p = np.array(
        [[x.K_transverse, x.nu_axial, x.E_axial, x.G_transverse, x.G_axial] for x in phases], dtype=float
    ).T
    across, along, x = 2 * nu * k, E + 4 * nu**2 * k, k + around.transverse
    h = around.bulk * around.transverse / (around.bulk + 2 * around.transverse)
    stiff = 1 / np.sum(c / x)  # k* + m0
    bulk, shear = stiff - around.transverse, 1 / np.sum(c / (m + h)) - h
    mean = np.sum(c * across / x)  # L
    coupling = stiff * mean
    poisson = coupling / (2 * bulk)
    young = np.sum(c * (along - across**2 / x)) + coupling * mean - coupling**2 / bulk
    E_transverse, nu_transverse = transverse_constants(young, poisson, bulk, shear)
    strains = _expansions(c, phases, x, np.array([[bulk, coupling], [coupling, young + coupling**2 / bulk]]))
    return TransverselyIsotropic(
        E_axial=float(young),
        E_transverse=float(E_transverse),
        nu_axial=float(poisson),
        nu_transverse=float(nu_transverse),
        G_axial=float(1 / np.sum(c / (p + around.axial)) - around.axial),
        G_transverse=float(shear),
        K_transverse=float(bulk),
        expansion_axial=strains[0],
        expansion_transverse=strains[1],
        deviation=0.0,
    )


def cylinders_in_matrix(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> TransverselyIsotropic:
    """`aligned_cylinders` with the matrix around, and for a fibre on springs the bonded one that does the same."""
    fractions = [matrix_fraction(fibres), *(family.fraction for family in fibres)]
    phases = [matrix, *(equivalent_fibre(family, matrix) for family in fibres)]
    return aligned_cylinders(fractions, phases, Surroundings(matrix.K_transverse, matrix.G_transverse, matrix.G_axial))


def mori_tanaka(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Every fibre is alone in the matrix, under the matrix's mean field; any kinds of round fibres, on springs too.

    `cylinders_in_matrix`.  Mori and Tanaka 1973, Benveniste 1987; transversely isotropic phases Chen, Dvorak and
    Benveniste 1992; springs Benveniste 1985.
    """
    return estimate_of(cylinders_in_matrix(matrix, fibres))


def composite_cylinders(matrix: TransverselyIsotropic, fibres: Sequence[Fibres]) -> Estimate:
    """Cylinders of fibre and matrix, alike but for their size, that fill space; one kind of fibres, on springs too.

    Exact for this arrangement: k, E_A, nu_A, G_A and the expansions, which are those of `cylinders_in_matrix`.  Of
    shear across the fibres there are bounds only.  Hashin and Rosen 1964; anisotropic fibres Hashin 1979; expansions
    Rosen and Hashin 1970; springs, of fibres of equal radius, Hashin 1990.
    """
    if len(fibres) != 1:
        return NOTHING
    exact = estimate_of(cylinders_in_matrix(matrix, fibres))
    return dataclasses.replace(exact, E_transverse=None, nu_transverse=None, G_transverse=None)


def _expansions(
    c: Float, phases: Sequence[TransverselyIsotropic], x: Float, stiffness: Float
) -> tuple[float, float] | tuple[None, None]:
    """alpha_A* and alpha_T* of `aligned_cylinders`, from [[k*, l*], [l*, n*]]; None if a phase has none."""
    given = [expansions(phase) for phase in phases]
    if None in given:
        return None, None
    axial, transverse = np.array(given, dtype=float).T
    k, nu, E = np.array([[phase.K_transverse, phase.nu_axial, phase.E_axial] for phase in phases]).T
    across, along = 2 * nu * k, E + 4 * nu**2 * k
    b, g = 2 * k * transverse + across * axial, 2 * across * transverse + along * axial
    mean = np.sum(c * b / x)  # B
    stresses = [mean / np.sum(c / x), np.sum(c * (g - across * b / x)) + stiffness[0, 1] * mean]
    area, length = np.linalg.solve(stiffness, stresses)
    return float(length), float(area / 2)
