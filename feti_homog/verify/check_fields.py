"""Laws of one state: problem, stresses, equilibrium, averages; jumps, bonds, contact."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Bool, Float, Int
from feti_homog.verify.bonds import friction_at, friction_of_damage_at, law_at, rubbing_force
from feti_homog.verify.cell_tables import State
from feti_homog.verify.constitutive_law import out_of_plane
from feti_homog.verify.discrete_cell import ROUNDED_TERMS, DiscreteCell
from feti_homog.verify.elements import PLACES, ElementFields
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.prescribed import damaged_at

BONDED, CLOSED, OPEN = 0, 1, 2
# Heat of an increment below this share of what is stored there is rounding.
LEAST_HEAT = 1e-4


def _check_interface_state(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check that jumps are those of the displacements, bonds hold, and debonded faces obey the contact conditions.

    The shear on the damaged share of bonds is within mu p, and s mu p where it slides.
    """
    at = f"{state.name}, interface node {{}}".format
    values, bonded = state.fluctuation[cell.nodes.node], state.status == BONDED
    parted = cell.faces.means(values, of_fibre=False) - cell.faces.means(values, of_fibre=True)
    largest = largest_displacement(cell, state)
    findings.record("jump", relative(np.abs(in_axes(cell, state.jump) - parted).max(axis=1, initial=0.0), largest), at)
    most = np.where(bonded, np.nextafter(1.0, 0.0), 1.0)
    off = np.abs(state.damage.clip(np.where(bonded, 0.0, 1.0), most) - state.damage)
    findings.record("bond", off, f"{state.name}, damage of node {{}}".format)
    slack = state.jump - law_at(cell.files, damage=state.damage).jumps(state.traction)
    rubs = (friction_of_damage_at(cell.files) > 0.0) & bonded & (state.damage > 0.0)
    slack[rubs, 1] = 0.0
    slack = np.abs(np.where(bonded[:, None], slack, np.where(np.arange(slack.shape[1]) == 0, slack, 0.0)))
    findings.record("bond", relative(np.where(state.status != OPEN, slack.max(axis=1, initial=0.0), 0.0), largest), at)
    if not bonded.all():
        _check_contact(findings, cell, state, rubs)
    if rubs.any():
        force, pull = rubbing_force(cell.files, state), float(np.abs(state.traction).max())
        limit = friction_of_damage_at(cell.files) * np.maximum(-state.traction[:, 0], 0.0)
        sticks, pull = np.maximum(np.abs(force) - limit, 0.0), max(pull, cell.least_stress(state))
        off = np.where(state.sliding != 0, np.abs(state.sliding * force - limit), sticks)
        findings.record("sliding", relative(np.where(rubs, off, 0.0), pull), at)


def _check_contact(findings: Findings, cell: DiscreteCell, state: State, rubs: Bool) -> None:
    """gap >= 0, traction <= 0, gap traction = 0, and no other force on debonded faces than friction."""
    at = f"{state.name}, interface node {{}}".format
    debonded, closed = state.status != BONDED, state.status == CLOSED
    gap = (state.jump - law_at(cell.files, damage=state.damage).jumps(state.traction))[:, 0]
    normal, shear = state.traction[:, 0], np.abs(state.traction[:, 1:]).max(axis=1)
    friction = friction_at(cell.files) * np.maximum(-normal, 0.0)
    length, imposed, least = cell.files.interface.length, cell.imposed(state), cell.least_stress(state)
    pull, force = max(float(np.abs(state.traction).max()), least), np.abs(normal) * length
    push = max(float(force.max()), least * float(length.max()))
    excess = np.maximum(shear - friction, 0.0)
    free = np.where(debonded, excess, 0.0) + np.where(state.status == OPEN, np.abs(normal), 0.0)
    findings.record("free faces", relative(free, pull), at)
    if friction.any():
        opposed = state.sliding * state.traction[:, 1] - friction
        findings.record("sliding", relative(np.where((state.sliding != 0) & closed, opposed, 0.0), pull), at)
        findings.record("sliding", np.where(closed | rubs, 0.0, np.abs(state.sliding)), at)
    if cell.files.contact:
        findings.record("penetration", relative(np.where(debonded, np.maximum(-gap, 0.0), 0.0), imposed), at)
        findings.record("tension", relative(np.where(closed, np.maximum(normal, 0.0), 0.0), pull), at)
        findings.record("complementarity", relative(np.where(debonded, force * gap, 0.0), push * imposed), at)


