"""Laws of the mesh, of the interface nodes on it, and of the arcs that are debonded from the start."""

from __future__ import annotations

import numpy as np
from scipy.special import roots_legendre

from feti_homog.typing import AnyInt, Bool, Float, Int
from feti_homog.verify.check_fields import BONDED
from feti_homog.verify.check_loads import States
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.leaves import Section

# The mesher moves the tips of arcs by so many degrees at most; what is nearer to a tip is on neither side of it.
AT_TIP = 0.06
# Errors of lengths and normals of straight sides in place of unknown curves that turn by half a turn at most.
MOST_OFF = np.pi / 2 - 1, np.sqrt(2.0)


def check_arcs(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Nodes inside the arcs are debonded in all states; those outside are bonded, before the load breaks them.

    In a user's mesh a curve may be debonded that is not in the files, so that only the first is known.
    """
    document, case = cell.files.document, cell.files.case
    from_mesh = case["cell"]["geometry"] == "mesh"
    points = document.get("angle", ())
    for point, angle in zip(points, case.get("angle", {}).get("values") or (), strict=False):
        findings.record("arcs", abs(point["angle"] - angle), "the angle of a point")
    for state in states:
        # A number that is wrong breaks the law of the tables.
        opening = points[min(max(state.point, 0), len(points) - 1)]["angle"] if points else None
        inside, outside = _sides(cell, opening)
        bonded = state.status == BONDED
        findings.record("arcs", np.count_nonzero(inside & bonded), f"{state.name}, bonded within arcs")
        # The first state of a path by events is the one at which the first bonds break.
        intact = "path" not in document or (state.point == 0 and case["path"]["method"] == "events")
        if intact and not (from_mesh and "interface" in case):
            findings.record("arcs", np.count_nonzero(outside & ~bonded), f"{state.name}, debonded outside of arcs")


def check_first_step(findings: Findings, cell: DiscreteCell, first: Section) -> None:
    """Check that the bonds before the first increment are those outside of the arcs of the case."""
    if cell.files.case["cell"]["geometry"] != "mesh" or "interface" not in cell.files.case:
        (inside, outside), count = _sides(cell, None), first["bonded"] + first["broke"]
        off = max(np.count_nonzero(outside) - count, count - np.count_nonzero(~inside), 0)
        findings.record("arcs", off, "path[0].broke")


def _sides(cell: DiscreteCell, opening: float | None) -> tuple[Bool, Bool]:
    """Return which interface nodes (k,) are inside of an arc, and which are outside of all of them."""
    rows, angle = cell.files.interface, directions(cell)
    inside, outside = np.zeros(len(angle), bool), np.ones(len(angle), bool)
    arcs = [(n, arc) for n, section in enumerate(cell.files.interfaces) for arc in section.get("debonded", ())]
    for pair, arc in arcs:
        own = (rows.pair == pair) & ((arc["fibre"] == "all") | np.isin(rows.fibre, arc["fibre"]))
        half = (arc["angle"] if arc.get("angle") is not None else float(opening or 0.0)) / 2
        away = np.abs((angle - arc["centre"] + 180.0) % 360.0 - 180.0)
        inside |= own & ((away < half - AT_TIP) | (half >= 180.0))
        outside &= ~own | ((away > half + AT_TIP) & (half < 180.0)) | (half == 0.0)
    return inside, outside


def directions(cell: DiscreteCell) -> Float:
    """(k,) directions in degrees of the interface nodes from the centres of their fibres."""
    rows = cell.files.interface
    away = from_centre(rows.points, cell.files.fibres.centre[rows.fibre - 1], cell.files.size)
    return np.asarray(np.degrees(np.arctan2(away[:, 1], away[:, 0])))


def check_mesh(findings: Findings, cell: DiscreteCell) -> None:
    """Elements have positive areas that fill the cell but for voids; a torn side has one partner or is at a void."""
    elements, sides, given = cell.elements, cell.sides, cell.files.document["cell"].get("porosity", 0.0)
    findings.record("mesh", np.where(elements.least_jacobian > 0, 0.0, np.inf), "element {}".format)
    findings.record("mesh", relative(elements.area.sum() - (1 - given) * cell.area, cell.area), "the sum of all areas")
    normals = sides.normal[sides.at_void]
    findings.record(
        "mesh", relative(np.abs(normals.sum(axis=0)), cell.files.size.max()), "the sides at voids are closed"
    )
    agrees = bool(sides.at_void.any()) == (given > 0)
    findings.record("mesh", np.where(agrees, 0.0, np.inf), f"cell.porosity = {given:g}, {len(normals)} sides at voids")
    findings.record("mesh", sides.mismatch, lambda i: f"a side of element {sides.element[i]}")


def check_interface(findings: Findings, cell: DiscreteCell) -> None:
    """Check that each place where two bodies meet that may part has one interface node.

    The node is of the inner body and of their section, and there are no others.
    """
    rows, faces = cell.files.interface, cell.faces
    at = "interface node {}".format
    findings.record("interface", faces.distance / cell.files.size.max(), at)
    count = np.bincount(faces.place[faces.place >= 0], minlength=cell.nodes.places)
    wrong = np.flatnonzero(count != (faces.pair >= 0))
    first = [int(cell.nodes.node[np.argmax(cell.nodes.place == place)]) for place in wrong[:1]]
    words = f"{len(wrong)} places with another number of interface nodes than one, the first at mesh node {first}"
    findings.record("interface", np.where(len(wrong), np.inf, 0.0), words)
    findings.record("interface", _strangers(cell), at)
    misplaced = (faces.place >= 0) & (rows.pair != faces.pair[faces.place])
    findings.record("interface", np.where(misplaced, np.inf, 0.0), at)
    if (faces.place >= 0).all():
        normal, length, is_known = _shape(cell)
        errors = np.abs(rows.length / length - 1.0), np.hypot(*(rows.normal - normal).T)
        for error, most in zip(errors, MOST_OFF, strict=True):
            findings.record("interface", np.where(is_known | (error > most), error, 0.0), at)
        findings.record("interface", np.abs(np.hypot(*rows.normal.T) - 1.0), at)


def _shape(cell: DiscreteCell) -> tuple[Float, Float, Bool]:
    """Return normals (k, 2) and tributary lengths (k,) that follow from the mesh, and which (k,) do exactly.

    A round fibre has radial normals.  Ends of linear sides have halves of their lengths, nodes of quadratic ones
    int N ds; a node has the mean normal of its sides, weighted by these parts.
    """
    files, rows, nodes = cell.files, cell.files.interface, cell.sides.nodes[cell.inner]
    row_of, frames, k = np.full(len(files.mesh.points), -1), _frames(cell), len(rows.length)
    row_of[cell.nodes.node] = cell.faces.row
    # A side whose nodes are no interface nodes belongs to none of them.
    row, is_quadratic = row_of[nodes], nodes.shape[1] == 3
    points, frame, (x, weights) = files.mesh.points[nodes], frames[row.max(axis=1)], roots_legendre(7)
    shares = np.stack([x * (x - 1), x * (x + 1), 2 - 2 * x * x]) / 2 if is_quadratic else np.full((2, len(x)), 0.5)
    parts = np.linalg.norm(_tangents(points, frame, x), axis=2) * weights / 2 @ shares.T
    ahead = _tangents(points, frame, np.array([-1.0, 1.0, 0.0])[: nodes.shape[1]])
    ahead *= (parts / np.linalg.norm(ahead, axis=2))[..., None]
    at, known = row[row >= 0], row >= 0
    length, right, up = (np.bincount(at, terms[known], k) for terms in (parts, ahead[..., 0], ahead[..., 1]))
    normal = np.column_stack([up, -right]) / np.hypot(right, up)[:, None]
    radius = np.where(_is_fibre(cell), files.fibres.radius[rows.fibre - 1], np.nan)
    is_round = np.isfinite(radius)
    radial = from_centre(rows.points, files.fibres.centre[rows.fibre - 1], files.size) / radius[:, None]
    # Coatings of users' meshes may be on ellipses of which the files tell nothing.
    on_arcs = is_quadratic & (_is_fibre(cell) | (files.case["cell"]["geometry"] != "mesh"))
    is_known = is_round | np.isfinite(frames[:, 0, 0]) | on_arcs
    return np.where(is_round[:, None], radial, normal), np.asarray(length, float), np.asarray(is_known)


def _frames(cell: DiscreteCell) -> Float:
    """(k, 2, 2) frame F of the circle or ellipse c + F p, |p| = 1, that each interface node is on; NaN if unknown."""
    rows, own = cell.files.interface, cell.files.document["fibres"]
    axes = np.array([fibre.get("semi_axes", [fibre.get("radius", np.nan)] * 2) for fibre in own], float).reshape(-1, 2)
    angle = np.radians([fibre.get("angle", 0.0) for fibre in own])
    thickness = np.array([fibre.get("coating", np.nan) for fibre in own], float)
    around = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    of, coats = rows.fibre - 1, np.where(_is_fibre(cell), 0.0, thickness[rows.fibre - 1])
    return np.asarray(around[of] * (axes[of] + coats[:, None])[:, None])


def _tangents(points: Float, frame: Float, places: Float) -> Float:
    """(s, q, 2) dx / ds, s in [0, 1], of sides with these nodes (s, n, 2), ends first, at `places` (q,) in [-1, 1].

    The chord of a side is one of the unit circle that its ellipse, of frame (s, 2, 2), is an image of; if that is NaN,
    the side is the arc of a circle through its three nodes, or straight.
    """
    on_ellipse = np.isfinite(frame[:, 0, 0])
    frame = np.where(on_ellipse[:, None, None], frame, np.eye(2))
    chord = np.linalg.solve(frame, (points[:, 1] - points[:, 0])[..., None])[..., 0] @ [1, 1j]
    bulge = (points[:, 2:].sum(axis=1) - points[:, :2].mean(axis=1)) @ [1, 1j] if points.shape[1] == 3 else 0.0
    half = np.where(on_ellipse, np.arcsin(np.minimum(abs(chord) / 2, 1)), -2 * np.arctan(2 * (bulge / chord).imag))
    ahead = (chord / np.sinc(half / np.pi))[:, None] * np.exp(1j * half[:, None] * places)
    return np.asarray(np.einsum("sij,snj->sni", frame, np.stack([ahead.real, ahead.imag], axis=2)))


def from_centre(points: Float, centres: Float, size: Float) -> Float:
    """(k, 2) vectors to points from the nearest images of centres."""
    away = points - centres
    return np.asarray(away - np.round(away / size) * size)


def _strangers(cell: DiscreteCell) -> Float:
    """(k,) with how many nodes each shares its body in one of two ways, but not in the other.

    One is on the mesh, the other by its label of the body and number of the fibre.
    """
    nodes, faces, rows = cell.nodes, cell.faces, cell.files.interface
    fibre = rows.fibre + (int(rows.fibre.max(initial=0)) + 1) * rows.body.astype(np.int64)
    own = (faces.row >= 0) & faces.is_fibre
    part = np.full(len(fibre), -1)
    part[faces.row[own]] = cell.constituent[nodes.subdomain[own]]
    alike = _alike(part * (int(fibre.max(initial=0)) + 1) + fibre)
    return np.asarray(np.maximum(_alike(part), _alike(fibre)) - alike, float)


def _alike(labels: AnyInt) -> Int:
    """(k,) how many have the same label as each."""
    _, inverse, count = np.unique(labels, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()])


def _is_fibre(cell: DiscreteCell) -> Bool:
    """(k,) whether the inner body is the fibre of the number itself, not a coating of it."""
    rows, fibres = cell.files.interface, cell.files.fibres
    return np.asarray(rows.body == fibres.body[rows.fibre - 1])
