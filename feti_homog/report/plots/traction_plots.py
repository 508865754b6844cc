"""interface.png: tractions and jumps around the fibres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, depth_first_order
from scipy.spatial import cKDTree

from feti_homog.report.plots import drawn_cell, plot_helpers
from feti_homog.report.plots.decimation import SAME_PLACE
from feti_homog.report.text.summary import reported
from feti_homog.results import landmarks
from feti_homog.typing import Array, Document

DEGREES = (-180.0, 180.0)
LOADS_IN_LINE = 7
SPIKES = 2.0  # per cent of the nodes, at either end
SHADE: dict[str, Any] = {"alpha": 0.18, "linewidth": 0}
INK = ("#1f4e9c", "#2a7f3f", "#c44e00")
NAMES = {"traction": (r"$t_\mathrm{n}$", r"$t_\mathrm{t}$", r"$t_\mathrm{a}$"), "jump": ("gap", "slip", "axial slip")}


def plot(directory: Path, cell: drawn_cell.DrawnCell, document: Document) -> list[Path]:
    """Draw interface.png, if any state has debonded nodes.

    A path shows its peak, dashed, and the valley after it or a late state; other analyses one state.
    """
    file = cell.file
    names = sorted(file.get("state", ()), key=int)
    debonded = {name: int((file[f"state/{name}/status"][:] != drawn_cell.BONDED).sum()) for name in names}
    if not any(debonded.values()):
        return []
    total = len(file["interface/points"])

    def touches(name: str) -> bool:
        return bool((file[f"state/{name}/status"][:] == drawn_cell.CLOSED).any())

    # After all bonds are gone there is not much left to see, unless the faces touch.
    last = next((n for n in reversed(names) if 0 < debonded[n] < total or touches(n)), names[-1])
    partly = [name for name in names if 0 < debonded[name] < total]
    drawn = [(partly or [last])[len(partly) // 2]]
    if reported(document).is_followed:
        of_point = {int(file[f"state/{name}"].attrs["point"]): name for name in names}
        peak = landmarks.peak_of(document)
        before, after = of_point.get(peak["event"], names[0]), of_point.get(peak.get("event_left", -1), last)
        drawn = list(dict.fromkeys([before, after if debonded[after] else last]))
    figure = _figure(cell, drawn, drawn_cell.LoadLabels.of(document))
    return [plot_helpers.save(figure, directory / "interface.png")]


def _figure(cell: drawn_cell.DrawnCell, names: list[str], labels: drawn_cell.LoadLabels) -> Figure:
    """Draw tractions and jumps around the most debonded fibres, a row each."""
    file = cell.file
    fibre, status = file["interface/fibre"][:], file[f"state/{names[-1]}/status"][:]
    bodies, count = np.unique(fibre[status != drawn_cell.BONDED], return_counts=True)
    chosen = np.sort(bodies[np.argsort(-count, kind="stable")][:4])
    figure = Figure(figsize=(9.0, 2.4 * len(chosen) + 1.5), layout="constrained")
    grid = figure.subplots(len(chosen), 2, sharex="row", sharey="col", squeeze=False)
    for row, body in zip(grid, chosen, strict=True):
        place = coordinate(cell, body)
        for axes, quantity in zip(row, NAMES, strict=True):
            # Each debonded node of the last state stands for half the distance to its neighbours.
            bounds = np.r_[place.ends[0], (place.values[1:] + place.values[:-1]) / 2, place.ends[1]]
            for at, kind in enumerate(status[place.nodes]):
                if kind != drawn_cell.BONDED:
                    axes.axvspan(bounds[at], bounds[at + 1], **SHADE, color=drawn_cell.STATE_COLOURS[kind])
            for name in names:
                _curves(axes, file[f"state/{name}"], quantity, place, name == names[-1])
            axes.axhline(0.0, color="0.6", linewidth=0.6)
            axes.set(xlim=place.ends, xlabel=place.label)
            if place.ends == DEGREES:
                axes.xaxis.set_major_locator(MultipleLocator(60))
            axes.spines[["top", "right"]].set_visible(False)
        fibre_name = f"fibre {file['interface/fibre_number'][place.nodes[0]]}"
        is_fibre = body in file["fibre/body"][:]
        row[0].set_title(fibre_name if is_fibre else f"coating of {fibre_name}", fontsize=10, loc="left")
    for column in grid.T:
        _clip_spikes(column)
    _labels(file, figure, grid, status[np.isin(fibre, chosen)])
    first, last = (file[f"state/{name}"].attrs for name in (names[0], names[-1]))
    title = f"{last['label']}: {labels.label(last, LOADS_IN_LINE)}"
    if len(names) > 1:
        title += f"   (dashed: {first['label']}: {labels.label(first, LOADS_IN_LINE)})"
    if len(bodies) > len(chosen):
        title += f"\nthe {len(chosen)} of {len(bodies)} debonded interfaces that are so most"
    figure.suptitle(title, fontsize=10)
    return figure


def _clip_spikes(column: Any) -> None:
    """Limit the shared range of axes where a few nodes at singular tips exceed all others."""
    values = np.concatenate([np.asarray(line.get_ydata(), float) for axes in column for line in axes.lines])
    low, high = np.percentile(values, (SPIKES, 100.0 - SPIKES))
    room = high - low
    if values.min() < low - room or values.max() > high + room:
        column[0].set_ylim(max(values.min(), low - room), min(values.max(), high + room))


def _curves(axes: Axes, state: Any, quantity: str, place: Coordinate, last: bool) -> None:
    """Draw a state's tractions or jumps around a fibre, as a closed curve if nodes surround it."""
    values: Array = state[quantity][:]
    if f"axial_{quantity}" in state and (axial := state[f"axial_{quantity}"][:]).any():
        values = np.column_stack([values, axial])
    values, at, turn = values[place.nodes], place.values, place.ends[1] - place.ends[0]
    # Nodes are all around if the gap between last and first is less than twice the others.
    if place.ends == DEGREES and len(at) > 1 and at[0] + turn - at[-1] < 2.0 * np.diff(at).max():
        at = np.concatenate([at[-1:] - turn, at, at[:1] + turn])
        values = np.concatenate([values[-1:], values, values[:1]])
    for label, column, ink in zip(NAMES[quantity], values.T, INK, strict=False):
        width, style = (1.5, "-") if last else (0.9, "--")
        axes.plot(at, column, style, color=ink, linewidth=width, label=label if last else None)


