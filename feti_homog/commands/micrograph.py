"""Find the round fibres in a micrograph, list them in a table for [cell] geometry = "table", and draw them."""

from pathlib import Path

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.microstructure import image_circles, label_image
from feti_homog.typing import Float


def fibres(path: Path, pixel: float) -> tuple[Float, str]:
    """Return the round fibres in an image as circles (n, 3), and as the text of a fibre table.  On one rank.

    A circle has x, y and radius; `pixel` is the side of a pixel in the same unit.  Raises CaseError for a faulty image,
    and if it shows no round fibres.
    """
    image = label_image.read_image(path, is_grey=True)[::-1].astype(float)  # the first row of an image is the upper one
    if not -1e100 < image.min() < image.max() < 1e100:
        raise CaseError(f"{path}: expected fibres brighter or darker than the matrix, and grey values below 1e100")
    circles = image_circles.round_fibres(image) * pixel
    if not len(circles):
        raise CaseError(
            f"{path}: expected round fibres of {2 * image_circles.SMALLEST:g} pixels in diameter or more, found none"
        )
    height, width = (pixel * n for n in image.shape)
    rows = [",".join(map(repr, circle)) for circle in circles.round(9).tolist()]
    head = f"# width = {width!r}, height = {height!r}, left = 0.0, bottom = 0.0"
    return circles, "\n".join([head, "x,y,radius", *rows])


def draw(path: Path, circles: Float, pixel: float, table: Path) -> str:
    """Draw circles over an image into TABLE_circles.png; return its path.  Raises CaseError if `path` is this file."""
    from feti_homog.report.plots import plot_helpers  # with Matplotlib

    picture = table.with_name(f"{table.stem}_circles.png")
    if picture.resolve() == path.resolve():
        raise CaseError(f"--out {table}: expected another name; the picture would replace the image {path}")
    image = label_image.read_image(path, is_grey=True)[::-1]
    height, width = (pixel * n for n in image.shape)
    figure = plot_helpers.PLAIN.figure(7.0, 7.0 * height / width)
    axes = figure.subplots()
    axes.imshow(image, cmap="gray", origin="lower", extent=(0.0, width, 0.0, height))
    rim = circles[:, :2] + circles[:, 2:] * image_circles.RIM[:, None]
    axes.plot(rim[..., 0], rim[..., 1], color="tab:orange", linewidth=1.5)
    share = np.pi * (circles[:, 2] ** 2).sum() / (width * height)
    title = f"{len(circles)} fibres; circles, with their parts outside, have {100 * share:.3g} % of the area"
    axes.set(xlim=(0.0, width), ylim=(0.0, height), xlabel="x", ylabel="y", title=title)
    return str(plot_helpers.save(figure, picture))
