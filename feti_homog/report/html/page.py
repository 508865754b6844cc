"""Page report.html of a results folder, made from its files alone, with the states for its viewer."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from bokeh.embed import components
from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from numpy.typing import NDArray

from feti_homog.errors import CaseError
from feti_homog.materials.voigt import SPATIAL_STRAINS, STRAINS, voigt_names
from feti_homog.report.html import curves
from feti_homog.report.plots.decimation import drawn_displacement
from feti_homog.report.plots.deformed_panels import shown_scale
from feti_homog.report.plots.interface_marks import STATE_COLOURS, STATE_NAMES, STATE_WIDTHS, DrawnCell
from feti_homog.report.plots.plot_helpers import drawn_stress, stress_component, value_range
from feti_homog.report.text.analyses import reported
from feti_homog.report.text.summary import answers, checks, title_of
from feti_homog.results import atomic, field_file, output_folder, result_json
from feti_homog.results.landmarks import marks
from feti_homog.results.path_curves import FAINT, components_above
from feti_homog.typing import Document
from feti_homog.version import __version__

NAME, SWEEP = "report.html", "sweep.json"
UNIT_LOADS = dict.fromkeys((*STRAINS, *SPATIAL_STRAINS, "temperature"))
PICTURES = {
    "cell": "The cell: phases and numbers of the fibres",
    "partition": "The subdomains",
    **{f"case_{load}": f"Deformed cell under {load}" for load in UNIT_LOADS},
    **{f"case_minus_{load}": f"Deformed cell under minus {load}" for load in UNIT_LOADS},
    "angle": "Response against the debonding angle",
    "angle_states": "Deformed cell at several angles",
    "path": "Response along the path of load",
    "path_states": "Deformed cell along the path",
    "load": "Deformed cell under the load",
    "envelope": "Onset of debonding",
    "interface": "Tractions and jumps of interfaces",
    "mesh_error": "Where the estimated error of the mesh is",
    "sensitivities": "Relative changes of constants by those of parameters",
}
MOST_STATES, TRIANGLES = 48, 8000  # of the viewer, which keep a page below some megabytes
LARGEST_SHORT, LARGEST_BYTE = 32767, 255
MOST_ROWS = 60  # of a table of points


def viewer_data(file: Any, document: Document) -> dict[str, Any]:
    """Return the data of the viewer from an open result.h5: tables as base64 of little-endian numbers.

    Displacements are shorts, to be multiplied by `unit` of the state; stresses are bytes between the `low` and `high`
    of component and state, which leave out the extreme 0.5 %.  `ranges` are those of all states but the end of a path,
    where stresses may be many times those of the peak; curves begin with them (`common`).
    """
    cell = DrawnCell.of(file, TRIANGLES)
    drawn = cell.drawn
    numbers = reported(document).states(document, MOST_STATES, len(file["state"]))
    shown = [file[f"state/{number}"] for number in numbers]
    stresses = voigt_names(len(shown[0].attrs["strain"]))[1]
    component = stress_component(document["case"]["output"].get("stress", "auto"), shown)
    fields = [[drawn_stress(state, name, drawn) for name in stresses] for state in shown]
    states = [_state(state, cell, document) for state in shown]
    ranged = [own for own, state in zip(fields, states, strict=True) if state["mark"] != "end"] or fields
    areas = np.tile(drawn.areas, len(ranged))
    return {
        "points": _base64(drawn.points, "<f4"),
        "triangles": _base64(drawn.triangles, "<u4"),
        "borders": _base64(cell.borders, "<u4"),
        "edges": _base64(cell.interface.edges, "<u4"),
        "colours": _base64(mpl.colormaps["viridis"](np.arange(256))[:, :3] * LARGEST_BYTE, "u1"),
        "scale": shown_scale(file, document),
        "components": list(stresses),
        "component": stresses.index(component),
        "unit": str(file.attrs["stress_unit"]),
        "kinds": [{"name": STATE_NAMES[k], "colour": STATE_COLOURS[k], "width": STATE_WIDTHS[k]} for k in range(3)],
        "ranges": [_range(np.concatenate(values), areas) for values in zip(*ranged, strict=True)],
        "common": reported(document).is_curve,
        "states": [
            state | {"number": number, "fields": [_field(values, drawn.areas) for values in own]}
            for number, own, state in zip(numbers, fields, states, strict=True)
        ],
    }


def _state(state: Any, cell: DrawnCell, document: Document) -> dict[str, Any]:
    """Return all but the number and the fields; `mark` names a first break, a peak, what is after it, or an end."""
    displacement = drawn_displacement(state, cell.drawn)
    unit = float(np.abs(displacement).max()) / LARGEST_SHORT or 1.0
    status = state["status"][:]
    attributes = state.attrs
    strains = voigt_names(len(attributes["strain"]))[0]
    loads = [(strains[k], attributes["strain"][k]) for k in components_above(FAINT, attributes["strain"][None])]
    loads += [("temperature", value)] if (value := attributes.get("temperature", 0.0)) else []
    words = [f"{name} = {value:.4g}" for name, value in loads]
    point, analysis = int(attributes["point"]), reported(document)
    return {
        "point": point if analysis.is_curve else None,
        "mark": marks(document).get(point, "") if analysis.is_followed else "",
        "label": str(attributes["label"]),
        "load": ", ".join(words) or "no strain",
        "stress": [float(value) for value in attributes["stress"]],
        "nodes": [int((status == kind).sum()) for kind in range(3)],
        "unit": unit,
        "displacement": _base64(np.round(displacement / unit), "<i2"),
        "status": _base64(cell.interface.state(status), "u1"),
    }


def _field(values: NDArray[Any], areas: NDArray[Any]) -> dict[str, Any]:
    """Bytes of values on triangles of these areas, and the range they are in."""
    low, high = _range(values, areas)
    scaled = np.clip((values - low) / (high - low), 0.0, 1.0)
    return {"low": low, "high": high, "values": _base64(np.round(scaled * LARGEST_BYTE), "u1")}


def _range(values: NDArray[Any], areas: NDArray[Any]) -> tuple[float, float]:
    norm, _ = value_range(values, areas)
    return float(norm.vmin or 0.0), float(norm.vmax or 0.0)


def _base64(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode()


def write(directory: Path) -> Path:
    """Write `directory`/report.html; returns its path.  Call on one rank.

    It is made of result.json, result.h5 if the case has fields, and the pictures that are there.

    Raises:
        CaseError: the folder is not that of a result, or a file of it is missing or damaged.
        FetiHomogError: the report cannot be written.
    """
    directory = Path(directory)
    document = _document(directory)
    atomic.remove_abandoned(directory, output_folder.RESULT_FILE)
    try:
        html = page(document, directory)
    except (OSError, KeyError) as error:  # KeyError: what h5py does not find in result.h5
        raise CaseError(f"cannot report {directory}: a file of the result is missing or damaged: {error}") from error
    return atomic.replace_text(directory / NAME, html)


def page(document: Document, directory: Path) -> str:
    """Return the page of a result. Raises OSError, KeyError or ValueError where its files are damaged."""
    figures = curves.figures(document)
    script, boxes = components(figures, wrap_script=False) if figures else ("", {})
    shown = _shown(document, directory)
    environment = Environment(
        loader=PackageLoader("feti_homog.report.html"), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    library = "\n".join(Resources(mode="inline", components=["bokeh"]).js_raw) if figures else ""
    return environment.get_template("page.html").render(
        title=title_of(document),
        document=document,
        version=__version__,
        facts=facts(document),
        answers=[Markup(table.html) for table in answers(document, MOST_ROWS)],
        checks=checks(document),
        pictures=_pictures(directory),
        library=Markup(library),
        curves=[(figures[key].name, Markup(boxes[key])) for key in figures],
        curves_script=Markup(script),
        states=None if shown is None else Markup(_json(shown)),
    )


def facts(document: Document) -> list[tuple[str, str]]:
    """Return the facts of a result: case, cell and solver."""
    case, cell, solver = document["case"], document["cell"], document["solver"]
    length = case["output"].get("length_unit", "")
    fractions = ", ".join(f"{phase} {share:.4f}" for phase, share in cell["fractions"].items())
    iterations, ranks = solver["iterations"], solver["ranks"]
    return [
        ("Analysis", f"{case['analysis']['type']}, plane {case['analysis']['plane']}"),
        ("Cell", f"{case['cell']['geometry']}, {cell['width']:.6g} x {cell['height']:.6g} {length}".rstrip()),
        ("Phases", fractions),
        ("Mesh", f"{_count(cell['elements'])} elements, {_count(cell['nodes'])} nodes, "
                 f"order {case['cell'].get('order', 1)}, refine {case['cell'].get('refine', cell.get('refine', 0))}"),
        ("Solver", f"{_count(ranks)} rank{'' if ranks == 1 else 's'}, {_count(solver['subdomains'])} subdomains, "
                   f"{_count(solver['dofs'])} degrees of freedom"),
        ("Iterations", f"{sum(iterations) or 'none'} in {len(iterations)} states, to {solver['rtol']:g}"),
        ("Time", ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in document["timings"].items())),
        ("Version", f"feti-homog {document['version']}, layout {document['schema']}"),
    ]  # fmt: skip


def _count(number: int) -> str:
    return f"{number:,}".replace(",", "\N{NO-BREAK SPACE}")


def _document(directory: Path) -> dict[str, Any]:
    if not directory.is_dir():
        raise CaseError(f"cannot report {directory}: there is no such folder")
    if (directory / SWEEP).exists():
        raise CaseError(f"cannot report {directory}: it is the folder of a sweep; name the folder of one of its cases")
    return result_json.read(directory)


def _shown(document: Document, directory: Path) -> dict[str, Any] | None:
    """Return the data of the viewer of deformed states, if the case has fields."""
    if not document["case"]["output"].get("fields", True):
        return None
    with h5py.File(directory / field_file.NAME, "r") as file:
        return viewer_data(file, document) if len(file.get("state", ())) else None


def _pictures(directory: Path) -> list[tuple[str, str]]:
    """Caption and data URI of the pictures that are there."""
    paths = {directory / f"{name}.png": caption for name, caption in PICTURES.items()}
    paths |= {path: f"Deformed cell, {path.stem.replace('_', ' ')}" for path in sorted(directory.glob("state_*.png"))}
    found = {path: caption for path, caption in paths.items() if path.is_file()}
    encoded = ((caption, base64.b64encode(path.read_bytes()).decode()) for path, caption in found.items())
    return [(caption, f"data:image/png;base64,{text}") for caption, text in encoded]


def _json(value: Any) -> str:
    """JSON that may stand in a script element of a page."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
