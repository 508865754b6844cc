"""The certificate of a state of contact: how far it is from the KKT conditions, whichever way it was found."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.typing import Bool, Float


def kkt_errors(
    comm: MPI.Intracomm,
    traction: Float,
    length: Float,
    gap: Float,
    debonded: Bool,
    closed: Bool,
    imposed: tuple[float, float],
) -> dict[str, float]:
    """Errors of gap >= 0, force <= 0, force gap = 0 on the debonded faces, each relative to its scale.  Collective.

    `kkt_penetration` is -gap relative to the imposed displacement, `kkt_tension` the normal traction of a closed node
    relative to the largest traction, `kkt_complementarity` |force gap| relative to the largest force times the
    displacement; of each the largest.  A traction scale is no less than the imposed stress: where no face carries
    a force, what is left of the tractions is rounding.

    Args:
        traction: (k, 2) normal and tangential traction of this rank's interface nodes, tension positive.
        length, gap: (k,) tributary interface length, force = traction length, and opening.
        debonded, closed: (k,) which nodes the conditions hold for, and which of them touch.
        imposed: the largest displacement that the strain imposes on the cell, and a stress that it would cause at
            least if all held.
    """
    force = traction[:, 0] * length
    worst = np.array(
        [
            np.where(debonded, -gap, 0.0).max(initial=0.0),
            np.where(debonded & closed, traction[:, 0], 0.0).max(initial=0.0),
            np.where(debonded, np.abs(force * gap), 0.0).max(initial=0.0),
            np.abs(traction).max(initial=0.0),
            np.abs(force).max(initial=0.0),
            length.max(initial=0.0),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
    penetration, tension, product, largest_traction, largest_force, longest = (float(w) for w in worst)
    displacement, stress = imposed
    # Without a strain there is nothing that an error could be a part of: it stands by itself.
    displacement = displacement or 1.0
    return {
        "kkt_penetration": penetration / displacement,
        "kkt_tension": tension / (max(largest_traction, stress) or 1.0),
        "kkt_complementarity": product / ((max(largest_force, stress * longest) or 1.0) * displacement),
    }
