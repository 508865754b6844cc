"""Draw all pictures of a result folder; load each module of this package only for results with its pictures."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache, partial
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.materials import voigt
from feti_homog.report.plots import cell_picture, drawn_cell, plot_helpers
from feti_homog.report.text.summary import reported
from feti_homog.results import atomic, checkpoints, field_file, landmarks, output_folder, result_json
from feti_homog.typing import Document

Picture = tuple[str, Callable[[], Figure | Path | None]]
"""A file name without suffix, and a function that draws a figure, writes a file itself, or has nothing to draw."""


def plot(
    directory: Path,
    look: plot_helpers.Look = plot_helpers.PLAIN,
    state: int | str | None = None,
    component: str | None = None,
) -> list[Path]:
    """Draw the pictures of a result folder into the folder; return the picture paths.

    - cell.png: materials; partition.png: body parts; mesh_error.png: estimated mesh error;
    - each load: case_E11.png, case_minus_E11.png, ... (unit strains), case_temperature.png or state_K.png;
    - `conductivity`: case_dT_dx1.png, case_dT_dx2.png;
    - sensitivities.png, if the case asks for them;
    - `angle`: angle.png, angle_states.png; `path`: path.png, path_states.png, path.gif, energy.png;
    - `load`: load.png; `envelope`: envelope.png;
    - interface.png, of a path or a debonded interface: tractions, jumps and damage around fibres.

    [output] of the case in result.json sets the stress component (default: from the unit strain) and the deformation
    scale. A case without fields has only curves. A `component` overrides the stress component; for a `state`, by
    number, label or mark, only state_K.png is drawn.  Call on one rank.

    Raises CaseError if the result is damaged, or has no such state or component; FetiHomogError if result.h5 cannot be
    read, or a picture cannot be written.
    """
    atomic.remove_unfinished(directory, output_folder.RESULT_FILE, alone=False)
    stored = {path.name for path in directory.iterdir()} & {result_json.NAME, checkpoints.FOLDER}
    document = output_folder.latest(directory) if stored else {}
    if component is not None:
        document.setdefault("case", {}).setdefault("output", {})["stress"] = component
    return draw(directory, document, slice(None), look, state)


def draw(
    directory: Path, document: Document, share: slice, look: plot_helpers.Look = plot_helpers.PLAIN, state: Any = None
) -> list[Path]:
    """Draw a `share` of the pictures of a result, so that ranks can draw different ones; see `plot`."""
    pictures, paths = list[Picture](), list[Path]()
    try:
        with mpl.rc_context(look.style), ExitStack() as stack:
            if "unfinished" not in document and document.get("case", {}).get("output", {}).get("fields", True):
                file = stack.enter_context(h5py.File(directory / field_file.NAME, "r"))
                pictures += of_fields(directory, file, document, look, state)
            if state is None and document.keys() & {"angle", "path", "envelope", "sensitivities"}:
                from feti_homog.report.plots import response_curves  # most results have no curves

                curves = response_curves.drawn(document)
                pictures += [(name, partial(curve, document, look)) for name, curve in curves.items()]
            for name, draw_picture in pictures[share]:
                picture = draw_picture()
                if isinstance(picture, Figure):
                    picture = plot_helpers.save(picture, directory / f"{name}.png", look)
                paths += [picture] if picture is not None else []
    except OSError as error:
        raise FetiHomogError(f"cannot draw {directory / field_file.NAME}: {error.strerror or error}") from error
    return paths


def of_fields(
    directory: Path, file: Any, document: Document, look: plot_helpers.Look, chosen: int | str | None = None
) -> Iterator[Picture]:
    """Yield the pictures of mesh and fields, or only of the `chosen` state.

    Raises CaseError if the result has no such state or component.
    """
    report, cell = reported(document), cache(partial(drawn_cell.DrawnCell.of, file))
    states = {number: file[f"state/{number}"] for number in sorted(file.get("state", ()), key=int)}
    stress = document.get("case", {}).get("output", {}).get("stress", "auto")
    conducts = report.name == "conductivity"
    if stress != "auto":
        table, _ = plot_helpers.STRESS_TABLES[stress]
        names = "S11, S22 or S12, and S33, von_mises or principal where the constants of all phases give S33"
        names = "none; its pictures show the flux along the gradient" if conducts else names
        if conducts or any(table not in state or np.isnan(state[table][:]).any() for state in states.values()):
            raise CaseError(f"--component {stress}: expected a stress that {directory} has: {names}")
    if chosen is not None:
        marks = {n: mark.split(" and ") for n, mark in landmarks.marks(document).items()} if report.is_followed else {}
        labels = {k: [state.attrs["label"], *marks.get(int(state.attrs["point"]), ())] for k, state in states.items()}
        number = next((k for k, names_of_state in labels.items() if str(chosen) in (k, *names_of_state)), None)
        if number is None:
            listed = ", ".join(f"{k} ({', '.join(names_of_state)})" for k, names_of_state in labels.items())
            raise CaseError(f"--state {chosen}: expected the number or label of a state of {directory}: {listed}")
        yield f"state_{number}", lambda: cell_picture.deformed(cell(), states[number], document, look)
        return
    yield "cell", lambda: cell_picture.figure(cell(), look)
    yield "partition", lambda: cell_picture.partition(cell(), look)
    yield "mesh_error", lambda: cell_picture.mesh_error(cell(), look)
    if report.is_curve and states:
        from feti_homog.report.plots import deformed_panels

        scale = deformed_panels.shown_scale(file, document)
        yield f"{report.name}_states", lambda: deformed_panels.panels(file, document, scale, look)
        if report.is_followed and look == plot_helpers.PLAIN:
            yield "path", lambda: deformed_panels.animation(file, document, scale, directory / "path.gif")
    for number, state in {} if report.is_curve else states.items():
        strain = state.attrs["strain"]
        if conducts and strain[2]:  # along the fibres the gradient is uniform
            continue
        loads = dict(zip(voigt.voigt_names(len(strain))[0], strain, strict=True))
        loads["temperature"] = state.attrs.get("temperature", 0.0)
        (load, value), *further_loads = [pair for pair in loads.items() if pair[1]] or [("", 0.0)]
        is_unit = abs(value) == 1.0 and not further_loads
        label = state.attrs["label"].replace("/", "_") if conducts else load
        name = f"case_{'minus_' if value < 0 else ''}{label}" if is_unit else f"state_{number}"
        of_state = partial(lambda state: cell_picture.deformed(cell(), state, document, look), state)
        yield report.picture or name, of_state
    broken = any((state["status"][:] != drawn_cell.BONDED).any() for state in states.values())
    if (broken and not conducts) or (report.is_followed and states):
        from feti_homog.report.plots import traction_plots  # perfect bonding has no picture

        yield "interface", lambda: traction_plots.figure(cell(), document, look)
