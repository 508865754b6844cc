"""Check the laws of a state: averages, equilibrium, interfaces, friction and the largest phase stresses."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import friction_at, law_at, rubbing_force
from feti_homog.verify.constitutive_law import PLANE, VOIGT, out_of_plane, phase_constants
from feti_homog.verify.discrete_cell import ROUNDED_TERMS, DiscreteCell
from feti_homog.verify.elements import PLACES, ElementFields, quadrature_points
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.reading import State, Status
from feti_homog.verify.torus import from_centre

LAW = "phases"
# Names of criteria by a key that no other criterion has.
CRITERIA = dict(principal="maximum principal", von_mises="von Mises", tension="Drucker-Prager", axial_shear="Hashin")
MODES = ("axial tension", "axial compression", "transverse tension", "transverse compression")
# Relative differences that count as rounding: between the largest value and the value at the stated position; between
# the position and a quadrature point.
SAME_VALUE, SAME_PLACE = 1e-5, 1e-9
# Least scale of stresses in a phase, relative to L |E|: smaller stresses, as in a free body, are rounding.
ROUNDED = 1e-4


def check_state(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check stresses, averages, S33, and Hill's lemma: <sigma : eps> = Sigma : E - (interface work) / (cell area)."""
    element = f"{state.name}, element {{}}".format
    stiffest = np.abs(cell.stiffnesses).max(axis=(1, 2))[cell.files.mesh.phase]
    findings.compare("stress", state.stress, fields.stress, (stiffest * fields.strain_size)[:, None], element)
    # <sigma> = Sigma; <eps> = E with the openings of faces and the strains of voids; Hill's lemma.
    area, weights, v, scales = cell.area, cell.elements.area[:, None], len(state.strain), cell.scales_of(state)
    mean = (weights * fields.stress).sum(axis=0) / area
    size = float(((weights * np.abs(fields.stress)).sum(axis=0) / area).max())
    size += ROUNDED_TERMS * float((weights[:, 0] * stiffest * fields.strain_size).sum() / area)
    findings.compare("mean stress", mean, state.mean_stress, max(size, scales.stress), state.name)
    jump = cell.in_axes(state.jump)
    integrals = (cell.elements.node_integrals + cell.void_integrals + cell.side_integrals)[cell.nodes.node]
    # A void adds its fraction of E and int sym(u* (x) n) ds, a closed integral even in voids that the cell sides cut.
    slope = state.fluctuation.T @ cell.void_integrals - jump.T @ cell.faces.sums(integrals, of_fibre=False)
    openings = np.bincount(PLACES[v].ravel(), slope.ravel(), v) / area + cell.porosity * state.strain
    strain = (weights * fields.strain).sum(axis=0) / area + openings
    findings.compare("mean strain", strain, state.strain, scales.strain, state.name)
    work = area * float(state.mean_stress @ state.strain) - float((interface_forces(cell, state) * jump).sum())
    least = area * scales.stress * scales.strain
    findings.compare("Hill", fields.energy, work, max(abs(fields.energy), least), state.name)
    if not cell.files.is_spatial:
        rules = out_of_plane(cell.files.case, cell.files.phases)[cell.files.mesh.phase, 0]
        S33 = np.einsum("ei,ei->e", rules, state.stress)
        terms = np.einsum("ei,ei->e", np.abs(rules), np.abs(state.stress))
        undetermined = np.isnan(S33) & np.isnan(state.stress_33)  # the constants of the phase leave S33 open
        off = np.where(undetermined, 0.0, state.stress_33 - S33)
        findings.record("stress 33", relative(off, np.where(undetermined, 1.0, terms)), element)


def interface_forces(cell: DiscreteCell, state: State) -> Float:
    """Compute forces (k, c) on the fibre, traction x tributary length, along x1, x2 and x3."""
    return cell.in_axes(state.traction * cell.files.interface.length[:, None])


