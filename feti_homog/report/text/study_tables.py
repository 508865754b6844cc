"""Write the tables of studies as text: a fit from fit.json, scatter from uncertainty.json."""

from typing import Any

import numpy as np

from feti_homog.report.text import constant_tables, tables
from feti_homog.typing import Document

FIRST, NUMBERS = tables.Column("", -38), ("value", "std", "computed", "residual")
LEAST_SHARE, MOST_DEVIATIONS = 0.01, 3.0


def fit_text(document: Document, axes: str = "", stress_unit: str = "") -> str:
    """Return the fit tables: unknowns, correlations, data, sum of squares.  `axes` is a remark after a misfit."""
    measured, is_single = document["measured"], len({datum["test"] for datum in document["measured"]}) == 1
    tests = ["" if is_single else f"test {datum['test']} " for datum in measured]
    strains = ["" if d["strain"] is None else f"({d['strain_name']} = {d['strain']:g})" for d in measured]
    data = [f"{test}{d['name']}{strain}" for test, d, strain in zip(tests, measured, strains, strict=True)]
    heads = [FIRST, tables.Column("estimate"), tables.Column("std")]
    mark = "?" if any("intervals fail" in fault for fault in document["faults"]) else ""
    heads += [tables.Column(f"{document['confidence']:.0%} interval{mark}", 14), tables.Column("", 12)]
    heads += [tables.Column("  determined by", -40)]
    rows = list[list[Any]]()
    for name, unknown in document["unknowns"].items():
        order = np.argsort(-np.array(unknown["shares"]), kind="stable")[:3]  # the three most informative data
        best = [f"{data[k]} {unknown['shares'][k]:.0%}" for k in order if unknown["shares"][k] >= LEAST_SHARE]
        bound = "" if unknown["at_bound"] is None else f"at its {unknown['at_bound']} bound; "
        numbers = [unknown["estimate"], *map(_dash, [unknown["std"], *unknown["interval"]])]
        rows.append([tables.with_unit(name, stress_unit), *numbers, f"  {bound}{', '.join(best)}"])
    printed = [tables.Table("Unknowns", heads, rows, title_in_head=True)]
    rows = [[name, *map(_dash, row)] for name, row in zip(document["unknowns"], document["correlation"], strict=True)]
    if len(rows) > 1:
        heads = [FIRST, *(tables.Column(str(k + 1), 8, ".3f") for k in range(len(rows)))]
        printed.append(tables.Table("Correlation", heads, rows, title_in_head=True))
    heads = [FIRST, *map(tables.Column, ("value", "std", "computed")), tables.Column("in std", 10, ".2f")]
    rows = [[label, *(datum[n] for n in NUMBERS)] for label, datum in zip(data, measured, strict=True)]
    printed.append(tables.Table("Measured", heads, rows, title_in_head=True))
    chance = "" if document["chance"] is None else f", as large or larger with a chance of {document['chance']:.2g}"
    total = "beyond all numbers" if document["sum_of_squares"] is None else f"{document['sum_of_squares']:.4g}"
    notes = [f"Sum of squares {total}{chance}; {document['evaluations']} evaluations"]
    intervals = ((name, row, row["interval"]) for name, row in document["unknowns"].items() if row["std"] is not None)
    wide = [name for name, row, (low, high) in intervals if not row["lower"] <= low <= high <= row["upper"]]
    if wide:
        notes.append(f"Remark: {', '.join(wide)}: the interval reaches beyond the bounds, which it ignores")
    ends = [f"{name} at its {row['at_bound']}" for name, row in document["unknowns"].items() if row["at_bound"]]
    label, worst = max(zip(data, (abs(d["residual"]) for d in measured), strict=True), key=lambda pair: pair[1])
    if ends and worst > MOST_DEVIATIONS:
        remark = f"the fit ends with {', '.join(ends)} bound, and {label} is {worst:.3g} standard deviations off"
        notes.append(f"Remark: {remark}; {axes}" if axes else f"Remark: {remark}")
    return "\n\n".join(["", *("\n".join(table.lines) for table in printed), *notes])


def _dash(value: float | None) -> float | str:
    return "-" if value is None else value


def scatter_text(document: Document) -> str:
    """Return a table of results with their scatter and the share of each input, as text.  Remarks name noisy slopes."""
    inputs, heads = document["parameters"], {"value": "value", "+- inputs": "std_inputs"}
    if document["cells"] > 1:
        heads |= {"+- cells": "std_cells", "+- both": "std"}
    heads["+- mesh"] = "mesh_error"
    labels = [number["name"].removeprefix("material.") for number in inputs]
    names = [result["name"] for result in document["results"]]
    listed = constant_tables.shown(names) if "E1" in names else names
    kinds = [name.rstrip("0123456789") for name in names]
    sizes = dict.fromkeys(kinds, 0.0)
    for kind, result in zip(kinds, document["results"], strict=True):
        sizes[kind] = max(sizes[kind], abs(result["value"]), result["std"])
    # Listed results have more scatter than the solver noise of the largest result of their kind.
    results = list[Document]()
    for kind, result in zip(kinds, document["results"], strict=True):
        if result["name"] in listed and tables.without_noise(result["std"], sizes[kind]) > 0:
            results.append(result)
    rows = list[list[Any]]()
    for result in results:
        numbers = [_dash(result[key]) for key in heads.values()]
        name = tables.with_unit(result["name"], document.get("stress_unit", ""))
        rows.append([name, *numbers, *(100 * fraction for fraction in result["shares"])])
    columns = [tables.Column("", -max([18, *(len(row[0]) for row in rows)]) - 2), *map(tables.Column, heads)]
    columns += [tables.Column(label, max(12, len(label) + 2), ".1f") for label in labels]
    title = "Scatter by uncertain numbers (std), and their shares of its variance (%)"
    lines = tables.Table(title, columns, rows).lines if rows else ["No result depends on the uncertain numbers."]
    differing = ", ".join(number["name"] for number in inputs if number["by"] == "differences")
    lines = ["", *lines, f"By differences of runs: {differing or 'none'}"]
    if any(min(result["shares"]) < -LEAST_SHARE for result in results):
        lines.append("Negative shares: correlated numbers act against each other")
    if any(result["mesh_error"] is None for result in results):
        lines.append("+- mesh: for stiffnesses, constants, conductivities alone, with [output] mesh_error = true")
    several = [result for result in results if result["derivative_errors"]]
    for k, number in enumerate(inputs):
        if bent := ", ".join(r["name"] for r in results if abs(r["bends"][k]) > r["std_inputs"] / 4):
            lines.append(f"Not linear within one standard deviation of {number['name']}: {bent}")
        noisy = ", ".join(r["name"] for r in several if 2 * r["derivative_errors"][k] > abs(r["derivatives"][k]))
        if noisy:
            lines.append(f"Standard error over the cells above half of the slope by {number['name']}: {noisy}")
    return "\n".join(lines)
