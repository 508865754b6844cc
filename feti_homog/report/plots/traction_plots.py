"""Draw interface.png: tractions, jumps and damage around the fibres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
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

SPIKES = 2.0  # percentage of the nodes that the range estimate ignores, at either end
SHADE: dict[str, Any] = {"alpha": 0.18, "linewidth": 0}
NAMES = {
    "traction": (r"$t_\mathrm{n}$", r"$t_\mathrm{t}$", r"$t_\mathrm{a}$"),
    "jump": ("gap", "slip", "axial slip"),
    "damage": ("damage",),
}


def figure(cell: drawn_cell.DrawnCell, document: Document, look: plot_helpers.Look = plot_helpers.PLAIN) -> Figure:
    """Draw tractions, jumps and damage, a row per fibre: up to four most damaged fibres, or else the most loaded."""
    file, names = cell.file, _chosen_states(cell.file, document)
    fibre, last_state = file["interface/fibre"][:], file[f"state/{names[-1]}"]
    status, damage = last_state["status"][:], last_state["damage"][:]
    is_partial = ((damage > 0.0) & (damage < 1.0)).any()
    quantities = ["traction", "jump", "damage"] if is_partial else ["traction", "jump"]
    harm = np.maximum(damage, status != drawn_cell.BONDED)
    bodies, place = np.unique(fibre, return_inverse=True)
    harmed, largest = np.unique(fibre[harm > 0.0]), np.full(len(bodies), -np.inf)
    np.maximum.at(largest, place, last_state["traction"][:, 0])
    order = np.lexsort((-largest, -np.bincount(place, harm)))  # by damage, then by the largest normal traction
    count = min(4, max(len(harmed), 1))
    picture = look.figure(1.5 + 3.75 * len(quantities), 2.4 * count + 1.5)
    stacked = picture.get_figwidth() < plot_helpers.NARROW
    count = 1 if stacked else min(count, max(int(picture.get_figheight() / 1.5), 1))
    chosen = np.sort(bodies[order[:count]])
    shape = (len(quantities), 1) if stacked else (len(chosen), len(quantities))
    grid = picture.subplots(*shape, sharey=False if stacked else "col", squeeze=False).reshape(len(chosen), -1)
    stress = plot_helpers.stress_label(file.attrs["stress_unit"])
    length = plot_helpers.unit_label(file.attrs["length_unit"]) or "(cell units)"
    for row, body in zip(grid, chosen, strict=True):
        along = coordinate(cell, body)
        for axes, quantity in zip(row, quantities, strict=True):
            _panel(axes, [file[f"state/{name}"] for name in names], quantity, along)
        row[0].set_ylabel(f"traction {stress}")
        row[1].set_ylabel(f"jump {length}")
        for axes in row[2:]:
            axes.set(ylabel="damage", ylim=(-0.03, 1.03))
        fibre_name = f"fibre {file['interface/fibre_number'][along.nodes[0]]}"
        row[0].set_title(fibre_name if body in file["fibre/body"][:] else f"coating of {fibre_name}", loc="left")
        for axes in row if stacked else ():
            axes.set_title(f"{axes.get_title('left')} {axes.get_ylabel()}".strip(), loc="left")
            axes.set_ylabel("")
            axes.label_outer()
    for column in grid.T:
        column[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), borderpad=0.1, ncols=3)
        _limit(list(column))
    if np.abs(last_state["jump"][:]).max() < SAME_PLACE**2 * file.attrs["width"]:
        grid[0][1].set_ylim(-1.0, 1.0)  # jumps of bonded faces are rounding
    shaded = status[np.isin(fibre, chosen)]
    kinds = [kind for kind in (drawn_cell.OPEN, drawn_cell.CLOSED) if kind in shaded]
    patches = [Patch(color=drawn_cell.STATE_COLOURS[k], label=drawn_cell.STATE_NAMES[k], **SHADE) for k in kinds]
    plot_helpers.legend_below(picture, patches)
    before, last, labels = file[f"state/{names[0]}"].attrs, last_state.attrs, drawn_cell.LoadLabels.of(document)
    title = f"{last['label']}: {labels.label(last)}"
    title += ", one of the loads" if reported(document).name == "stiffness" else ""
    if len(names) > 1:
        title += f" (dashed: {before['label']})" if stacked else f" (dashed: {before['label']}: {labels.label(before)})"
    if len(harmed) > len(chosen):
        title += f"\nthe most debonded or damaged of {len(harmed)} interfaces"
    picture.suptitle(title)
    return picture


def _limit(column: Sequence[Axes]) -> None:
    """Limit the common ordinate if a few nodes at singular tips exceed all other values; mark the hidden extremes."""
    curves = [np.concatenate([np.asarray(line.get_ydata(), float) for line in axes.lines]) for axes in column]
    values = np.concatenate(curves)
    lower, upper = np.percentile(values, (SPIKES, 100.0 - SPIKES))
    low, high = 2.0 * lower - upper, 2.0 * upper - lower
    if high > low and (values.min() < low or values.max() > high):
        column[0].set_ylim(max(values.min(), low), min(values.max(), high))
        for axes, curve in zip(column, curves, strict=True):
            ends = [f"▲ {curve.max():.3g}"] if curve.max() > high else []
            ends += [f"▼ {curve.min():.3g}"] if curve.min() < low else []
            if ends:
                axes.text(0.99, 0.97, "\n".join(ends), ha="right", va="top", transform=axes.transAxes)


def _chosen_states(file: Any, document: Document) -> list[str]:
    """Choose the states to draw; return their names in result.h5.

    A path gives the state at the peak (or the first), and the state in the valley after the peak (or the last with
    tractions).  Other analyses give the first (angles: the middle) partly debonded state, or the last with tractions.
    """
    names, total = sorted(file["state"], key=int), len(file["interface/points"])
    status = {name: file[f"state/{name}/status"][:] for name in names}
    partly = [name for name in names if 0 < np.count_nonzero(status[name]) < total]
    # After the last break the tractions vanish, unless the faces touch.
    worthwhile = [name for name in names if name in partly or (status[name] == drawn_cell.CLOSED).any()]
    last = (worthwhile or names)[-1]
    if not reported(document).is_followed:
        middle = len(partly) // 2 if reported(document).name == "angle" else 0
        return [partly[middle] if partly else last]
    of_point = {int(file[f"state/{name}"].attrs["point"]): name for name in names}
    peak = landmarks.peak_of(document)
    before, after = of_point.get(peak.get("event", 0), names[0]), of_point.get(peak.get("event_left", -1), last)
    return list(dict.fromkeys([before, after if (status[after] != drawn_cell.BONDED).any() else last]))


def _panel(axes: Axes, states: list[Any], quantity: str, place: Coordinate) -> None:
    """Draw tractions, jumps or damage around a fibre, with earlier states dashed.

    The background marks the debonded part in the last state.
    """
    # Each debonded node represents half the distance to either neighbour.
    bounds = np.r_[place.ends[0], (place.values[1:] + place.values[:-1]) / 2, place.ends[1]]
    for k, kind in enumerate(states[-1]["status"][:][place.nodes]):
        if kind != drawn_cell.BONDED:
            axes.axvspan(bounds[k], bounds[k + 1], **SHADE, color=drawn_cell.STATE_COLOURS[kind])
    for state in states:
        values: Array = state[quantity][:]
        if f"axial_{quantity}" in state and (axial := state[f"axial_{quantity}"][:]).any():
            values = np.column_stack([values, axial])
        values = values.reshape(len(values), -1)[place.nodes]
        at, turn = place.values, place.ends[1] - place.ends[0]
        # The curve closes if the gap between the last and the first node is less than twice the largest other gap.
        if place.is_closed and len(at) > 1 and at[0] + turn - at[-1] < 2.0 * np.diff(at).max():
            at = np.concatenate([at[-1:] - turn, at, at[:1] + turn])
            values = np.concatenate([values[-1:], values, values[:1]])
        is_last = state is states[-1]
        width, style = (1.5, "-") if is_last else (0.9, "--")
        for label, column, ink in zip(NAMES[quantity], values.T, plot_helpers.INK, strict=False):
            axes.plot(at, column, style, color=ink, linewidth=width, label=label if is_last else None)
    axes.axhline(0.0, color="0.6", linewidth=0.6)
    axes.set(xlim=place.ends, xlabel=place.label)
    if place.is_direction:
        axes.xaxis.set_major_locator(MultipleLocator(60))


@dataclass(frozen=True)
class Coordinate:
    """The interface nodes in order along a fibre outline, with their coordinate."""

    nodes: Array  # (k,) rows of /interface
    values: Array  # (k,) ascending
    ends: tuple[float, float]
    label: str
    is_direction: bool
    is_closed: bool = True


def coordinate(cell: drawn_cell.DrawnCell, body: int) -> Coordinate:
    """Return the coordinate of the interface nodes along a body outline.

    It is the normal direction (degrees) on round fibres and their coatings.  On other bodies it is the arc length,
    counterclockwise from the node whose normal is nearest to x1, or from an open end; boundaries follow each other.
    """
    file, edges = cell.file, cell.interface.nodes
    of_body = np.flatnonzero(file["interface/fibre"][:] == body)
    points, normal = file["interface/points"][:], file["interface/normal"][:]
    radius = file["fibre/radius"][:][np.isin(file["fibre/number"][:], file["interface/fibre_number"][:][of_body])]
    if np.isfinite(radius).all():
        angle = np.degrees(np.arctan2(normal[of_body, 1], normal[of_body, 0]))
        order = np.argsort(angle)
        return Coordinate(of_body[order], angle[order], (-180.0, 180.0), "direction of the normal (degrees)", True)
    period = np.array([file.attrs["width"], file.attrs["height"]])
    chain = np.unique(np.sort(edges[np.isin(edges, of_body).all(axis=1)], axis=1), axis=0)
    lines = _lines(chain, normal, points, period)
    # (e, 2) the boundary edges, from `starts` by `steps`, with the arc length `before` each of them.
    starts = np.concatenate([points[line[:-1]] for line in lines])
    steps = np.concatenate([_shortest(np.diff(points[line], axis=0), period) for line in lines])
    before = np.append(0.0, np.cumsum(np.linalg.norm(steps, axis=1)))
    tree = cKDTree(np.mod(starts + 0.5 * steps, period) % period, boxsize=period)
    nodes = points[of_body]
    nearest = tree.query(np.mod(nodes, period) % period, k=min(8, len(starts)))[1].reshape(len(nodes), -1)
    step = steps[nearest]
    offset, length = _shortest(nodes[:, None] - starts[nearest] - 0.5 * step, period), np.linalg.norm(step, axis=2)
    fraction = np.clip(0.5 + (offset * step).sum(axis=2) / length**2, 0.0, 1.0)
    distance = np.linalg.norm(offset - (fraction - 0.5)[..., None] * step, axis=2)
    # A vertex counts as the start of an edge, not as an end.
    best = np.arange(len(nodes)), (distance + SAME_PLACE * length * fraction).argmin(axis=1)
    at = before[nearest[best]] + (fraction * length)[best]
    order, unit = np.argsort(at, kind="stable"), plot_helpers.unit_label(file.attrs["length_unit"])
    is_closed = all(line[0] == line[-1] for line in lines)
    label = f"arc length{' from normal $x_1$' if is_closed else ''}, counterclockwise {unit or '(cell units)'}"
    ends = 0.0, float(before[-1])
    return Coordinate(of_body[order], at[order], ends, label, False, is_closed and len(lines) == 1)


def _lines(chain: Array, normal: Array, points: Array, period: Array) -> list[Array]:
    """Chain edges (e, 2) into boundaries, as counterclockwise node lists.

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
    """Shift vectors (..., 2) by whole periods, to components of at most half a period."""
    return np.asarray(vectors - period * np.round(vectors / period))
