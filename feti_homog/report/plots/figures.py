"""The pictures of a result: cell, deformed cell under each load, curves and panels of an angle or path."""

from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from feti_homog.errors import FetiHomogError
from feti_homog.materials import voigt
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
UNDEFORMED = "0.5"


def plot(directory: Path) -> list[Path]:
    """Draw the pictures of a result folder beside its files; returns their paths.

    - cell.png: materials; partition.png: body parts; mesh_error.png: estimated mesh error;
    - each load: case_E11.png, case_minus_E11.png, ... (unit strains), case_temperature.png or state_K.png;
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
            if not _output(document).get("fields", True):
                return response_curves.plot(directory, document)
            with h5py.File(directory / field_file.NAME, "r") as file:
                cell, report = drawn_cell.DrawnCell.of(file), reported(document)
                entries = {"cell": cell_picture.figure(cell), "partition": cell_picture.partition(cell)}
                entries |= {"mesh_error": error} if (error := cell_picture.mesh_error(cell)) is not None else {}
                paths = [plot_helpers.save(figure, directory / f"{name}.png") for name, figure in entries.items()]
                if report.is_curve:
                    paths += deformed_panels.plot(directory, file, document)
                for number in [] if report.is_curve else sorted(file.get("state", ()), key=int):
                    state = file[f"state/{number}"]
                    name = report.picture or _name(number, state.attrs)
                    paths.append(plot_helpers.save(_drawn_state(cell, state, document), directory / f"{name}.png"))
                paths += traction_plots.plot(directory, cell, document)
            return paths + response_curves.plot(directory, document)
        except OSError as error:
            raise FetiHomogError(f"cannot draw {directory / field_file.NAME}: {error.strerror or error}") from error


def _output(document: Document) -> Document:
    """Return the section [output] of the case, empty without a result.json."""
    entries: Document = document.get("case", {}).get("output", {})
    return entries


def _name(number: str, attributes: Any) -> str:
    strain = attributes["strain"]
    loads = dict(zip(voigt.voigt_names(len(strain))[0], strain, strict=True))
    loads["temperature"] = attributes.get("temperature", 0.0)
    name, value = max(loads.items(), key=lambda load: abs(load[1]))
    if abs(value) != 1.0 or np.count_nonzero(list(loads.values())) != 1:
        return f"state_{number}"
    return f"case_{'minus_' if value < 0 else ''}{name}"


def _drawn_state(cell: drawn_cell.DrawnCell, state: Any, document: Document) -> Figure:
    """Return the cell in a state with a stress component in colour, and the states of its interface.

    In the plane it is magnified, with its undeformed outline.  A shear along the fibres moves nothing in the plane:
    lines of equal axial displacement u_3 show it.
    """
    drawn, attributes, output = cell.drawn, cell.file.attrs, _output(document)
    displacement, load = decimation.drawn_displacement(state, drawn), drawn_cell.LoadLabels.of(document)
    title, scale = load.label(state.attrs), 0.0
    if not is_axial(state):
        largest = decimation.largest_scale(displacement, drawn)
        size, length = float(np.ptp(drawn.points, axis=0).min()), plot_helpers.largest_length(displacement)
        chosen = output.get("deformation_scale")
        scale = plot_helpers.magnification(length, size, largest=largest) if chosen is None else chosen
        title += f", displacement × {scale:g}"
    moved = drawn.points + scale * displacement
    figure, (axes,) = drawn_cell.figure_of(attributes, panels=1, beside=drawn_cell.BAR_INCHES)
    component = plot_helpers.stress_component(output.get("stress", "auto"), [state])
    stress = plot_helpers.nodal_stress(state, component, drawn)
    norm, colours, extend = plot_helpers.colour_range(stress, drawn.node_areas)
    shapes = plot_helpers.shade_triangles(axes, drawn, moved, stress, norm, colours)
    bar = drawn_cell.bar_beside(axes, shapes, extend, drawn_cell.cell_size(attributes))
    bar.ax.ticklabel_format(axis="y", scilimits=(-2, 4))
    bar.set_label(f"${plot_helpers.STRESS_SYMBOLS[component]}$ {plot_helpers.stress_label(attributes['stress_unit'])}")
    if is_axial(state):
        step = draw_levels(axes, state, drawn)
        caption = f"$u_3$ every {step:g} {plot_helpers.plain(attributes['length_unit'])}".rstrip()
        line = Line2D([], [], color=LEVEL_INK, linewidth=LEVEL_WIDTH, label=caption)
    else:
        outline: Array = drawn.points[cell.borders]
        if drawn.body.max() >= 8:  # the cell alone
            corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * [attributes["width"], attributes["height"]]
            outline = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        plot_helpers.draw_segments(axes, outline, UNDEFORMED, 0.7)
        line = Line2D([], [], color=UNDEFORMED, linewidth=0.7, label="undeformed")
    plot_helpers.draw_segments(axes, moved[cell.borders], "black", 0.8)
    marks = cell.interface.mark(axes, moved, drawn_cell.states_of_nodes(state))
    drawn_cell.label_cell_axes(axes, attributes)
    handles = [*(marks if len(marks) > 1 else ()), line]
    figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 2), frameon=False)
    axes.set_title(f"{plot_helpers.plain(attributes['title'])}\n{title}".lstrip())
    return figure


def is_axial(state: Any) -> bool:
    """Return whether a state shears the cell along the fibres alone."""
    strain = state.attrs["strain"]
    components = [*strain[[0, 1, -1]], strain[2], state.attrs["temperature"]] if len(strain) > 3 else strain
    return not np.any(components) and bool(np.any(strain))


def draw_levels(axes: Axes, state: Any, drawn: decimation.DrawnMesh) -> float:
    """Draw about twelve lines of equal axial displacement; returns the step between them."""
    displacement: Array = decimation.nodal_values(state["axial_displacement"], drawn)
    levels = MaxNLocator(12, steps=(1, 2, 5, 10)).tick_values(displacement.min(), displacement.max())
    x, y = drawn.points.T
    mesh = Triangulation(x, y, drawn.triangles)
    axes.tricontour(mesh, displacement, levels=levels, colors=LEVEL_INK, linewidths=LEVEL_WIDTH, linestyles="solid")
    return float(levels[1] - levels[0])
