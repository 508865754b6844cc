"""Draw the cell: cell.png, partition.png, mesh_error.png, and the deformed cell under each load.

Fibres have the numbers N of `fibre = N` in case files.
"""

import json
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, StrMethodFormatter
from matplotlib.tri import Triangulation
from scipy.spatial import cKDTree

from feti_homog.report.plots import decimation, drawn_cell, plot_helpers
from feti_homog.report.text.summary import reported
from feti_homog.report.text.tables import with_micro
from feti_homog.typing import Array, Document

IN_LEGEND = 10  # most phases or parts in the legend, which would otherwise cover the cell
MATRIX = "0.87"
TURN = 0.618  # golden section: as a fraction of the colour circle, it never repeats a colour
LEAST_SIZE = 3.0  # points; smallest font size
LEVEL_INK, LEVEL_WIDTH = "0.15", 0.6  # style of the contour lines of u_3
UNDEFORMED = "0.5"
CUT = "#B00000"  # colour of cuts within bodies, and of debonded arcs
FLAT = 0.02  # standard deviation in each phase, relative to the largest stress, below which colours show nothing


def figure(cell: drawn_cell.DrawnCell, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw the materials of the cell with the fibre numbers and the initially debonded arcs.

    The figure also has the strength factors of the fibres if a factor is not 1.
    """
    drawn, attributes, fibres = cell.drawn, cell.file.attrs, cell.file["fibre"]
    phases = list(attributes["phases"])
    # Pale colours leave black numbers readable.
    inks = np.array([mpl.colors.to_rgba(MATRIX), *(0.45 + 0.55 * _cyclic_colours(len(phases) - 1))])
    picture, axes = _outlined(cell, inks[drawn.phase], look)
    factors = fibres["strength"][:] if "strength" in fibres else np.ones(len(fibres["number"]))
    varies = bool((factors != 1.0).any())
    longest = max(attributes["width"], attributes["height"])
    inches = float((picture.get_size_inches() - drawn_cell.MARGINS).min()) / longest
    write_fibre_numbers(axes, cell, inches, factors if varies else None)
    text = "\nbelow the numbers: strength / strength in [interface]" if varies else ""
    axes.set_title(_title(attributes, f"bodies: {drawn.body.max() + 1}") + text)
    present = np.unique(drawn.phase)
    # Legends leave out labels that begin with "_".
    labels = [f" {name}" if name.startswith("_") else name for name in phases]
    style: dict[str, Any] = {"edgecolor": "black", "linewidth": 0.6}
    entries: list[Any] = [Patch(facecolor=inks[k], label=labels[k], **style) for k in present[:IN_LEGEND]]
    if len(present) > IN_LEGEND:
        entries.append(Patch(facecolor="none", edgecolor="none", label=f"and {len(present) - IN_LEGEND} others"))
    state = cell.file.get("state/0")  # before the load breaks bonds
    if state is not None and (is_debonded := cell.interface.state(state["status"][:]) != drawn_cell.BONDED).any():
        plot_helpers.draw_segments(axes, drawn.points[cell.interface.edges[is_debonded]], CUT, 2.4, "round")
        entries.append(Line2D([], [], color=CUT, linewidth=2.4, label="initially debonded"))
    plot_helpers.legend_below(picture, entries, 4)
    return picture


def _cyclic_colours(count: int) -> Array:
    """Return colours (count, 4) around the colour circle, from blue on.  None of them is grey."""
    return np.asarray(mpl.colormaps["hsv"]((0.58 + TURN * np.arange(count)) % 1.0))


def partition(cell: drawn_cell.DrawnCell, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw the subdomains, coloured one by one or, if the run had several ranks, by rank.

    A subdomain across materials counts once for each body.  More than `IN_LEGEND` colours are pale, with numbers.
    """
    drawn, ranks = cell.drawn, np.unique(cell.drawn.rank)
    kind, coloured = ("rank", drawn.rank) if len(ranks) > 1 else ("part", drawn.subdomain)
    numbers = np.unique(coloured)
    is_numbered = len(numbers) > IN_LEGEND
    colours = 1.0 - (0.2 if is_numbered else 0.6) * (1.0 - _cyclic_colours(coloured.max() + 1))
    picture, axes = _outlined(cell, colours[coloured], look)
    cuts = decimation.outline_edges(drawn, drawn.subdomain)
    plot_helpers.draw_segments(axes, drawn.points[cuts], CUT, 0.8)  # hidden below the outlines
    plot_helpers.draw_segments(axes, drawn.points[cell.borders], "black", 0.9)
    text = f"bodies: {drawn.body.max() + 1}, parts within bodies: {drawn.subdomain.max() + 1}, ranks: {len(ranks)}"
    axes.set_title(_title(cell.file.attrs, text))
    entries: list[Any] = [Patch(facecolor=colours[k], label=f"{kind} {k}") for k in numbers if not is_numbered]
    if len(cuts) > len(cell.borders):
        entries.append(Line2D([], [], color=CUT, label="cut within a body"))
    plot_helpers.legend_below(picture, entries)
    scale = 32 * (picture.get_size_inches() - drawn_cell.MARGINS).min() / np.ptp(drawn.points, axis=0).max()
    outline, middles = cKDTree(drawn.points[np.unique(cuts)]), drawn.points[drawn.triangles].mean(axis=1)
    for part in np.unique(drawn.subdomain) if is_numbered else ():
        triangles = np.flatnonzero(drawn.subdomain == part)
        room = outline.query(middles[triangles])[0]
        inner, size = triangles[room.argmax()], min(room.max() * scale, 11.0)
        if size >= LEAST_SIZE:
            x, y = middles[inner]
            axes.text(x, y, str(coloured[inner]), fontsize=size, ha="center", va="center", clip_on=True)
    return picture


def mesh_error(cell: drawn_cell.DrawnCell, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure | None:
    """Draw the cell coloured by its mesh error density.  Returns None without finite errors above 0.

    The density is (energy error / energy of the cell) / (area / area of the cell) of a triangle, the largest over all
    states.  Singular tips lie above the colour range: otherwise the rest of the cell would have one colour.
    """
    file, drawn = cell.file, cell.drawn
    tables = [state["mesh_error"] for state in file.get("state", {}).values() if "mesh_error" in state]
    if not tables:
        return None
    area = drawn.areas / (file.attrs["width"] * file.attrs["height"])
    errors = np.max([decimation.triangle_means(table, None, drawn) for table in tables], axis=0)
    density: Array = errors * drawn.group / drawn.pieces / area
    highest = float(density.max(initial=0.0))
    if not 0.0 < highest < np.inf:
        return None
    picture, axes = drawn_cell.figure_of(file.attrs, look)
    top = float(plot_helpers.value_range(density, area)[0].vmax or highest)
    lowest = top / 10.0**4  # smaller densities, on hardly any area, have one colour
    colours = ScalarMappable(LogNorm(lowest, top), "magma_r")
    # Means at the nodes of each body do not show where the body is cut.
    values = np.maximum(np.exp(decimation.node_means(np.log(np.maximum(density, lowest)), drawn)), lowest)
    plot_helpers.shade_triangles(axes, drawn, drawn.points, values, colours.norm, colours.cmap)
    bar = drawn_cell.bar_beside(axes, colours, "both" if highest > top else "min")
    bar.set_label(fill("local error / mean energy (both per area)", int((picture.get_figheight() - 1.2) / 0.075)))
    plot_helpers.draw_segments(axes, drawn.points[cell.borders], "black", 0.7)
    drawn_cell.label_cell_axes(axes, file.attrs)
    axes.set_title(_title(file.attrs, "estimated mesh error, largest of all states"))
    return picture


def _outlined(cell: drawn_cell.DrawnCell, colours: Array, look: plot_helpers.Look) -> tuple[Figure, Axes]:
    """Draw the cell with triangle colours (q, 4) and body outlines.  Returns figure and axes."""
    picture, axes = drawn_cell.figure_of(cell.file.attrs, look)
    points, triangles = cell.drawn.points, cell.drawn.triangles
    # Each triangle has its own nodes, for sharp colours; antialiasing would leave seams.
    separate = np.arange(triangles.size).reshape(-1, 3)
    mesh: Any = plot_helpers.add_triangles(axes, points[triangles].reshape(-1, 2), separate)
    mesh.set_facecolor(np.repeat(colours, 3, axis=0))
    if len(triangles) <= 6000:
        sides = points[triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)]
        plot_helpers.draw_segments(axes, sides, plot_helpers.MESH, 0.25)
    plot_helpers.draw_segments(axes, points[cell.borders], "black", 0.9)
    drawn_cell.label_cell_axes(axes, cell.file.attrs)
    return picture, axes


def _title(attributes: Any, text: str) -> str:
    return f"{plot_helpers.plain(attributes['title'])}\n{text}".lstrip()


def write_fibre_numbers(axes: Axes, cell: drawn_cell.DrawnCell, inches: float, factors: Array | None = None) -> None:
    """Write the fibre numbers onto the drawn fibres; write nothing in a cell of more than 2000 fibres.

    The cell sides may cut a round fibre; every part of the fibre then gets the number.

    Args:
        inches: inches in the picture per length unit.
        factors: (f,) values to write below the numbers, if any.
    """
    fibres, drawn = cell.file["fibre"], cell.drawn
    if len(fibres["number"]) > 2000:  # such small numbers would be illegible
        return
    period, low = np.array([cell.file.attrs[name] for name in ("width", "height")]), drawn.points.min(axis=0)
    outline, middles = cKDTree(drawn.points[np.unique(cell.borders)]), drawn.points[drawn.triangles].mean(axis=1)
    elements, sections = cKDTree(middles), json.loads(cell.file.attrs.get("case", "{}"))
    is_periodic = sections.get("cell", {}).get("boundary", "periodic") == "periodic"  # else there are no images
    shifts = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 2)
    tables = (fibres[name][:] for name in ("number", "body", "centre", "radius"))
    for k, (number, body, centre, radius) in enumerate(zip(*tables, strict=True)):
        places, room = np.zeros((0, 2)), radius
        if np.isfinite(radius):  # the centres of the periodic images, moved into the cell
            images, margin = centre + shifts * period, np.minimum(0.4 * radius, 0.4 * period)
            moved = np.clip(images, low + margin, low + period - margin)
            places = moved[np.linalg.norm(moved - images, axis=1) <= 0.85 * radius]
            places = places[is_periodic | (drawn.body[elements.query(places)[1]] == body)]
        if not len(places):  # the point of the body farthest from its outlines
            of_body = middles[drawn.body == body]
            distance = outline.query(of_body)[0]
            places, room = of_body[[distance.argmax()]], distance.max()
        size = float(np.clip(room * inches * 72 / 2.2, LEAST_SIZE, 11.0))  # points, 2.2 characters in the room
        text = str(number)
        if factors is not None:
            text, size = f"{number}\n{factors[k]:.2f}", max(0.75 * size, LEAST_SIZE)
        for x, y in places:
            axes.text(x, y, text, fontsize=size, ha="center", va="center", clip_on=True)


