"""Patterns of fibres whose statistics are known."""

import numpy as np

from feti_homog.microstructure.fibre_pattern import FibrePattern


def square_lattice(n=8, spacing=1.0, radius=0.3, periodic=True):
    """n x n points; of a window in the middles of squares of their own."""
    middles = (np.arange(n) + 0.5) * spacing
    return pattern(np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2), n * spacing, radius, periodic)


def hexagonal_lattice(n=8, radius=0.3):
    """Points at the distance 1, n cells of 1 x sqrt(3) beside each other and n / 2 above."""
    size = np.array([n, n // 2 * np.sqrt(3)])
    shifts = np.stack(np.meshgrid(np.arange(n), np.arange(n // 2) * np.sqrt(3)), axis=-1).reshape(-1, 1, 2)
    pair = np.array([[0.25, 0.25], [0.75, 0.25 + np.sqrt(3) / 2]])
    points = (shifts + pair).reshape(-1, 2)
    return FibrePattern(*size, points, np.full(len(points), radius), True)


def poisson_points(count=150, side=10.0, seed=1, periodic=True, radius=0.2):
    """Points anywhere in a square."""
    return pattern(np.random.default_rng(seed).random((count, 2)) * side, side, radius, periodic)


def pattern(points, side, radius, periodic=True):
    """Fibres of one radius in a square."""
    return FibrePattern(side, side, points, np.full(len(points), radius), periodic)
