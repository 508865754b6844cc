"""Compute the named constants of a stiffness, and describe their symbols and axes.

Stiffnesses C are (3, 3) in Voigt order [11, 22, 12], or (6, 6) in the order [11, 22, 33, 23, 13, 12] with x3 along the
fibres, with engineering shears, in any stress unit.  Expansions (6,) are strains per unit of temperature.  The index A
means axial, T transverse.

Axes 1, 2, 3 of a cell are x1 and x2, across the fibres, and x3, along them.  Axes 1, 2, 3 of a ply, of data sheets and
of cards are x3, x1, x2: names with `axial`, `transverse`, `x1` or `x2` are the same in both.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from feti_homog.materials.laws import COUPLINGS, ISOTROPY
from feti_homog.materials.material_forms import PER_TEMPERATURE
from feti_homog.materials.voigt import EXPANSIONS, IN_PLANE_BLOCK, THERMAL_STRESSES
from feti_homog.system.runtime import described, records
from feti_homog.typing import Array, Float

DIRECTIONS = 720  # number of directions across the fibres

# Factors for the components of a stiffness, (3, 3) or (6, 6), that make their norm the Frobenius norm of the tensor.
_MANDEL = {n: np.sqrt(np.outer(scale, scale)) for n, scale in ((3, [1, 1, 2]), (6, [1, 1, 1, 2, 2, 2]))}


@dataclass(frozen=True)
class Moduli:
    """Moduli in the plane; in plane strain E and nu belong to the plane state, not to the bulk material.

    nu_ij = -eps_j/eps_i and eta_i = gamma_12/eps_i (mutual influence) under stress along i; `bulk` and `shear` belong
    to the nearest isotropic stiffness, and `anisotropy` is the relative distance to it.
    """

    E1: float = described("Young's modulus along x1", records.STRESS)
    E2: float = described("Young's modulus along x2", records.STRESS)
    nu12: float = described("contraction along x2 under stress along x1")
    nu21: float = described("contraction along x1 under stress along x2")
    G12: float = described("shear modulus in the axes of the cell", records.STRESS)
    eta1: float = described("shear strain gamma12 over the strain along x1 under stress along x1")
    eta2: float = described("shear strain gamma12 over the strain along x2 under stress along x2")
    bulk: float = described("plane bulk modulus of the nearest isotropic stiffness", records.STRESS)
    shear: float = described("shear modulus of the nearest isotropic stiffness", records.STRESS)
    anisotropy: float = described("relative distance to the nearest isotropic stiffness")


@dataclass(frozen=True)
class EngineeringConstants:
    """Constants in the cell's axes: nu_ij = -eps_j/eps_i under stress along i."""

    E1: float = described("Young's modulus along x1", records.STRESS)
    E2: float = described("Young's modulus along x2", records.STRESS)
    E3: float = described("Young's modulus along x3, the fibres", records.STRESS)
    nu12: float = described("contraction along x2 under stress along x1")
    nu13: float = described("contraction along x3 under stress along x1")
    nu23: float = described("contraction along x3 under stress along x2")
    G12: float = described("shear modulus in the plane across the fibres", records.STRESS)
    G13: float = described("shear modulus of x1 and the fibres", records.STRESS)
    G23: float = described("shear modulus of x2 and the fibres", records.STRESS)


@dataclass(frozen=True)
class TransverseIsotropy:
    """Constants of the nearest material isotropic about x3; five of the seven elastic constants are independent."""

    E_axial: float = described("Young's modulus along the fibres", records.STRESS)
    E_transverse: float = described("Young's modulus across the fibres", records.STRESS)
    nu_axial: float = described("contraction across the fibres under stress along them")
    nu_transverse: float = described("contraction across the fibres under stress across them")
    G_axial: float = described("shear modulus along the fibres", records.STRESS)
    G_transverse: float = described("shear modulus across the fibres", records.STRESS)
    K_transverse: float = described("bulk modulus across the fibres in plane strain", records.STRESS)
    expansion_axial: float | None = described("expansion along the fibres; null if a phase gives none", PER_TEMPERATURE)
    expansion_transverse: float | None = described("expansion across the fibres; or null, too", PER_TEMPERATURE)
    deviation: float = described(
        "relative distance of the stiffness, as a fourth-order tensor, to the nearest transversely isotropic one"
    )


