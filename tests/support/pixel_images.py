"""Images of square pixels as meshes of gmsh: two triangles a pixel, so that bodies touch at corners."""

from __future__ import annotations

import numpy as np
from unit.cell.faulty_meshes import Elements, MshFile

# The symmetries of the square: their matrices.
SYMMETRIES = [
    np.array(rows)
    for rows in (
        ((1, 0), (0, 1)), ((0, -1), (1, 0)), ((-1, 0), (0, -1)), ((0, 1), (-1, 0)),
        ((-1, 0), (0, 1)), ((1, 0), (0, -1)), ((0, 1), (1, 0)), ((0, -1), (-1, 0)),
    )
]  # fmt: skip


def random_image(size: int, seed: int, share: float = 0.4, phases: int = 1) -> np.ndarray:
    """(size, size) phases of pixels [row, column], 0 the matrix, of which about that `share` are others."""
    rng = np.random.default_rng(seed)
    return np.where(rng.random((size, size)) < share, rng.integers(1, phases + 1, (size, size)), 0)


def pixel_mesh(image: np.ndarray, jitter: float = 0.0, symmetry: np.ndarray = SYMMETRIES[0], seed: int = 0) -> MshFile:
    """The unit square of these pixels, negative ones voids, its nodes moved by up to `jitter` pixels, periodically, and
    then turned or mirrored about its centre."""
    n = len(image)
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1))
    moved = jitter * np.random.default_rng(seed).uniform(-1, 1, (2, n, n))
    # The sides stay straight, and the lower and left ones move as their partners do.
    moved[0][:, 0], moved[1][0] = 0.0, 0.0
    x, y = (np.array([i, j]) + np.pad(moved, ((0, 0), (0, 1), (0, 1)), mode="wrap")) / n
    places = (np.stack([x, y], axis=-1).reshape(-1, 2) - 0.5) @ symmetry.T + 0.5
    elements: Elements = {}
    for (row, column), phase in np.ndenumerate(image):
        a = 1 + column + (n + 1) * row
        b, c, d = a + 1, a + n + 2, a + n + 1
        for corners in ((a, b, c), (a, c, d)):
            if phase >= 0:
                own = corners if np.linalg.det(symmetry) > 0 else corners[::-1]
                elements[len(elements) + 1] = (2, int(phase) + 1, int(phase) + 1, own)
    used = sorted({node for *_, own in elements.values() for node in own})
    nodes = {tag: (*places[tag - 1].tolist(), 0.0) for tag in used}
    names = {1: "matrix", 2: "fibre", 3: "fibre:2", 4: "fibre:3"}
    return MshFile(nodes, elements, {tag: names[tag] for tag in range(1, int(image.max()) + 2)})


def turned_stiffness(stiffness: np.ndarray, symmetry: np.ndarray) -> np.ndarray:
    """(3, 3) in the order [11, 22, 12] with engineering shear, of a body that is turned or mirrored."""
    (a, b), (c, d) = symmetry
    stress = np.array([[a * a, b * b, 2 * a * b], [c * c, d * d, 2 * c * d], [a * c, b * d, a * d + b * c]])
    return np.asarray(stress @ stiffness @ stress.T)
