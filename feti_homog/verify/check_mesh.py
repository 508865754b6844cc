"""Check the mesh, interface nodes, initially debonded arcs, tips of arcs, and the estimated mesh error.

The mesh error is compared with an estimate by stresses averaged at nodes (Zienkiewicz and Zhu 1987).
"""

from collections.abc import Iterator

import numpy as np
from scipy.special import gammaln, roots_legendre

from feti_homog.typing import Bool, Float
from feti_homog.verify.check_loads import NAMES, States
from feti_homog.verify.constitutive_law import GRADIENT
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import PLACES, add_at_nodes, quadrature_points
from feti_homog.verify.findings import ROUNDING, Findings, Section
from feti_homog.verify.reading import COATING, State, Status
from feti_homog.verify.torus import from_centre

# Largest distance in degrees between the tip of an arc and its mesh node; closer nodes are on neither side.
AT_TIP = 0.06
# Largest errors of lengths and normals if straight sides replace unknown curves, which turn by at most half a turn.
LENGTH_ERROR, NORMAL_ERROR = np.pi / 2 - 1, np.sqrt(2.0)
# Ratio of errors by fits to several elements to errors by nodal averages: measured 1.5 to 1.9 for quadratic elements
# without a bubble, otherwise 0.76 to 1.6, in hexagonal and random cells with contrasts of 1e-3 and 1e3, refined up to
# twice; up to a quarter more for elements as large as a fibre.
WITHOUT_BUBBLE = 1.7
# Least ratio of an energy error to the sum of the element errors, which may cancel at arcs.
LEAST_SHARE = 0.05
MODE_LENGTH = 1e-3  # least length at which modes are evaluated, in radii
# Middles of sides in barycentric coordinates: a quadrature rule, exact for squares of linear functions.
MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])


def check_mesh(findings: Findings, cell: DiscreteCell) -> None:
    """Check that elements fill the cell, and that torn sides lie in pairs, at voids or on the cell boundary.

    Also check that areas are positive, and that sizes, counts and fractions in result.json agree with the mesh.
    """
    elements, sides, section, phases = cell.elements, cell.sides, cell.files.document["cell"], cell.files.phases
    mesh, (width, height), porosity = cell.files.mesh, cell.files.size, section.get("porosity", 0.0)
    findings.record("mesh", np.where(elements.least_jacobian > 0, 0.0, np.inf), "element {}".format)
    findings.compare("mesh", elements.area.sum(), (1 - porosity) * cell.area, cell.area, "the sum of element areas")
    normals = sides.normal[sides.alone]
    findings.compare("mesh", normals.sum(axis=0), [0, 0], cell.files.size.max(), "the sides at voids are closed")
    agrees = bool(sides.at_void.any()) == (porosity > 0)
    findings.require("mesh", agrees, f"cell.porosity = {porosity:g}, {sides.at_void.sum()} sides at voids")
    sums = np.hypot(*(sides.normal + sides.normal[sides.partner]).T) / np.hypot(*sides.normal.T)
    mismatch = np.where(sides.alone, 0.0, np.where(sides.partner < 0, np.inf, sums))  # inf: several partners
    findings.record("mesh", mismatch, lambda i: f"a side of element {sides.element[i]}")
    counts = {"width": width, "height": height, "area": cell.area}
    counts |= {"elements": len(mesh.triangles), "nodes": len(mesh.points)}
    for name, value in counts.items():
        findings.compare("cell", section[name], value, value, f"cell.{name}")
    findings.compare("cell", section.get("origin", [0, 0]), mesh.points.min(axis=0), width, "cell.origin")
    fibres = [number for number, name in enumerate(phases) if name not in ("matrix", COATING)]
    shares = {"fibre_fraction": cell.fractions[fibres].sum(), "porosity": cell.porosity}
    for name, value in shares.items():
        findings.compare("cell", section.get(name, 0.0), value, 1.0, f"cell.{name}")
    for name, value in zip(phases, cell.fractions, strict=True):
        findings.compare("cell", section["fractions"][name], value, 1.0, f"cell.fractions.{name}")
    order = 1 + mesh.triangles.shape[1] // 6
    findings.compare("cell", cell.files.case["cell"].get("order", order), order, 1.0, "case.cell.order")


