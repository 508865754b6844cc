"""A window of a larger arrangement made periodic by the smallest moves."""

import numpy as np
import pytest
from support.moved_rows import moved_rows
from unit.microstructure.test_arrangement import smallest_gap
from unit.microstructure.test_periodic_table import cell_of, table

from feti_homog.case.cell_section import Cell
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.microstructure.cut_window import LEAST_GAP, MOST_GAP, moves
from feti_homog.microstructure.shapes.ellipses import Discs

SIZE = np.array([1.0, 1.0])


def window(seed, size=(0.7, 0.6)):
    whole = arrange(
        Cell(geometry="random", fibre_fraction=0.55, fibres=120, radius_spread=0.3, seed=seed, min_gap=0.03)
    )
    inside = np.all(whole.centres < size, axis=1)
    return whole.centres[inside], whole.radii[inside], np.array(size)


def overlaps_within(centres, radii):
    distance = np.linalg.norm(centres[:, None] - centres, axis=2) - radii[:, None] - radii
    return distance[np.triu_indices(len(radii), 1)].min()


def test_two_discs_share_the_move():
    """The overlap of 0.05 and the largest gap, for within there is no smaller one; half for each."""
    radii = np.array([0.1, 0.1])
    moved = moves(Discs(np.array([[0.05, 0.5], [0.9, 0.5]]), radii), SIZE)
    half = (0.2 * (1 + MOST_GAP) - 0.15) / 2
    assert np.abs(moved - [[half, 0.0], [-half, 0.0]]).max() < 1e-5


def test_a_disc_that_is_in_the_way_is_pushed():
    """Three in a row, the first over the border: least squares share the overlap as chains do."""
    centres, radii = np.array([[0.05, 0.5], [0.95, 0.5], [0.31, 0.5]]), np.full(3, 0.1)
    moved = moves(Discs(centres, radii), SIZE)
    assert np.abs(moved[:, 1]).max() < 1e-6
    # d0 - d1 = 0.11, and d2 - d0 = -0.05 leaves the gap of 0.05: d0 = t, d1 = t - 0.11, d2 = t - 0.05.
    first = (0.11 + 0.05) / 3
    assert moved[:, 0] == pytest.approx([first, first - 0.11, first - 0.05], abs=1e-5)


def test_gaps_across_are_those_within():
    """0.03 of the sum of the radii, if the nearest two within are so near; not less than a least gap."""
    for gap, kept in ((0.03, 0.03), (0.001, LEAST_GAP)):
        centres = np.array([[0.05, 0.2], [0.95, 0.2], [0.5, 0.7], [0.5 + 0.2 * (1 + gap), 0.7]])
        moved = moves(Discs(centres, np.full(4, 0.1)), SIZE)
        assert np.abs(moved[2:]).max() < 1e-9
        assert moved[0, 0] - moved[1, 0] == pytest.approx(0.2 * (1 + kept) - 0.1, rel=1e-5)


def test_discs_that_need_not_move_do_not():
    centres = np.array([[0.25, 0.25], [0.75, 0.75], [0.25, 0.75]])
    assert np.array_equal(moves(Discs(centres, np.full(3, 0.2)), SIZE), np.zeros((3, 2)))


@pytest.mark.parametrize("seed", range(4))
def test_a_window_is_made_periodic(seed):
    centres, radii, size = window(seed)
    moved = moves(Discs(centres, radii), size)
    far = np.linalg.norm(moved, axis=1)
    placed = arrange(cell_of(table(centres, radii, (1.0, 1.0), (0.0, 0.0))))
    assert overlaps_within(placed.centres, radii) > 0  # the overlaps are those across the border
    fibres = table(centres, radii, size.tolist(), (0.0, 0.0))
    arrangement = arrange(Cell(geometry="table", table=fibres, window="cut"))
    assert smallest_gap(arrangement) > 0
    rows, listed = moved_rows(fibres)
    assert np.array_equal(listed, far[rows - 1]) and len(rows) < 0.7 * len(radii)
    assert far[np.setdiff1d(np.arange(len(radii)), rows - 1)].max() < 1e-6 * radii.mean()
    assert far.max() < 1.1 * radii.max()


@pytest.mark.parametrize("seed", range(4))
def test_no_smaller_moves_are_near(seed):
    """Moves scaled down, or those of any one disc, would let discs overlap."""
    centres, radii, size = window(seed)
    moved = moves(Discs(centres, radii), size)

    def gap(trial):
        at = (centres + trial)[:, None] - (centres + trial)
        at -= np.round(at / size) * size
        return (np.linalg.norm(at, axis=2) - radii[:, None] - radii)[np.triu_indices(len(radii), 1)].min()

    assert gap(moved) > 0 > gap(np.zeros_like(moved))
    assert gap(0.9 * moved) < gap(moved)
    for k in np.flatnonzero(np.linalg.norm(moved, axis=1) > 0.1 * radii.mean()):
        assert gap(np.where(np.arange(len(radii))[:, None] == k, 0.5 * moved, moved)) < gap(moved)


def test_faults_of_cut_windows():
    # In a cell of 0.62 x 0.43 two discs are at most 0.38 apart; they need 0.42.
    fibres = table([[0.1, 0.2], [0.53, 0.2]], [0.21, 0.21], (0.62, 0.43), (0.0, 0.0))
    with pytest.raises(MeshError, match=r'window = "cut": fibres overlap across the border, and there is no room'):
        arrange(Cell(geometry="table", table=fibres, window="cut"))
    fibres = table([[0.3, 0.5], [0.45, 0.5], [0.95, 0.5]], [0.1] * 3, (1.0, 1.0), (0.0, 0.0))
    with pytest.raises(MeshError) as error:
        arrange(Cell(geometry="table", table=fibres, window="cut"))
    assert error.value.faults == ("[cell] t.csv: rows 1 and 2: overlap by 0.05",)
    fibres = table([[0.3, 0.5], [1.05, 0.5]], [0.1] * 2, (1.0, 1.0), (0.0, 0.0))
    with pytest.raises(MeshError, match=r"row 2: x = 1.05: lies outside the cell, of width 1"):
        arrange(Cell(geometry="table", table=fibres, window="cut"))
