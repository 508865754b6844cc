"""Text of the scatter of results: a table with each input's share, and what of it random cells hardly determine."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from feti_homog.report.text.constant_tables import shown
from feti_homog.report.text.table import Column, Table, with_unit, without_noise

DIGITS = "0123456789"
NOISY = 0.5  # of a slope: a larger standard error over random cells is worth a line


def text(document: Mapping[str, Any]) -> str:
    """Return the table for a terminal: results with their scatter, and each input's share of it."""
    inputs, of_cells = document["parameters"], {"+- cells": "std_cells", "+- both": "std"}
    labels = [each["name"].removeprefix("material.") for each in inputs]
    heads = {"value": "value", "+- inputs": "std_inputs", **(of_cells if document["cells"] > 1 else {})}
    heads["+- mesh"] = "mesh_error"
    rows = _rows(document, [*heads.values()])
    width = max([18, *(len(row[0]) for row in rows)]) + 2
    columns = [Column("", -width), *map(Column, heads), *(Column(n, max(12, len(n) + 2), ".1f") for n in labels)]
    title = "Scatter by uncertain numbers (std), and their shares of its variance (%)"
    differing = ", ".join(each["name"] for each in inputs if each["by"] == "differences")
    lines = Table(title, columns, rows).lines if rows else ["No result depends on the uncertain numbers."]
    return "\n".join(["", *lines, f"By differences of runs: {differing or 'none'}", *_noisy(document)])


def _noisy(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield lines of the slopes that random cells hardly determine."""
    for k, name in enumerate(each["name"] for each in document["parameters"]):
        known = [each for each in _shown(document) if each["derivative_errors"]]
        found = [each["name"] for each in known if each["derivative_errors"][k] > NOISY * abs(each["derivatives"][k])]
        if found:
            yield f"Standard error over the cells above half of the slope by {name}: {', '.join(found)}"


def _rows(document: Mapping[str, Any], keys: Sequence[str]) -> list[list[Any]]:
    """Return the rows of results that scatter."""
    stress_unit = document.get("stress_unit", "")
    return [
        [
            with_unit(each["name"], stress_unit),
            *("-" if each[key] is None else each[key] for key in keys),
            *(100 * s for s in each["shares"]),
        ]
        for each in _shown(document)
    ]


def _shown(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the results that scatter by more than what the solver leaves of zero beside the largest of their kind."""
    results = document["results"]
    names = [each["name"] for each in results]
    kept, sizes = {*(shown(names) if "C11" in names else names)}, dict[str, float]()
    for each in results:
        kind = each["name"].rstrip(DIGITS)
        sizes[kind] = max(sizes.get(kind, 0.0), abs(each["value"]), each["std"])
    return [
        each for each in results
        if each["name"] in kept and without_noise(each["std"], sizes[each["name"].rstrip(DIGITS)]) > 0
    ]  # fmt: skip
