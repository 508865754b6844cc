"""Vertices at which two bodies do not meet along one line, and the pinned class, in small images."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from support.pixel_images import SYMMETRIES, pixel_mesh

from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.submeshes import pinned_classes

# Rows from below: the fibre winds around the cell along the lowest, and its branches touch at (1, 2) / 4.
BRANCHES = np.array([[1, 1, 1, 1], [1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0]])
# A void at the corner (2, 2) / 5 of the fibre, which elsewhere is in the matrix; then along its side.
VOID_AT_CORNER = np.array([[0, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, -1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]])
VOID_AT_SIDE = np.array([[0, 0, 0, 0, 0], [0, 1, -1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 0]])
# Two fibres that touch, and so three bodies meet.
TWO_FIBRES = np.array([[0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0]])


def torus_of(folder: Path, image: np.ndarray, jitter: float = 0.0, symmetry: np.ndarray = SYMMETRIES[0]) -> Torus:
    pixel_mesh(image, jitter, symmetry).write(folder / "pixels.msh")
    return Torus.of(read(folder / "pixels.msh", has_voids=True))


def places(torus: Torus, classes: np.ndarray, size: int) -> set[tuple[float, float]]:
    """Return the plane nodes of some classes, in pixels."""
    found = torus.mesh.points[classes[torus.node_class]] * size
    return {tuple(place) for place in np.round(found, 1).tolist()}


@pytest.mark.parametrize(
    ("image", "touching", "triple"),
    [
        (BRANCHES, {(1, 2)}, set()),
        (VOID_AT_CORNER, {(2, 2)}, set()),
        (VOID_AT_SIDE, set(), set()),
        (TWO_FIBRES, set(), {(2, 2)}),
    ],
    ids=["branches", "void at a corner", "void at a side", "two fibres"],
)
def test_bodies_that_do_not_meet_along_one_line_are_found_without_coordinates(
    tmp_path: Path, image: np.ndarray, touching: set, triple: set
) -> None:
    for symmetry, jitter in zip(SYMMETRIES, itertools.cycle([0.0, 1e-9, 1e-2]), strict=False):
        torus, size = torus_of(tmp_path, image, jitter, symmetry), len(image)
        turned = [
            {tuple(np.round((np.array(place) - size / 2) @ symmetry.T + size / 2, 1).tolist()) for place in some}
            for some in (touching, triple)
        ]
        assert [places(torus, torus.touching, size), places(torus, torus.meeting > 2, size)] == turned
        assert np.array_equal(torus.never_part, torus.touching | (torus.meeting > 2))


def test_what_never_parts_is_pinned_rather_than_what_may(tmp_path: Path) -> None:
    """Where no node is inside a body."""
    torus = torus_of(tmp_path, np.kron(np.array([[1, 0], [0, 1]]), np.ones((1, 1), int)))
    assert torus.never_part.all()
    torus = torus_of(tmp_path, BRANCHES)
    inside = torus.meeting == 1
    assert inside[pinned_classes(torus)]
    thin = torus_of(tmp_path, np.array([[1, 1, 1], [1, 0, 0], [0, 1, 0]]))
    assert not (thin.meeting == 1).any() and thin.never_part[pinned_classes(thin)]
