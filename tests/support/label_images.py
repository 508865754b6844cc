"""Label images of circles, and runs of them."""

from pathlib import Path

import numpy as np
from PIL import Image

from support.cases import FIBRE, MATRIX

RUN = {
    "material": {"matrix": MATRIX, "fibre": FIBRE},
    "analysis": {"type": "stiffness", "plane": "strain"},
    "petsc": {"feti_ksp_rtol": 1e-12},
    "output": {"pictures": False},
}
CIRCLES = ((0.3, 0.3, 0.18), (0.75, 0.68, 0.2), (0.8, 0.2, 0.12))
"""Centres and radii in a periodic unit square."""


def labels_of(circles, pixels: int) -> np.ndarray:
    """Return rows from above, 255 in circles of the periodic unit square, else 0."""
    places = (np.arange(pixels) + 0.5) / pixels
    x, y = np.meshgrid(places, places[::-1])
    near = [np.hypot((x - a + 0.5) % 1 - 0.5, (y - b + 0.5) % 1 - 0.5) < r for a, b, r in circles]
    return np.where(np.any(near, axis=0), 255, 0).astype(np.uint8)


def circles_in_pixels(pixels: int) -> np.ndarray:
    """Return rows from above, 1 in CIRCLES, else 0."""
    return (labels_of(CIRCLES, pixels) // 255).astype(np.uint8)


def write_png(path: Path, image: np.ndarray) -> Path:
    """Write grey values; returns the path."""
    Image.fromarray(image).save(path)
    return path
