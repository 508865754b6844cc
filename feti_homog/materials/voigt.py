"""Define Voigt notation with engineering shears: component names, plane states, rotations and stress measures.

The order is [11, 22, 12] in plane strain and stress, [11, 22, 33, 23, 13, 12] in space and generalized plane strain.
"""

from dataclasses import dataclass, replace

import numpy as np

from feti_homog.typing import Document, Float

STRESSES, STRAINS = ("S11", "S22", "S12"), ("E11", "E22", "gamma12")
SPATIAL_STRESSES = ("S11", "S22", "S33", "S23", "S13", "S12")
SPATIAL_STRAINS = ("E11", "E22", "E33", "gamma23", "gamma13", "gamma12")
AXIAL_STRESSES = ("S23", "S13")
STIFFNESSES = tuple(f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
SPATIAL_STIFFNESSES = tuple(f"C{i}{j}" for i in range(1, 7) for j in range(1, 7))
THERMAL_STRESSES = tuple(f"thermal_{name}" for name in SPATIAL_STRESSES)
EXPANSIONS = ("expansion_x1", "expansion_x2", "expansion_axial", *(f"expansion_{name}" for name in SPATIAL_STRAINS[3:]))
"""Names of the free strains (6,) per unit of temperature, in the spatial order with x3 along the fibres."""
IN_PLANE = [0, 1, 5]
"""Indices of [11, 22, 12] in the spatial order."""
IN_PLANE_BLOCK = np.ix_(IN_PLANE, IN_PLANE)


@dataclass(frozen=True)
class PlaneState:
    """A plane state of the analysis: the names, order and number of strain and stress components.

    Attributes:
        name: value of [analysis] plane.
        title: name of the state in words.
        strains, stresses: component names, in Voigt order.
        is_sheet: whether S33 vanishes; otherwise E33 vanishes or is a load.
        is_spatial: whether components have the spatial order: the loads are six strains and a temperature, axial shear
            is a separate problem, and stiffness (6, 6), constants, estimates and bounds are spatial.
        is_scalar: whether the unknown is a temperature: its gradient takes the positions [13, 23, 33] of strains, and
            -q the positions of stresses, with the heat flux q; the stiffness is the conductivity (3, 3).
        numbers: digits i, j in the names Cij of stiffness entries, for the three in-plane components.
    """

    name: str
    title: str
    strains: tuple[str, ...] = STRAINS
    stresses: tuple[str, ...] = STRESSES
    is_sheet: bool = False
    is_spatial: bool = False
    is_scalar: bool = False
    numbers: tuple[int, int, int] = (1, 2, 3)

    @property
    def components(self) -> tuple[tuple[str, str], ...]:
        """The strain name and the stress name of each component."""
        return tuple(zip(self.strains, self.stresses, strict=True))

    @property
    def locks(self) -> bool:
        """Whether displacement elements lock in nearly incompressible phases."""
        return not (self.is_sheet or self.is_scalar)

    @property
    def normals(self) -> int:
        """The number of normal strains, which come first among the components."""
        return len(self.strains) - (3 if self.is_spatial else 1)


PLANE_STRAIN = PlaneState("strain", "plane strain")
PLANE_STRESS = PlaneState("stress", "plane stress", is_sheet=True)
GENERALIZED = PlaneState(
    "generalized", "generalized plane strain", SPATIAL_STRAINS, SPATIAL_STRESSES, is_spatial=True, numbers=(1, 2, 6)
)
CONDUCTION = replace(GENERALIZED, name="conduction", title="conduction", is_scalar=True)
PLANE_STATES = {state.name: state for state in (PLANE_STRAIN, PLANE_STRESS, GENERALIZED, CONDUCTION)}


def plane_state_of(document: Document) -> PlaneState:
    """Return the plane state of a result.json document."""
    return PLANE_STATES[document["case"]["analysis"]["plane"]]


def voigt_names(count: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return strain and stress names: the three in the plane if `count` is 3, otherwise the six in space."""
    return (STRAINS, STRESSES) if count == len(STRAINS) else (SPATIAL_STRAINS, SPATIAL_STRESSES)


def turned_axes(angle: float) -> Float:
    """Return the matrix R (3, 3) whose columns are the axes turned about x3 by `angle` degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotated(stiffness: Float, angle: float) -> Float:
    """Transform a stiffness C', (3, 3) or (6, 6), to cell axes from material axes turned about x3 by `angle` degrees.

    The result is C = T^T C' T with the matrix T of `strain_rotation`.
    """
    rotation = strain_rotation(angle)
    to_axes = rotation if len(stiffness) == 6 else rotation[IN_PLANE_BLOCK]
    return np.asarray(to_axes.T @ stiffness @ to_axes)


def strain_rotation(angle: float) -> Float:
    """Return the matrix T (6, 6) that transforms strains to axes turned about x3 by `angle` degrees."""
    rotation, (c, s, _) = np.eye(6), turned_axes(angle)[:, 0]
    rotation[IN_PLANE_BLOCK] = [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    rotation[3:5, 3:5] = [[c, -s], [s, c]]  # of [gamma23, gamma13]
    return rotation


def is_positive_definite(matrix: Float) -> bool:
    """Return whether a symmetric matrix is positive definite: scaled to a diagonal of 1, eigenvalues exceed 1e-12."""
    diagonal = np.diag(matrix)
    if diagonal.min() <= 0.0:
        return False
    scaled = matrix / np.sqrt(np.outer(diagonal, diagonal))
    return bool(np.linalg.eigvalsh(scaled).min() > 1e-12)


def von_mises(stress: Float, S33: Float) -> Float:
    """Return the von Mises stress (m,) from [S11, S22, S12] (m, 3) and S33 (m,): sqrt(3/2 s:s) with the deviator s."""
    S11, S22, S12 = stress.T
    between_11 = np.hypot(S11 - S22, S33 - S11)
    return np.asarray(np.hypot(between_11, np.hypot(S22 - S33, np.sqrt(6) * S12)) / np.sqrt(2))


def principal(stress: Float, S33: Float) -> Float:
    """Return principal stresses (m, 3) of [S11, S22, S12] (m, 3) and S33 (m,), largest first; NaN where S33 is NaN."""
    S11, S22, S12 = stress.T
    middle, radius = (S11 + S22) / 2, np.hypot((S11 - S22) / 2, S12)
    ordered = np.sort(np.stack([middle - radius, middle + radius, S33], axis=1), axis=1)[:, ::-1]
    return np.where(np.isnan(S33)[:, None], np.nan, ordered)


def spatial_von_mises(stress: Float, S33: Float, axial: Float) -> Float:
    """Return the von Mises stress (m,) from [S11, S22, S12] (m, 3), S33 (m,) and the axial [S23, S13] (m, 2)."""
    return np.asarray(np.hypot(von_mises(stress, S33), np.sqrt(3) * np.hypot(*axial.T)))


def spatial_principal(stress: Float, S33: Float, axial: Float) -> Float:
    """Return the principal stresses (m, 3), largest first, from the arguments of `spatial_von_mises`."""
    tensor = np.empty((len(stress), 3, 3))
    tensor[:, :2, :2], tensor[:, 2, 2] = stress[:, [[0, 2], [2, 1]]], S33
    tensor[:, :2, 2] = tensor[:, 2, :2] = axial[:, ::-1]
    return np.asarray(np.linalg.eigvalsh(tensor)[:, ::-1])