def check_step_heat(findings: Findings, cell: DiscreteCell, before: State, state: State) -> None:
    """Check that an increment without breaks makes the heat of its slips under the tractions behind it.

    It is relative to tractions times slips from the beginning on, of which the increment is a difference.  The work of
    increments is booked as what is stored, lost or heat, so it does not bear witness to the heat.
    """
    files, at = cell.files, state.point
    points = files.document["path"]
    if at != before.point + 1 or "friction_heat" not in points[at] or damaged_at(points[at]):
        return
    if files.case["path"]["method"] == "events" or friction_of_damage_at(files).any():
        return
    slips = [each.jump - law_at(files, damage=each.damage).jumps(each.traction) for each in (before, state)]
    rubs = (state.status == CLOSED) & (friction_at(files) > 0.0)
    made = np.where(rubs, state.traction[:, 1] * (slips[1] - slips[0])[:, 1], 0.0) @ files.interface.length
    off = abs(made / cell.area - points[at]["friction_heat"] + points[before.point]["friction_heat"])
    sizes = sum(np.abs(slip[:, 1]) for slip in slips)
    terms = np.where(rubs, np.abs(state.traction[:, 1]) * sizes, 0.0) @ files.interface.length / cell.area
    scale = terms + LEAST_HEAT * max(abs(points[each]["stored"]) for each in (before.point, at)) or 1e-300
    findings.record("heat", off / scale, f"path[{at}].friction_heat")


