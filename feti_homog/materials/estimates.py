"""Estimate the constants of a unidirectional composite by closed formulas from phases and fractions.

E_A, E_T, nu_A, nu_T: Young's moduli and contractions along and across the fibres; G_A, G_T, k: shear moduli along and
across the fibres and bulk modulus across them; alpha: expansions; c: fractions; f, m: fibre and matrix.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.materials import engineering_constants, phase_bounds
from feti_homog.materials.engineering_constants import TransverseIsotropy
from feti_homog.materials.phase_bounds import NOTHING, Estimate, Estimates, Fibres

ON_SPRINGS = {"mori_tanaka", "composite_cylinders", "self_consistent"}
OF_SEVERAL_KINDS = {"rule_of_mixtures", "mori_tanaka"}
MODULI_ACROSS = ("E_transverse", "G_transverse", "G_axial")


def estimates(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimates:
    """Estimate the constants of fibres in a matrix by each method, None where a method gives no value.

    The rule of mixtures and Mori and Tanaka's estimate allow several kinds of fibres, the other methods one; springs
    are allowed by `mori_tanaka`, `composite_cylinders` and `self_consistent` alone.  No method gives a constant if a
    phase is not transversely isotropic about x3, nor an expansion if a phase has no expansion.
    """
    able = set(METHODS)
    if any(family.springs is not None for family in fibres):
        able &= ON_SPRINGS
    if len(fibres) != 1:
        able &= OF_SEVERAL_KINDS
    if not all(map(engineering_constants.is_transversely_isotropic, [matrix, *(f.constants for f in fibres)])):
        able.clear()
    return Estimates(**{name: method(matrix, fibres) if name in able else NOTHING for name, method in METHODS.items()})


def rule_of_mixtures(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants of bonded phases, in parallel along and in series across the fibres.

        E_A = sum c E_A,  nu_A = sum c nu_A,  1/E_T = sum c/E_T,  1/G_A = sum c/G_A,  1/G_T = sum c/G_T,
        alpha_A = sum c E_A alpha_A / E_A*,  alpha_T = sum c (alpha_T + nu_A alpha_A) - nu_A* alpha_A*,

    with a star for the composite; nu_T and k follow: nu_T = E_T/(2 G_T) - 1, 1/k = 4/E_T - 1/G_T - 4 nu_A^2/E_A.  Voigt
    1889, Reuss 1929; expansions: Schapery 1968, with anisotropic fibres Hashin 1979.
    """
    phases, along = _phases(matrix, fibres), _in_parallel(matrix, fibres)
    E, G, G_axial = (1 / sum(c / getattr(x, name) for c, x in phases) for name in MODULI_ACROSS)
    K = 1 / (4 / E - 1 / G - 4 * along["nu_axial"] ** 2 / along["E_axial"])
    return Estimate(**along, E_transverse=E, nu_transverse=E / (2 * G) - 1, G_axial=G_axial, G_transverse=G,
                    K_transverse=K)  # fmt: skip