def check_gluing(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check that copies of a node have equal fluctuations u*, and that forces balance.

    Forces on faces balance the traction; on the sides of the cell they balance Sigma n if prescribed, and prescribed
    displacements are E x.  The reaction of the fixed node, u* = 0, contains the rounding of all nodes.
    """
    nodes, traction, largest = cell.nodes, interface_forces(cell, state), cell.largest_displacement(state)
    # Periodic copies lie in one subdomain.  Glued nodes have one number: the places have even numbers, and the fibre
    # side of an interface node has the odd number above.
    in_subdomain = nodes.place * (int(nodes.subdomain.max()) + 1) + nodes.subdomain
    glued = 2 * nodes.place + ((cell.faces.row >= 0) & cell.faces.is_fibre)
    values = state.fluctuation[nodes.node]
    for law, group in (("periodicity", in_subdomain), ("continuity", glued)):
        side, first, copy, count = np.unique(group, return_index=True, return_inverse=True, return_counts=True)
        copy = copy.ravel()
        means = np.stack([(np.bincount(copy, column) / count)[copy] for column in values.T], axis=1)
        findings.compare(law, values, means, largest, lambda i: f"{state.name}, mesh node {nodes.node[i]}")
    is_given, sigma = cell.files.boundary == "displacement", state.mean_stress[PLACES[len(state.strain)]]
    on_side = np.unique(cell.sides.nodes[cell.sides.on_side])
    if is_given:
        on_sides = np.abs(state.fluctuation[on_side])
        findings.record("sides", on_sides / largest, lambda i: f"{state.name}, mesh node {on_side[i]}")
    scale = max(fields.largest_force, float(np.abs(traction).max(initial=0.0)))
    scale = max(scale, cell.scales_of(state).stress * float(np.sqrt(cell.elements.area.min())) * 1e-3)
    scale *= 10.0 if (state.status == Status.CLOSED).any() else 1.0  # bodies that they hardly hold count as free
    is_fixed = (state.fluctuation == 0.0).all(axis=1)
    rounding, rounding_of_all = (ROUNDED_TERMS * np.linalg.norm(fields.force_size, order) for order in (np.inf, 2))
    inner = fields.force.copy()  # forces at nodes within subdomains
    inner[nodes.node] = 0.0
    scales = scale + np.where(is_fixed, rounding_of_all, rounding)
    findings.record("equilibrium", relative(inner, scales[:, None]), f"{state.name}, mesh node {{}}".format)
    # Sums of forces over glued nodes, the last group of the loop.
    force = fields.force if is_given else fields.force + cell.side_integrals @ sigma.T  # n inwards
    sums = np.stack([np.bincount(copy, column) for column in force[nodes.node].T], axis=1, dtype=float)
    # The traction pulls the fibre, its reaction the matrix.
    row = cell.faces.row[first]
    on_face = row >= 0
    sums[on_face] -= np.where(side % 2 == 1, 1.0, -1.0)[on_face, None] * traction[row[on_face]]

    def name(i: int) -> str:
        at_face = f" (interface node {row[i]})" if on_face[i] else ""
        return f"{state.name}, mesh node {nodes.node[first[i]]}{at_face}"

    if is_given:  # where unknown reactions act
        sums[copy[np.isin(nodes.node, on_side)]] = 0.0
    has_fixed = np.bincount(copy, is_fixed[nodes.node]) > 0
    scales = scale + np.where(has_fixed, rounding_of_all, rounding)
    findings.record("equilibrium", relative(sums, scales[:, None]), name)


def check_bonds(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check jumps, springs of bonds, contact and friction at interface nodes.

    On debonded faces gap >= 0, normal traction <= 0, gap x traction = 0, |shear traction| <= friction x pressure.
    """
    files, at = cell.files, f"{state.name}, interface node {{}}".format
    values, bonded = state.fluctuation[cell.nodes.node], state.status == Status.BONDED
    difference = cell.faces.means(values, of_fibre=False) - cell.faces.means(values, of_fibre=True)
    largest = cell.largest_displacement(state)
    findings.compare("jump", cell.in_axes(state.jump), difference, largest, at)
    damage = state.damage.clip(np.where(bonded, 0.0, 1.0), np.where(bonded, np.nextafter(1.0, 0.0), 1.0))
    findings.record("bond", np.abs(damage - state.damage), f"{state.name}, damage of node {{}}".format)
    slack = state.jump - law_at(files, damage=state.damage).jumps(state.traction)
    rubs = (friction_at(files, on_damage=True) > 0.0) & bonded & (state.damage > 0.0)
    gap = slack[:, 0].copy()
    slack[rubs, 1] = slack[~bonded, 1:] = slack[state.status == Status.OPEN] = 0.0
    findings.record("bond", relative(slack, largest), at)
    if not len(bonded):
        return
    normal, shear = state.traction[:, 0], np.abs(state.traction[:, 1:]).max(axis=1)
    pressure, scales = np.maximum(-normal, 0.0), cell.scales_of(state)
    pull, force = max(float(np.abs(state.traction).max()), scales.stress), np.abs(normal) * files.interface.length

    def record(law: str, violation: Float, scale: float) -> None:
        findings.record(law, relative(violation, scale), at)

    if not bonded.all():
        friction, closed = friction_at(files) * pressure, state.status == Status.CLOSED
        push = max(float(force.max()), scales.stress * float(files.interface.length.max()))
        excess = np.where(bonded, 0.0, np.maximum(shear - friction, 0.0))
        record("free faces", excess + np.where(state.status == Status.OPEN, np.abs(normal), 0.0), pull)
        if friction.any():
            slides = (state.sliding != 0) & closed
            record("sliding", np.where(slides, state.sliding * state.traction[:, 1] - friction, 0.0), pull)
            record("sliding", np.where(closed | rubs, 0.0, np.abs(state.sliding)), 1.0)
        if files.contact:
            record("penetration", np.where(bonded, 0.0, np.maximum(-gap, 0.0)), scales.displacement)
            record("tension", np.where(closed & (normal > 0.0), force, 0.0), push)
            record("complementarity", np.where(bonded, 0.0, force * gap), push * scales.displacement)
    if rubs.any():
        rubbing, limit = rubbing_force(files, state), friction_at(files, on_damage=True) * pressure
        sticks = np.maximum(np.abs(rubbing) - limit, 0.0)
        off = np.where(state.sliding != 0, state.sliding * rubbing - limit, sticks)
        record("sliding", np.where(rubs, off, 0.0), pull)


def check_phases(findings: Findings, cell: DiscreteCell, state: State, number: int) -> None:
    """Check the largest stresses of the phases in state `number`, their positions and utilisations."""
    table, conducts = cell.files.document.get("phase_stresses", []), "effective_conductivity" in cell.files.document
    limits = {name: phase_constants(cell.files.case, name).get("strength") for name in cell.files.phases}
    is_complete = bool(table) or conducts or not any(limits.values())
    findings.require(LAW, is_complete, "phase_stresses, which strengths need")
    if not table:
        return
    stress, points = _stresses(cell, state)
    phase_of = np.repeat(cell.files.mesh.phase, len(stress) // len(cell.files.mesh.phase))
    names = [name for k, name in enumerate(cell.files.phases) if not np.isnan(stress[phase_of == k]).any()]
    findings.require(LAW, sorted(entry["phase"] for entry in table) == sorted(names), "names of the phases")
    for entry in (entry for entry in table if entry["phase"] in names):
        name, labels = entry["phase"], [str(label) for label in entry["state"]]
        phase, strength = cell.files.phases.index(name), limits[name]
        is_labelled = number < len(labels) and state.name.endswith(f"({labels[number]})")
        findings.require(LAW, is_labelled and len(labels) == len(cell.files.file["state"]), f"{state.name}: its label")
        rows = phase_of == phase
        values, scale = _measures(stress[rows], strength), float(np.abs(stress[rows]).max())
        rounded = ROUNDED * float(np.abs(cell.stiffnesses[phase]).max()) * cell.scales_of(state).strain
        raised = max(1.0, rounded / scale) if scale > 0.0 else 1.0
        for measure, column in values.items():
            place = f"{state.name}, {measure} of {name}"
            reported, at = entry.get(measure), entry.get(f"{measure}_at")
            if not len(reported or ()) == len(at or ()) == len(labels):
                findings.require(LAW, False, f"{place}: missing")
                continue
            size = raised * float(np.abs(column).max()) if measure == "utilisation" else max(scale, rounded)
            findings.compare(LAW, float(reported[number]), column.max(), size, place)
            distance = np.hypot(*from_centre(points[rows], np.array(at[number]), cell.files.shift).T)
            near = column[distance < SAME_PLACE * cell.files.size.max()]
            is_largest = bool((near >= column.max() - SAME_VALUE * size).any())
            findings.require(LAW, is_largest, f"{place}: another position")
        key = next((key for key in CRITERIA if key in (strength or ())), "")
        findings.require(LAW, entry.get("criterion") == CRITERIA.get(key), f"{name}: its criterion")
        if strength is not None and key == "axial_shear":
            modes, mode = _hashin(stress[rows], strength), dict(enumerate(entry.get("mode") or ())).get(number)
            used = modes[MODES.index(mode)].max() if mode in MODES else -np.inf
            findings.require(LAW, used >= (1 - SAME_VALUE * raised) * np.max(modes), f"{state.name}, mode of {name}")


def _stresses(cell: DiscreteCell, state: State) -> tuple[Float, Float]:
    """Compute stress tensors (n, 3, 3) at all quadrature points, and the points (n, 2)."""
    mesh, v = cell.files.mesh, len(state.strain)
    free = state.temperature * cell.expansions
    answers = [answer for *_, answer in cell.elements.responses(state.displacement, state.along, free)]
    stress = np.concatenate(answers)
    tensors = np.zeros((*stress.shape[:2], 3, 3))
    size = len(VOIGT[v])
    tensors[..., :size, :size] = stress[..., VOIGT[v]]
    # S33 follows from the stresses in the plane, also in elements with an internal pressure.
    if v == 3:
        rules, along = out_of_plane(cell.files.case, cell.files.phases)[:, 0], np.zeros(len(free))
    else:
        L, out = cell.stiffnesses, cell.stiffnesses[:, 2, PLANE]
        rules = np.asarray(np.linalg.solve(L[:, PLANE][:, :, PLANE], out[..., None])[..., 0], float)
        along = (L[:, 2, 2] - (rules * out).sum(axis=1)) * (state.along - free[:, 2])
    in_plane = stress[..., PLANE if v == 6 else slice(None)]
    tensors[..., 2, 2] = np.einsum("ei,eqi->eq", rules[mesh.phase], in_plane) + along[mesh.phase, None]
    r = quadrature_points() if mesh.triangles.shape[1] == 6 else np.full((1, 3), 1 / 3)
    functions = r if len(r) == 1 else np.hstack([r * (2 * r - 1), 4 * r * np.roll(r, -1, axis=1)])
    points = np.einsum("qa,ead->eqd", functions, mesh.points[mesh.triangles])
    return tensors.reshape(-1, 3, 3), points.reshape(-1, 2)


def _measures(stress: Float, strength: Mapping[str, Any] | None) -> dict[str, Float]:
    """Compute principal, von Mises and hydrostatic stresses (n,), and the utilisation (n,) of a `strength`.

    With hydrostatic p, von Mises' q = sqrt(3/2 s : s) and J3 = det s of the deviator s, the largest principal stress is
    p + 2/3 q cos(arccos(27 J3 / (2 q^3)) / 3).  The utilisation is absent without a strength.
    """
    p = np.trace(stress, axis1=1, axis2=2) / 3
    deviator = stress - p[:, None, None] * np.eye(3)
    q = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    third = np.divide(13.5 * np.linalg.det(deviator), q**3, out=np.zeros_like(q), where=q**3 > 0)
    first = p + 2 / 3 * q * np.cos(np.arccos(np.clip(third, -1.0, 1.0)) / 3)
    values = {"principal": first, "von_mises": q, "hydrostatic": p}
    if strength is None:
        return values
    limit = {name: float(value) for name, value in strength.items()}
    if "principal" in limit:
        used = first / limit["principal"]
    elif "von_mises" in limit:
        used = q / limit["von_mises"]
    elif "tension" in limit:  # the cone through both uniaxial strengths: a I1 + sqrt(J2) = k
        T, C = limit["tension"], limit["compression"]
        used = ((C - T) * 3 * p + (C + T) * q) / (2 * C * T)
    else:
        used = np.max(_hashin(stress, limit), axis=0)
    return values | {"utilisation": np.maximum(used, 0.0)}


def _hashin(stress: Float, limit: Mapping[str, float]) -> list[Float]:
    """Compute Hashin's utilisations (n,) by `MODES`: 1 / load factor at failure, or 0 where a mode does not apply."""
    zero = SAME_PLACE * float(np.abs(stress).max(initial=0.0))  # both matrix modes count near S11 + S22 = 0
    shear = (stress[:, 0, 2] ** 2 + stress[:, 1, 2] ** 2) / limit["axial_shear"] ** 2
    along, across = stress[:, 2, 2], stress[:, 0, 0] + stress[:, 1, 1]
    turned = shear - np.linalg.det(stress[:, :2, :2]) / limit["transverse_shear"] ** 2
    modes = [
        np.where(along > 0, np.sqrt((along / limit["axial_tension"]) ** 2 + shear), 0.0),
        np.where(along < 0, -along / limit["axial_compression"], 0.0),
        np.where(across > -zero, np.sqrt(np.maximum((across / limit["transverse_tension"]) ** 2 + turned, 0.0)), 0.0),
    ]
    ratio = limit["transverse_compression"] / (2 * limit["transverse_shear"])
    b = (ratio**2 - 1) / limit["transverse_compression"] * across
    a = np.maximum((across / (2 * limit["transverse_shear"])) ** 2 + turned, 0.0)
    root = np.sqrt(b**2 + 4 * a)
    return [*modes, np.where(across < zero, (b + root) / 2, 0.0)]
