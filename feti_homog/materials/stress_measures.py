"""Numbers of a stress state: von Mises' equivalent stress and the principal stresses."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float


def von_mises(stress: Float, S33: Float) -> Float:
    """(m,) sqrt(3/2 s:s), s the deviator of stresses [S11, S22, S12] (m, 3) and S33 (m,); unit of stress."""
    S11, S22, S12 = stress.T
    between_11 = np.hypot(S11 - S22, S33 - S11)
    return np.asarray(np.hypot(between_11, np.hypot(S22 - S33, np.sqrt(6) * S12)) / np.sqrt(2))


def principal(stress: Float, S33: Float) -> Float:
    """(m, 3) principal stresses, the largest first, of the stresses of `von_mises`; NaN where S33 is."""
    S11, S22, S12 = stress.T
    middle, radius = (S11 + S22) / 2, np.hypot((S11 - S22) / 2, S12)
    ordered = np.sort(np.stack([middle - radius, middle + radius, S33], axis=1), axis=1)[:, ::-1]
    return np.where(np.isnan(S33)[:, None], np.nan, ordered)


def spatial_von_mises(stress: Float, S33: Float, axial: Float) -> Float:
    """(m,) the same with the stresses [S23, S13] (m, 2)."""
    return np.asarray(np.hypot(von_mises(stress, S33), np.sqrt(3) * np.hypot(*axial.T)))


def spatial_principal(stress: Float, S33: Float, axial: Float) -> Float:
    """(m, 3) principal stresses, the largest first, of the stresses of `spatial_von_mises`."""
    tensor = np.empty((len(stress), 3, 3))
    tensor[:, :2, :2], tensor[:, 2, 2] = stress[:, [[0, 2], [2, 1]]], S33
    tensor[:, :2, 2] = tensor[:, 2, :2] = axial[:, ::-1]
    return np.asarray(np.linalg.eigvalsh(tensor)[:, ::-1])
