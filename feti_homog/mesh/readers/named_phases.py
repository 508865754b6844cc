"""Phases in a user's mesh by names and numbers in its file, as [cell.phases] maps them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from feti_homog.errors import MeshError
from feti_homog.mesh.coarse_mesh import areas
from feti_homog.mesh.readers.raw_mesh import DEBONDED, RawMesh, first_of
from feti_homog.microstructure.phase_names import PHASE, VOID
from feti_homog.schema.wording import toml_key, toml_value

NUMBER = re.compile("number [0-9]+")
"""Groups that have no other name."""
HOLE = "expected no elements in a void, which is a hole in the mesh (with voids = true in [cell])"
Selectors = Mapping[str, tuple[str | int, ...]]


def with_phases(mesh: RawMesh, phases: Selectors) -> RawMesh:
    """Give groups the phases that select one of their names, or else of their aliases.

    Other groups keep their names. `debonded` selects curves.

    Raises:
        MeshError: a name or number that no element has; one line for each.
    """
    pairs = [(phase, name) for phase, selected in phases.items() for name in selected]
    if faults := _unknown_names(mesh, pairs):
        raise MeshError(*faults)
    phase_of = {_key(name): phase for phase, name in pairs if phase != DEBONDED}
    lines = set(map(_key, phases.get(DEBONDED, ())))
    curves = {DEBONDED if _key(name) in lines else name: ends for name, ends in mesh.curves.items()}
    both = zip(mesh.groups, mesh.aliases or ((),) * len(mesh.groups), strict=True)
    groups = tuple(_selecting(names, phase_of) or _selecting(aliases, phase_of) or names for names, aliases in both)
    return replace(mesh, groups=groups, curves=curves)


def _unknown_names(mesh: RawMesh, pairs: Iterable[tuple[str, str | int]]) -> list[str]:
    """List names and numbers that no element has, or no line."""
    faults = []
    for phase, name in pairs:
        of_curves = phase == DEBONDED
        if _key(name) not in map(_key, _names(mesh, of_curves)):
            selected = f"[cell.phases] {toml_key(phase)} = {toml_value(name)}"
            kind = "lines" if of_curves else "elements"
            faults.append(f"{selected}: no {kind} of that name; {known_names(mesh, of_curves)}")
    return faults


def _selecting(names: tuple[str, ...], phase_of: Mapping[str, str]) -> tuple[str, ...]:
    """Return the phases that select one of the names, each once."""
    return tuple(dict.fromkeys(phase_of[_key(name)] for name in names if _key(name) in phase_of))


def _key(name: str | int) -> str:
    """Return a name, or the number of a nameless group, such that capitals do not matter."""
    return (f"number {name}" if isinstance(name, int) else name).casefold()


def unknown_phases(mesh: RawMesh) -> list[str]:
    """List physical surfaces whose name is not a phase, and a missing matrix."""
    names = list(dict.fromkeys(name for group in mesh.groups for name in group))
    has_matrix = "matrix" in names
    expected = 'expected "matrix", "fibre", "glass", ... of letters, digits, _ and -, "fibre:2"'
    # Without a matrix all groups are named anew, and numbers need no further word.
    faults = [
        f'{mesh.container} "{name}" is not a phase: {HOLE if name == VOID else expected}'
        for name in names
        if not PHASE.fullmatch(name) and (has_matrix or not NUMBER.fullmatch(name))
    ]
    if not has_matrix:
        faults.append(f'no {mesh.container} is named "matrix"')
    if faults:
        faults[-1] += f"; {known_names(mesh)}{_way_out(mesh)}"
    return faults


def _way_out(mesh: RawMesh) -> str:
    """Propose the two largest groups for [cell.phases], with all shares of the area."""
    shares: dict[str, float] = {}
    with np.errstate(all="ignore"):  # coordinates are judged later
        sizes = np.bincount(mesh.group, np.abs(areas(mesh.points[:, :2], mesh.triangles)), len(mesh.groups))
        for names, percent in zip(mesh.groups, 100 * sizes / sizes.sum(), strict=True):
            if names and names[0] != VOID:
                shares[names[0]] = shares.get(names[0], 0.0) + percent
    if not shares:
        return ""
    order = sorted(shares, key=lambda name: -shares[name])
    entries = ", ".join(
        f"{phase} = {_as_selected(name)}" for phase, name in zip(("matrix", "fibre"), order, strict=False)
    )
    named = first_of((f"{_as_selected(name)}: {share:.3g} %" for name, share in shares.items()), len(shares), 20)
    matrix = _as_selected(order[0])
    return f". If {matrix} is the matrix, add to [cell]: phases = {{{entries}}}. Shares of the area: {named}"


def known_names(mesh: RawMesh, of_curves: bool = False) -> str:
    """List the names of groups, or of curves; numbers stand for nameless ones."""
    names = _names(mesh, of_curves)
    return f"the file has {first_of(map(_as_selected, names), len(names), 20) or 'none'}"


def _names(mesh: RawMesh, of_curves: bool) -> list[str]:
    named = list(mesh.curves) if of_curves else [name for group in (*mesh.groups, *mesh.aliases) for name in group]
    return list(dict.fromkeys(named))


def _as_selected(name: str) -> str:
    """Return the name or number of a group as a case file has it."""
    return name.removeprefix("number ") if NUMBER.fullmatch(name) else toml_value(name)
