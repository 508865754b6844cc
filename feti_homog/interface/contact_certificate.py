"""The certificate of a state of contact: how far it is from the KKT conditions, whichever way it was found."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from feti_homog.typing import Bool, Float


def kkt_errors(
    comm: MPI.Intracomm, traction: Float, force: Float, gap: Float, debonded: Bool, closed: Bool, displacement: float
) -> dict[str, float]:
    """Errors of gap >= 0, force <= 0, force gap = 0 on the debonded faces, each relative to its scale.  Collective.

    `kkt_penetration` is -gap relative to the largest imposed `displacement`, `kkt_tension` the normal traction of a
    closed node relative to the largest traction, `kkt_complementarity` |force gap| relative to the largest force
    times the displacement; of each the largest.

    Args:
        traction: (k, 2) normal and tangential traction of this rank's interface nodes.
        force, gap: (k,) normal nodal force, tension positive, and opening.
        debonded, closed: (k,) which nodes the conditions hold for, and which of them touch.
    """
    worst = np.array(
        [
            np.where(debonded, -gap, 0.0).max(initial=0.0),
            np.where(debonded & closed, traction[:, 0], 0.0).max(initial=0.0),
            np.where(debonded, np.abs(force * gap), 0.0).max(initial=0.0),
            np.abs(traction).max(initial=0.0),
            np.abs(force).max(initial=0.0),
        ]
    )
    comm.Allreduce(MPI.IN_PLACE, worst, MPI.MAX)
    penetration, tension, product, largest_traction, largest_force = (float(w) for w in worst)
    # Without a strain, or without forces, there is nothing that an error could be a part of: it stands by itself.
    scale = displacement or 1.0
    return {
        "kkt_penetration": penetration / scale,
        "kkt_tension": tension / (largest_traction or 1.0),
        "kkt_complementarity": product / ((largest_force or 1.0) * scale),
    }
