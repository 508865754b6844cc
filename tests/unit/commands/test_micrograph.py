"""Find known circles in drawn images, and refuse faulty images."""

import math
from functools import cache

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

from feti_homog.commands import micrograph
from feti_homog.errors import CaseError
from feti_homog.report.plots import plot_helpers

SIZE, FINER = 400, 4


@cache
def circles(seed):
    """Return circles (n, 3) apart by half a pixel or more, some cut by the border."""
    rng, found = np.random.default_rng(seed), []
    for x, y, r in rng.uniform((0, 0, 12), (SIZE, SIZE, 20), (4000, 3)):
        if all(math.hypot(x - a, y - b) > r + c + 0.5 for a, b, c in found):
            found.append((x, y, r))
    return np.array(found)


def drawn(path, known, bright=True, noise=10.0):
    """Write a noisy picture of circles; returns the path."""
    places = (np.arange(SIZE * FINER) + 0.5) / FINER
    image = np.full((SIZE * FINER,) * 2, 60.0, np.float32)
    for a, b, r in known:
        rows, columns = (slice(max(int((c - r) * FINER), 0), int((c + r) * FINER) + 1) for c in (b, a))
        image[rows, columns][np.hypot(places[columns] - a, places[rows, None] - b) < r] = 190.0
    image = image.reshape(SIZE, FINER, SIZE, FINER).mean(axis=(1, 3))
    image += np.random.default_rng(1).normal(0.0, noise, image.shape)
    Image.fromarray((image if bright else 255 - image).clip(0, 255).astype(np.uint8)[::-1]).save(path)
    return path


@pytest.mark.parametrize("bright", [True, False])
@pytest.mark.parametrize("seed", [1, 2])
def test_circles_are_found_within_half_a_pixel(tmp_path, seed, bright):
    known = circles(seed)
    whole = ((known[:, :2] > known[:, 2:]) & (known[:, :2] < SIZE - known[:, 2:])).all(axis=1)
    found, table = micrograph.fibres(drawn(tmp_path / "a.png", known, bright), 0.5)
    found = found / 0.5
    distance, nearest = cKDTree(found[:, :2]).query(known[:, :2])
    assert (
        distance[whole].max() < 0.5
        and distance[whole].mean() < 0.12
        and np.abs(found[nearest, 2] - known[:, 2])[whole].max() < 0.5
    )
    assert np.count_nonzero(distance < 0.5) >= 0.97 * len(known) and len(found) <= len(known)
    lines = table.splitlines()
    assert lines[:2] == ["# width = 200.0, height = 200.0, left = 0.0, bottom = 0.0", "x,y,radius"]
    assert np.allclose(np.loadtxt(lines[2:], delimiter=","), 0.5 * found, atol=1e-8)


@pytest.mark.parametrize("seed", [3, 4])
def test_fibres_with_dents_and_specks_in_uneven_light_are_found(tmp_path, seed):
    """As in polished sections: chipped rims, specks, light from one side, a blurred picture, a scale bar."""
    known, rng = circles(seed), np.random.default_rng(seed)
    image = np.asarray(Image.open(drawn(tmp_path / "a.png", known)), float)[::-1].copy()
    y, x = np.indices(image.shape) + 0.5
    for a, b, r in known:
        for angle, depth in ((rng.uniform(0.0, 2 * np.pi), 1.0), (rng.uniform(0.0, 2 * np.pi), 0.5)):
            image[np.hypot(x - a - depth * r * np.cos(angle), y - b - depth * r * np.sin(angle)) < 0.2 * r] = 60.0
    image = gaussian_filter(image, 1.0) + 60.0 * x / SIZE
    image[8:14, 300:380] = 255.0
    Image.fromarray(image.clip(0, 255).astype(np.uint8)[::-1]).save(tmp_path / "b.png")
    whole = ((known[:, :2] > known[:, 2:]) & (known[:, :2] < SIZE - known[:, 2:])).all(axis=1)
    found, _ = micrograph.fibres(tmp_path / "b.png", 1.0)
    distance, nearest = cKDTree(found[:, :2]).query(known[:, :2])
    is_found = (distance < 1.0) & (np.abs(found[nearest, 2] - known[:, 2]) < 1.0)
    assert is_found[whole].mean() >= 0.97 and len(found) <= 1.02 * len(known)


