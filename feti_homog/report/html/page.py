"""report.html of a results folder, made from its files alone."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
from bokeh.embed import components
from bokeh.resources import Resources
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from feti_homog.errors import CaseError
from feti_homog.materials.voigt import SPATIAL_STRAINS, STRAINS
from feti_homog.report.html import curves, states, tables
from feti_homog.report.text.summary import checks, title_of
from feti_homog.results import atomic, field_file, output_folder, result_json
from feti_homog.version import __version__

NAME, SWEEP = "report.html", "sweep.json"
UNIT_LOADS = dict.fromkeys((*STRAINS, *SPATIAL_STRAINS, "temperature"))
PICTURES = {
    "cell": "The cell: phases, numbers of the fibres, subdomains",
    **{f"case_{load}": f"Deformed cell under {load}" for load in UNIT_LOADS},
    **{f"case_minus_{load}": f"Deformed cell under minus {load}" for load in UNIT_LOADS},
    "angle": "Response against the debonding angle",
    "angle_states": "Deformed cell at several angles",
    "path": "Response along the path of load",
    "path_states": "Deformed cell along the path",
    "load": "Deformed cell under the load",
    "envelope": "Onset of debonding",
    "interface": "Tractions and jumps of interfaces",
}

Document = Mapping[str, Any]


def write(directory: Path) -> Path:
    """Write `directory`/report.html from result.json, result.h5 if the case has fields, and the pictures that are
    there; returns its path.  Call on one rank.

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
        facts=tables.facts(document),
        answers=[Markup(table.html) for table in tables.answers(document)],
        checks=checks(document),
        pictures=_pictures(directory),
        library=Markup(library),
        curves=[(figures[key].name, Markup(boxes[key])) for key in figures],
        curves_script=Markup(script),
        states=None if shown is None else Markup(_json(shown)),
    )


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
        return states.viewer_data(file, document) if len(file.get("state", ())) else None


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
