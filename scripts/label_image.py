"""Write a periodic label image of disks or of winding phases, and a case of its effective stiffness.

Run `.venv/bin/python scripts/label_image.py DIR --pixels 2000 --phases winding`, then `feti_homog run DIR/image.toml`.
Winding phases have thousands of bodies of a few pixels.
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter

from feti_homog.microstructure.random_fibres import relax

CASE = """\
[cell]
geometry = "pixels"
file = "image.png"
labels = {0 = "matrix", 1 = "fibre"}
pixel = 0.5

[material.matrix]
young = 3.5
poisson = 0.35

[material.fibre]
young = 70.0
poisson = 0.2

[analysis]
type = "stiffness"
plane = "strain"

[output]
fields = false
pictures = false
mesh_error = false
"""


def disks(pixels: int, rng: np.random.Generator, fraction: float = 0.5, area: float = 8000.0) -> np.ndarray:
    """Draw equal disks of about `area` square pixels, a tenth of their radius apart: labels (pixels, pixels)."""
    count = max(1, round(pixels**2 * fraction / area))
    radius = np.sqrt(fraction / (np.pi * count))
    centres, _ = relax(rng.random((count, 2)), np.full(count, 1.05 * radius), 20_000)
    image, places = np.zeros((pixels, pixels), np.uint8), (np.arange(pixels) + 0.5) / pixels
    for centre in centres:
        x, y = ((places - c + 0.5) % 1.0 - 0.5 for c in centre)
        rows, columns = np.flatnonzero(np.abs(y) < radius), np.flatnonzero(np.abs(x) < radius)
        image[np.ix_(rows, columns)] |= x[columns] ** 2 + y[rows, None] ** 2 < radius**2
    return image


def winding(pixels: int, rng: np.random.Generator) -> np.ndarray:
    """Threshold the sum of smooth noise and a quarter of rough noise: labels (pixels, pixels)."""
    rough, smooth = (gaussian_filter(rng.standard_normal((pixels, pixels)), s, mode="wrap") for s in (1.0, 6.0))
    return (smooth / smooth.std() + rough / rough.std() / 4 > 0.2).astype(np.uint8)


def main() -> None:
    """Write image.png and image.toml."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pixels", type=int, default=2000, help="in a row and in a column")
    parser.add_argument("--phases", choices=("disks", "winding"), default="disks")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw = disks if arguments.phases == "disks" else winding
    arguments.folder.mkdir(parents=True, exist_ok=True)
    image = draw(arguments.pixels, np.random.default_rng(arguments.seed))
    Image.fromarray(image).save(arguments.folder / "image.png")
    (arguments.folder / "image.toml").write_text(CASE, encoding="utf-8")


if __name__ == "__main__":
    main()