@dataclass(frozen=True)
class TransverseModuli:
    """Ranges of the moduli across the fibres, over 720 directions in half a turn about x3."""

    E_least: float = described("least Young's modulus across the fibres", records.STRESS)
    E_largest: float = described("largest Young's modulus across the fibres", records.STRESS)
    G_least: float = described("least shear modulus in the plane across the fibres", records.STRESS)
    G_largest: float = described("largest shear modulus in the plane across the fibres", records.STRESS)


def constants(C: Array, heat: Array | None = None) -> dict[str, Any]:
    """Tabulate the constants of a stiffness C, real or complex, by name.

    The table has Cij of the upper triangle without COUPLINGS, and E_i = 1/S_ii, nu_ij = -S_ji/S_ii, G_ij = 1/S_kk with
    S = C^-1 and the position k of shear ij; in space also the constants of `about_fibres` and, if `heat` (6,) is the
    stress under a unit temperature, its normal stresses, the free normal strains -S heat and their mean across the
    fibres.  Raises numpy.linalg.LinAlgError if C is singular.
    """
    S, n = np.linalg.inv(C), len(C)
    entries = [(i, j) for i in range(n) for j in range(i, n) if n == 3 or (i, j) not in COUPLINGS]
    table = {f"C{i + 1}{j + 1}": C[i, j] for i, j in entries} | along_axes(S)
    if n == 3:
        return table
    table |= about_fibres(C)
    if heat is not None:
        strains = -S @ heat
        for names, values in ((THERMAL_STRESSES, heat), (EXPANSIONS, strains)):
            table |= dict(zip(names[:3], values, strict=False))
        table["expansion_transverse"] = (strains[0] + strains[1]) / 2
    return table


def along_axes(S: Array) -> dict[str, Any]:
    """Tabulate the moduli and ratios of a compliance, (3, 3) or (6, 6), along the axes of the cell."""
    is_plane = len(S) == 3
    pairs = ((0, 1), (1, 0)) if is_plane else ((0, 1), (0, 2), (1, 2))
    table = {f"E{i + 1}": 1 / S[i, i] for i in range(2 if is_plane else 3)}
    table |= {f"nu{i + 1}{j + 1}": -S[j, i] / S[i, i] for i, j in pairs}
    shears = ("G12",) if is_plane else ("G12", "G13", "G23")
    return table | {name: 1 / S[-k, -k] for k, name in enumerate(shears, 1)}


def about_fibres(C: Array) -> dict[str, Any]:
    """Tabulate the constants of the transversely isotropic stiffness nearest to C, (6, 6) real or complex.

    The nearest stiffness in the Frobenius norm is the mean of C and C^T over all turns about x3, with Hill's moduli

        k = (C11 + C22 + 2 C12)/4,  l = (C13 + C23)/2,  n = C33,  m = (C11 + C22 - 2 C12 + 4 C66)/8,  p = (C44 + C55)/2,

    where Cij means (Cij + Cji)/2, because for nearly incompressible phases the rounding of C12 - C21 is not small
    beside m.  The moduli are equal in all axes turned about x3; E_axial = n - l^2/k, nu_axial = l/(2 k), G_axial = p,
    G_transverse = m, K_transverse = k (Hill 1964).
    """
    k, m = isotropic_part(C[IN_PLANE_BLOCK])
    across = (C[0, 2] + C[1, 2] + C[2, 0] + C[2, 1]) / 4
    return elastic_constants(C[2, 2] - across**2 / k, across / (2 * k), (C[3, 3] + C[4, 4]) / 2, m, k)


def elastic_constants(E_axial: Any, nu_axial: Any, G_axial: Any, G: Any, K: Any) -> dict[str, Any]:
    """Tabulate all constants from G and K across the fibres: 4/E_T = 1/K + 1/G + 4 nu_A^2/E_A, nu_T = E_T/(2 G) - 1."""
    E = 4 / (1 / K + 1 / G + 4 * nu_axial**2 / E_axial)
    return {
        "E_axial": E_axial, "E_transverse": E, "nu_axial": nu_axial, "nu_transverse": E / (2 * G) - 1,
        "G_axial": G_axial, "G_transverse": G, "K_transverse": K,
    }  # fmt: skip


def engineering_moduli(stiffness: ArrayLike) -> Moduli:
    """Return the moduli of a plane stiffness (3, 3).  Raises numpy.linalg.LinAlgError if it is singular."""
    C = np.asarray(stiffness, dtype=float)
    S, (bulk, shear) = np.linalg.inv(C), isotropic_part(C)
    table = along_axes(S) | {"eta1": S[2, 0] / S[0, 0], "eta2": S[2, 1] / S[1, 1], "bulk": bulk, "shear": shear}
    return Moduli(**{name: float(value) for name, value in table.items()}, anisotropy=anisotropy(C))


