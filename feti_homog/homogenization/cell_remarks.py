"""Remarks on a cell that its case may not lead to expect, and the interfaces of the case between its phases."""

from __future__ import annotations

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.interface_section import interface_label
from feti_homog.homogenization import bonds
from feti_homog.mesh.periodic_topology import Torus
from feti_homog.mesh.submesh import pinned_class
from feti_homog.schema.wording import toml_value
from feti_homog.typing import AnyInt, Int

SAME_FRACTION = 0.01  # of a matched table and its cell, relative


def pairs_of(case: Case, phases: tuple[str, ...]) -> Int:
    """(phases, phases) symmetric: the place of the interface between two phases among the case's.

    It is -1 where there is none and they never part.

    An interface without `between` is that of the matrix, the first phase, with all others; so is perfect
    bonding, which is looked at there too.
    """
    pairs = np.full((len(phases), len(phases)), -1)
    for number, between in enumerate([interface.between for interface in case.interfaces] or [None]):
        if between is None:
            pairs[0, 1:] = pairs[1:, 0] = number
        elif set(between) <= set(phases):
            a, b = map(phases.index, between)
            pairs[a, b] = pairs[b, a] = number
    return pairs


def faults(case: Case, phases: tuple[str, ...], left: AnyInt, right: AnyInt) -> list[str]:
    """Faults of interfaces between phases that the cell does not have, or that touch nowhere in it.

    Those numbered `left` (n,) touch those numbered `right` (n,).
    """
    found = []
    touching = np.zeros((len(phases), len(phases)), bool)
    touching[left, right] = touching[right, left] = True
    for number, interface in enumerate(case.interfaces):
        if interface.between is None:
            continue
        line = f"[{interface_label(number, len(case.interfaces))}] between = {toml_value(list(interface.between))}: "
        unknown = [name for name in interface.between if name not in phases]
        if unknown:
            found.append(f"{line}the cell has no phase {toml_value(unknown[0])}; it has {', '.join(phases)}")
        elif not touching[tuple(map(phases.index, interface.between))]:
            found.append(f"{line}expected phases that touch; in this cell they do nowhere")
    return found


def mesh_remarks(case: Case, torus: Torus, pairs: Int) -> tuple[str, ...]:
    """List what the mesh remarks, an [interface] without an effect, and nodes that never part, a line each.

    `pairs` as in `share_entities`.
    """
    return (
        *torus.mesh.remarks,
        *_bonding(case, len(torus.mesh.debonded_edges) > 0),
        *((*_held_nodes(torus, pairs), *_pinned_bond(torus)) if case.interfaces else ()),
    )


def _held_nodes(torus: Torus, pairs: Int) -> tuple[str, ...]:
    """Count the nodes of interfaces that never part: where three bodies meet, and where two meet more than once."""
    left, right, edge = torus.sides
    may_part = pairs[torus.mesh.phase[left], torus.mesh.phase[right]] >= 0
    ends = np.unique(torus.edge_ends[edge[may_part & (torus.constituent[left] != torus.constituent[right])]])
    kinds = ((torus.meeting[ends] > 2, "three bodies meet"), (torus.touching[ends], "two bodies meet more than once"))
    words = [f"at {which.sum()} {what}" for which, what in kinds if which.any()]
    return (f"[interface] nodes that never part: {', '.join(words)}",) if words else ()


def _pinned_bond(torus: Torus) -> tuple[str, ...]:
    """Mention that the node which is pinned against translation, Eq. (15), is a bond, and so never parts."""
    at = np.searchsorted(torus.class_keys, pinned_class(torus))
    if torus.never_part[at] or torus.meeting[at] < 2:
        return ()
    x, y = torus.mesh.points[np.flatnonzero(torus.node_class == at)[0]]
    return (
        f"[interface] the node at ({x:.6g}, {y:.6g}) never parts: it holds the cell, for all nodes of the mesh are on "
        "interfaces; use a finer mesh",
    )


def _bonding(case: Case, has_debonded_curve: bool) -> tuple[str, ...]:
    """Mention a debonded curve without an [interface], and an [interface] under which every bond is perfect."""
    if case.interface is None:
        return ('the curve "debonded" of the mesh is bonded: there is no [interface]',) if has_debonded_curve else ()
    can_open = case.arcs or has_debonded_curve or bonds.has_springs(case) or case.section.breaks
    if can_open or not case.cell.has_own_mesh:
        return ()
    return ("[interface]: nothing is debonded, and no bond is elastic: the bonding is perfect",)


def subdomain_remarks(case: Case, bodies: int, subdomains: int, coarse_triangles: int) -> tuple[str, ...]:
    """Mention that there are more or fewer subdomains than the case asks for, and why."""
    asked = case.decomposition.subdomains
    if asked is None or asked == subdomains:
        return ()
    if subdomains > asked:
        whole = f"each of the {bodies} bodies is at least one"
        why = whole if bodies > asked else "pieces that METIS leaves in several parts were split"
    else:
        why = f"METIS makes no more of {coarse_triangles} coarse triangles; a smaller mesh_size has more"
    return (f"[decomposition] subdomains = {asked}: {subdomains} were made: {why}",)


def table_remarks(case: Case) -> tuple[str, ...]:
    """Mention a fibre fraction other than that of the table that the cell matches."""
    cell = case.cell
    if cell.match is None or cell.matched is None or cell.fibre_fraction is None:
        return ()
    fraction = cell.matched.fibre_fraction
    if abs(cell.fibre_fraction / fraction - 1.0) <= SAME_FRACTION:
        return ()
    return (
        f"[cell] fibre_fraction = {cell.fibre_fraction:g}: {cell.match.name} has {fraction:.4g}; neighbours are as far "
        "away as there, in diameters",
    )