def _labels(file: Any, figure: Figure, grid: Any, shaded: Array) -> None:
    stress = plot_helpers.stress_label(file.attrs["stress_unit"])
    length = plot_helpers.unit_label(file.attrs["length_unit"]) or "(cell units)"
    for row in grid:
        row[0].set_ylabel(f"traction {stress}")
        row[1].set_ylabel(f"jump {length}")
    for axes in grid[0]:
        axes.legend(frameon=False, fontsize=9, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1, ncols=3)
    patches = [
        Patch(color=drawn_cell.STATE_COLOURS[kind], label=drawn_cell.STATE_NAMES[kind], **SHADE)
        for kind in (drawn_cell.OPEN, drawn_cell.CLOSED)
        if kind in shaded
    ]
    figure.legend(handles=patches, loc="outside lower center", ncols=2, frameon=False)


@dataclass(frozen=True)
class Coordinate:
    """Interface nodes in order along a fibre outline."""

    nodes: Array  # (k,) rows of /interface
    values: Array  # (k,) ascending
    ends: tuple[float, float]
    label: str


def coordinate(cell: drawn_cell.DrawnCell, body: int) -> Coordinate:
    """Return the coordinate along a body outline: on round fibres and their coatings the normal direction (degrees).

    Other bodies have the arc length, counterclockwise from the node whose normal is nearest to x1; several boundaries
    follow each other.
    """
    file, edges = cell.file, cell.interface.nodes
    of_body = np.flatnonzero(file["interface/fibre"][:] == body)
    normal = file["interface/normal"][:]
    radius = file["fibre/radius"][:][np.isin(file["fibre/number"][:], file["interface/fibre_number"][:][of_body])]
    if np.isfinite(radius).all():
        angle = np.degrees(np.arctan2(normal[of_body, 1], normal[of_body, 0]))
        order = np.argsort(angle)
        return Coordinate(of_body[order], angle[order], DEGREES, "direction of the normal (degrees)")
    period = np.array([file.attrs["width"], file.attrs["height"]])
    chain = np.unique(np.sort(edges[np.isin(edges, of_body).all(axis=1)], axis=1), axis=0)
    length, total = _arc_length(file["interface/points"][:], normal, of_body, chain, period)
    order = np.argsort(length, kind="stable")
    unit = file.attrs["length_unit"] or "cell units"
    return Coordinate(of_body[order], length[order], (0.0, total), f"arc length, counterclockwise ({unit})")


