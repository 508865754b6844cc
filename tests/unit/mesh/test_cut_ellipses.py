"""A window of ellipses made periodic by the smallest moves."""

import numpy as np
import pytest
from support.moved_rows import moved_rows
from unit.mesh.test_table_ellipses import cell_of, table

from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.microstructure.arrangements import neighbours
from feti_homog.microstructure.cut_window import LEAST_GAP, MOST_GAP, moves
from feti_homog.microstructure.shapes.ellipses import Discs, Ellipses
from feti_homog.microstructure.shapes.outlines import gaps

SIZE = np.array([1.0, 1.0])


def smallest_gap(ellipses, size=SIZE):
    """Return the smallest gap of all pairs of images on the torus / sum of the radii of their areas."""
    first, second, vector = neighbours(ellipses.centres, size, 2.5 * ellipses.longest.max())
    other = Ellipses(ellipses.centres[first] + vector, ellipses.frames[second])
    radii = np.sqrt(np.abs(np.linalg.det(ellipses.frames)))
    return (gaps(ellipses[first], other)[0] / (radii[first] + radii[second])).min()


def crowd(seed):
    """Ellipses in a window, apart from each other there by more than the least gap."""
    generator = np.random.default_rng(seed)
    kept = Ellipses(np.zeros((0, 2)), np.zeros((0, 2, 2)))
    for _ in range(400):
        a, b, angle = generator.uniform(0.06, 0.12), generator.uniform(0.04, 0.06), generator.uniform(0, 180)
        one = Ellipses.of(generator.uniform(0, 1, (1, 2)), np.array([a]), np.array([b]), np.array([angle]))
        many = one[np.zeros(len(kept), int)]
        if len(kept) == 0 or gaps(kept, many)[0].min() > 0.004:
            kept = kept.joined(one)
    return kept


def test_ellipses_that_are_discs_move_like_discs():
    generator = np.random.default_rng(3)
    centres, radii = np.array([[0.05, 0.2], [0.95, 0.22], [0.5, 0.7], [0.52, 0.97], [0.5, 0.1]]), np.full(5, 0.1)
    frames = radii[:, None, None] * np.linalg.qr(generator.normal(size=(5, 2, 2)))[0]
    discs, ellipses = moves(Discs(centres, radii), SIZE), moves(Ellipses(centres, frames), SIZE)
    assert np.abs(discs).max() > 0.02 and ellipses == pytest.approx(discs, abs=1e-7)


def test_two_flat_ones_share_the_move_across():
    """Two ellipses lie along the side, which they overlap by 0.02, and move away from it to the largest gap."""
    a, b = 0.2, 0.05
    own = Ellipses.of(np.array([[0.5, 0.04], [0.5, 0.96]]), np.full(2, a), np.full(2, b), np.zeros(2))
    radius = np.sqrt(a * b)
    moved = moves(own, SIZE)
    half = (2 * radius * MOST_GAP + 0.02) / 2
    assert moved == pytest.approx(np.array([[0.0, half], [0.0, -half]]), abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_a_window_is_made_periodic_by_small_moves(seed):
    own = crowd(seed)
    radii = np.sqrt(np.abs(np.linalg.det(own.frames)))
    assert smallest_gap(own) < 0
    moved = moves(own, SIZE)
    at = Ellipses(own.centres + moved, own.frames)
    assert smallest_gap(at) >= LEAST_GAP * (1 - 1e-3) and np.linalg.norm(moved, axis=1).max() < 2 * radii.max()
    part = Ellipses(own.centres + 0.9 * moved, own.frames)
    assert smallest_gap(part) < smallest_gap(at)


def test_a_cut_table_says_which_rows_it_moved():
    rows = [{"x": x, "y": y, "a": 0.2, "b": 0.05} for x, y in ((0.5, 0.04), (0.5, 0.96), (0.5, 0.5))]
    fibres = table(rows, (0.0, 0.0))
    with pytest.raises(MeshError, match=r"overlap by 0\.02 across the border"):
        arrange(cell_of(fibres))
    assert smallest_gap(arrange(cell_of(fibres, window="cut")).outlines) > 0
    assert moved_rows(fibres)[0].tolist() == [1, 2]
