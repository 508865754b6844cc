"""List interface faults, remarks on unexpected cell properties, and warnings about coarse interface elements."""

import math

import numpy as np

from feti_homog.case import Case, bond_laws, cell_sizes, interface_section
from feti_homog.homogenization import phase_laws
from feti_homog.materials import engineering_constants, laws, voigt
from feti_homog.mesh import Torus, submeshes
from feti_homog.microstructure.shapes import Ellipses
from feti_homog.schema import wording
from feti_homog.typing import AnyInt, Float, Int

# Largest relative difference between fibre fractions, stiffness ratios or peak tractions that deserves no remark.
SAME_RATIO = 0.01
# Largest element on an interface, in lengths of the process zone. At 0.54, the stresses of the square cell in
# tests/parallel/test_energy.py differ by 1.4 % from the stresses with elements a quarter as long; at 1.1, by 4.3 %.
RESOLVED = 0.5
# The same ratio for cohesive laws, whose tractions fall along the process zone.
RESOLVED_SOFTENING = 1 / 3
LEAST_SIZE = 1e-5  # in cell widths: least default element size at tips, and recommended size on interfaces


def pairs_of(case: Case, phases: tuple[str, ...]) -> Int:
    """Return the interface number (phases, phases) of each pair of phases.

    The number is -1 for a pair without an interface.  An interface without `between` joins the matrix (the first phase)
    to all other phases; so does number 0 in a case without interfaces, whose bonding is perfect.
    """
    pairs = np.full((len(phases), len(phases)), -1)
    for number, between in enumerate([interface.between for interface in case.interfaces] or [None]):
        if between is None:
            pairs[0, 1:] = pairs[1:, 0] = number
        elif set(between) <= set(phases):
            a, b = map(phases.index, between)
            pairs[a, b] = pairs[b, a] = number
    return pairs


def faults(case: Case, phases: tuple[str, ...], first: AnyInt, second: AnyInt) -> list[str]:
    """List faults in the keys `between`, for a cell whose phases `first` (n,) touch the phases `second` (n,)."""
    lines, touching = list[str](), np.zeros((len(phases), len(phases)), bool)
    touching[first, second] = touching[second, first] = True
    for section, interface in interface_section.labelled(case.interfaces):
        if interface.between is None:
            continue
        line = f"[{section}] between = {wording.toml_value(list(interface.between))}: "
        if unknown := [name for name in interface.between if name not in phases]:
            lines.append(f"{line}the cell has no phase {wording.toml_value(unknown[0])}; it has {', '.join(phases)}")
        elif not touching[tuple(map(phases.index, interface.between))]:
            lines.append(f"{line}expected phases that touch; in this cell these phases do not touch")
    return lines


def mesh_remarks(case: Case, torus: Torus, pairs: Int, radii: Float) -> tuple[str, ...]:
    """List remarks on a mesh: polygons, exchanged phases, idle interfaces, soft springs, and nodes that never part.

    `pairs` are as in `pairs_of`, `radii` as in `soft_springs`.
    """
    mesh, has_curve = torus.mesh, len(torus.mesh.debonded_edges) > 0
    lines = [*mesh.remarks, *cut_off(case, mesh.ellipses[mesh.arc_circle], mesh.points[mesh.arc_edges])]
    cell, matrix = case.cell, torus.mesh.triangles[torus.mesh.phase == 0]
    if cell.has_own_mesh and cell.boundary == "periodic" and (torus.mesh.representative[matrix] == matrix).all():
        lines.append("[cell] the matrix reaches no side of the cell: are its phase and another exchanged?")
    if case.interface is None:
        if has_curve:
            lines.append('the curve "debonded" of the mesh is bonded: there is no [interface]')
        return tuple(lines)
    if torus.mesh.triangles.shape[1] == 4:
        longer = "stepped interfaces are longer than smooth ones, around a disc by 27 %"
        lines.append(
            f"[cell] smooth = false: {longer}, and springs and bonds act along all of it; smooth = true avoids it"
        )
    lines += soft_springs(case, radii)
    can_open = any((case.arcs, has_curve, phase_laws.has_springs(case), case.section.breaks))
    if case.cell.has_own_mesh and not can_open:
        lines.append("[interface]: nothing is debonded, and no bond is elastic: the bonding is perfect")
    first, second, edge = torus.sides
    pair = pairs[torus.mesh.phase[first], torus.mesh.phase[second]]
    if len(bonded := np.flatnonzero(torus.debonded[edge] & (pair < 0))):
        a, b = sorted(torus.mesh.phases[torus.mesh.phase[side[bonded[0]]]] for side in (first, second))
        lines.append(f'the curve "debonded" of the mesh is bonded between {a} and {b}: no [[interface]] joins them')
    ends = np.unique(torus.edge_ends[edge[(pair >= 0) & (torus.constituent[first] != torus.constituent[second])]])
    kinds = ((torus.meeting[ends] > 2, "three bodies meet"), (torus.touching[ends], "two bodies meet more than once"))
    if counts := [f"at {mask.sum()} {kind}" for mask, kind in kinds if mask.any()]:
        lines.append(f"[interface] nodes that never part: {', '.join(counts)}")
    # A bond at the pinned node, Eq. (15).
    pinned = np.searchsorted(torus.class_keys, submeshes.pinned_classes(torus))
    if len(pinned) == 1 and not torus.never_part[pinned[0]] and torus.meeting[pinned[0]] >= 2:
        x, y = torus.mesh.points[np.flatnonzero(torus.node_class == pinned[0])[0]] + torus.mesh.origin
        why = "it holds the cell, for all nodes of the mesh are on interfaces"
        lines.append(f"[interface] the node at ({x:.6g}, {y:.6g}) never parts: {why}; use a finer mesh")
    return tuple(lines)