def _arc_length(points: Array, normal: Array, of_body: Array, chain: Array, period: Array) -> tuple[Array, float]:
    """Return the arc length (k,) of the nodes `of_body` on their nearest boundary edges, and the total length.

    `chain` has the boundary edges (e, 2).
    """
    origins, sides_of_lines, lengths, total = list[Array](), list[Array](), list[Array](), 0.0
    for line in _lines(chain, normal, points, period):
        sides = _shortest(np.diff(points[line], axis=0), period)
        ends = total + np.cumsum(np.linalg.norm(sides, axis=1))
        origins.append(points[line[:-1]])
        sides_of_lines.append(sides)
        lengths.append(np.append(total, ends[:-1]))
        total = float(ends[-1])
    starts, steps, before = map(np.concatenate, (origins, sides_of_lines, lengths))
    tree = cKDTree(np.mod(starts + 0.5 * steps, period) % period, boxsize=period)
    nodes = points[of_body]
    nearest = tree.query(np.mod(nodes, period) % period, k=min(8, len(starts)))[1].reshape(len(nodes), -1)
    step = steps[nearest]
    offset, length = _shortest(nodes[:, None] - starts[nearest] - 0.5 * step, period), np.linalg.norm(step, axis=2)
    fraction = np.clip(0.5 + (offset * step).sum(axis=2) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(offset - (fraction - 0.5)[..., None] * step, axis=2)
    # A vertex is the start of an edge, not an end.
    best = (distance + SAME_PLACE * length * fraction).argmin(axis=1)
    rows = np.arange(len(nodes))
    return before[nearest[rows, best]] + (fraction * length)[rows, best], total


def _lines(chain: Array, normal: Array, points: Array, period: Array) -> list[Array]:
    """Chain edges (e, 2) to boundaries, each a counterclockwise node list.

    A closed boundary repeats its first node, whose normal is nearest to x1; an open one begins at an end.
    """
    vertices, ends = np.unique(chain, return_inverse=True)
    first, second = ends.reshape(-1, 2).T
    size = len(vertices)
    pairs = np.append(first, second), np.append(second, first)
    graph = coo_array((np.ones(2 * len(first)), pairs), shape=(size, size)).tocsr()
    degree, (count, label) = np.bincount(pairs[0], minlength=size), connected_components(graph)
    lines = []
    for part in range(count):
        members = np.flatnonzero(label == part)
        closed = bool((degree[members] == 2).all())
        start = members[np.argmax(normal[vertices[members], 0] if closed else -degree[members])]
        line = vertices[depth_first_order(graph, start, return_predecessors=False)]
        line = np.append(line, line[0]) if closed else line
        n1, n2 = normal[line[0]]
        step = _shortest(points[line[1]] - points[line[0]], period)
        lines.append(line if -n2 * step[0] + n1 * step[1] > 0 else line[::-1])
    return lines


def _shortest(vectors: Array, period: Array) -> Array:
    """Return vectors (..., 2) shortened by whole periods."""
    return np.asarray(vectors - period * np.round(vectors / period))