def check_interface(findings: Findings, cell: DiscreteCell) -> None:
    """Check places, bodies, sections, normals, lengths and strengths of interface nodes."""
    rows, faces, at = cell.files.interface, cell.faces, "interface node {}".format
    count = cell.files.document["solver"]["interface_nodes"]
    findings.compare("cell", count, len(rows.points), 1.0, "solver.interface_nodes")
    # Strengths scatter by Weibull's distribution with mean 1, except in a table of fibres.
    strength, scatter = cell.files.fibres.strength, next(iter(cell.files.interfaces), {}).get("scatter")
    if cell.files.case["cell"]["geometry"] != "table":
        expected = np.ones_like(strength)
        if scatter is not None:
            stream = np.random.default_rng(np.random.SeedSequence(scatter["seed"], spawn_key=(1,)))
            m = scatter["shape"]
            expected = np.exp(np.log(-np.log(1.0 - stream.random(len(strength)))) / m - gammaln(1.0 + 1.0 / m))
        findings.compare("tables", strength, expected, expected, "/fibre/strength at fibre {}".format)
    findings.record("interface", faces.distance / cell.files.size.max(), at)
    rows_at = np.bincount(faces.place[faces.place >= 0], minlength=cell.nodes.places)
    wrong = np.flatnonzero(rows_at != (faces.pair >= 0))
    first = [int(cell.nodes.node[np.argmax(cell.nodes.place == place)]) for place in wrong[:1]]
    text = f"{len(wrong)} places without exactly one interface node, the first at mesh node {first}"
    findings.require("interface", not len(wrong), text)
    # For every node, the number of nodes that share its body by the mesh or by the labels, but not by both.
    nodes, on_fibre = cell.nodes, (faces.row >= 0) & faces.is_fibre
    fibre = rows.fibre + (int(rows.fibre.max(initial=0)) + 1) * rows.body.astype(np.int64)
    part = np.full(len(fibre), -1)
    part[faces.row[on_fibre]] = cell.constituent[nodes.subdomain[on_fibre]]
    alike = []
    for labels in (part, fibre, part * (int(fibre.max(initial=0)) + 1) + fibre):
        _, inverse, sizes = np.unique(labels, return_inverse=True, return_counts=True)
        alike.append(sizes[inverse.ravel()])
    by_mesh, by_label, by_both = alike
    findings.record("interface", np.maximum(by_mesh, by_label) - by_both, at)
    misplaced = (faces.place >= 0) & (rows.pair != faces.pair[faces.place])
    findings.record("interface", np.where(misplaced, np.inf, 0.0), at)
    if (faces.place >= 0).all():
        normal, length, is_known = _shape(cell)
        errors = np.abs(rows.length / length - 1.0), np.hypot(*(rows.normal - normal).T)
        for error, limit in zip(errors, (LENGTH_ERROR, NORMAL_ERROR), strict=True):
            findings.record("interface", np.where(is_known | (error > limit), error, 0.0), at)
        findings.record("interface", np.abs(np.hypot(*rows.normal.T) - 1.0), at)