def cut_off(case: Case, curves: Ellipses, arcs: Float) -> tuple[str, ...]:
    """Name the fibre area outside linear elements, whose edges join the ends (a, 2, 2) of arcs of `curves` (a,).

    Returns () for other elements and for cells with a fibre fraction, which a run compares with the mesh.
    """
    if case.cell.order != 1 or case.cell.fractions or not len(arcs):
        return ()
    ends = np.linalg.solve(curves.frames, (arcs - curves.centres[:, None]).swapaxes(1, 2))
    angle = np.arccos(np.clip((ends[:, :, 0] * ends[:, :, 1]).sum(axis=1), -1.0, 1.0)) / 2**case.cell.refine
    area = np.abs(np.linalg.det(curves.frames))
    lost = 1.0 - float(area @ np.sin(angle)) / float(area @ angle)
    line = f"[cell] order = 1: polygons have {lost:.1%} less area than round fibres; refine, or order = 2"
    return (line,) if lost > SAME_RATIO / 2 else ()


def subdomain_remarks(case: Case, bodies: int, subdomains: int, coarse_triangles: int) -> tuple[str, ...]:
    """Explain in one line why the subdomain count is not the requested number; () if it is, or without a request."""
    asked = case.decomposition.subdomains
    if asked is None or asked == subdomains:
        return ()
    if subdomains > asked:
        bodies_alone = f"each of the {bodies} bodies is at least one"
        why = bodies_alone if bodies > asked else "pieces that METIS leaves in several parts were split"
    else:
        why = f"METIS makes no more from {coarse_triangles} coarse triangles; a smaller mesh_size gives more"
    return (f"[decomposition] subdomains = {asked}: {subdomains} were made: {why}",)


