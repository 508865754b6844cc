"""The pictures of a result: the cell, the deformed cell of each state, the tractions on a fibre."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path as Path2D

from feti_homog.errors import FetiHomogError
from feti_homog.output import fields, results
from feti_homog.output.draw import Array, Drawing, drawing, on_nodes, on_triangles, outlines

CASES = ("E11", "E22", "G12")
STRAINS = (r"E_{11}", r"E_{22}", r"\gamma_{12}")
STRESSES = {"S11": r"\sigma_{11}", "S22": r"\sigma_{22}", "S12": r"\sigma_{12}"}
MESH_LINES = 6000  # triangles up to which their edges are drawn
FEW_BODIES = 8  # up to which the deformed cell is drawn over all that it has left
SIDE = 4.8  # inches, the longer side of a drawn cell
STYLE = {"font.size": 10, "axes.titlesize": 11, "axes.linewidth": 0.8, "savefig.dpi": 200}
MATRIX = "#ece8df"
FIBRES = ("Blues", "Oranges", "Greens", "Purples", "Reds", "Greys")  # one colour map for each phase


def plot(directory: Path) -> list[Path]:
    """Draws the pictures of `directory`/result.h5 beside it and returns their paths.

    cell.png, and for each state case_E11.png, case_E22.png, case_G12.png (unit strains) or state_K.png. If
    there is a result.json, its case.output chooses the stress component (else that of the unit strain) and
    the deformation scale. Call on one rank.

    Raises:
        FetiHomogError: result.h5 cannot be read, or a picture cannot be written.
    """
    directory = Path(directory)
    output = _settings(directory)
    try:
        with mpl.rc_context(STYLE), h5py.File(directory / fields.NAME, "r") as file:
            drawn = drawing(file)
            borders = outlines(drawn, drawn.body)
            paths = [_save(_cell(file.attrs, drawn, borders), directory / "cell.png")]
            for number in sorted(file.get("state", ()), key=int):
                state = file[f"state/{number}"]
                unit = _unit_case(state.attrs["strain"])
                name = f"state_{number}" if unit is None else f"case_{CASES[unit]}"
                paths.append(_save(_deformed(file, state, drawn, borders, output), directory / f"{name}.png"))
    except OSError as error:
        raise FetiHomogError(f"cannot draw {directory / fields.NAME}: {error.strerror or error}") from error
    return paths


def _settings(directory: Path) -> Mapping[str, Any]:
    """The case's [output]; empty if there is no result.json."""
    if not (directory / results.NAME).exists():
        return {}
    output: Mapping[str, Any] = results.read(directory).get("case", {}).get("output", {})
    return output


def _unit_case(strain: Array) -> int | None:
    """Which of E11, E22, gamma12 is 1 while the others are 0."""
    cases = [i for i in range(3) if np.array_equal(strain, np.eye(3)[i])]
    return cases[0] if cases else None


def _save(figure: Figure, path: Path) -> Path:
    FigureCanvasAgg(figure)
    figure.savefig(path, bbox_inches="tight", pad_inches=0.08)
    return path


def _cell(attributes: Any, drawn: Drawing, borders: Array) -> Figure:
    """The phases, each body in a shade of its own, beside the subdomains."""
    figure, (left, right) = _figure(attributes, panels=2)
    edges = len(drawn.triangles) <= MESH_LINES
    bodies, subdomains = drawn.body.max() + 1, drawn.subdomain.max() + 1
    shades, legend = _shades(drawn, list(attributes["phases"]))
    for axes, label, colours in ((left, drawn.body, shades), (right, drawn.subdomain, _distinct(subdomains))):
        _paint(axes, drawn, drawn.points, colours[label], edges)
        _lines(axes, drawn.points[borders], "black", 0.9)
        _frame(axes, attributes)
    _lines(right, drawn.points[outlines(drawn, drawn.subdomain)], "black", 0.5)
    left.set_title(_count(bodies, "body", "bodies"))
    right.set_title(_count(subdomains, "subdomain", "subdomains"))
    right.set_ylabel("")
    figure.suptitle(attributes["title"], fontsize=12)
    left.legend(handles=legend, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=3, frameon=False)
    return figure


def _deformed(file: Any, state: Any, drawn: Drawing, borders: Array, output: Mapping[str, Any]) -> Figure:
    """The magnified deformed cell with a stress component in colour, and the outline it has left."""
    attributes, strain = file.attrs, state.attrs["strain"]
    figure, (axes,) = _figure(attributes, panels=1)
    displacement = on_nodes(state["displacement"], drawn)
    scale = output.get("deformation_scale") or _scale(displacement, drawn.points)
    unit = _unit_case(strain)
    component = output.get("stress", "auto")
    if component not in STRESSES:
        component = list(STRESSES)[unit or 0]
    stress = on_triangles(state["stress"], list(STRESSES).index(component), drawn)
    norm, colours, extend = _colours(stress)
    moved = drawn.points + scale * displacement
    picture = _paint(axes, drawn, moved, stress, edges=False, norm=norm, cmap=colours)
    _lines(axes, _left(attributes, drawn, borders), "0.5", 0.7)
    _lines(axes, moved[borders], "black", 0.8)
    _frame(axes, attributes)
    bar = figure.colorbar(picture, cax=axes.inset_axes((1.03, 0.0, 0.04, 1.0)), extend=extend)
    bar.set_label(f"${STRESSES[component]}$ " + (_unit(attributes["stress_unit"]) or "(unit of the moduli)"))
    axes.set_title(f"{attributes['title']}\n{_load(strain)}, displacement × {scale:g}".lstrip())
    return figure


