"""Engineering moduli of a plane stiffness, and bounds that its phases set to it.

Stiffnesses are (3, 3) in Voigt order [11, 22, 12] with engineering shear, in any unit of stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.system.runtime.records import STRESS, described
from feti_homog.typing import Array, Float


@dataclass(frozen=True)
class Moduli:
    """Moduli in the plane; in plane strain E and nu are those of the plane state, not of the bulk material.

    nu_ij = -eps_j/eps_i under stress along i; eta_i = gamma_12/eps_i under the same (mutual influence);
    `bulk` and `shear` are those of the nearest isotropic stiffness, `anisotropy` the relative distance to it.
    """

    E1: float = described("Young's modulus along x1", STRESS)
    E2: float = described("Young's modulus along x2", STRESS)
    nu12: float = described("contraction along x2 under stress along x1")
    nu21: float = described("contraction along x1 under stress along x2")
    G12: float = described("shear modulus in the axes of the cell", STRESS)
    eta1: float = described("shear strain gamma12 over the strain along x1 under stress along x1")
    eta2: float = described("shear strain gamma12 over the strain along x2 under stress along x2")
    bulk: float = described("plane bulk modulus of the nearest isotropic stiffness", STRESS)
    shear: float = described("shear modulus of the nearest isotropic stiffness", STRESS)
    anisotropy: float = described("relative distance to the nearest isotropic stiffness")


@dataclass(frozen=True)
class Bounds:
    """Lower and upper bound of the plane bulk modulus and of the shear modulus."""

    bulk: tuple[float, float] = described("lower and upper bound of the plane bulk modulus", STRESS, "(2,)")
    shear: tuple[float, float] = described("lower and upper bound of the shear modulus", STRESS, "(2,)")


def engineering_moduli(stiffness: ArrayLike) -> Moduli:
    """Return the moduli of a stiffness. Raises numpy.linalg.LinAlgError if it is singular."""
    s = np.linalg.inv(np.asarray(stiffness, dtype=float))
    bulk, shear = isotropic_part(stiffness)
    values = plane_constants(s) | {"eta1": s[2, 0] / s[0, 0], "eta2": s[2, 1] / s[1, 1]}
    values |= {"bulk": bulk, "shear": shear, "anisotropy": anisotropy(stiffness)}
    return Moduli(**{name: float(value) for name, value in values.items()})


def plane_constants(S: Array) -> dict[str, Any]:
    """E_i = 1/S_ii, nu_ij = -S_ji/S_ii and G12 = 1/S_33 of a compliance (3, 3), real or complex."""
    found = {"E1": 1 / S[0, 0], "E2": 1 / S[1, 1], "nu12": -S[1, 0] / S[0, 0], "nu21": -S[0, 1] / S[1, 1]}
    return found | {"G12": 1 / S[2, 2]}


def isotropic_part(stiffness: ArrayLike) -> tuple[float, float]:
    """Plane bulk modulus k and shear modulus mu of the isotropic stiffness nearest in the Frobenius norm.

    k = (C11 + C22 + C12 + C21)/4, mu = (C11 + C22 - C12 - C21 + 4 C33)/8; both are the same in all axes.
    """
    c = np.asarray(stiffness, dtype=float)
    bulk = (c[0, 0] + c[1, 1] + c[0, 1] + c[1, 0]) / 4
    shear = (c[0, 0] + c[1, 1] - c[0, 1] - c[1, 0] + 4 * c[2, 2]) / 8
    return float(bulk), float(shear)


def isotropic_stiffness(bulk: float, shear: float) -> Float:
    """C11 = C22 = k + mu, C12 = k - mu, C33 = mu."""
    plus, minus = bulk + shear, bulk - shear
    return np.array([[plus, minus, 0.0], [minus, plus, 0.0], [0.0, 0.0, shear]])


def anisotropy(stiffness: ArrayLike) -> float:
    """||C - C_iso|| / ||C|| as fourth-order tensors, C_iso the nearest isotropic; the same in all axes."""
    c = np.asarray(stiffness, dtype=float)
    mandel = np.outer([1, 1, np.sqrt(2)], [1, 1, np.sqrt(2)])  # turns the norm into that of the tensor
    rest = c - isotropic_stiffness(*isotropic_part(c))
    return float(np.linalg.norm(mandel * rest) / np.linalg.norm(mandel * c))


def voigt(fractions: ArrayLike, stiffnesses: ArrayLike) -> Float:
    """Upper bound sum c_i C_i, (3, 3), of fractions (n,) and stiffnesses (n, 3, 3)."""
    return np.asarray(np.einsum("i,ijk->jk", np.asarray(fractions, float), np.asarray(stiffnesses, float)))


def reuss(fractions: ArrayLike, stiffnesses: ArrayLike) -> Float:
    """Lower bound (sum c_i C_i^-1)^-1, (3, 3), of fractions (n,) and stiffnesses (n, 3, 3)."""
    return np.asarray(np.linalg.inv(voigt(fractions, np.linalg.inv(np.asarray(stiffnesses, dtype=float)))))


def is_isotropic(stiffness: ArrayLike) -> bool:
    return anisotropy(stiffness) < 1e-9


def hashin_shtrikman(fractions: ArrayLike, stiffnesses: Sequence[ArrayLike]) -> Bounds:
    """Bounds of an isotropic composite of isotropic phases, (n,) and (n, 3, 3), in the plane.

    k* = (sum c_i/(k_i + mu0))^-1 - mu0, mu* = (sum c_i/(mu_i + h0))^-1 - h0, h0 = k0 mu0/(k0 + 2 mu0), with
    k0, mu0 the least moduli of the phases for the lower bound and the greatest for the upper (Hashin 1965,
    Walpole 1969). That of k holds for a composite of square symmetry too. Raises ValueError if a phase is not
    isotropic.
    """
    if not all(map(is_isotropic, stiffnesses)):
        raise ValueError("the Hashin-Shtrikman bounds hold for isotropic phases")
    c = np.asarray(fractions, dtype=float)
    bulk, shear = np.array([isotropic_part(stiffness) for stiffness in stiffnesses]).T

    def bounds(k0: float, mu0: float) -> tuple[float, float]:
        h0 = k0 * mu0 / (k0 + 2 * mu0)
        return float(1 / np.sum(c / (bulk + mu0)) - mu0), float(1 / np.sum(c / (shear + h0)) - h0)

    lower, upper = bounds(bulk.min(), shear.min()), bounds(bulk.max(), shear.max())
    return Bounds(bulk=(lower[0], upper[0]), shear=(lower[1], upper[1]))
