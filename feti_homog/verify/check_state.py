"""Laws of one state: stresses, averages, continuity, equilibrium, jumps, bonds, contact and friction."""

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.bonds import friction_at, law_at, rubbing_force
from feti_homog.verify.constitutive_law import out_of_plane
from feti_homog.verify.discrete_cell import ROUNDED_TERMS, DiscreteCell
from feti_homog.verify.elements import PLACES, ElementFields
from feti_homog.verify.findings import Findings, relative
from feti_homog.verify.reading import State, Status


def check_state(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check stresses, their averages, Hill's lemma (8) and S33; `fields` follow from the displacements."""
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
    # A void adds its fraction of E and int sym(u* (x) n) ds, which is closed even where the cell boundary cuts the
    # void.
    slope = state.fluctuation.T @ cell.void_integrals - jump.T @ cell.faces.sums(integrals, of_fibre=False)
    openings = np.bincount(PLACES[v].ravel(), slope.ravel(), v) / area + cell.porosity * state.strain
    strain = (weights * fields.strain).sum(axis=0) / area + openings
    findings.compare("mean strain", strain, state.strain, scales.strain, state.name)
    work = area * float(state.mean_stress @ state.strain) - float((interface_forces(cell, state) * jump).sum())
    least = area * scales.stress * scales.strain
    findings.compare("Hill", fields.energy, work, max(abs(fields.energy), least), state.name)
    if not cell.files.is_spatial:
        rules = out_of_plane(cell.files.case, cell.files.phases)[cell.files.mesh.phase, 0]
        S33, terms = (np.einsum("ei,ei->e", *pair) for pair in ((rules, state.stress), np.abs((rules, state.stress))))
        undetermined = np.isnan(S33) & np.isnan(state.stress_33)  # the constants of the phase leave S33 open
        off = np.where(undetermined, 0.0, state.stress_33 - S33)
        findings.record("stress 33", relative(off, np.where(undetermined, 1.0, terms)), element)


def interface_forces(cell: DiscreteCell, state: State) -> Float:
    """Compute forces (k, c) on the fibre along x1, x2 and x3: traction x tributary length."""
    return cell.in_axes(state.traction * cell.files.interface.length[:, None])


def check_gluing(findings: Findings, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """Check that copies of a node have equal fluctuations, and that forces balance at all nodes.

    Forces on faces balance with the traction, and those on sides with Sigma n if it is given; given displacements on
    sides are E x.  The rounding of all nodes adds to the reaction of the fixed node, u* = 0.
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
        return f"{state.name}, mesh node {nodes.node[first[i]]}" + f" (interface node {row[i]})" * bool(on_face[i])

    if is_given:  # where unknown reactions act
        sums[copy[np.isin(nodes.node, on_side)]] = 0.0
    has_fixed = np.bincount(copy, is_fixed[nodes.node]) > 0
    scales = scale + np.where(has_fixed, rounding_of_all, rounding)
    findings.record("equilibrium", relative(sums, scales[:, None]), name)


def check_bonds(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check jumps, springs of bonds, contact and friction at interface nodes.

    On debonded faces gap >= 0, normal traction <= 0, gap x traction = 0, and the shear traction is at most mu p.
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
    pressure, (_, least, imposed) = np.maximum(-normal, 0.0), cell.scales_of(state)
    pull, force = max(float(np.abs(state.traction).max()), least), np.abs(normal) * files.interface.length

    def record(law: str, violation: Float, scale: float) -> None:
        findings.record(law, relative(violation, scale), at)

    if not bonded.all():
        friction, closed = friction_at(files) * pressure, state.status == Status.CLOSED
        push = max(float(force.max()), least * float(files.interface.length.max()))
        excess = np.where(bonded, 0.0, np.maximum(shear - friction, 0.0))
        record("free faces", excess + np.where(state.status == Status.OPEN, np.abs(normal), 0.0), pull)
        if friction.any():
            slides = (state.sliding != 0) & closed
            record("sliding", np.where(slides, state.sliding * state.traction[:, 1] - friction, 0.0), pull)
            record("sliding", np.where(closed | rubs, 0.0, np.abs(state.sliding)), 1.0)
        if files.contact:
            record("penetration", np.where(bonded, 0.0, np.maximum(-gap, 0.0)), imposed)
            record("tension", np.where(closed, np.maximum(normal, 0.0), 0.0), pull)
            record("complementarity", np.where(bonded, 0.0, force * gap), push * imposed)
    if rubs.any():
        rubbing, limit = rubbing_force(files, state), friction_at(files, on_damage=True) * pressure
        sticks = np.maximum(np.abs(rubbing) - limit, 0.0)
        off = np.where(state.sliding != 0, state.sliding * rubbing - limit, sticks)
        record("sliding", np.where(rubs, off, 0.0), pull)