def case_remarks(case: Case, bonds: int = 0) -> tuple[str, ...]:
    """List remarks on a case: missing expansions, the boundary, element order, scatter, teeth and fibre fraction.

    Unless sides are periodic, only the first two are checked.  `bonds` is the number of bonds with teeth, or 0.
    """
    cell, lines = case.cell, list[str]()
    missing = [name for name, material in case.materials.items() if laws.expansion(material) is None]
    if case.analysis.plane == voigt.GENERALIZED.name and 0 < len(missing) < len(case.materials):
        phases = ", ".join(f"[material.{wording.toml_key(phase)}]" for phase in missing)
        lines += [f"{phases} expansion: missing; without it the cell has no thermal expansion"]
    if cell.boundary != "periodic":
        bound = "an upper" if cell.boundary == "displacement" else "a lower"
        return (*lines, f'[cell] boundary = "{cell.boundary}": the result is {bound} bound of the effective one')
    if case.analysis.type == "envelope" and cell.order == 1:
        lines += ["[cell] order = 1: onsets err more than the stiffness: expected order = 2 or smaller elements"]
    if cell.geometry == "random" and case.output.mesh_error and case.analysis.type not in ("load", "path", "angle"):
        lines += ['[cell] geometry = "random": errors are those of its mesh; realisations in [sweep] show the scatter']
    if phase_laws.has_softening(case) and case.interfaces[0].teeth is None:
        from feti_homog.interface.laws import law_of_sections  # few laws have teeth

        levels = getattr(law_of_sections(case.interfaces, np.zeros(0, np.int64)), "levels", ())
        tolerance = case.interfaces[0].softening_tolerance
        events = f", up to {(len(levels) - 1) * bonds} events" if bonds else ""
        if tolerance <= interface_section.InterfaceSection.softening_tolerance:
            events += "; a larger one gives fewer"
        if len(levels):
            lines += [f"[interface] softening_tolerance = {tolerance:g}: {len(levels) - 1} teeth a bond{events}"]
    if cell.match is not None and cell.matched is not None and cell.fibre_fraction is not None:
        fraction = cell.matched.fibre_fraction
        remark = f"[cell] fibre_fraction = {cell.fibre_fraction:g}: {cell.match.name} has {fraction:.4g}"
        if abs(cell.fibre_fraction / fraction - 1.0) > SAME_RATIO:
            lines += [f"{remark}; distances between neighbours are the same in diameters"]
    if cell.matched is not None and case.interfaces and cell.width is None and cell.fibre_radius is None:
        radius = f"fibre_radius = {cell.matched.radii.mean():.4g}"
        lines += [f"[cell] width: missing, and therefore 1; {radius} would give the lengths of the table"]
    return tuple(lines)


def soft_springs(case: Case, radii: Float) -> list[str]:
    """List springs that are too soft to represent rigid bonds, among the springs of bonds that can break.

    `radii` (f,) are fibre radii, NaN unless round.  The loss of stiffness grows with E' / (k r), the ratio of the
    matrix modulus in the plane state to spring stiffness and mean radius.  At 1 / 50, the limit of Turon et al. (Eng.
    Fract. Mech. 74, 2007, 1665), epoxy with 30 to 60 % of fibres loses 2.5 to 10 % of C11.
    """
    lines, radii = list[str](), radii[np.isfinite(radii)]
    for section, bond in interface_section.labelled(case.interfaces if len(radii) else ()):
        if not any(getattr(bond, name) for name in (*bond_laws.STRENGTHS, "toughness")):
            continue
        k, name = min((getattr(bond, name) or math.inf, name) for name in bond_laws.STIFFNESSES)
        if (ratio := k * radii.mean() / _modulus(case, "matrix")) < 50.0:
            line = f"[{section}] {name} = {k:g}: k r / E' = {ratio:.2g}, so the springs take part of the deformation; "
            unit = "; check the unit of length" if ratio < 0.1 else ""
            lines.append(f"{line}Turon et al. (2007) advise at least {50.0 * k / ratio:.2g}{unit}")
    return lines


def process_zone(case: Case) -> tuple[float, float, int]:
    """Return the least process zone length E' G_Ic / sigma_c^2, its sigma_c, and the index of its interface.

    Length and sigma_c are inf unless bonds break by energy.  sigma_c = sqrt(2 k_n G_Ic); for cohesive laws, G_Ic and
    sigma_c are the toughness and strength in the pure mode with the shorter zone.  E' is Young's modulus in the plane
    state, equal to E / (1 - nu^2) in plane strain, along the most compliant axis of the most compliant phase that the
    interface may join.  Bonds at least 100 times as strong as the weakest bond hold, and do not count.
    """
    zones = []
    for number, bond in enumerate(case.interfaces):
        pure = [(bond.normal_toughness, bond.normal_strength), (bond.tangential_toughness, bond.tangential_strength)]
        if bond.toughness and bond.normal_stiffness:
            pure.append((bond.toughness, math.sqrt(2 * bond.normal_stiffness * bond.toughness)))
        for toughness, strength in pure:
            if toughness and strength:  # not in conduction, where phases have no modulus
                modulus = min(_modulus(case, phase) for phase in bond.between or case.materials)
                zones.append((modulus * toughness / strength**2, strength, number))
    limit = 100.0 * min((strength for _, strength, _ in zones), default=0.0)
    return min((zone for zone in zones if zone[1] < limit), default=(math.inf, math.inf, 0))


def _modulus(case: Case, phase: str) -> float:
    """Return Young's modulus of a phase in the plane state, along the most compliant axis."""
    moduli = engineering_constants.engineering_moduli(laws.plane_stiffness(case.materials[phase], case.analysis.plane))
    return min(moduli.E1, moduli.E2)


