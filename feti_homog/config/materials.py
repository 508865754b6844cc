"""Linear elastic phases and their plane stiffness in Voigt order [11, 22, 12] with engineering shear."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from feti_homog.config.schema import key
from feti_homog.config.values import ValueType, is_number, real
from feti_homog.config.wording import limit_in_words, toml_value
from feti_homog.typing import Float

Matrix3 = tuple[tuple[float, float, float], ...]

POSITIVE = real(above=0.0)


def _is_triple(row: object) -> bool:
    return isinstance(row, list | tuple) and len(row) == 3 and all(map(is_number, row))


def _is_matrix(value: object) -> bool:
    return isinstance(value, list | tuple) and len(value) == 3 and all(map(_is_triple, value))


def _to_matrix(value: Any) -> Matrix3:
    return tuple(tuple(float(entry) for entry in row) for row in value)  # type: ignore[misc]


def _three(items: Mapping[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": 3, "maxItems": 3}


MATRIX = ValueType(
    "a symmetric 3x3 array of numbers in the order 11, 22, 12",
    _is_matrix,
    _to_matrix,
    _three(_three(real().json_schema)),
)


@dataclass(frozen=True)
class Isotropic:
    """Young's modulus and Poisson's ratio."""

    young: float = key(POSITIVE, "Young's modulus.", unit="stress")
    poisson: float = key(real(above=-1.0, most=0.5), "Poisson's ratio; in plane strain below 0.5.")


@dataclass(frozen=True, kw_only=True)
class Orthotropic:
    """Engineering constants along the material axes; nu_ij = -eps_j/eps_i under stress along i.

    So nu_ij/E_i = nu_ji/E_j. The constants out of the plane (E3, nu13, nu23) are needed for plane strain only.
    """

    E1: float = key(POSITIVE, "Young's modulus along axis 1.", unit="stress")
    E2: float = key(POSITIVE, "Young's modulus along axis 2.", unit="stress")
    E3: float | None = key(
        POSITIVE, "Young's modulus out of the plane; plane strain needs it.", unit="stress", default=None
    )
    nu12: float = key(real(), "Poisson's ratio in the plane; nu12^2 < E1/E2.")
    nu13: float | None = key(real(), "Poisson's ratio out of the plane; plane strain needs it.", default=None)
    nu23: float | None = key(real(), "Poisson's ratio out of the plane; plane strain needs it.", default=None)
    G12: float = key(POSITIVE, "Shear modulus in the plane.", unit="stress")
    angle: float = key(real(), "Direction of axis 1, from x1 towards x2.", unit="degrees", default=0.0)


@dataclass(frozen=True)
class General:
    """The plane stiffness itself, for whichever plane state the case asks for."""

    stiffness: Matrix3 = key(MATRIX, "The plane stiffness, symmetric and positive definite.", unit="stress")


Material = Isotropic | Orthotropic | General
MATERIAL_FORMS: dict[str, type[Isotropic] | type[Orthotropic] | type[General]] = {
    "isotropic": Isotropic,
    "orthotropic": Orthotropic,
    "general": General,
}


def plane_stiffness(material: Material, plane: str) -> Float:
    """C with [S11, S22, S12] = C [E11, E22, gamma12], (3, 3), symmetric positive definite, unit of stress.

    `plane` is "strain" or "stress". Raises ValueError, with the keys at fault, if the constants are those of
    no stable material.
    """
    if isinstance(material, Isotropic):
        return _isotropic(material, plane)
    if isinstance(material, Orthotropic):
        return rotated(np.asarray(np.linalg.inv(_orthotropic_compliance(material, plane)), float), material.angle)
    stiffness = np.array(material.stiffness)
    if not np.allclose(stiffness, stiffness.T, rtol=0.0, atol=1e-9 * np.abs(stiffness).max()):
        raise ValueError(f"stiffness = {toml_value(material.stiffness)}: expected a symmetric matrix")
    if not is_positive_definite(stiffness):
        raise ValueError(f"stiffness = {toml_value(material.stiffness)}: expected a positive definite matrix")
    return np.asarray((stiffness + stiffness.T) / 2.0)


def out_of_plane(material: Material, plane: str) -> tuple[Float, Float]:
    """s and e, (3,) each, with S33 = s . [S11, S22, S12] and E33 = e . [S11, S22, S12].

    S33 vanishes in plane stress, E33 in plane strain. NaN if the constants of the material do not say it.
    """
    row, young = _compliance_33(material)
    return (np.zeros(3), row) if plane == "stress" else (-young * row, np.zeros(3))


def _compliance_33(material: Material) -> tuple[Float, float]:
    """c (3,) and E3 of E33 = c . [S11, S22, S12] + S33 / E3; NaN where the constants do not say it."""
    if isinstance(material, Isotropic):
        ratio = -material.poisson / material.young
        return np.array([ratio, ratio, 0.0]), material.young
    if isinstance(material, General):
        return np.full(3, np.nan), np.nan
    E3, nu13, nu23 = (np.nan if c is None else c for c in (material.E3, material.nu13, material.nu23))
    c, s = np.cos(np.radians(material.angle)), np.sin(np.radians(material.angle))
    along_axes = np.array([[c * c, s * s, 2 * c * s], [s * s, c * c, -2 * c * s]])
    return np.array([-nu13 / material.E1, -nu23 / material.E2]) @ along_axes, E3


def _isotropic(material: Isotropic, plane: str) -> Float:
    if plane == "strain" and material.poisson >= 0.5:
        raise ValueError(f"poisson = {material.poisson}: expected less than 0.5 in plane strain")
    shear = material.young / (2.0 * (1.0 + material.poisson))
    thickness = 1.0 - 2.0 * material.poisson if plane == "strain" else 1.0 - material.poisson
    lame = 2.0 * shear * material.poisson / thickness  # plane stress: the reduced Lame constant
    return np.array([[lame + 2 * shear, lame, 0.0], [lame, lame + 2 * shear, 0.0], [0.0, 0.0, shear]])


def _orthotropic_compliance(material: Orthotropic, plane: str) -> Float:
    """Compliance (3, 3) in the material axes; in plane strain S_ij - S_i3 S_j3 / S_33."""
    E1, E2, G12, nu12 = material.E1, material.E2, material.G12, material.nu12
    compliance = np.array([[1 / E1, -nu12 / E1, 0.0], [-nu12 / E1, 1 / E2, 0.0], [0.0, 0.0, 1 / G12]])
    if not is_positive_definite(compliance):
        limit = limit_in_words(E1 / E2, nu12**2, 6)
        raise ValueError(f"nu12 = {nu12}: expected nu12^2 < E1/E2 = {limit}; no material is stable otherwise")
    if plane == "stress":
        return compliance
    E3, nu13, nu23 = material.E3, material.nu13, material.nu23
    if E3 is None or nu13 is None or nu23 is None:
        absent = [name for name in ("E3", "nu13", "nu23") if getattr(material, name) is None]
        raise ValueError(f"{', '.join(absent)}: missing; plane strain needs them")
    out = np.array([-nu13 / E1, -nu23 / E2, 0.0])
    compliance -= E3 * np.outer(out, out)
    if not is_positive_definite(compliance):
        raise ValueError("E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance")
    return compliance


def rotated(stiffness: Float, angle: float) -> Float:
    """Stiffness (3, 3) in axes x1, x2 of a material whose axis 1 is turned by `angle` degrees from x1.

    C = T^T C' T, where T takes strains [E11, E22, gamma12] to the material axes.
    """
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    strain_to_axes = np.array([[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]])
    return np.asarray(strain_to_axes.T @ stiffness @ strain_to_axes)


def is_positive_definite(matrix: Float) -> bool:
    """Whether a symmetric matrix, scaled to a unit diagonal, has no eigenvalue below 1e-12."""
    diagonal = np.diag(matrix)
    if diagonal.min() <= 0.0:
        return False
    scaled = matrix / np.sqrt(np.outer(diagonal, diagonal))
    return bool(np.linalg.eigvalsh(scaled).min() > 1e-12)
