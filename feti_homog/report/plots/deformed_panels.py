"""Draw the deformed cell at several angles or along a path: panels and an animation, in one colour range."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill
from typing import Any

import h5py
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from PIL import Image

from feti_homog.errors import FetiHomogError
from feti_homog.report.plots import decimation, drawn_cell, plot_helpers
from feti_homog.report.text.summary import reported
from feti_homog.results import atomic, field_file, field_guard, landmarks
from feti_homog.typing import Array, Document

MAX_PANELS, MAX_ANGLES = 6, 9
OWN_COLOURS = "end, own colours"
MAX_FRAMES, FRAME_TIME = 24, 250  # frames of the animation; milliseconds per frame
PANEL_LIMIT = 30_000  # triangles in a panel
WIDTH, FRAME, MOST_HEIGHT = 8.0, 3.6, 6.0  # inches: all panels, an animated cell, the highest cell


@dataclass(frozen=True)
class DeformedCell(drawn_cell.DrawnCell):
    """A cell with the colours, scale and labels that all panels share.

    `colours` are as from `plot_helpers.colour_range`; `marks` maps point numbers to titles of landmarks.
    """

    component: str
    colours: tuple[Normalize, Any, str]
    scale: float
    labels: drawn_cell.LoadLabels
    marks: Mapping[int, str]

    @classmethod
    def of_states(cls, file: Any, numbers: Sequence[int], document: Document, scale: float, limit: int) -> DeformedCell:
        """Create the cell with one stress component and one colour range for all states `numbers`; see `draw`.

        The case may name the component; by default it follows from all states, or on a path from the peak.
        """
        cell, states = drawn_cell.DrawnCell.of(file, limit), [file[f"state/{n}"] for n in numbers]
        chosen, mark_of = document["case"]["output"].get("stress", "auto"), dict[int, str]()
        if reported(document).is_followed:
            mark_of, peak = landmarks.marks(document), landmarks.peak_of(document)
            chosen = peak["stress_name"] if chosen == "auto" and "stress" in peak else chosen
        component, areas = plot_helpers.stress_component(chosen, states), cell.drawn.node_areas
        stress = np.array([plot_helpers.nodal_stress(state, component, cell.drawn) for state in states])
        colours = plot_helpers.colour_range(stress, areas)
        if mark_of.get(int(states[-1].attrs["point"])) == "end" and len(states) > 1:
            # At the end, after all fibres have debonded, stresses may be many times larger than before.
            before, end = (plot_helpers.colour_range(part, areas) for part in (stress[:-1], stress[-1]))
            if np.abs(end[0].inverse([0.0, 1.0])).max() > 2.0 * np.abs(before[0].inverse([0.0, 1.0])).max():
                colours, mark_of = before, mark_of | {max(mark_of): OWN_COLOURS}
        parts = vars(cell) | {"component": component, "colours": colours, "scale": scale, "marks": mark_of}
        return cls(**parts, labels=drawn_cell.LoadLabels.of(document))

    def state(self, number: int) -> Any:
        """Return the group of state `number` in the open result.h5."""
        return self.file[f"state/{number}"]

    def moved(self, number: int) -> Array:
        """Return the positions (p, 2) of the drawn nodes in state `number`, displaced by `scale` times u."""
        places: Array = self.drawn.points + self.scale * decimation.drawn_displacement(self.state(number), self.drawn)
        return places

    def draw(self, axes: Axes, number: int, moved: Array) -> Any:
        """Draw the cell in state `number`, with its nodes at `moved` (p, 2).

        Returns the coloured triangles.  The end of a path has its own colours above twice the earlier stresses.
        """
        state, (norm, colours, _) = self.state(number), self.colours
        norm = Normalize(norm.vmin, norm.vmax)  # a shared one would call the artists of earlier frames
        attributes = state.attrs
        stress = plot_helpers.nodal_stress(state, self.component, self.drawn)
        mark = self.marks.get(attributes["point"])
        if mark == OWN_COLOURS:
            norm, colours, _ = plot_helpers.colour_range(stress, self.drawn.node_areas)
        shapes = plot_helpers.shade_triangles(axes, self.drawn, moved, stress, norm, colours)
        plot_helpers.draw_segments(axes, moved[self.borders], "black", 0.5)
        self.interface.mark(axes, moved, state, magnified=0.8)
        axes.set(aspect="equal", xticks=(), yticks=())
        axes.set_axis_off()
        # Letters are about half of the font size wide; a panel is a quarter wider than its axes before the layout.
        letters = int(180.0 * axes.bbox.width / axes.figure.dpi / float(axes.title.get_fontsize()))
        label = attributes["label"].replace(" deg", "°")
        title = f"{mark}: {label}" if mark else label
        if mark and len(title) > letters:
            title = f"{fill(mark, letters)}:\n{label}"
        load = self.labels.label(attributes, 2) if letters > 30 else self.labels.words(attributes)[0]
        axes.set_title(f"{title}\n{load}", y=1.0)
        return shapes

    def bar(self, axes: Axes, shapes: Any) -> None:
        """Draw the colour bar of the shapes beside the axes.  If there are two bars, both have titles."""
        is_common = shapes.get_clim() == (self.colours[0].vmin, self.colours[0].vmax)
        bar = drawn_cell.bar_beside(axes, shapes, self.colours[2] if is_common else shapes.cmap.colorbar_extend)
        before = "before" if OWN_COLOURS in self.marks.values() else ""
        bar.ax.set_title(before if is_common else "end")
        bar.locator = MaxNLocator(6)

    @property
    def caption(self) -> str:
        """Describe the stress, its unit and the displacement scale in words."""
        scale = "true scale" if self.scale == 1 else f"displacement × {self.scale:g}"
        symbol = plot_helpers.STRESS_SYMBOLS[self.component]
        return f"${symbol}$ {plot_helpers.stress_label(self.file.attrs['stress_unit'])}, {scale}"


def draw_state(
    axes: Axes, out: str | Path, number: int = 0, stress: str = "auto", scale: float = 1.0, most: float | None = None
) -> str:
    """Draw the deformed cell in one stored state into Matplotlib's axes.

    The state has index `number` in `out`/result.h5.  Call on one rank.  Returns the caption.

    `stress` is a component such as "S11", by default along the largest strain; `scale` multiplies displacements.
    Colours go from minus `most` to `most`, so that pictures can share their colours; by default they suit the state.

    `axes.get_legend_handles_labels()` has the marks of bonded, open and closed interfaces.  Raises FetiHomogError if
    result.h5 cannot be read, or has no such state.
    """
    path = Path(out) / field_file.NAME
    field_guard.require_own(path, number)
    try:
        with h5py.File(path, "r") as file:
            cell = DeformedCell.of_states(file, [number], {"case": {"output": {"stress": stress}}}, scale, 60_000)
            if most is not None:
                cell = replace(cell, colours=(Normalize(-most, most), "RdBu_r", "both"))
            cell.bar(axes, cell.draw(axes, number, cell.moved(number)))
            caption, states = cell.caption, drawn_cell.states_of_nodes(file[f"state/{number}"])
            softens = bool((states == drawn_cell.DAMAGED).any())
    except (OSError, KeyError) as error:
        raise FetiHomogError(f"cannot draw state {number} of {path}: {error}") from error
    axes.autoscale_view()
    kinds = [kind for kind in drawn_cell.STATE_NAMES if softens or kind != drawn_cell.DAMAGED]
    for line in drawn_cell.state_legend(kinds):
        axes.add_line(line)
    return caption


def shown_scale(file: Any, document: Document) -> float:
    """Return the displacement factor for all pictures of an `angle` or `path` analysis.

    The case may give the factor; by default the largest displacement and opening are visible and no triangle turns
    over, but the factor is at least 1 if the case gives the load.
    """
    chosen = document.get("case", {}).get("output", {}).get("deformation_scale")
    if chosen is not None:
        return float(chosen)
    drawn = decimation.drawn_mesh(file, PANEL_LIMIT)
    displacement = opening = 0.0
    largest = math.inf
    for number in shown_states(document, MAX_FRAMES, len(file["state"])):
        state = file[f"state/{number}"]
        u = decimation.drawn_displacement(state, drawn)
        displacement = max(displacement, float(np.linalg.norm(u, axis=1).max()))
        largest = min(largest, decimation.largest_scale(u, drawn))
        opening = max(opening, float(state["jump"][:, 0].max(initial=0.0)))
    size = float(min(file.attrs["width"], file.attrs["height"]))
    scale = plot_helpers.magnification(displacement, size, opening, largest)
    is_load_given = reported(document).is_followed or document["case"].get("angle", {}).get("strain") is not None
    return max(scale, 1.0) if is_load_given else scale


def shown_states(document: Document, most: int, count: int) -> list[int]:
    """Choose at most `most` of `count` states for pictures, and return their indices.

    The states are at the path landmarks, or else evenly spaced, with equal steps if `count` allows.
    """
    if reported(document).is_followed:
        return landmarks.chosen_states(document, most, count)
    even = (parts for parts in range(min(most, count) - 1, 2, -1) if (count - 1) % parts == 0)
    return sorted({round(k) for k in np.linspace(0, count - 1, next(even, most - 1) + 1)})


def panels(file: Any, document: Document, scale: float, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw panels of several states, path landmarks or angles, with displacements times `scale`."""
    count, analysis = len(file["state"]), reported(document)
    if analysis.is_followed:
        numbers = landmarks.landmark_states(document, MAX_PANELS, count)
    else:  # the first unit load, if an angle has several
        every = range(0, count, max(1, count // len(document[analysis.name])))
        numbers = [every[k] for k in shown_states(document, MAX_ANGLES, len(every))]
    cell = DeformedCell.of_states(file, numbers, document, scale, PANEL_LIMIT)
    places = [cell.moved(number) for number in numbers]
    low, high = _corners(places)
    size = high - low
    rows, columns = _grid(len(numbers), size[0] / size[1])
    height = _height(size, (WIDTH - 0.5) / columns) + 0.55  # with room for a colour bar and a title
    figure = look.figure(WIDTH, rows * height + 0.7, "compressed")
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    shapes = [cell.draw(axes, number, moved) for axes, number, moved in zip(grid, numbers, places, strict=False)]
    if OWN_COLOURS in cell.marks.values():
        below = grid[len(numbers) - 1].inset_axes((0.0, -0.12, 1.0, 0.05))  # beside it, columns would be uneven
        figure.colorbar(shapes[-1], below, extend=shapes[-1].cmap.colorbar_extend, orientation="horizontal")
    bar: Any = figure.colorbar(shapes[0], ax=grid.tolist(), extend=cell.colours[2], shrink=0.7, aspect=30, pad=0.03)
    bar.locator = MaxNLocator(6)
    bar.set_label(cell.caption if look.title is not None else "")
    bar.ax.set_title("before" if OWN_COLOURS in cell.marks.values() else "")
    for axes in grid[len(numbers) :]:
        axes.set_axis_off()
    grid[0].autoscale_view()
    figure.suptitle(f"{plot_helpers.plain(file.attrs['title'])}: {cell.caption}".lstrip(": "))
    states = [cell.interface.state(drawn_cell.states_of_nodes(cell.state(number))) for number in numbers]
    present = np.unique(np.concatenate(states))
    plot_helpers.legend_below(figure, drawn_cell.state_legend([k for k in drawn_cell.STATE_NAMES if k in present]))
    figure.draw_without_rendering()  # the layout settles at the second drawing
    return figure


def _height(size: Array, width: float) -> float:
    """Return the height in inches of a cell with sides `size` (2,) that is `width` wide, at most MOST_HEIGHT."""
    return float(min(width / size[0], MOST_HEIGHT / size[1]) * size[1])


def _grid(panels: int, ratio: float) -> tuple[int, int]:
    """Choose the numbers of rows and columns for panels with width / height `ratio`.

    The grid is about square and has few empty positions.
    """
    ideal = min(math.sqrt(0.7 * panels * ratio), panels)
    most = 3 if panels <= MAX_PANELS else 4
    choices = {max(1, math.floor(ideal)), math.ceil(ideal), math.ceil(panels / most)}
    grids = [(rows, math.ceil(panels / rows)) for rows in choices if math.ceil(panels / rows) <= most]
    return min(grids, key=lambda grid: (grid[0] * grid[1] - panels, abs(grid[0] - ideal)))


def animation(file: Any, document: Document, scale: float, path: Path) -> Path:
    """Write the states along a load path to the file `path` as an animated GIF, all frames in the last one's layout."""
    numbers = shown_states(document, MAX_FRAMES, len(file["state"]))
    cell = DeformedCell.of_states(file, numbers, document, scale, 8000)
    places = [cell.moved(number) for number in numbers]
    low, high = _corners(places)
    figure = Figure(figsize=(FRAME + 0.55, _height(high - low, FRAME) + 1.05), dpi=100, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    axes, frames = figure.subplots(), list[Image.Image]()
    figure.suptitle(cell.caption)
    for number, moved in zip(reversed(numbers), reversed(places), strict=True):
        for artist in [*axes.collections, *axes.patches, *axes.child_axes]:
            artist.remove()
        cell.bar(axes, cell.draw(axes, number, moved))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        with plot_helpers.missing_letters_as_boxes():
            canvas.draw()
        figure.set_layout_engine("none")
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        frames.insert(0, picture.quantize(256, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE))
    times = [FRAME_TIME] * (len(frames) - 1) + [6 * FRAME_TIME]
    film = {"save_all": True, "append_images": frames[1:], "duration": times, "loop": 0}
    return atomic.replace(path, lambda part: frames[0].save(part, format="GIF", **film))


def _corners(places: Sequence[Array]) -> tuple[Array, Array]:
    """Return the lower left and upper right corners around the node positions (p, 2) of all states, with a margin."""
    low, high = np.min([p.min(axis=0) for p in places], axis=0), np.max([p.max(axis=0) for p in places], axis=0)
    margin = 0.02 * (high - low)
    return low - margin, high + margin
