"""Build the result of a fit: the content of fit.json, and the table of measured values."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.case import sections
from feti_homog.studies.estimation import CONFIDENCE, ParameterEstimates, names_of
from feti_homog.studies.predictions import Datum

HEAD = ("test", "name", "strain", "value", "std", "computed", "residual")


def content(
    unknowns: Mapping[str, sections.Unknown], data: Sequence[Datum], estimates: ParameterEstimates, teeth: int = 0
) -> dict[str, Any]:
    """Return the content of fit.json without its name; numbers that are not finite are None.  `teeth` as `names_of`."""
    faults = [] if estimates.converged else [f"no minimum after {estimates.evaluations} evaluations"]
    misfits = estimates.misfits
    if misfits and estimates.undetermined:
        place = ", ".join(f"{name} = {value:.6g}" for name, value in zip(unknowns, estimates.x, strict=True))
        faults.append(f"the search stalled at {place}, where the values change in jumps or not at all: start elsewhere")
    elif misfits:
        faults.append(f"the model does not describe the measurements (chance {estimates.chance:.2g}): intervals fail")
    faults += [] if misfits else names_of(estimates.undetermined, [*unknowns], teeth)
    faults += [
        f"[unknown] {name}: the measured values hardly determine it: its standard deviation {std:.3g} is more than the "
        f"width {unknown.upper - unknown.lower:.3g} of its bounds"
        for (name, unknown), std in zip(unknowns.items(), estimates.std, strict=True)
        if np.isfinite(std) and std > unknown.upper - unknown.lower
    ]
    return {
        "status": "not converged" if faults else "done",
        "faults": faults,
        "confidence": CONFIDENCE,
        "evaluations": estimates.evaluations,
        "unknowns": {
            name: {
                "estimate": float(estimates.x[k]),
                "std": _finite(estimates.std[k]),
                "interval": [_finite(estimates.x[k] + sign * estimates.half_width[k]) for sign in (-1, 1)],
                "at_bound": {-1: "lower", 0: None, 1: "upper"}[int(estimates.at_bound[k])],
                "start": unknown.start, "lower": unknown.lower, "upper": unknown.upper,
                "shares": [float(share) for share in estimates.shares[k]],
            }
            for k, (name, unknown) in enumerate(unknowns.items())
        },
        "correlation": [[_finite(value) for value in row] for row in estimates.correlation],
        "singular_values": estimates.singular_values.tolist(),
        "directions": estimates.directions.tolist(),
        "sum_of_squares": _finite(float(estimates.residuals @ estimates.residuals)),
        "chance": estimates.chance,
        "measured": [
            {"test": datum.test + 1, "name": datum.name, "strain": datum.strain,
             "strain_name": datum.strain_name or None, "value": datum.value, "std": datum.std,
             "computed": float(f), "residual": float(r)}
            for datum, f, r in zip(data, estimates.computed, estimates.residuals, strict=True)
        ],
    }  # fmt: skip


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