def deformed(
    cell: drawn_cell.DrawnCell, state: Any, document: Document, look: plot_helpers.Look = plot_helpers.PLAIN
) -> Figure:
    """Draw the deformed cell in a state, coloured by a stress component.

    The figure also shows the states of the interface.  Displacements in the plane are magnified, over the undeformed
    outline.  A shear along the fibres moves nothing in the plane: contour lines of the axial displacement u_3 show the
    shear.  For conduction, the figure shows isotherms and minus the flux.
    """
    drawn, attributes, output = cell.drawn, cell.file.attrs, document.get("case", {}).get("output", {})
    displacement, scale = decimation.drawn_displacement(state, drawn), 0.0
    title = drawn_cell.LoadLabels.of(document).label(state.attrs)
    if not is_axial(state):
        largest = decimation.largest_scale(displacement, drawn)
        size, length = float(np.ptp(drawn.points, axis=0).min()), float(np.linalg.norm(displacement, axis=1).max())
        chosen = output.get("deformation_scale")
        scale = plot_helpers.magnification(length, size, largest=largest) if chosen is None else chosen
        title += f", displacement × {scale:g}"
    moved = drawn.points + scale * displacement
    figure, axes = drawn_cell.figure_of(attributes, look)
    component = plot_helpers.stress_component(output.get("stress", "auto"), [state])
    stress = plot_helpers.nodal_stress(state, component, drawn)
    norm, colours, extend = plot_helpers.colour_range(stress, drawn.node_areas)
    shapes = plot_helpers.shade_triangles(axes, drawn, moved, stress, norm, colours)
    bar = drawn_cell.bar_beside(axes, shapes, extend)
    bar.formatter = StrMethodFormatter("{x:.6g}")  # without a power of ten above the bar
    phases = {name: stress[drawn.triangles[drawn.phase == k]] for k, name in enumerate(attributes["phases"])}
    phases = {name: values for name, values in phases.items() if values.size}
    if max(values.std() for values in phases.values()) < FLAT * np.abs(stress).max():
        title += "\nmeans: " + ", ".join(f"{name} {values.mean():.4g}" for name, values in phases.items())
    bar.set_label(f"${plot_helpers.STRESS_SYMBOLS[component]}$ {plot_helpers.stress_label(attributes['stress_unit'])}")
    conducts = reported(document).name == "conductivity"
    if conducts:
        title = rf"$\partial T / \partial x_{component[1]} = 1$"
        bar.set_label(f"$-q_{component[1]}$ (k times gradient)")
    if conducts or is_axial(state):
        step, length_unit = draw_levels(axes, state, drawn), plot_helpers.plain(with_micro(attributes["length_unit"]))
        label = f"$T$ every {step:g}" if conducts else f"$u_3$ every {step:g} {length_unit}".rstrip()
        line = Line2D([], [], color=LEVEL_INK, linewidth=LEVEL_WIDTH, label=label)
    else:
        outline: Array = drawn.points[cell.borders]
        if drawn.body.max() >= 8:  # the cell alone
            corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [attributes["width"], attributes["height"]]
            outline = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1) + drawn.points.min(axis=0)
        plot_helpers.draw_segments(axes, outline, UNDEFORMED, 0.7)
        label = "undeformed" if look.title is None else f"undeformed; displacement × {scale:g}"
        line = Line2D([], [], color=UNDEFORMED, linewidth=0.7, label=label)
    plot_helpers.draw_segments(axes, moved[cell.borders], "black", 0.8)
    marks = cell.interface.mark(axes, moved, state)
    drawn_cell.label_cell_axes(axes, attributes)
    plot_helpers.legend_below(figure, [*(marks if len(marks) > 1 else ()), line], 3)
    axes.set_title(_title(attributes, title))
    return figure


def is_axial(state: Any) -> bool:
    """Return whether the only load of a state is a shear along the fibres."""
    strain = state.attrs["strain"]
    components = [*strain[[0, 1, -1]], strain[2], state.attrs["temperature"]] if len(strain) > 3 else strain
    return not np.any(components) and bool(np.any(strain))


def draw_levels(axes: Axes, state: Any, drawn: decimation.DrawnMesh) -> float:
    """Draw about twelve contour lines of axial displacement or temperature.  Returns the step between lines."""
    displacement: Array = decimation.nodal_values(state["axial_displacement"], drawn)
    levels = MaxNLocator(12, steps=(1, 2, 5, 10)).tick_values(displacement.min(), displacement.max())
    x, y = drawn.points.T
    mesh = Triangulation(x, y, drawn.triangles)
    axes.tricontour(mesh, displacement, levels=levels, colors=LEVEL_INK, linewidths=LEVEL_WIDTH, linestyles="solid")
    return float(levels[1] - levels[0])