def check_fields(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check what the fields of a state obey by themselves; `fields` are what its displacements make."""
    element = f"{state.name}, element {{}}".format
    stiffest = np.abs(cell.stiffnesses).max(axis=(1, 2))[cell.files.mesh.phase]
    off = np.abs(state.stress - fields.stress).max(axis=1)
    findings.record("stress", relative(off, stiffest * fields.strain_size), element)
    _check_copies(findings, cell, state)
    _check_equilibrium(findings, cell, state, fields)
    _check_averages(findings, cell, state, fields)
    if not cell.files.is_spatial:
        _check_stress_33(findings, cell, state)
    _check_interface_state(findings, cell, state)


def interface_forces(cell: DiscreteCell, state: State) -> Float:
    """(k, c) forces on the fibre at the interface nodes, in x1, x2 and x3: traction times tributary length."""
    return in_axes(cell, state.traction * cell.files.interface.length[:, None])


def in_axes(cell: DiscreteCell, vectors: Float) -> Float:
    """(k, c) components in x1, x2 and x3 of normal, tangential and axial ones; the tangent is (-n2, n1)."""
    n1, n2 = cell.files.interface.normal.T
    normal, tangential, *axial = vectors.T
    return np.stack([n1 * normal - n2 * tangential, n2 * normal + n1 * tangential, *axial], axis=1)


def largest_displacement(cell: DiscreteCell, state: State) -> float:
    """Return a scale of displacements that does not vanish where the fluctuation does."""
    return float(np.abs(state.fluctuation).max()) + cell.imposed(state)


def _check_copies(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check that copies of a node have one fluctuation: in a subdomain by periodicity, elsewhere by gluing."""
    nodes, scale = cell.nodes, largest_displacement(cell, state)
    values = state.fluctuation[nodes.node]
    sides = _sides(cell)
    for law, group in (("periodicity", nodes.place * (int(nodes.subdomain.max()) + 1) + nodes.subdomain),
                       ("continuity", sides)):  # fmt: skip
        _, inverse, count = np.unique(group, return_inverse=True, return_counts=True)
        own = inverse.ravel()
        means = np.stack([(np.bincount(own, column) / count)[own] for column in values.T], axis=1)
        off = np.abs(values - means).max(axis=1)
        findings.record(law, relative(off, scale), lambda i: f"{state.name}, mesh node {nodes.node[i]}")


def _sides(cell: DiscreteCell) -> Int:
    """(b,) a number for each place and, at interface nodes, for each face: torn nodes of one number are glued."""
    return np.asarray(2 * cell.nodes.place + ((cell.faces.row >= 0) & cell.faces.is_fibre))


def _check_equilibrium(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check that the forces of all copies of a node add up to zero, those of each face at an interface to its traction.

    The place that is held, where u* = 0, collects what rounding leaves at all others: errors of independent signs, so
    the root of the sum of their squares.
    """
    nodes, faces = cell.nodes, cell.faces
    traction = interface_forces(cell, state)
    scale = max(fields.largest_force, float(np.abs(traction).max(initial=0.0)))
    scale = max(scale, cell.least_stress(state) * float(np.sqrt(cell.elements.area.min())) * 1e-3)
    held = (state.fluctuation == 0.0).all(axis=1)
    most, of_all = float(fields.force_size.max()), float(np.linalg.norm(fields.force_size))
    rest = fields.force.copy()
    rest[nodes.node] = 0.0
    scales = scale + ROUNDED_TERMS * np.where(held, of_all, most)
    findings.record("equilibrium", relative(np.abs(rest).max(axis=1), scales), f"{state.name}, mesh node {{}}".format)
    side, inverse = np.unique(_sides(cell), return_inverse=True)
    own = fields.force[nodes.node]
    sums = np.stack([np.bincount(inverse.ravel(), column, len(side)) for column in own.T], axis=1)
    row = np.full(nodes.places, -1)
    row[nodes.place] = faces.row
    at = row[side // 2]
    # The fibre is pulled by the traction, the matrix by its reaction.
    external = np.where(at < 0, 0.0, np.where(side % 2 == 1, 1.0, -1.0))
    sums[at >= 0] -= external[at >= 0, None] * traction[at[at >= 0]]
    first = np.unique(inverse.ravel(), return_index=True)[1]

    def name(i: int) -> str:
        return f"{state.name}, mesh node {nodes.node[first[i]]}" + f" (interface node {at[i]})" * bool(at[i] >= 0)

    is_held = np.bincount(inverse.ravel(), held[nodes.node], len(side)) > 0
    scales = scale + ROUNDED_TERMS * np.where(is_held, of_all, most)
    findings.record("equilibrium", relative(np.abs(sums).max(axis=1), scales), name)


def _check_averages(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """<sigma> = Sigma, <eps> = E with the opening of the faces and the strain of voids, and Hill's condition."""
    area, weights = cell.area, cell.elements.area[:, None]
    mean = (weights * fields.stress).sum(axis=0) / area
    size = float(((weights * np.abs(fields.stress)).sum(axis=0) / area).max())
    stiffest = np.abs(cell.stiffnesses).max(axis=(1, 2))[cell.files.mesh.phase]
    size += ROUNDED_TERMS * float((weights[:, 0] * stiffest * fields.strain_size).sum() / area)
    findings.record("mean stress", relative(mean - state.mean_stress, max(size, cell.least_stress(state))), state.name)
    jump = in_axes(cell, state.jump)
    integral = cell.faces.sums(cell.node_integrals[cell.nodes.node], of_fibre=False)
    opening = np.einsum("ki,kj->ij", jump, integral)
    opened = np.bincount(PLACES[len(mean)].ravel(), opening.ravel(), len(mean)) / area
    # Of voids their share of E, and int sym(u* (x) n) ds along them, which closes where the cell's boundary cuts one.
    slope = np.einsum("ni,nd->id", state.fluctuation, cell.void_integrals)
    of_voids = np.bincount(PLACES[len(mean)].ravel(), slope.ravel(), len(mean)) / area + cell.porosity * state.strain
    off = (weights * fields.strain).sum(axis=0) / area + of_voids - state.strain - opened
    scale = cell.strain_size(state)
    findings.record("mean strain", relative(off, scale), state.name)
    work = area * float(state.mean_stress @ state.strain) - float((interface_forces(cell, state) * jump).sum())
    scale = max(abs(fields.energy), area * cell.least_stress(state) * scale)
    findings.record("Hill", relative(np.array(fields.energy - work), scale), state.name)


def _check_stress_33(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check the stresses out of the plane by the materials."""
    rules = out_of_plane(cell.files.case, cell.files.phases)[cell.files.mesh.phase, 0]
    S33, terms = (np.einsum("ei,ei->e", *pair) for pair in ((rules, state.stress), np.abs((rules, state.stress))))
    same = np.isnan(S33) & np.isnan(state.stress_33)  # where the constants do not determine them
    off = np.where(same, 0.0, relative(np.where(same, 0.0, state.stress_33 - S33), np.where(same, 1.0, terms)))
    findings.record("stress 33", off, f"{state.name}, element {{}}".format)
