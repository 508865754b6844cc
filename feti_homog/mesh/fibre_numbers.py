"""The numbers of fibres, as case files and results have them."""

from __future__ import annotations

import numpy as np

from feti_homog.case.phase_names import COATING
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.typing import Bool, Float, Int

# Relative to the longer semi-axis: coatings whose thicknesses along both differ by less are of one.
SAME_LENGTH = 1e-6


def fibre_numbers(torus: Torus) -> tuple[Int, Bool]:
    """(constituents,) the number of the fibre that each is, from 1, or that it coats, 0 of the matrix; and which of
    them (constituents,) are fibres.

    A coating of several fibres has the lowest of their numbers; one that coats none is a fibre itself.
    """
    phase, n = torus.constituent_phase, len(torus.constituent_phase)
    coats = np.array([name == COATING for name in torus.mesh.phases])[phase]
    sides = torus.constituent[np.stack(torus.sides[:2])]
    coating, core = np.hstack([sides, sides[::-1]])
    inside = coats[coating] & ~coats[core] & (phase[core] > 0)
    is_coating = np.zeros(n, bool)
    is_coating[coating[inside]] = True
    is_fibre = (phase > 0) & ~is_coating
    number = np.where(is_fibre, np.cumsum(is_fibre), n)
    np.minimum.at(number, coating[inside], number[core[inside]])
    return np.where(phase > 0, number, 0), is_fibre


def coating_thickness(numbers: Int, is_fibre: Bool, semi_axes: Float) -> Float:
    """(fibres,) by how much coatings make both semi-axes longer, 0 without one, for `fibre_numbers` and the semi-axes
    (constituents, 2), of discs the radius twice.

    NaN where fibre or coating is neither round nor an ellipse, and where their semi-axes differ by two lengths.
    """
    coats, fibres = np.flatnonzero((numbers > 0) & ~is_fibre), np.flatnonzero(is_fibre)
    thickness, coated = np.zeros(len(fibres)), numbers[coats] - 1
    outer, inner = np.sort(semi_axes[coats], axis=1), np.sort(semi_axes[fibres[coated]], axis=1)
    low, high = (outer - inner).T
    thickness[coated] = np.where(np.abs(high - low) <= SAME_LENGTH * outer[:, 1], low, np.nan)
    return thickness
