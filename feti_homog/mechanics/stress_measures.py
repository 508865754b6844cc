"""Numbers of a stress state: von Mises' equivalent stress and the principal stresses."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float


def von_mises(stress: Float, out_of_plane: Float) -> Float:
    """(m,) sqrt(3/2 s:s), s the deviator of plane stresses [S11, S22, S12] (m, 3) and S33 (m,); unit of stress."""
    S11, S22, S12 = stress.T
    between_11 = np.hypot(S11 - S22, out_of_plane - S11)
    return np.asarray(np.hypot(between_11, np.hypot(S22 - out_of_plane, np.sqrt(6) * S12)) / np.sqrt(2))


def principal(stress: Float, out_of_plane: Float) -> Float:
    """(m, 3) principal stresses, the largest first, of the stresses of `von_mises`; NaN where S33 is."""
    S11, S22, S12 = stress.T
    middle, radius = (S11 + S22) / 2, np.hypot((S11 - S22) / 2, S12)
    ordered = np.sort(np.stack([middle - radius, middle + radius, out_of_plane], axis=1), axis=1)[:, ::-1]
    return np.where(np.isnan(out_of_plane)[:, None], np.nan, ordered)