def _shape(cell: DiscreteCell) -> tuple[Float, Float, Bool]:
    """Compute normals (k, 2) and tributary lengths (k,) from the mesh.  Flags (k,) tell whether they are exact.

    Round fibres have radial normals.  The length of a node is half the length of its linear sides, or the integral of
    its shape function over its quadratic sides; the normal is the mean of side normals, weighted by these lengths.
    """
    files, rows, nodes = cell.files, cell.files.interface, cell.sides.nodes[cell.inner]
    is_fibre = np.asarray(rows.body == files.fibres.body[rows.fibre - 1])
    # Frames F of the circles or ellipses c + F p, |p| = 1, NaN if unknown.
    fibres = cell.files.document["fibres"]
    axes = [fibre.hint("semi_axes", [fibre.hint("radius", np.nan)] * 2) for fibre in fibres]
    angle = np.radians([fibre.hint("angle", 0.0) for fibre in fibres])
    thickness = np.array([fibre.hint("coating", np.nan) for fibre in fibres], float)
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    fibre, coats = rows.fibre - 1, np.where(is_fibre, 0.0, thickness[rows.fibre - 1])
    frames = turn[fibre] * (np.array(axes, float).reshape(-1, 2)[fibre] + coats[:, None])[:, None]
    # Nodes of a side that are no interface nodes have row -1, and get no share.
    row, is_quadratic, k = cell.inner_rows, nodes.shape[1] == 3, len(rows.length)
    points, frame, (x, weights) = files.mesh.points[nodes], frames[row.max(axis=1)], roots_legendre(7)
    shares = np.stack([x * (x - 1), x * (x + 1), 2 - 2 * x * x]) / 2 if is_quadratic else np.full((2, len(x)), 0.5)
    parts = np.linalg.norm(_tangents(points, frame, x), axis=2) * weights / 2 @ shares.T
    tangent = _tangents(points, frame, np.array([-1.0, 1.0, 0.0])[: nodes.shape[1]])
    tangent *= (parts / np.linalg.norm(tangent, axis=2))[..., None]
    on_row, at = row >= 0, row[row >= 0]
    length, right, up = (np.bincount(at, terms[on_row], k) for terms in (parts, tangent[..., 0], tangent[..., 1]))
    normal = np.column_stack([up, -right]) / np.hypot(right, up)[:, None]
    radius = np.where(is_fibre, files.fibres.radius[rows.fibre - 1], np.nan)
    is_round = np.isfinite(radius)
    radial = from_centre(rows.points, files.fibres.centre[rows.fibre - 1], files.shift) / radius[:, None]
    # Coatings in users' meshes may be on ellipses that the files do not describe.
    on_arcs = is_quadratic & (is_fibre | (files.case["cell"]["geometry"] not in ("mesh", "pixels")))
    is_known = is_round | np.isfinite(frames[:, 0, 0]) | on_arcs
    return np.where(is_round[:, None], radial, normal), np.asarray(length, float), np.asarray(is_known)


def _tangents(points: Float, frame: Float, places: Float) -> Float:
    """Compute the tangents dx / dt (s, q, 2) of sides x(t), t in [0, 1]; `places` (q,) are values of 2 t - 1.

    The nodes of the sides are `points` (s, n, 2), ends first.  A side is an elliptic arc, the image of a unit arc under
    its `frame` (s, 2, 2); without a frame (NaN) it is the circular arc through its three nodes, or straight.
    """
    on_ellipse = np.isfinite(frame[:, 0, 0])
    frame = np.where(on_ellipse[:, None, None], frame, np.eye(2))
    chord = np.linalg.solve(frame, (points[:, 1] - points[:, 0])[..., None])[..., 0] @ [1, 1j]
    bulge = (points[:, 2:].sum(axis=1) - points[:, :2].mean(axis=1)) @ [1, 1j] if points.shape[1] == 3 else 0.0
    half = np.where(on_ellipse, np.arcsin(np.minimum(abs(chord) / 2, 1)), -2 * np.arctan(2 * (bulge / chord).imag))
    tangent = (chord / np.sinc(half / np.pi))[:, None] * np.exp(1j * half[:, None] * places)
    return np.asarray(np.einsum("sij,snj->sni", frame, np.stack([tangent.real, tangent.imag], axis=2)))