def _left(attributes: Any, drawn: Drawing, borders: Array) -> Array:
    """The undeformed outlines (e, 2, 2): of the bodies if they are few, else of the cell alone."""
    if drawn.body.max() < FEW_BODIES:
        outline: Array = drawn.points[borders]
        return outline
    corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [attributes["width"], attributes["height"]]
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


def _figure(attributes: Any, panels: int) -> tuple[Figure, Sequence[Axes]]:
    width, height = float(attributes["width"]), float(attributes["height"])
    inches = SIDE / max(width, height)
    figure = Figure(figsize=(panels * (width * inches + 0.7) + 0.1, height * inches + 1.2), layout="constrained")
    return figure, figure.subplots(1, panels, squeeze=False)[0]


def _frame(axes: Axes, attributes: Any) -> None:
    unit = _unit(attributes["length_unit"]) or "(cell units)"
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.03)
    axes.set_xlabel(f"$x_1$ {unit}")
    axes.set_ylabel(f"$x_2$ {unit}")
    axes.spines[["top", "right"]].set_visible(False)


def _paint(axes: Axes, drawn: Drawing, points: Array, colours: Array, edges: bool, **mapping: Any) -> Any:
    """Fills the triangles with values, or with colours (q, 4); antialiasing would leave seams."""
    fill = {"array": colours} if colours.ndim == 1 else {"facecolors": colours}
    lines = {"edgecolors": "0.55", "linewidths": 0.15} if edges else {"edgecolors": "none", "antialiased": False}
    style: dict[str, Any] = fill | lines | mapping
    corners: Any = points[drawn.triangles]
    shapes = PolyCollection(corners, **style)
    axes.add_collection(shapes)
    return shapes


def _lines(axes: Axes, segments: Array, colour: str, width: float) -> None:
    """Draws segments (e, 2, 2) as one path, in which they join without spots."""
    path = Path2D(segments.reshape(-1, 2), [Path2D.MOVETO, Path2D.LINETO] * len(segments))
    axes.add_patch(PathPatch(path, fill=False, edgecolor=colour, linewidth=width, capstyle="butt", snap=False))


def _shades(drawn: Drawing, phases: list[str]) -> tuple[Array, list[Patch]]:
    """A colour (bodies, 4) for each body, a shade of its phase's; and the legend of the phases."""
    colours = np.zeros((drawn.body.max() + 1, 4))
    legend = []
    for index, phase in enumerate(phases):
        bodies = np.unique(drawn.body[drawn.phase == index])
        if not len(bodies):
            continue
        if index == 0:
            shades = np.tile(mpl.colors.to_rgba(MATRIX), (len(bodies), 1))
        else:
            tones = 0.65 - 0.35 * (np.arange(len(bodies)) * 0.618 % 1.0)
            shades = mpl.colormaps[FIBRES[(index - 1) % len(FIBRES)]](tones)
        colours[bodies] = shades
        legend.append(Patch(facecolor=shades[0], edgecolor="black", linewidth=0.6, label=phase))
    return colours, legend


def _distinct(count: int) -> Array:
    """Colours (count, 4), of which those with near numbers differ most."""
    colours: Array = mpl.colormaps["tab20"](np.arange(count) * 7 % 20)
    colours[:, :3] = 0.3 + 0.7 * colours[:, :3]
    return colours


def _colours(values: Array) -> tuple[Normalize, str, str]:
    """Colour range, map and the ends at which values lie outside; the extreme 0.5 % may, at either end."""
    low, high = float(values.min()), float(values.max())
    least, most = (float(value) for value in np.percentile(values, (0.5, 99.5)))
    if high - low <= 1e-6 * max(abs(low), abs(high), 1e-300):
        middle = 0.5 * (low + high)
        half = 0.5 * (abs(middle) or 1.0)
        return Normalize(middle - half, middle + half), "viridis", "neither"
    slack = 0.05 * (most - least)
    least, most = (low if least - low < slack else least), (high if high - most < slack else most)
    colours = "viridis"
    if min(-least, most) > 0.05 * max(-least, most):
        colours, most = "RdBu_r", max(-least, most)
        least = -most
    extend = {(0, 0): "neither", (1, 0): "min", (0, 1): "max", (1, 1): "both"}[low < least, high > most]
    return Normalize(least, most), colours, extend


def _scale(displacement: Array, points: Array) -> float:
    """1, 2 or 5 times a power of ten, with which the largest displacement is about a tenth of the cell."""
    largest = float(np.linalg.norm(displacement, axis=1).max())
    if largest == 0.0:
        return 1.0
    wanted = 0.1 * float(np.ptp(points, axis=0).min()) / largest
    power = 10.0 ** math.floor(math.log10(wanted))
    return power * min((1, 2, 5, 10), key=lambda factor: abs(math.log(factor * power / wanted)))


def _load(strain: Array) -> str:
    return ", ".join(f"${STRAINS[i]} = {strain[i]:.4g}$" for i in range(3) if strain[i] != 0.0) or "no strain"


def _unit(label: str) -> str:
    return f"({label})" if label else ""


def _count(number: int, one: str, many: str) -> str:
    return f"{number} {one if number == 1 else many}"
