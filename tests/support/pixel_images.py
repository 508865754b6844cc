"""Images of square pixels as meshes of gmsh, two triangles or a quadrilateral a pixel: bodies touch at corners."""

from pathlib import Path

import numpy as np
from PIL import Image
from unit.mesh.faulty_meshes import Elements, MshFile

from feti_homog import Case

# The symmetries of the square: their matrices.
SYMMETRIES = [
    np.array(rows)
    for rows in (
        ((1, 0), (0, 1)), ((0, -1), (1, 0)), ((-1, 0), (0, -1)), ((0, 1), (-1, 0)),
        ((-1, 0), (0, 1)), ((1, 0), (0, -1)), ((0, 1), (1, 0)), ((0, -1), (-1, 0)),
    )
]  # fmt: skip


def random_image(size: int, seed: int, share: float = 0.4, phases: int = 1, voids: float = 0.0) -> np.ndarray:
    """(size, size) phases of pixels [row, column], 0 the matrix, of which about that `share` are others.

    One body of each phase, grown pixel by pixel in thin branches that touch, and -1 of that share of inner pixels.
    """
    rng = np.random.default_rng(seed)
    image = np.zeros((size, size), int)
    for phase in range(1, phases + 1):
        image[tuple(rng.choice(np.argwhere(image == 0)))] = phase
        while np.count_nonzero(image == phase) < share / phases * size**2:
            beside = sum(np.roll(image == phase, step, axis).astype(int) for step in (-1, 1) for axis in (0, 1))
            beside[image > 0] = 0
            thin = np.argwhere(beside == 1)
            if not beside.any():
                break
            image[tuple(rng.choice(thin if len(thin) else np.argwhere(beside > 0)))] = phase
    image[1:-1, 1:-1][rng.random((size - 2, size - 2)) < voids] = -1
    return image


def pixel_mesh(image: np.ndarray, jitter: float = 0.0, symmetry: np.ndarray = SYMMETRIES[0], seed: int = 0) -> MshFile:
    """Return the unit square of these pixels, negative ones voids.

    Its nodes are moved by up to `jitter` pixels, periodically, and then turned or mirrored about its centre.
    """
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


def quadrilaterals(image: np.ndarray) -> MshFile:
    """Return the unit square of these pixels, a quadrilateral of four nodes each."""
    mesh = pixel_mesh(image)
    halves = list(mesh.elements.values())
    pairs = enumerate(zip(halves[::2], halves[1::2], strict=True), start=1)
    elements = {tag: (3, *first[1:3], (*first[3], second[3][2])) for tag, (first, second) in pairs}
    return MshFile(mesh.nodes, elements, mesh.names)


def turned(symmetry: np.ndarray, of_strain: bool = False) -> np.ndarray:
    """(3, 3) matrix that turns or mirrors stresses [11, 22, 12] of a body, or its strains.

    Strains have engineering shear.
    """
    (a, b), (c, d) = symmetry
    two, half = (1, 2) if of_strain else (2, 1)
    return np.array(
        [[a * a, b * b, two * a * b], [c * c, d * d, two * c * d], [half * a * c, half * b * d, a * d + b * c]]
    )


MATERIALS = {
    "matrix": {"young": 3.0, "poisson": 0.35},
    "fibre": {"young": 70.0, "poisson": 0.2},
    "fibre:2": {"young": 7.0, "poisson": 0.3},
}


def case(path: Path, image: np.ndarray | None, phases: tuple[str, ...] = ("matrix", "fibre"), **cell: object) -> Case:
    """Return the case of an image, whose rows count from below."""
    if image is not None:
        upper = np.asarray(image)[::-1]
        np.save(path, upper) if path.suffix == ".npy" else Image.fromarray(upper.astype(np.uint8)).save(path)
    labels = {str(k): name for k, name in enumerate(phases)}
    document = {
        "cell": {"geometry": "pixels", "file": str(path), "labels": labels} | cell,
        "material": {name: MATERIALS[name] for name in phases if name in MATERIALS},
        "analysis": {"type": "stiffness", "plane": "strain"},
    }
    return Case.parse(document)