def check_arcs(findings: Findings, cell: DiscreteCell, states: States) -> None:
    """Check that nodes inside debonded arcs have no bond.  Nodes outside must start with one.

    A user's mesh may have debonded curves that the files do not list: nodes outside arcs are then unchecked.
    """
    document, case = cell.files.document, cell.files.case
    points, from_mesh = document.get("angle", ()), case["cell"]["geometry"] == "mesh" and "interface" in case
    angles = case.get("angle", {}).get("values") or ()
    off = [abs(point["angle"] - angle) for point, angle in zip(points, angles, strict=False)]
    findings.record("arcs", off, "the angle of a point")
    for state in states:
        # The law "tables" reports a wrong point number.
        opening = points[min(max(state.point, 0), len(points) - 1)]["angle"] if points else None
        inside, outside = _sides(cell, opening)
        bonded = state.status == Status.BONDED
        findings.record("arcs", np.count_nonzero(inside & bonded), f"{state.name}, bonded within arcs")
        # The first state of a path by events is the one at which the first bonds break.
        intact = "path" not in document or (state.point == 0 and case["path"]["method"] == "events")
        if intact and not from_mesh:
            findings.record("arcs", np.count_nonzero(outside & ~bonded), f"{state.name}, debonded outside arcs")
    if "path" in document and case["path"]["method"] != "events" and not from_mesh:
        # Before the first increment, exactly the nodes outside the arcs have bonds.
        (inside, outside), first = _sides(cell, None), document["path"][0]
        count = first["bonded"] + first["broke"]
        excess = max(np.count_nonzero(outside) - count, count - np.count_nonzero(~inside), 0)
        findings.record("arcs", excess, "path[0].broke")


def _sides(cell: DiscreteCell, opening: float | None) -> tuple[Bool, Bool]:
    """Return masks (k,), inside arcs and outside all arcs, both False at tips; `opening` is the default angle."""
    rows = cell.files.interface
    inside, outside = np.zeros(len(rows.pair), bool), np.ones(len(rows.pair), bool)
    arcs = [(n, arc) for n, section in enumerate(cell.files.interfaces) for arc in section.get("debonded", ())]
    for pair, arc in arcs:
        on_curve = (rows.pair == pair) & ((arc["fibre"] == "all") | np.isin(rows.fibre, arc["fibre"]))
        half = (arc["angle"] if arc.get("angle") is not None else float(opening or 0.0)) / 2
        distance = np.abs((cell.directions - arc["centre"] + 180.0) % 360.0 - 180.0)
        inside |= on_curve & ((distance < half - AT_TIP) | (half >= 180.0))
        outside &= ~on_curve | ((distance > half + AT_TIP) & (half < 180.0)) | (half == 0.0)
    return inside, outside


def check_rates(findings: Findings, cell: DiscreteCell, tips: Section, where: str) -> None:
    """Check release rates G = G_I + G_II + G_III, modes tan^2 psi = (G_II + G_III) / G_I, and places of crack tips."""
    rows, at = cell.files.interface, f"{where}, tip {{}}".format
    names = "G", "G_I", "G_II", "psi", "length", "angle", "fibre"
    G, opening, shear, psi, length, angle, number = (np.array(tips[name]) for name in names)
    pair, third = np.array(tips.get("interface", [1] * len(G))), np.array(tips.get("G_III", [0.0] * len(G)))
    loads = [*NAMES[6 if "G_III" in tips else 3][0], "strain", "load"]
    tips.leaves_open("G", "G_I", "G_II", "G_III")
    findings.compare("rates", G, opening + shear + third, np.abs(G), at)
    findings.compare("rates", shear + third, G * np.sin(np.radians(psi)) ** 2, np.abs(G), at)
    findings.record("rates", [0.0 if load.lstrip("-") in loads else np.inf for load in tips["load"]], at)
    radii = np.hypot(*from_centre(rows.points, cell.files.fibres.centre[rows.fibre - 1], cell.files.shift).T)
    for t in range(len(G)):
        on_curve = (rows.fibre == number[t]) & (rows.pair == pair[t] - 1)
        # A coating has the number of its fibre, but another radius.
        radius = float(np.median(radii[on_curve])) if on_curve.any() else np.nan
        chords = 2 * radius * np.abs(np.sin(np.radians(cell.bond_directions[on_curve] - angle[t]) / 2))
        off = np.abs(np.append(chords, MODE_LENGTH * radius) - length[t]).min() / length[t]
        apart = 1.0 if chords.min(initial=np.inf) > ROUNDING * radius else 0.0  # no bond is at the tip
        findings.record("rates", max(off + apart - ROUNDING, 0.0), at(t))