def test_circles_are_drawn_beside_the_table_and_not_over_the_image(tmp_path):
    image = drawn(tmp_path / "a.png", circles(1)[:5])
    before = image.read_bytes()
    found, _ = micrograph.fibres(image, 1.0)
    assert micrograph.draw(image, found, 1.0, tmp_path / "a.csv") == str(tmp_path / "a_circles.png")
    assert image.read_bytes() == before and (tmp_path / "a_circles.png").stat().st_size > 10_000


def test_circles_of_a_wide_image_are_drawn_where_it_is_bright(tmp_path, monkeypatch):
    x, y = np.meshgrid(np.arange(300) + 0.5, np.arange(160) + 0.5)
    known = np.array([[60.0, 40.0, 20.0], [150.0, 110.0, 30.0], [240.0, 60.0, 25.0]])
    bright = np.any([np.hypot(x - a, y - b) < r for a, b, r in known], axis=0)
    Image.fromarray(np.where(bright, 200, 50).astype(np.uint8)[::-1]).save(tmp_path / "a.png")
    found, table = micrograph.fibres(tmp_path / "a.png", 0.5)
    assert table.startswith("# width = 150.0, height = 80.0, left = 0.0, bottom = 0.0\n")
    assert found[found[:, 0].argsort()] == pytest.approx(0.5 * known, abs=0.1)
    figures = []
    monkeypatch.setattr(plot_helpers, "save", lambda figure, path: figures.append(figure))
    micrograph.draw(tmp_path / "a.png", found, 0.5, tmp_path / "a.csv")
    (axes,) = figures[0].axes
    (shown,) = axes.images
    assert shown.origin == "lower" and shown.get_extent() == [0.0, 150.0, 0.0, 80.0]
    assert np.array_equal(np.asarray(shown.get_array()), np.where(bright, 200, 50))
    rims = np.array([line.get_xydata() for line in axes.lines])
    middles = (rims[:, 0] + rims[:, 32]) / 2  # of opposite points
    assert middles[middles[:, 0].argsort()] == pytest.approx(0.5 * known[:, :2], abs=0.1)
    words, share = axes.get_title().split("; circles, with their parts outside, have ")
    assert words == "3 fibres" and float(share.split()[0]) == pytest.approx(100 * bright.mean(), rel=0.02)


def test_the_picture_replaces_no_image(tmp_path):
    image = drawn(tmp_path / "a_circles.png", circles(1)[:5])
    before = image.read_bytes()
    with pytest.raises(CaseError, match=r"the picture would replace the image"):
        micrograph.draw(image, np.zeros((0, 3)), 1.0, tmp_path / "a.csv")
    assert image.read_bytes() == before


BAND = np.full((80, 80), 40, np.uint8)
BAND[70:] = 220
AWAY = np.mod(np.arange(120) + 0.5, 20.0) - 10.0
SPECKS = np.where(np.hypot(AWAY[None], AWAY[:, None]) < 2.8, 200, 50).astype(np.uint8)


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (BAND, "expected round fibres of 6 pixels in diameter or more"),  # all points of the contour lie on a line
        (BAND.T, "expected round fibres of 6 pixels in diameter or more"),
        (SPECKS, "expected round fibres of 6 pixels in diameter or more"),
        (np.full((20, 20), 7, np.uint8), "expected fibres brighter or darker"),
        (np.pad(np.full((40, 40), 200, np.uint8), 20), "expected round fibres of 6 pixels in diameter or more"),
    ],
)
def test_images_without_fibres_are_refused(tmp_path, image, words):
    Image.fromarray(image).save(tmp_path / "a.png")
    with pytest.raises(CaseError, match=words):
        micrograph.fibres(tmp_path / "a.png", 1.0)
