"""The deformed states for the viewer of the page: a coarse mesh, and of each state displacements, stresses, contact."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from feti_homog.materials.voigt import voigt_names
from feti_homog.report.plots.decimation import DrawnMesh, drawn_displacement, drawn_mesh, outline_edges
from feti_homog.report.plots.deformed_panels import shown_scale
from feti_homog.report.plots.interface_marks import STATE_COLOURS, STATE_NAMES, STATE_WIDTHS, InterfaceEdges
from feti_homog.report.plots.plot_helpers import drawn_stress, stress_component, value_range
from feti_homog.report.text.analyses import reported
from feti_homog.results.path_curves import FAINT, components_above

MOST_STATES, TRIANGLES = 48, 8000  # of the viewer, which keep a page below some megabytes
LARGEST_SHORT, LARGEST_BYTE = 32767, 255

Document = Mapping[str, Any]


def viewer_data(file: Any, document: Document) -> dict[str, Any]:
    """Return the data of the viewer from an open result.h5: tables as base64 of little-endian numbers.

    Displacements are shorts, to be multiplied by `unit` of the state; stresses are bytes between the `low` and `high`
    of component and state, which leave out the extreme 0.5 %.
    """
    drawn = drawn_mesh(file, TRIANGLES)
    borders = outline_edges(drawn, drawn.body)
    edges = InterfaceEdges.of(file, drawn, borders)
    numbers = reported(document).states(document, MOST_STATES, len(file["state"]))
    shown = [file[f"state/{number}"] for number in numbers]
    stresses = voigt_names(len(shown[0].attrs["strain"]))[1]
    component = stress_component(document["case"]["output"].get("stress", "auto"), shown)
    return {
        "points": _base64(drawn.points, "<f4"),
        "triangles": _base64(drawn.triangles, "<u4"),
        "borders": _base64(borders, "<u4"),
        "edges": _base64(edges.edges, "<u4"),
        "colours": _base64(mpl.colormaps["viridis"](np.arange(256))[:, :3] * LARGEST_BYTE, "u1"),
        "scale": shown_scale(file, document),
        "components": list(stresses),
        "component": stresses.index(component),
        "unit": str(file.attrs["stress_unit"]),
        "kinds": [{"name": STATE_NAMES[k], "colour": STATE_COLOURS[k], "width": STATE_WIDTHS[k]} for k in range(3)],
        "states": [_state(file, number, drawn, edges, document) for number in numbers],
    }


def _state(file: Any, number: int, drawn: DrawnMesh, edges: InterfaceEdges, document: Document) -> dict[str, Any]:
    state = file[f"state/{number}"]
    displacement = drawn_displacement(state, drawn)
    unit = float(np.abs(displacement).max()) / LARGEST_SHORT or 1.0
    status = state["status"][:]
    attributes = state.attrs
    strains, stresses = voigt_names(len(attributes["strain"]))
    loads = [(strains[k], attributes["strain"][k]) for k in components_above(FAINT, attributes["strain"][None])]
    loads += [("temperature", value)] if (value := attributes.get("temperature", 0.0)) else []
    words = [f"{name} = {value:.4g}" for name, value in loads]
    return {
        "number": number,
        "point": int(attributes["point"]) if reported(document).is_curve else None,
        "label": str(attributes["label"]),
        "load": ", ".join(words) or "no strain",
        "stress": [float(value) for value in attributes["stress"]],
        "nodes": [int((status == kind).sum()) for kind in range(3)],
        "unit": unit,
        "displacement": _base64(np.round(displacement / unit), "<i2"),
        "fields": [_field(drawn_stress(state, name, drawn)) for name in stresses],
        "status": _base64(edges.state(status), "u1"),
    }


def _field(values: NDArray[Any]) -> dict[str, Any]:
    """Bytes of values, and the range they are in."""
    norm, _ = value_range(values)
    low, high = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    scaled = np.clip((values - low) / (high - low), 0.0, 1.0)
    return {"low": low, "high": high, "values": _base64(np.round(scaled * LARGEST_BYTE), "u1")}


def _base64(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode()
