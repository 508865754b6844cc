"""The certificate of a state of contact: how far it is from the KKT conditions, whichever way it was found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from feti_homog.interface.contact.states import Status
from feti_homog.typing import Bool, Float


def kkt_errors(
    comm: MPI.Intracomm,
    traction: Float,
    length: Float,
    gap: Float,
    debonded: Bool,
    closed: Bool,
    displacement: float,
    stress: Float,
    over_interface: Callable[[Float], Float],
) -> dict[str, float]:
    """Errors of gap >= 0, force <= 0, force gap = 0 on the debonded faces, each relative to its scale.  Collective.

    `kkt_penetration` is -gap relative to the imposed displacement, `kkt_tension` the normal traction of a closed node
    relative to the largest traction of its interface, `kkt_complementarity` |force gap| relative to the largest force
    there times the displacement; of each the largest.  A traction scale is no less than the imposed stress: where no
    face carries a force, what is left of the tractions is rounding.

    Args:
        traction: (k, 2) normal and tangential traction of this rank's interface nodes, tension positive.
        length, gap: (k,) tributary interface length, force = traction length, and opening.
        debonded, closed: (k,) which nodes the conditions hold for, and which of them touch.
        displacement: the largest that the strain imposes on the cell.
        stress: (k,) that it would cause at each node.
        over_interface: from values (k,) to the largest on the interface of each node.
    """
    force = traction[:, 0] * length
    largest_traction = np.maximum(over_interface(np.abs(traction).max(axis=1, initial=0.0)), stress)
    largest_force = np.maximum(over_interface(np.abs(force)), stress * over_interface(length))
    # Without a strain there is nothing that an error could be a part of: it stands by itself.
    displacement = displacement or 1.0
    largest_traction, largest_force = (np.where(size > 0.0, size, 1.0) for size in (largest_traction, largest_force))
    worst = np.array(
        [
            np.where(debonded, -gap, 0.0).max(initial=0.0) / displacement,
            np.where(debonded & closed, traction[:, 0] / largest_traction, 0.0).max(initial=0.0),
            np.where(debonded, np.abs(force * gap) / (largest_force * displacement), 0.0).max(initial=0.0),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
    return dict(zip(("kkt_penetration", "kkt_tension", "kkt_complementarity"), worst.tolist(), strict=True))


def coulomb_errors(force: Float, friction: Float, sliding: Status) -> Float:
    """(k,) how far shear is beyond mu p, or off s mu p, and shear along the fibres, of which faces bear none.

    Args:
        force: (k, c) normal, tangential and axial traction of faces, and of damaged bonds what is beside their springs.
        friction, sliding: (k,) mu, and the sign s with which the slip grows, 0 of faces that stick.
    """
    limit, shear = friction * np.maximum(-force[:, 0], 0.0), force[:, 1]
    off = np.where(sliding == 0, np.maximum(np.abs(shear) - limit, 0.0), np.abs(sliding * shear - limit))
    along = np.abs(force[:, 2:]).max(axis=1, initial=0.0)
    return np.asarray(np.maximum(off, along))
