"""Which interface of the case two phases have."""

from __future__ import annotations

import numpy as np

from feti_homog.case.case import Case
from feti_homog.case.interface_section import interface_label
from feti_homog.schema.wording import toml_value
from feti_homog.typing import AnyInt, Int


def pairs_of(case: Case, phases: tuple[str, ...]) -> Int:
    """(phases, phases) symmetric: the place among the case's interfaces of that between two phases, -1 where there is
    none and they never part.

    An interface that does not say between what is that of the matrix, the first phase, with all others; so is perfect
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
    """Faults of interfaces between phases that the cell does not have, or that touch nowhere in it: those numbered
    `left` (n,) touch those numbered `right` (n,)."""
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