def warnings(case: Case, width: float, edge: float, radii: Float) -> list[str]:
    """List warnings about cohesive laws, unlikely lengths of process zones, and elements too long for a process zone.

    Args:
        width: cell width.
        edge: longest coarse edge between phases, which `refine` halves.
        radii: radii of fibres, NaN unless round.
    """
    (length, strength, number), softens, lines = process_zone(case), phase_laws.has_softening(case), _law_warnings(case)
    if math.isinf(length):
        return lines
    section, bond = interface_section.labelled(case.interfaces)[number]
    law, radii = f'[{section}] law = "{bond.criterion}"', radii[np.isfinite(radii)]
    ratio = length / radii.mean() if len(radii) else 1.0
    resolved = RESOLVED_SOFTENING if softens else RESOLVED
    zone = f"E' G / s^2 = {length:.3g} long with the strength s = {strength:.3g}"
    is_doubtful = softens and not 0.01 <= ratio <= 100.0  # perhaps wrong units
    if is_doubtful:
        zone += f" ({ratio:.2g} fibre radii: is the unit of toughness that of stress times length?)"
    longest_element = edge / 2**case.cell.refine
    if longest_element <= resolved * length:
        return [f"{law}: the process zone is {zone}", *lines] if is_doubtful else lines
    size = f"elements on the interface are up to {longest_element:.3g} long"
    if case.cell.refine:
        size += f" after refine = {case.cell.refine}"
    if not softens:
        zone = f"E' G_Ic / sigma_c^2 = {length:.3g} long for sigma_c = sqrt(2 k_n G_Ic) = {strength:.3g}"
    limit = f"elements should be at most {'a third' if softens else 'half'} as long"
    refine = math.ceil(math.log2(edge / (resolved * length)))
    # Rounded down to two digits.
    needed = resolved * length * 2**case.cell.refine / width
    digit = 10.0 ** (math.floor(math.log10(needed)) - 1)
    needed = math.floor(needed / digit + 1e-9) * digit
    finer = [f"refine = {refine}"] if refine <= cell_sizes.MOST_REFINED else []
    if case.cell.has_own_mesh:
        remedies = " or ".join([*finer, "a finer mesh"])
    else:
        sizes = [f"interface_size = {needed:.2g} (or mesh_size, of all elements)"] if needed >= LEAST_SIZE else []
        remedies = ", or ".join([*sizes, *finer]) or "interface_size and refine"
    if case.cell.accuracy is not None:
        remedies = f"mesh_size = {case.cell.mesh_size:g} and refine = {case.cell.refine} for accuracy, and {remedies}"
    return [f"{law}: {size}; the process zone is {zone}, {limit}: set {remedies}", *lines]


def _law_warnings(case: Case) -> list[str]:
    """List warnings about cohesive laws on paths: energies depend on the order of modes, or teeth exceed the peak."""
    if not (case.section.is_followed and phase_laws.has_softening(case)):
        return []
    from feti_homog.interface.laws import law_of_sections  # few laws soften

    lines, law = [], law_of_sections(case.interfaces, np.arange(len(case.interfaces)))
    for section, bond in interface_section.labelled(case.interfaces):
        stiffness, strength, toughness = (
            getattr(bond, f"tangential_{kind}") / getattr(bond, f"normal_{kind}")
            for kind in ("stiffness", "strength", "toughness")
        )
        similar = strength**2 / toughness
        if abs(stiffness / similar - 1.0) > SAME_RATIO:
            formula = "(normal_toughness / tangential_toughness) (tangential_strength / normal_strength)^2"
            expected = f"expected {similar * bond.normal_stiffness:.7g}, of normal_stiffness {formula}"
            fault = "the energy of bonds whose mode changes depends on the path"
            lines.append(f"[{section}] tangential_stiffness = {bond.tangential_stiffness:g}: {fault}; {expected}")
    bond, most = case.interfaces[0], interface_section.InterfaceSection.softening_tolerance
    if law.overshoot > most * (1.0 + SAME_RATIO):
        cause = f"softening_tolerance = {bond.softening_tolerance:g}" if bond.teeth is None else f"teeth = {bond.teeth}"
        excess = f"the first tooth exceeds the peak traction by {law.overshoot:.1%}, and so may the peak of the cell"
        lines.append(f"[interface] {cause}: {excess}; by default at most by {most:.1%}")
    return lines
