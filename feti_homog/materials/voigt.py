"""Voigt orders with engineering shear strains: names of the components, and the tensor of a strain.

[11, 22, 12] in the plane, [11, 22, 33, 23, 13, 12] in space.
"""

from __future__ import annotations

import numpy as np

from feti_homog.case.load_names import SPATIAL_STRAINS, SPATIAL_STRESSES, STRAINS, STRESSES
from feti_homog.typing import Float

__all__ = [
    "AXIAL_STRESSES",
    "SPATIAL_STIFFNESSES",
    "SPATIAL_STRAINS",
    "SPATIAL_STRESSES",
    "STIFFNESSES",
    "STRAINS",
    "STRESSES",
    "strain_tensor",
    "voigt_names",
]

AXIAL_STRESSES = ("S23", "S13")
STIFFNESSES = tuple(f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))
SPATIAL_STIFFNESSES = tuple(f"C{i}{j}" for i in range(1, 7) for j in range(1, 7))


def voigt_names(count: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the strains and of the stresses, 3 in the plane or 6 in space."""
    return (STRAINS, STRESSES) if count == len(STRAINS) else (SPATIAL_STRAINS, SPATIAL_STRESSES)


def strain_tensor(strain: Float) -> Float:
    """(2, 2) tensor of a strain (3,): E12 = gamma12 / 2."""
    return np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