def isotropic_part(stiffness: ArrayLike) -> tuple[Any, Any]:
    """Return the bulk modulus k and shear modulus mu of the isotropic stiffness nearest to C (3, 3), real or complex.

    k = (C11 + C22 + C12 + C21)/4 and mu = (C11 + C22 - C12 - C21 + 4 C33)/8 are nearest in the Frobenius norm of
    tensors.  Turns of the axes change neither.
    """
    c = np.asarray(stiffness)
    off = c[0, 1] + c[1, 0]
    return (c[0, 0] + c[1, 1] + off) / 4, (c[0, 0] + c[1, 1] - off + 4 * c[2, 2]) / 8


def isotropic_stiffness(bulk: float, shear: float) -> Float:
    """Return the isotropic stiffness (3, 3) with bulk k and shear mu: C11 = C22 = k + mu, C12 = k - mu, C33 = mu."""
    plus, minus = bulk + shear, bulk - shear
    return np.array([[plus, minus, 0.0], [minus, plus, 0.0], [0.0, 0.0, shear]])


def anisotropy(stiffness: ArrayLike) -> float:
    """Return the relative distance ||C - C_iso|| / ||C|| of C (3, 3) to the nearest isotropic stiffness C_iso."""
    c = np.asarray(stiffness, dtype=float)
    return _distance(c, isotropic_stiffness(*isotropic_part(c)))


def _distance(C: Float, nearest: Float) -> float:
    """Return the relative distance ||C - nearest|| / ||C|| in the Frobenius norm of tensors."""
    scale = _MANDEL[len(C)]
    return float(np.linalg.norm(scale * (C - nearest)) / np.linalg.norm(scale * C))


def engineering_constants(stiffness: ArrayLike) -> EngineeringConstants:
    """Return the constants of a spatial stiffness (6, 6).  Raises numpy.linalg.LinAlgError if it is singular."""
    table = along_axes(np.linalg.inv(np.asarray(stiffness, dtype=float)))
    return EngineeringConstants(**{name: float(value) for name, value in table.items()})


def transversely_isotropic_part(stiffness: ArrayLike, expansion: ArrayLike | None = None) -> TransverseIsotropy:
    """Return the constants of the transversely isotropic material nearest to a stiffness C (6, 6), see `about_fibres`.

    `deviation` is ||C - C_nearest|| / ||C||.  `expansion` (6,) gives alpha_33 and (alpha_11 + alpha_22)/2, else None.
    """
    c = np.asarray(stiffness, dtype=float)
    table = {name: float(value) for name, value in about_fibres(c).items()}
    strains: tuple[float | None, float | None] = (None, None)
    if expansion is not None:
        alpha = np.asarray(expansion, dtype=float)
        strains = float(alpha[2]), float(alpha[0] + alpha[1]) / 2
    nearest = TransverseIsotropy(**table, expansion_axial=strains[0], expansion_transverse=strains[1], deviation=0.0)
    return replace(nearest, deviation=_distance(c, transversely_isotropic_stiffness(nearest)))


def transversely_isotropic_stiffness(constants: TransverseIsotropy) -> Float:
    """Return the stiffness C (6, 6) of constants with k = K_transverse and m = G_transverse.

    C11 = C22 = k + m, C12 = k - m, C13 = C23 = 2 nu_A k, C33 = E_A + 4 nu_A^2 k, C44 = C55 = G_A, C66 = m.
    """
    k, m = constants.K_transverse, constants.G_transverse
    across = 2 * constants.nu_axial * k
    along = constants.E_axial + 2 * constants.nu_axial * across
    c = np.diag([k + m, k + m, along, constants.G_axial, constants.G_axial, m])
    c[0, 1] = c[1, 0] = k - m
    c[:2, 2] = c[2, :2] = across
    return c


def is_transversely_isotropic(constants: TransverseIsotropy) -> bool:
    """Return whether the stiffness behind these constants is transversely isotropic, up to rounding."""
    return constants.deviation < ISOTROPY


