"""Find the round fibres in a micrograph, as a table for [cell] geometry = "table" and a picture."""

from pathlib import Path

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import cKDTree

from feti_homog.errors import CaseError
from feti_homog.microstructure import label_image
from feti_homog.typing import Bool, Float

SMALLEST = 3.0  # radius in pixels
# Of each fit, the largest distance / radius of a point on a circle, and the least part of the visible rim with points.
FITS = (0.1, 0.2), (0.1, 0.4), (0.05, 0.7)
RIM = np.stack([np.cos(angles := np.linspace(0.0, 2 * np.pi, 65)), np.sin(angles)], axis=1)


def fibres(path: Path, pixel: float) -> tuple[Float, str]:
    """Return the round fibres in an image as circles (n, 3) and as a table.  On one rank.

    Otsu's threshold splits the grey values; circles begin at the maxima of the distance to the threshold's contour,
    are fitted to its points by least squares, and lie on the side, bright or dark, of which more points are on circles.

    Raises:
        CaseError: the image is faulty or without fibres, or scikit-image is not installed.
    """
    try:
        from skimage.feature import peak_local_max
        from skimage.filters import threshold_otsu
        from skimage.measure import find_contours
    except ImportError:
        raise CaseError('--image: needs scikit-image, as by pip install "feti_homog[images]"') from None
    image = label_image.read_image(path, is_grey=True)[::-1].astype(float)  # the first row of an image is the upper one
    bright, sides = image > threshold_otsu(image), list[tuple[float, Float]]()
    if bright.all() or not bright.any():
        raise CaseError(f"{path}: expected fibres brighter or darker than the matrix, found one grey value")
    level = (image[bright].mean() + image[~bright].mean()) / 2
    points = np.concatenate([np.zeros((0, 2)), *find_contours(image, level)])[:, ::-1] + 0.5
    for inside in (bright, ~bright):
        distance = distance_transform_edt(inside)
        peaks = peak_local_max(gaussian_filter(distance, 1.0), min_distance=2, exclude_border=False)
        sides.append(_fitted(points, np.column_stack([peaks[:, ::-1] + 0.5, distance[tuple(peaks.T)]]), image.T.shape))
    circles = max(sides, key=lambda side: side[0])[1] * pixel
    if not len(circles):
        raise CaseError(f"{path}: expected round fibres of {2 * SMALLEST:g} pixels in diameter or more, found none")
    height, width = (pixel * n for n in image.shape)
    rows = [",".join(map(repr, circle)) for circle in circles.round(9).tolist()]
    head = f"# width = {width!r}, height = {height!r}, left = 0.0, bottom = 0.0"
    return circles, "\n".join([head, "x,y,radius", *rows])


def draw(path: Path, circles: Float, pixel: float, table: Path) -> str:
    """Draw circles over an image, in TABLE_circles.png; return its name.  Raises CaseError if that is the image."""
    from feti_homog.report.plots import plot_helpers  # with Matplotlib

    picture = table.with_name(f"{table.stem}_circles.png")
    if picture.resolve() == path.resolve():
        raise CaseError(f"--out {table}: expected another name; the picture would replace the image {path}")
    image = label_image.read_image(path, is_grey=True)[::-1]
    height, width = (pixel * n for n in image.shape)
    figure = plot_helpers.PLAIN.figure(7.0, 7.0 * height / width)
    axes = figure.subplots()
    axes.imshow(image, cmap="gray", origin="lower", extent=(0.0, width, 0.0, height))
    rim = circles[:, :2] + circles[:, 2:] * RIM[:, None]
    axes.plot(rim[..., 0], rim[..., 1], color="tab:orange", linewidth=1.5)
    share = np.pi * (circles[:, 2] ** 2).sum() / (width * height)
    title = f"{len(circles)} fibres; whole circles have {100 * share:.3g} % of the area"
    axes.set(xlim=(0.0, width), ylim=(0.0, height), xlabel="x", ylabel="y", title=title)
    return str(plot_helpers.save(figure, picture))


def _fitted(points: Float, circles: Float, size: tuple[int, ...]) -> tuple[float, Float]:
    """Fit circles (m, 3) to contour points (n, 2) in an image of `size` pixels.

    Returns the part of the points on circles, and the circles (k, 3) with points on most of their rims in the image.
    """
    part = 0.0
    for reach, share in FITS:
        circles = circles[circles[:, 2] >= SMALLEST]
        circles = circles[_apart(circles)]
        if not len(circles) or not len(points):
            return 0.0, circles[:0]
        distance, nearest = cKDTree(circles[:, :2]).query(points, range(1, min(6, len(circles)) + 1))
        error = np.abs(distance - circles[nearest, 2])
        place, best = np.arange(len(points)), error.argmin(axis=1)
        owner, error = nearest[place, best], error[place, best]
        is_on = error < np.maximum(reach * circles[owner, 2], 1.0)
        part, owner = float(is_on.mean()), owner[is_on]
        # x^2 + y^2 = 2 a x + 2 b y + c about the centre of before, by normal equations.
        x, y = (points[is_on] - circles[owner, :2]).T
        rows = np.stack([2 * x, 2 * y, np.ones_like(x)])
        sums = [np.bincount(owner, row, len(circles)) for row in (rows[:, None] * rows).reshape(9, -1)]
        right = [np.bincount(owner, row * (x**2 + y**2), len(circles)) for row in rows]
        rim = circles[:, :2] + circles[:, 2:] * RIM[:, None]
        visible = ((rim > 0.0) & (rim < size)).all(axis=2).mean(axis=0)
        is_round = np.bincount(owner, minlength=len(circles)) > share * visible * 2 * np.pi * circles[:, 2]
        N, b = np.stack(sums, axis=1).reshape(-1, 3, 3)[is_round], np.stack(right, axis=1)[is_round, :, None]
        moved = (np.linalg.pinv(N, hermitian=True) @ b)[..., 0]  # points on a line leave N singular
        radius = np.sqrt(moved[:, 2] + moved[:, 0] ** 2 + moved[:, 1] ** 2)
        circles = np.column_stack([circles[is_round, :2] + moved[:, :2], radius])
    return part, circles


def _apart(circles: Float) -> Bool:
    """Mark the circles whose centres lie in no larger marked circle."""
    tree, is_covered, is_apart = cKDTree(circles[:, :2]), np.zeros(len(circles), bool), np.zeros(len(circles), bool)
    for k in np.argsort(-circles[:, 2], kind="stable"):
        if not is_covered[k]:
            is_apart[k] = True
            is_covered[tree.query_ball_point(circles[k, :2], circles[k, 2])] = True
    return is_apart
