"""The deformed cell at several states of an angle or path, side by side and as an animation, in one range of colour."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image

from feti_homog.errors import FetiHomogError
from feti_homog.report.plots.cell_frame import bar_beside
from feti_homog.report.plots.decimation import drawn_displacement, drawn_mesh, largest_scale
from feti_homog.report.plots.interface_marks import DAMAGED, STATE_NAMES, DrawnCell, state_legend, states_of_nodes
from feti_homog.report.plots.load_labels import LoadLabels
from feti_homog.report.plots.plot_helpers import (
    STRESS_SYMBOLS,
    colour_range,
    draw_segments,
    largest_length,
    magnification,
    nodal_stress,
    pixels_of,
    plain,
    save,
    shade_triangles,
    stress_component,
    stress_label,
)
from feti_homog.report.text.analyses import reported
from feti_homog.results import atomic, field_file, landmarks
from feti_homog.results.landmarks import marks
from feti_homog.typing import Array, Document

MAX_PANELS = 6
MAX_FRAMES, FRAME_TIME = 24, 250  # of the animation; milliseconds
FRAME_LIMIT, PANEL_LIMIT, STATE_LIMIT = 8000, 30_000, 60_000  # triangles in a frame, a panel, a picture of one state
MOST_COLUMNS = 3
INCHES, BAR = 8.0, 0.55  # of all panels of a row, and of the colour bar in each
FRAME, MOST_HEIGHT = 3.6, 6.0  # width of a cell in the animation; largest height of a cell in it and in a panel; inches
LOADS_IN_PANEL, LINE = 2, 0.15  # in a line of its title; inches of a line


@dataclass(frozen=True)
class DeformedCell(DrawnCell):
    """Data that all panels share."""

    component: str
    colours: tuple[Normalize, str, str]
    scale: float
    labels: LoadLabels
    marks: Mapping[int, str]

    @classmethod
    def of_states(cls, file: Any, numbers: Sequence[int], document: Document, scale: float, limit: int) -> DeformedCell:
        """Return the stress that the case chooses, or that suits all these states, and one range of colours of all."""
        cell, states = DrawnCell.of(file, limit), [file[f"state/{n}"] for n in numbers]
        component = stress_component(document["case"]["output"].get("stress", "auto"), states)
        words = marks(document) if reported(document).is_followed else {}
        # At the end, once all fibres have come off, stresses may be many times those of the peak.
        marked = [state for state in states if words.get(int(state.attrs["point"]), "end") != "end"] or states
        stress = np.concatenate([nodal_stress(state, component, cell.drawn) for state in marked])
        colours = colour_range(stress, np.tile(cell.drawn.node_areas, len(marked)))
        parts = vars(cell) | {"component": component, "colours": colours, "scale": scale, "marks": words}
        return cls(**parts, labels=LoadLabels.of(document))

    def state(self, number: int) -> Any:
        """Return a state of the file."""
        return self.file[f"state/{number}"]

    def moved(self, number: int) -> Array:
        """(p, 2) places of the drawn nodes."""
        places: Array = self.drawn.points + self.scale * drawn_displacement(self.state(number), self.drawn)
        return places

    def draw(self, axes: Axes, number: int, moved: Array) -> Any:
        """Draw the cell of a state, drawn nodes at `moved`; returns what a colour bar is of."""
        state, (norm, colours, _) = self.state(number), self.colours
        stress = nodal_stress(state, self.component, self.drawn)
        shapes = shade_triangles(axes, self.drawn, moved, stress, norm, colours)
        draw_segments(axes, moved[self.borders], "black", 0.5)
        self.interface.mark(axes, moved, states_of_nodes(state), magnified=0.8)
        axes.set_aspect("equal")
        axes.set(xticks=(), yticks=())
        axes.set_axis_off()
        attributes = state.attrs
        mark = self.marks.get(int(attributes["point"]))
        title = f"{mark}: {attributes['label']}" if mark else attributes["label"]
        axes.set_title(f"{title}\n{self.labels.label(attributes, LOADS_IN_PANEL)}", fontsize=9, y=1.0)
        return shapes

    def bar(self, axes: Axes, shapes: Any, size: tuple[float, float] | None = None) -> None:
        """Draw the colour bar of all states beside axes, of a cell in this size (inches), if it is known."""
        bar = bar_beside(axes, shapes, self.colours[2], size)
        bar.ax.tick_params(labelsize=8)
        bar.locator = MaxNLocator(6)

    def lines(self, number: int) -> int:
        """Lines of the words for the load of a state."""
        return 1 + self.labels.label(self.state(number).attrs, LOADS_IN_PANEL).count("\n")

    @property
    def caption(self) -> str:
        """Return what is drawn."""
        scale = "true scale" if self.scale == 1 else f"displacement × {self.scale:g}"
        return f"${STRESS_SYMBOLS[self.component]}$ {stress_label(self.file.attrs['stress_unit'])}, {scale}"


def draw_state(
    axes: Axes,
    out: str | Path,
    number: int = 0,
    stress: str = "auto",
    scale: float = 1.0,
    most: float | None = None,
) -> str:
    """Draw the deformed cell in a state of `out`/result.h5 into Matplotlib's axes; returns the caption.  On one rank.

    `stress` is "S11", "S22" or "S12", by default along the largest strain; `scale` multiplies displacements.  Colours
    go from minus `most` to `most`, so that pictures beside each other have one scale; by default they suit the state.

    `axes.get_legend_handles_labels()` has the marks of bonded, open and closed interfaces.

    Raises:
        FetiHomogError: result.h5 cannot be read, or has no such state.
    """
    path = Path(out) / field_file.NAME
    try:
        with h5py.File(path, "r") as file:
            cell = DeformedCell.of_states(file, [number], {"case": {"output": {"stress": stress}}}, scale, STATE_LIMIT)
            if most is not None:
                cell = replace(cell, colours=(Normalize(-most, most), "RdBu_r", "both"))
            cell.bar(axes, cell.draw(axes, number, cell.moved(number)))
            caption, softens = cell.caption, bool((states_of_nodes(file[f"state/{number}"]) == DAMAGED).any())
    except (OSError, KeyError) as error:
        raise FetiHomogError(f"cannot draw state {number} of {path}: {error}") from error
    axes.autoscale_view()
    for line in state_legend([kind for kind in STATE_NAMES if softens or kind != DAMAGED]):
        axes.add_line(line)
    return caption


def plot(directory: Path, file: Any, document: Document) -> list[Path]:
    """`angle_states.png`, or `path_states.png` and `path.gif`."""
    count = len(file.get("state", ()))
    if not count:
        return []
    return PANELS[reported(document).name](directory, file, document, count)


def _angle(directory: Path, file: Any, document: Document, count: int) -> list[Path]:
    # The first of the unit cases, if there are three an angle.
    every = range(0, count, count // len(document["angle"]) or 1)
    numbers = [every[round(k)] for k in np.linspace(0, len(every) - 1, min(MAX_PANELS, len(every)))]
    panels = _side_by_side(file, numbers, document, shown_scale(file, document))
    return [save(panels, directory / "angle_states.png")]


def _path(directory: Path, file: Any, document: Document, count: int) -> list[Path]:
    scale = shown_scale(file, document)
    panels = _side_by_side(file, landmarks.landmark_states(document, MAX_PANELS, count), document, scale)
    paths = [save(panels, directory / "path_states.png")]
    frames = landmarks.chosen_states(document, MAX_FRAMES, count)
    return [*paths, _animation(file, frames, document, scale, directory / "path.gif")]


PANELS = {"angle": _angle, "path": _path}


def shown_scale(file: Any, document: Document) -> float:
    """Return the factor of displacements in all pictures of an angle or a path and in the report.

    It is that of the case or, by default, one at which the largest displacement and opening are seen and no triangle
    turns over, but at least 1 under a given load.
    """
    chosen = document.get("case", {}).get("output", {}).get("deformation_scale")
    if chosen is not None:
        return float(chosen)
    drawn = drawn_mesh(file, PANEL_LIMIT)
    displacement = opening = 0.0
    largest = math.inf
    for number in reported(document).states(document, MAX_FRAMES, len(file["state"])):
        state = file[f"state/{number}"]
        u = drawn_displacement(state, drawn)
        displacement, largest = max(displacement, largest_length(u)), min(largest, largest_scale(u, drawn))
        opening = max(opening, float(state["jump"][:, 0].max(initial=0.0)))
    size = float(min(file.attrs["width"], file.attrs["height"]))
    scale = magnification(displacement, size, opening, largest)
    return max(scale, 1.0) if reported(document).is_load_given(document) else scale


def _side_by_side(file: Any, numbers: Sequence[int], document: Document, scale: float) -> Figure:
    cell = DeformedCell.of_states(file, numbers, document, scale, PANEL_LIMIT)
    places = [cell.moved(number) for number in numbers]
    size = np.subtract(*_corners(places)[::-1])
    rows, columns = _grid(len(numbers), size[0] / size[1])
    height = _inches(size, (INCHES - BAR) / columns)[1]
    title = 0.2 + LINE * (1 + max(cell.lines(number) for number in numbers))
    figure = Figure(figsize=(INCHES, rows * (height + title) + 0.7), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    shapes = [cell.draw(axes, number, moved) for axes, number, moved in zip(grid, numbers, places, strict=False)]
    bar: Any = figure.colorbar(shapes[0], ax=grid.tolist(), extend=cell.colours[2], shrink=0.7, aspect=30, pad=0.01)
    bar.locator = MaxNLocator(6)
    for axes in grid[len(numbers) :]:
        axes.set_axis_off()
    grid[0].autoscale_view()
    figure.suptitle(f"{plain(file.attrs['title'])}: {cell.caption}".lstrip(": "), fontsize=11)
    states = [cell.interface.state(states_of_nodes(cell.state(number))) for number in numbers]
    found = np.unique(np.concatenate(states))
    handles = state_legend([kind for kind in STATE_NAMES if kind in found])
    if handles:
        figure.legend(handles=handles, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _inches(size: Array, width: float) -> tuple[float, float]:
    """Width and height of a cell of this size (2,) in a picture: as wide as may be, but not higher than MOST_HEIGHT."""
    scale = min(width / size[0], MOST_HEIGHT / size[1])
    return float(scale * size[0]), float(scale * size[1])


def _grid(panels: int, ratio: float) -> tuple[int, int]:
    """Return rows and columns of panels of this ratio of width to height: about as wide as high, few places empty."""
    wanted = min(math.sqrt(0.7 * panels * ratio), panels)
    grids = [(rows, -(-panels // rows)) for rows in {max(1, math.floor(wanted)), math.ceil(wanted)}]
    grids = [grid for grid in grids if grid[1] <= MOST_COLUMNS] or grids
    return min(grids, key=lambda grid: (grid[0] * grid[1] - panels, abs(grid[0] - wanted)))


def _animation(file: Any, numbers: Sequence[int], document: Document, scale: float, path: Path) -> Path:
    """Frames of one layout, that of the last state."""
    cell = DeformedCell.of_states(file, numbers, document, scale, FRAME_LIMIT)
    places = [cell.moved(number) for number in numbers]
    low, high = _corners(places)
    size = high - low
    title = 0.75 + LINE * max(cell.lines(number) for number in numbers)
    width, height = _inches(size, FRAME)
    figure = Figure(figsize=(FRAME + BAR, height + title), dpi=100, layout="constrained")
    axes = figure.subplots()
    figure.suptitle(cell.caption, fontsize=10)
    frames: list[Image.Image] = []
    for number, moved in zip(reversed(numbers), reversed(places), strict=True):
        for artist in [*axes.collections, *axes.patches, *axes.child_axes]:
            artist.remove()
        cell.bar(axes, cell.draw(axes, number, moved), (width, height))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        picture = Image.fromarray(pixels_of(figure))
        figure.set_layout_engine("none")
        frames.insert(0, picture.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))
    times = [FRAME_TIME] * (len(frames) - 1) + [6 * FRAME_TIME]
    film = {"save_all": True, "append_images": frames[1:], "duration": times, "loop": 0}
    return atomic.replace(path, lambda part: frames[0].save(part, format="GIF", **film))


def _corners(places: Sequence[Array]) -> tuple[Array, Array]:
    """Lower left and upper right corner of all states, with a margin."""
    low, high = np.min([p.min(axis=0) for p in places], axis=0), np.max([p.max(axis=0) for p in places], axis=0)
    margin = 0.02 * (high - low)
    return low - margin, high + margin