def chamis(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants except k for one kind of bonded fibres by Chamis's simplified equations.

        E_A, nu_A: rule of mixtures,  M = M_m / (1 - sqrt(c) (1 - M_m/M_f)) for M = E_T, G_A, G_T,
        nu_T = E_T/(2 G_T) - 1,  alpha_A = (c E_f alpha_f + (1 - c) E_m alpha_m)/E_A,
        alpha_T = sqrt(c) alpha_Tf + (1 - sqrt(c)) (alpha_Tm + c nu_m E_f/E_A alpha_m),

    where E, nu and alpha of a phase are axial values unless the index has a T.  Chamis 1984: isotropic matrix.
    """
    fibre, c = fibres[0].constants, fibres[0].fraction
    root, along = math.sqrt(c), _in_parallel(matrix, fibres)
    pairs = ((getattr(matrix, name), getattr(fibre, name)) for name in MODULI_ACROSS)
    E, G, G_axial = (of_matrix / (1 - root * (1 - of_matrix / of_fibre)) for of_matrix, of_fibre in pairs)
    fibre_strains, matrix_strains = phase_bounds.expansions(fibre), phase_bounds.expansions(matrix)
    if fibre_strains is not None and matrix_strains is not None:
        restrained = c * matrix.nu_axial * fibre.E_axial / along["E_axial"] * matrix_strains[0]
        along["expansion_transverse"] = root * fibre_strains[1] + (1 - root) * (matrix_strains[1] + restrained)
    return Estimate(**along, E_transverse=E, nu_transverse=E / (2 * G) - 1, G_axial=G_axial, G_transverse=G,
                    K_transverse=None)  # fmt: skip


def halpin_tsai(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants for one kind of bonded fibres by Halpin and Tsai's equations.

        E_A, nu_A: rule of mixtures,  M = M_m (1 + xi eta c)/(1 - eta c),  eta = (M_f - M_m)/(M_f + xi M_m),

    with xi = 2 for M = E_T, 1 for G_A, k_m/(k_m + 2 G_m) for G_T and G_m/k_m for k, where G_m is across the fibres.
    Only E_T is fitted, so that E_T/(2 G_T) - 1 may exceed 1: nu_T and expansions are None.  Halpin and Kardos 1976.
    """
    fibre, c = fibres[0].constants, fibres[0].fraction

    def mean(of_matrix: float, of_fibre: float, xi: float) -> float:
        eta = (of_fibre - of_matrix) / (of_fibre + xi * of_matrix)
        return of_matrix * (1 + xi * eta * c) / (1 - eta * c)

    k, G = matrix.K_transverse, matrix.G_transverse
    along = _in_parallel(matrix, fibres)
    return dataclasses.replace(
        NOTHING,
        E_axial=along["E_axial"],
        E_transverse=mean(matrix.E_transverse, fibre.E_transverse, 2),
        nu_axial=along["nu_axial"],
        G_axial=mean(matrix.G_axial, fibre.G_axial, 1),
        G_transverse=mean(G, fibre.G_transverse, k / (k + 2 * G)),
        K_transverse=mean(k, fibre.K_transverse, G / k),
    )


def _phases(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> list[tuple[float, TransverseIsotropy]]:
    """Return fraction and constants of the matrix, then of each kind of fibres."""
    rest = 1 - sum(family.fraction for family in fibres)
    return [(rest, matrix), *((family.fraction, family.constants) for family in fibres)]


def _in_parallel(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> dict[str, Any]:
    """Return E_A, nu_A and expansions by name, by the rule of mixtures; expansions None unless all phases have both."""
    phases = _phases(matrix, fibres)
    E, nu = sum(c * x.E_axial for c, x in phases), sum(c * x.nu_axial for c, x in phases)
    axial = transverse = 0.0
    for c, phase in phases:
        if (strains := phase_bounds.expansions(phase)) is None:
            return {"E_axial": E, "nu_axial": nu, "expansion_axial": None, "expansion_transverse": None}
        axial += c * phase.E_axial * strains[0] / E
        transverse += c * (strains[1] + phase.nu_axial * strains[0])
    return {"E_axial": E, "nu_axial": nu, "expansion_axial": axial, "expansion_transverse": transverse - nu * axial}


def cylinders_in_matrix(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> TransverseIsotropy:
    """Estimate the constants by `aligned_cylinders` with the matrix as medium, and `equivalent_fibre` for fibres."""
    fractions = [c for c, _ in _phases(matrix, fibres)]
    phases = [matrix, *(phase_bounds.equivalent_fibre(family, matrix) for family in fibres)]
    return phase_bounds.aligned_cylinders(fractions, phases, (matrix.K_transverse, matrix.G_transverse, matrix.G_axial))


def mori_tanaka(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants by `cylinders_in_matrix`: each fibre alone, under the mean field of the matrix.

    The method allows several kinds of round fibres and springs.  Mori and Tanaka 1973, Benveniste 1987; transversely
    isotropic phases: Chen, Dvorak and Benveniste 1992; springs: Benveniste 1985.
    """
    return Estimate.of(cylinders_in_matrix(matrix, fibres))


def composite_cylinders(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants of similar cylinders that fill space, for one kind of fibres.

    Each cylinder is a fibre coated by matrix.  By `cylinders_in_matrix`, k, E_A, nu_A, G_A and expansions are exact for
    this arrangement, also on springs; shear across the fibres has only bounds.  Hashin and Rosen 1964; anisotropic
    fibres: Hashin 1979; expansions: Rosen and Hashin 1970; springs on fibres of equal radius: Hashin 1990.
    """
    exact = Estimate.of(cylinders_in_matrix(matrix, fibres))
    return dataclasses.replace(exact, E_transverse=None, nu_transverse=None, G_transverse=None)


def self_consistent(matrix: TransverseIsotropy, fibres: Sequence[Fibres]) -> Estimate:
    """Estimate the constants for one kind of fibres, also on springs, by Christensen and Lo's method.

    k, E_A, nu_A, G_A and the expansions come from `composite_cylinders`, G_T from `transverse_shear`; E_T and nu_T
    follow.  Christensen and Lo 1979; springs on fibres of equal radius: Hashin 1990.
    """
    x, G = cylinders_in_matrix(matrix, fibres), transverse_shear(matrix, fibres[0])
    table = engineering_constants.elastic_constants(x.E_axial, x.nu_axial, x.G_axial, G, x.K_transverse)
    return dataclasses.replace(Estimate.of(x), **table)


def transverse_shear(matrix: TransverseIsotropy, family: Fibres) -> float:
    """Return the shear modulus m* of the medium whose energy a coated fibre does not change.

    Under shear across the fibre, the displacement u = u_1 + i u_2 and the resultant F = phi + z conj(phi') + conj(psi)
    of Muskhelishvili's potentials phi and psi have two harmonics on a circle z = r exp(i t): exp(-i t), with index 1,
    and exp(3 i t), with index 3.  As the coated fibre stores the energy of the medium that it replaces, phi has no term
    1/z in the medium, and so 2 m* u = -F (Eshelby).  In the matrix with moduli m and k, P = F + 2 m u and
    kappa_m = 1 + 2 m/k,

        P_1 ~ 1/r,  P_3 ~ r^3,  F_1 - (3 P_3 + P_1)/(kappa_m + 1) ~ r,  F_3 - (P_3 - P_1)/(kappa_m + 1) ~ 1/r^3,

    and at the fibre 2 m u = V F.  A homogeneous fibre has V = diag(-m/m_f, m/m_f + 2 m/k_f); springs with
    q_i = 1/(k_i a) add m [[-(q_n + q_t), 3 (q_n - q_t)], [-(q_n - q_t), 3 (q_n + q_t)]], and m_e of `equivalent_fibre`
    has m/m_e = V13 V31/(1 + V33) - V11.  With two unknowns y at the fibre, P = A y and F = B y at the outer radius,
    where P = (1 - m/m*) F: det(A - (1 - m/m*) B) = 0, Christensen and Lo's quadratic, has one positive root m*, because
    V is indefinite, as for a homogeneous cylinder.
    """
    fibre, c, m = family.constants, family.fraction, matrix.G_transverse
    normal, tangential, _ = (0.0, 0.0, 0.0) if family.springs is None else family.springs.compliances
    total, difference = m * (normal + tangential), m * (normal - tangential)
    ratio = phase_bounds.equivalent_fibre(family, matrix).G_transverse / m  # m_e/m
    d = 1 / (1 + m / fibre.G_transverse + 2 * m / fibre.K_transverse + 3 * total)  # 1/(1 + V33)
    w, v = -difference * d * ratio, 3 * difference * d  # (m_e/m) V31/(1 + V33) and V13/(1 + V33)
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


METHODS: Mapping[str, Callable[[TransverseIsotropy, Sequence[Fibres]], Estimate]] = {
    method.__name__: method
    for method in (rule_of_mixtures, chamis, halpin_tsai, mori_tanaka, composite_cylinders, self_consistent)
}
