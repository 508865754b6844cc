"""A fit's result: the content of fit.json, the table of measured values, and the text."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from feti_homog.case import sections
from feti_homog.report.text import tables
from feti_homog.studies.case_folders import csv_text
from feti_homog.studies.estimation import CONFIDENCE, ParameterEstimates, names_of
from feti_homog.studies.predictions import Datum

FIRST, LEAST_SHARE, MOST_DEVIATIONS = tables.Column("", -38), 0.01, 3.0
HEAD = ("test", "name", "strain", "value", "std", "computed", "residual")


def content(
    unknowns: Mapping[str, sections.Unknown], data: Sequence[Datum], estimates: ParameterEstimates
) -> dict[str, Any]:
    """Return the content of fit.json behind its name; numbers that are not finite are None."""
    faults = _faults(unknowns, estimates)
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


def _faults(unknowns: Mapping[str, sections.Unknown], estimates: ParameterEstimates) -> list[str]:
    """Return a line for each reason to distrust the estimates."""
    faults = [] if estimates.converged else [f"no minimum after {estimates.evaluations} evaluations"]
    faults += names_of(estimates.undetermined, [*unknowns])
    return faults + [
        f"[unknown] {name}: the measured values hardly determine it: its standard deviation {std:.3g} is more than the "
        f"width {unknown.upper - unknown.lower:.3g} of its bounds"
        for (name, unknown), std in zip(unknowns.items(), estimates.std, strict=True)
        if np.isfinite(std) and std > unknown.upper - unknown.lower
    ]


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def measured_csv(document: Mapping[str, Any]) -> str:
    """Return the table of measured values."""
    return csv_text([HEAD, *([datum[name] for name in HEAD] for datum in document["measured"])])


def text(document: Mapping[str, Any]) -> str:
    """Return the tables of a fit for a terminal."""
    measured, is_single = document["measured"], len({datum["test"] for datum in document["measured"]}) == 1
    tests = ["" if is_single else f"test {datum['test']} " for datum in measured]
    strains = ["" if d["strain"] is None else f"({d['strain_name']} = {d['strain']:g})" for d in measured]
    data = [f"{test}{d['name']}{strain}" for test, d, strain in zip(tests, measured, strains, strict=True)]
    heads = [FIRST, tables.Column("estimate"), tables.Column("std")]
    heads += [tables.Column(f"{document['confidence']:.0%} interval", 14), tables.Column("", 12)]
    heads += [tables.Column("  determined by", -40)]
    rows = list[list[Any]]()
    for name, unknown in document["unknowns"].items():
        order = np.argsort(-np.array(unknown["shares"]), kind="stable")[:3]  # the data that determine it best
        best = [f"{data[k]} {unknown['shares'][k]:.0%}" for k in order if unknown["shares"][k] >= LEAST_SHARE]
        bound = "" if unknown["at_bound"] is None else f"at its {unknown['at_bound']} bound; "
        numbers = [unknown["estimate"], *map(_dash, [unknown["std"], *unknown["interval"]])]
        rows.append([name, *numbers, f"  {bound}{', '.join(best)}"])
    printed = [tables.Table("Unknowns", heads, rows, title_in_head=True)]
    rows = [[name, *map(_dash, row)] for name, row in zip(document["unknowns"], document["correlation"], strict=True)]
    columns = [FIRST, *(tables.Column(str(k + 1), 8, ".3f") for k in range(len(rows)))]
    printed += [tables.Table("Correlation", columns, rows, title_in_head=True)] if len(rows) > 1 else []
    columns = [FIRST, *(tables.Column(name) for name in HEAD[3:6]), tables.Column("in std", 10, ".2f")]
    rows = [[label, *(datum[n] for n in HEAD[3:])] for label, datum in zip(data, measured, strict=True)]
    printed.append(tables.Table("Measured", columns, rows, title_in_head=True))
    chance = "" if document["chance"] is None else f", as large or larger with a chance of {document['chance']:.2g}"
    squares = document["sum_of_squares"]
    total = "beyond all numbers" if squares is None else f"{squares:.4g}"
    last = f"Sum of squares {total}{chance}; {document['evaluations']} evaluations"
    return "\n\n".join(["", *("\n".join(table.lines) for table in printed), last, *_remarks(document, data)])


def _dash(value: float | None) -> float | str:
    return "-" if value is None else value


def _remarks(document: Mapping[str, Any], data: Sequence[str]) -> list[str]:
    """Return a remark where unknowns end at their bounds and a measured value is off by MOST_DEVIATIONS or more."""
    bound = [f"{name} at its {row['at_bound']}" for name, row in document["unknowns"].items() if row["at_bound"]]
    residuals = [datum["residual"] for datum in document["measured"]]
    worst = int(np.argmax(np.abs(residuals)))
    if not bound or abs(residuals[worst]) <= MOST_DEVIATIONS:
        return []
    deviation = f"{data[worst]} is {abs(residuals[worst]):.3g} standard deviations off"
    return [f"Remark: the fit ends with {', '.join(bound)} bound, and {deviation}"]