def check_mesh_error(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check that energy errors are at least LEAST_SHARE of summed element errors; under unit loads, check this sum."""
    document, total, error = cell.files.document, float(state.mesh_error.sum()), None
    if "path" in document or "load" in document:
        error = (document["path"][state.point] if "path" in document else document["load"]).hint("mesh_error")
    elif "mesh_error" in document and not state.temperature:
        k = int(np.abs(state.strain).argmax())
        name = f"effective_stiffness{'_compression' if state.strain[k] < 0 else ''}"
        if "effective_conductivity" in document:
            name, k = "effective_conductivity", GRADIENT.index(k)
        error = document["mesh_error"].hint(name)[k][k] / abs(document.hint(name)[k][k])
    if error is not None and not np.isnan(total):
        ratio = (LEAST_SHARE * total + ROUNDING) / (error + ROUNDING)
        findings.record("mesh error", ratio - 1, f"{state.name}, the error of its energy")
    energy = float(state.strain @ state.mean_stress) * cell.area
    has_unit_loads = cell.files.case["analysis"]["type"] in ("stiffness", "conductivity")
    if not has_unit_loads or not energy > 0 or np.isnan(state.mesh_error).all():
        return
    # int d : S : d, where d is the stress interpolated from averages at nodes minus the stress of the element.
    mesh, v, elements = cell.files.mesh, cell.stiffnesses.shape[1], cell.elements
    n, is_linear = mesh.triangles.shape[1], mesh.triangles.shape[1] == 3
    r = MIDDLES if is_linear else quadrature_points()  # (q, 3) barycentric coordinates

    def stresses() -> Iterator[tuple[slice, Float, Float]]:
        """Yield slices of elements, with weights (e, q), and stresses (e, q, v) at the points `r`."""
        free = state.temperature * cell.expansions
        for part, _, w, _, _, stress in elements.responses(state.displacement, state.along, free):
            yield part, w * np.ones(len(r)) * w.shape[1] / len(r), stress * np.ones((len(r), 1))

    weights, sums = np.zeros(len(mesh.points)), np.zeros((len(mesh.points), v))
    for part, w, stress in stresses():
        nodes, area = mesh.triangles[part], w.sum(axis=1)
        if not is_linear:  # values at nodes of the nearest linear functions
            corners = np.linalg.pinv(r) @ stress
            stress = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)
        weights += np.bincount(nodes.ravel(), np.repeat(area, n), len(weights))
        add_at_nodes(sums, nodes, stress * area[:, None, None])
    averages = sums / np.where(weights > 0.0, weights, 1.0)[:, None]
    components, averaged = np.unique(PLACES[v]), 0.0  # stresses that displacements change; bubbles are in the plane
    has_bubble = elements.mixed[:, None] & np.isin(components, PLACES[v][:2])
    factor = np.where(has_bubble | is_linear, 1.0, np.sqrt(WITHOUT_BUBBLE))
    flexibility = np.linalg.inv(cell.stiffnesses[:, components[:, None], components])
    # (q, nodes) N_a, r_a or r_a (2 r_a - 1) and 4 r_a r_b.
    functions = r if is_linear else np.hstack([r * (2 * r - 1), 4 * r * np.roll(r, -1, axis=1)])
    for part, w, stress in stresses():
        phase = mesh.phase[part]
        off = (functions @ averages[mesh.triangles[part]] - stress)[..., components] * factor[phase, None]
        averaged += float(np.einsum("eq,eqi,eij,eqj->", w, off, flexibility[phase], off, optimize=True))
    ratio = (total + ROUNDING) / (averaged / energy + ROUNDING)
    findings.record("mesh error", max(ratio, 1 / ratio) - 1, state.name)
