"""The pictures of a result: cell, deformed cell under each load, curves and panels of an angle or path."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.tri import Triangulation

from feti_homog.errors import FetiHomogError
from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots import (
    cell_picture,
    decimation,
    deformed_panels,
    drawn_cell,
    plot_helpers,
    response_curves,
    traction_plots,
)
from feti_homog.report.text.summary import reported
from feti_homog.results import atomic, field_file, output_folder, result_json
from feti_homog.typing import Array, Document

LEVEL_INK, LEVEL_WIDTH = "0.15", 0.6  # of lines of equal displacement along the fibres
FREE = r"free expansion by $\Delta T = 1$"
UNDEFORMED = "0.5"


def plot(directory: Path) -> list[Path]:
    """Draw the pictures of a result folder beside its files; returns their paths.

    - cell.png: materials; partition.png: body parts; mesh_error.png: estimated mesh error;
    - each load: case_E11.png, case_minus_E11.png, ... (unit strains), case_temperature.png or state_K.png; under
      temperature the cell expands freely if its expansion is known, else its strain is zero;
    - sensitivities.png, if the case asks for them;
    - `angle`: angle.png, angle_states.png; `path`: path.png, path_states.png, path.gif, energy.png;
    - `load`: load.png; `envelope`: envelope.png;
    - interface.png, if some interface is debonded.

    [output] of the case in result.json chooses stress component (default: by the unit strain) and deformation scale.
    A case without fields has curves alone.  Call on one rank.

    Raises:
        FetiHomogError: result.h5 cannot be read, or a picture cannot be written.
    """
    directory = Path(directory)
    atomic.remove_unfinished(directory, output_folder.RESULT_FILE, alone=False)
    document = result_json.read(directory) if (directory / result_json.NAME).exists() else {}
    with mpl.rc_context(plot_helpers.STYLE):
        try:
            paths = _pictures(directory, document) if _output(document).get("fields", True) else []
            return paths + response_curves.plot(directory, document)
        except OSError as error:
            raise FetiHomogError(f"cannot draw {directory / field_file.NAME}: {error.strerror or error}") from error


def _output(document: Document) -> Document:
    """Return the section [output] of the case, empty without a result.json."""
    entries: Document = document.get("case", {}).get("output", {})
    return entries


def _pictures(directory: Path, document: Document) -> list[Path]:
    """Return the pictures of result.h5."""
    with h5py.File(directory / field_file.NAME, "r") as file:
        cell = drawn_cell.DrawnCell.of(file)
        entries = {"cell": cell_picture.figure(cell), "partition": cell_picture.partition(cell)}
        entries |= {"mesh_error": error} if (error := cell_picture.mesh_error(cell)) is not None else {}
        paths = [plot_helpers.save(figure, directory / f"{name}.png") for name, figure in entries.items()]
        if reported(document).is_curve:
            paths += deformed_panels.plot(directory, file, document)
        else:
            for number in sorted(file.get("state", ()), key=int):
                state = file[f"state/{number}"]
                draw = _sheared if is_axial(state) else _deformed
                visible = decimation.FreeExpansion.of(state, document) or state
                name = reported(document).picture or _name(number, state.attrs)
                paths.append(plot_helpers.save(draw(cell, visible, document), directory / f"{name}.png"))
        return paths + traction_plots.plot(directory, cell, document)


def _name(number: str, attributes: Any) -> str:
    strain = attributes["strain"]
    loads = dict(zip(voigt_names(len(strain))[0], strain, strict=True))
    loads["temperature"] = attributes.get("temperature", 0.0)
    name, value = max(loads.items(), key=lambda load: abs(load[1]))
    if abs(value) != 1.0 or np.count_nonzero(list(loads.values())) != 1:
        return f"state_{number}"
    return f"case_{'minus_' if value < 0 else ''}{name}"


def _deformed(cell: drawn_cell.DrawnCell, state: Any, document: Document) -> Figure:
    """Return the magnified deformed cell with a stress component in colour, and the outline it has left."""
    drawn, output = cell.drawn, _output(document)
    displacement = decimation.drawn_displacement(state, drawn)
    size = float(np.ptp(drawn.points, axis=0).min())
    seen = plot_helpers.magnification(
        plot_helpers.largest_length(displacement), size, largest=decimation.largest_scale(displacement, drawn)
    )
    chosen = output.get("deformation_scale")
    scale = seen if chosen is None else chosen
    moved = drawn.points + scale * displacement
    figure, axes = _coloured(cell, state, moved, output)
    outline: Array = drawn.points[cell.borders]
    if drawn.body.max() >= 8:  # the cell alone
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [cell.file.attrs[name] for name in ("width", "height")]
        outline = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    plot_helpers.draw_segments(axes, outline, UNDEFORMED, 0.7)
    undeformed = Line2D([], [], color=UNDEFORMED, linewidth=0.7, label="undeformed")
    _outlined(axes, cell, state, moved, undeformed)
    load = (
        FREE if isinstance(state, decimation.FreeExpansion) else drawn_cell.LoadLabels.of(document).label(state.attrs)
    )
    axes.set_title(f"{plot_helpers.plain(cell.file.attrs['title'])}\n{load}, displacement × {scale:g}".lstrip())
    return figure


def _sheared(cell: drawn_cell.DrawnCell, state: Any, document: Document) -> Figure:
    """Return the cell with an axial stress in colour and lines of equal axial displacement u_3.

    u_3 moves nothing in the plane.
    """
    attributes, points = cell.file.attrs, cell.drawn.points
    figure, axes = _coloured(cell, state, points, _output(document))
    step = draw_levels(axes, state, cell.drawn)
    caption = f"$u_3$ every {step:g} {plot_helpers.plain(attributes['length_unit'])}".rstrip()
    _outlined(axes, cell, state, points, Line2D([], [], color=LEVEL_INK, linewidth=LEVEL_WIDTH, label=caption))
    axes.set_title(
        f"{plot_helpers.plain(attributes['title'])}\n{drawn_cell.LoadLabels.of(document).label(state.attrs)}".lstrip()
    )
    return figure


def _coloured(cell: drawn_cell.DrawnCell, state: Any, moved: Array, output: Document) -> tuple[Figure, Axes]:
    """Return the cell with nodes at `moved` (p, 2), coloured by a stress."""
    attributes, drawn = cell.file.attrs, cell.drawn
    figure, (axes,) = drawn_cell.figure_of(attributes, panels=1, beside=drawn_cell.BAR_INCHES)
    component = plot_helpers.stress_component(output.get("stress", "auto"), [state])
    stress = plot_helpers.nodal_stress(state, component, drawn)
    norm, colours, extend = plot_helpers.colour_range(stress, drawn.node_areas)
    shapes = plot_helpers.shade_triangles(axes, drawn, moved, stress, norm, colours)
    bar = drawn_cell.bar_beside(axes, shapes, extend, drawn_cell.cell_size(attributes))
    bar.ax.ticklabel_format(axis="y", scilimits=(-2, 4))
    bar.set_label(f"${plot_helpers.STRESS_SYMBOLS[component]}$ {plot_helpers.stress_label(attributes['stress_unit'])}")
    return figure, axes


def _outlined(axes: Axes, cell: drawn_cell.DrawnCell, state: Any, moved: Array, line: Line2D) -> None:
    """Draw body outlines and interface states, with a legend for both and for `line`."""
    plot_helpers.draw_segments(axes, moved[cell.borders], "black", 0.8)
    marks = cell.interface.mark(axes, moved, drawn_cell.states_of_nodes(state))
    drawn_cell.label_cell_axes(axes, cell.file.attrs)
    figure: Any = axes.figure
    handles = [*(marks if len(marks) > 1 else ()), line]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 2), frameon=False)


def is_axial(state: Any) -> bool:
    """Return whether a state shears the cell along the fibres alone."""
    strain = state.attrs["strain"]
    components = [*strain[[0, 1, -1]], strain[2], state.attrs["temperature"]] if len(strain) > 3 else strain
    return not np.any(components) and bool(np.any(strain))


def draw_levels(axes: Axes, state: Any, drawn: decimation.DrawnMesh) -> float:
    """Draw lines of equal axial displacement; returns the step between them."""
    displacement: Array = decimation.nodal_values(state["axial_displacement"], drawn)
    low, high = float(displacement.min()), float(displacement.max())
    step = round_step((high - low) / 12)
    levels = step * np.arange(math.ceil(low / step), math.floor(high / step) + 1)
    x, y = drawn.points.T
    mesh = Triangulation(x, y, drawn.triangles)
    axes.tricontour(mesh, displacement, levels=levels, colors=LEVEL_INK, linewidths=LEVEL_WIDTH, linestyles="solid")
    return step


def round_step(ideal: float) -> float:
    """1, 2 or 5 times a power of ten, not less than wanted."""
    if ideal <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(ideal))
    return power * next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= ideal * (1 - 1e-9))
