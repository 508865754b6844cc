"""Engineering constants of a spatial stiffness, and the nearest transversely isotropic one about the fibres.

Stiffnesses are (6, 6) in Voigt order [11, 22, 33, 23, 13, 12] with engineering shear, in any unit of stress; x3 is the
direction of the fibres.  Expansions are strains per unit of temperature, (6,) in the same order.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.materials.forms import PER_TEMPERATURE
from feti_homog.system.runtime.records import STRESS, described
from feti_homog.typing import Array, Float

DIRECTIONS = 720  # across the fibres
TRANSVERSELY_ISOTROPIC = 1e-9  # relative distance to the nearest transversely isotropic stiffness, from rounding

# Turns a (6, 6) matrix of the components of a stiffness into one of the same Frobenius norm as the tensor.
_MANDEL = np.sqrt(np.outer([1, 1, 1, 2, 2, 2], [1, 1, 1, 2, 2, 2]))


@dataclass(frozen=True)
class EngineeringConstants:
    """Constants in the axes of the cell: nu_ij = -eps_j/eps_i under stress along i."""

    E1: float = described("Young's modulus along x1", STRESS)
    E2: float = described("Young's modulus along x2", STRESS)
    E3: float = described("Young's modulus along x3, the fibres", STRESS)
    nu12: float = described("contraction along x2 under stress along x1")
    nu13: float = described("contraction along x3 under stress along x1")
    nu23: float = described("contraction along x3 under stress along x2")
    G12: float = described("shear modulus in the plane across the fibres", STRESS)
    G13: float = described("shear modulus of x1 and the fibres", STRESS)
    G23: float = described("shear modulus of x2 and the fibres", STRESS)


@dataclass(frozen=True)
class TransverselyIsotropic:
    """Constants of the nearest transversely isotropic material about x3; five of the first seven are independent."""

    E_axial: float = described("Young's modulus along the fibres", STRESS)
    E_transverse: float = described("Young's modulus across the fibres", STRESS)
    nu_axial: float = described("contraction across the fibres under stress along them")
    nu_transverse: float = described("contraction across the fibres under stress across them")
    G_axial: float = described("shear modulus along the fibres", STRESS)
    G_transverse: float = described("shear modulus across the fibres", STRESS)
    K_transverse: float = described("bulk modulus across the fibres in plane strain", STRESS)
    expansion_axial: float | None = described(
        "expansion along the fibres; null if a phase does not give its own", PER_TEMPERATURE
    )
    expansion_transverse: float | None = described("expansion across the fibres; null likewise", PER_TEMPERATURE)
    deviation: float = described(
        "relative distance of the stiffness, as a fourth-order tensor, to the nearest transversely isotropic one"
    )


@dataclass(frozen=True)
class TransverseModuli:
    """Range of moduli across the fibres, of 720 directions in half a turn about x3."""

    E_least: float = described("least Young's modulus across the fibres", STRESS)
    E_largest: float = described("the largest one", STRESS)
    G_least: float = described("least shear modulus in the plane across the fibres", STRESS)
    G_largest: float = described("the largest one", STRESS)


def transverse_moduli(stiffness: ArrayLike) -> TransverseModuli:
    """Return the ranges of 1/E = sigma:S:sigma, sigma = n n, and 1/G, sigma = n t + t n, n across x3, t across both.

    Raises numpy.linalg.LinAlgError if C is singular.
    """
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)
    compliance = np.linalg.inv(np.asarray(stiffness, dtype=float))
    pulled = np.stack([c * c, s * s, zero, zero, zero, c * s])
    sheared = np.stack([-2 * c * s, 2 * c * s, zero, zero, zero, c * c - s * s])
    E, G = (1 / np.einsum("in,ij,jn->n", stress, compliance, stress) for stress in (pulled, sheared))
    return TransverseModuli(*(float(value) for value in (E.min(), E.max(), G.min(), G.max())))


def engineering_constants(stiffness: ArrayLike) -> EngineeringConstants:
    """Return the constants of a stiffness, as `constants_along_axes`. Raises numpy.linalg.LinAlgError if singular."""
    found = constants_along_axes(np.linalg.inv(np.asarray(stiffness, dtype=float)))
    return EngineeringConstants(**{name: float(value) for name, value in found.items()})


def constants_along_axes(S: Array) -> dict[str, Any]:
    """E_i = 1/S_ii, nu_ij = -S_ji/S_ii and G_ij = 1/S_kk of a compliance (6, 6), real or complex, in this order."""
    found = {f"E{i + 1}": 1 / S[i, i] for i in range(3)}
    found |= {f"nu{i + 1}{j + 1}": -S[j, i] / S[i, i] for i, j in ((0, 1), (0, 2), (1, 2))}
    return found | {"G12": 1 / S[5, 5], "G13": 1 / S[4, 4], "G23": 1 / S[3, 3]}


def constants_about_fibres(C: Array) -> dict[str, Any]:
    """Constants of the transversely isotropic stiffness about x3 nearest to C, (6, 6) real or complex.

    Nearest in the Frobenius norm of the tensors is the mean of C and C^T over all turns about x3, in Hill's moduli

        k = (C11 + C22 + 2 C12)/4,  l = (C13 + C23)/2,  n = C33,  m = (C11 + C22 - 2 C12 + 4 C66)/8,  p = (C44 + C55)/2,

    where Cij is the mean of Cij and Cji: between nearly incompressible phases what rounding leaves of C12 - C21 is not
    small beside m.  They are the same in all axes turned about x3; E_axial = n - l^2/k, nu_axial = l/(2 k),
    G_axial = p, G_transverse = m, K_transverse = k (Hill 1964).
    """
    off = C[0, 1] + C[1, 0]
    k = (C[0, 0] + C[1, 1] + off) / 4
    m = (C[0, 0] + C[1, 1] - off + 4 * C[5, 5]) / 8
    across = (C[0, 2] + C[1, 2] + C[2, 0] + C[2, 1]) / 4
    E, nu = C[2, 2] - across**2 / k, across / (2 * k)
    E_transverse, nu_transverse = transverse_constants(E, nu, k, m)
    return {
        "E_axial": E, "E_transverse": E_transverse, "nu_axial": nu, "nu_transverse": nu_transverse,
        "G_axial": (C[3, 3] + C[4, 4]) / 2, "G_transverse": m, "K_transverse": k,
    }  # fmt: skip


def transversely_isotropic_part(stiffness: ArrayLike, expansion: ArrayLike | None = None) -> TransverselyIsotropic:
    """Constants of a stiffness C as `constants_about_fibres`, and `deviation`, ||C - C_nearest|| / ||C||.

    The expansion is the mean over the same turns, alpha_33 and (alpha_11 + alpha_22)/2.
    """
    c = np.asarray(stiffness, dtype=float)
    found = {name: float(value) for name, value in constants_about_fibres(c).items()}
    strains = None if expansion is None else np.asarray(expansion, dtype=float)
    nearest = TransverselyIsotropic(
        **found,
        expansion_axial=None if strains is None else float(strains[2]),
        expansion_transverse=None if strains is None else float(strains[0] + strains[1]) / 2,
        deviation=0.0,
    )
    rest = c - transversely_isotropic_stiffness(nearest)
    return replace(nearest, deviation=float(np.linalg.norm(_MANDEL * rest) / np.linalg.norm(_MANDEL * c)))


def transversely_isotropic_stiffness(constants: TransverselyIsotropic) -> Float:
    """(6, 6) C11 = C22 = k + m, C12 = k - m, C13 = C23 = 2 nu_A k, C33 = E_A + 4 nu_A^2 k, C44 = C55 = G_A, C66 = m."""
    k, m = constants.K_transverse, constants.G_transverse
    across = 2 * constants.nu_axial * k
    along = constants.E_axial + 2 * constants.nu_axial * across
    c = np.diag([k + m, k + m, along, constants.G_axial, constants.G_axial, m])
    c[0, 1] = c[1, 0] = k - m
    c[:2, 2] = c[2, :2] = across
    return c


def transverse_constants(E_axial: float, nu_axial: float, bulk: float, shear: float) -> tuple[float, float]:
    """E_T and nu_T: 4/E_T = 1/k + 1/m + 4 nu_A^2/E_A and nu_T = E_T/(2 m) - 1 (Hill 1964)."""
    E_transverse = 4 / (1 / bulk + 1 / shear + 4 * nu_axial**2 / E_axial)
    return E_transverse, E_transverse / (2 * shear) - 1


def is_transversely_isotropic(constants: TransverselyIsotropic) -> bool:
    """Return whether the stiffness of which these are the constants is, up to rounding."""
    return constants.deviation < TRANSVERSELY_ISOTROPIC