def transverse_moduli(stiffness: ArrayLike) -> TransverseModuli:
    """Return the ranges of E and G of a stiffness (6, 6) over DIRECTIONS directions n across x3.

    1/E = sigma:S:sigma with the compliance S and sigma = n n; 1/G likewise with sigma = n t + t n, where t is normal to
    n and x3.  Raises numpy.linalg.LinAlgError if the stiffness is singular.
    """
    angle = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    c, s, zero = np.cos(angle), np.sin(angle), np.zeros(DIRECTIONS)
    compliance = np.linalg.inv(np.asarray(stiffness, dtype=float))
    pulled = np.stack([c * c, s * s, zero, zero, zero, c * s])
    sheared = np.stack([-2 * c * s, 2 * c * s, zero, zero, zero, c * c - s * s])
    E, G = (1 / np.einsum("in,ij,jn->n", stress, compliance, stress) for stress in (pulled, sheared))
    return TransverseModuli(float(E.min()), float(E.max()), float(G.min()), float(G.max()))


CELL_AXES = "axes of the cell, x3 along the fibres"
MATERIAL_AXES = "Material axes: 1 along the fibres (x3 of the cell), 2 and 3 across (x1, x2)"
ALONG, ACROSS = "along", "across"
MATERIAL_EXPANSIONS = ("expansion_axial", "expansion_x1", "expansion_x2", *EXPANSIONS[3:])
"""Names of the expansions in the order of material axes; `voigt.EXPANSIONS` has the names in the order of cell axes."""


class Constant(NamedTuple):
    """Symbol and direction of a constant, and its names on a transversely isotropic material card."""

    symbol: str
    way: str
    card: tuple[str, ...] = ()


ABOUT_FIBRES = {
    "E_axial": Constant("$E$", ALONG, ("E1",)),
    "E_transverse": Constant("$E$", ACROSS, ("E2", "E3")),
    "nu_axial": Constant("$\\nu$", ALONG, ("nu12", "nu13")),
    "nu_transverse": Constant("$\\nu$", ACROSS, ("nu23",)),
    "G_axial": Constant("$G$", ALONG, ("G12", "G13")),
    "G_transverse": Constant("$G$", ACROSS, ("G23",)),
    "K_transverse": Constant("$K$", ACROSS),
    "expansion_axial": Constant("$\\alpha$", ALONG, ("expansion_axial",)),
    "expansion_transverse": Constant("$\\alpha$", ACROSS, ("expansion_transverse",)),
}
"""Constants of the nearest transversely isotropic material, by name."""
OF_THE_CELL = {"E1": "E3", "E2": "E1", "E3": "E2", "G12": "G13", "G13": "G23", "G23": "G12",
               "nu12": "nu31", "nu13": "nu32", "nu23": "nu12"}  # fmt: skip
"""Names of constants in cell axes, by their names in material axes."""
_PLACES = (("expansion.", EXPANSIONS), ("thermal_stress.", THERMAL_STRESSES), ("alpha", MATERIAL_EXPANSIONS))
FORMER = {f"{former}{k + 1}": names[k] for former, names in _PLACES for k in range(3)}
"""Removed names of constants, each with the name that replaces it."""
# Names with another meaning in a ply: kind and direction in a cell, and the names for the other direction.
_READ_EITHER_WAY = {
    "E1": ("Young's modulus", ACROSS, "E_axial"), "E3": ("Young's modulus", ALONG, "E_transverse"),
    "G12": ("shear", ACROSS, "G_axial"), "G23": ("shear", ALONG, "G_transverse"),
    "nu12": ("contraction under stress", ACROSS, "nu_axial"),
    "nu13": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "nu23": ("contraction of x3 under stress", ACROSS, "nu_axial"),
    "S11": ("stress", ACROSS, "S33"), "S33": ("stress", ALONG, "S11, S22"),
    "S12": ("shear", ACROSS, "S13, S23"), "S23": ("shear", ALONG, "S12"),
    "E11": ("strain", ACROSS, "E33"), "E33": ("strain", ALONG, "E11, E22"),
    "gamma12": ("shear", ACROSS, "gamma13, gamma23"), "gamma23": ("shear", ALONG, "gamma12"),
}  # fmt: skip


def axes_line(names: Iterable[str]) -> str:
    """Explain the directions of names with another meaning in a ply, such as `S12`; '' without such names."""
    lines = []
    for name in dict.fromkeys(name.rpartition("_")[2] for name in names):
        if name in _READ_EITHER_WAY:
            kind, way, others = _READ_EITHER_WAY[name]
            other_way = ALONG if way == ACROSS else ACROSS
            lines.append(f"{name} is {kind} {way} the fibres; {other_way} them {others}")
    return ". ".join(lines)
