"""Voigt order [11, 22, 12], with engineering shear strain: names of the components, and the tensor of a strain."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float

STRAINS = ("E11", "E22", "gamma12")
STRESSES = ("S11", "S22", "S12")
STIFFNESSES = tuple(f"C{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3))


def strain_tensor(strain: Float) -> Float:
    """(2, 2) tensor of a strain (3,): E12 = gamma12 / 2."""
    return np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
