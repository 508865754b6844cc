"""Quadrilaterals cut in triangles: one diagonal everywhere couples stretch and shear, alternate ones hardly."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from support.cases import case_of
from support.other_formats import written
from support.pixel_images import quadrilaterals

from feti_homog import run
from feti_homog.mesh.readers.msh_reader import read
from feti_homog.mesh.readers.raw_mesh import in_triangles

# Rows of 24 pixels from below, and C13, C23 of these squares: by another program with 8 x 8 squares a pixel, within
# 0.004 of quadratic elements of this one refined three times.
IMAGE = """f00003 f00003 f00003 c00380 0007c0 000fe0 000fe0 078fc0 0fc7c0 0fc380 0fe03e 0fc03f
           07c07f 00007f 78073f fc0fbe fe1fc0 fe1fc0 fc1fc0 7c0f80 300700 e00001 f00003 f00003"""
STRETCH_AND_SHEAR = np.array([-0.101, -0.106])
FORMATS = (".inp", ".vtu", ".msh", ".INP")


def solved(image: np.ndarray, path):
    materials = {"matrix": {"young": 3.0, "poisson": 0.35}, "fibre": {"young": 70.0, "poisson": 0.2}}
    cell = {"geometry": "mesh", "file": str(written(quadrilaterals(image), path))}
    return run(case_of(cell, material=materials), MPI.COMM_SELF)


@pytest.mark.parametrize("suffix", FORMATS)
def test_couplings_of_pixels_and_their_errors_are_small(tmp_path, suffix):
    image = np.array([[int(bit) for bit in f"{int(row, 16):024b}"] for row in IMAGE.split()])
    result = solved(image, tmp_path / f"a{suffix}")
    error = np.abs(result.effective_stiffness[:2, 2] - STRETCH_AND_SHEAR)
    assert (error < 0.02).all()  # 0.113 and 0.078 with one diagonal
    estimate = result.mesh_error.effective_stiffness[:2, 2]
    assert 0.5 * error.max() < estimate.max() < 2 * error.max() and (estimate > error / 2).all()


def test_a_mirrored_image_has_no_coupling(tmp_path):
    half = np.random.default_rng(1).random((8, 4)) < 0.4
    stiffness = solved(np.hstack([half, half[:, ::-1]]).astype(int), tmp_path / "a.inp").effective_stiffness
    assert np.abs(stiffness[:2, 2]).max() < 1e-12 * stiffness[0, 0]


@pytest.mark.parametrize("suffix", [".inp", ".vtu", ".msh"])
def test_a_quadrilateral_with_a_repeated_corner_is_a_triangle(tmp_path, suffix):
    """Two such quadrilaterals in place of one, along the diagonal that cuts the one."""
    mesh = quadrilaterals(np.pad(np.ones((2, 2), int), 1))
    number, (kind, phase, curve, (a, b, c, d)) = next((k, e) for k, e in mesh.elements.items() if len(e[3]) == 4)
    expected = read(written(mesh, tmp_path / f"a{suffix}"))
    more = max(mesh.elements) + 1
    halves = {number: (kind, phase, curve, (a, b, c, c)), more: (kind, phase, curve, (a, c, d, d))}
    found = read(written(replace(mesh, elements=mesh.elements | halves), tmp_path / f"b{suffix}"))
    assert len(found.triangles) == len(expected.triangles) and np.array_equal(found.points, expected.points)


def grid(columns: int, rows: int, shear: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Corners (m, 4) and points (n, 2) of columns x rows parallelograms."""
    j, i = np.divmod(np.arange((columns + 1) * (rows + 1)), columns + 1)
    first = np.flatnonzero((i < columns) & (j < rows))
    return first[:, None] + [0, 1, columns + 2, columns + 1], np.column_stack([i + shear * j, j]).astype(float)


def cuts(triangles: np.ndarray, points: np.ndarray) -> set[frozenset[tuple[float, ...]]]:
    return {frozenset(map(tuple, points[each].tolist())) for each in triangles.reshape(-1, 3)}


@pytest.mark.parametrize("shear", [0.0, 0.3])
def test_diagonals_alternate_whatever_the_numbering(shear):
    corners, points = grid(5, 4, shear)
    found = in_triangles(corners, points)
    both = np.array([list(set(a) & set(b)) for a, b in found.tolist()])
    assert ((both // 6 + both % 6) % 2 == 0).all()
    rng = np.random.default_rng(0)
    number = rng.permutation(len(points))
    moved = np.empty_like(points)
    moved[number] = points
    again = number[np.stack([np.roll(each, rng.integers(4))[:: rng.choice([-1, 1])] for each in corners])]
    assert cuts(in_triangles(rng.permutation(again), moved), moved) == cuts(found, points)


@pytest.mark.parametrize(("corner", "diagonal"), [((0.8, 0.3), (0, 2)), ((0.6, 0.5), (1, 3)), ((0.4, 0.6), (1, 3))])
def test_a_diagonal_that_leaves_a_sliver_is_not_taken(corner, diagonal):
    points = np.array([[0.0, 0.0], corner, [1.0, 1.0], [0.0, 1.0]])
    (halves,) = in_triangles(np.array([[0, 1, 2, 3]]), points).tolist()
    assert set(halves[0]) & set(halves[1]) == set(diagonal)
