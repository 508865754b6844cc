"""The numbers of a result for report.html and for notebooks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from typing import Any

from feti_homog.report.text.analyses import reported
from feti_homog.report.text.summary import checks, title_of
from feti_homog.report.text.table import Column, Table, in_brackets

MOST_ROWS, NOTEBOOK_ROWS = 60, 20  # of a table of points

Document = Mapping[str, Any]


def facts(document: Document) -> list[tuple[str, str]]:
    """Return the facts of a result: case, cell and solver."""
    case, cell, solver = document["case"], document["cell"], document["solver"]
    length = case["output"].get("length_unit", "")
    fractions = ", ".join(f"{phase} {share:.4f}" for phase, share in cell["fractions"].items())
    iterations, ranks = solver["iterations"], solver["ranks"]
    return [
        ("Analysis", f"{case['analysis']['type']}, plane {case['analysis']['plane']}"),
        ("Cell", f"{case['cell']['geometry']}, {cell['width']:.6g} x {cell['height']:.6g} {length}".rstrip()),
        ("Phases", fractions),
        ("Mesh", f"{_count(cell['elements'])} elements, {_count(cell['nodes'])} nodes, "
                 f"order {case['cell'].get('order', 1)}, refine {case['cell'].get('refine', cell.get('refine', 0))}"),
        ("Solver", f"{_count(ranks)} rank{'' if ranks == 1 else 's'}, {_count(solver['subdomains'])} subdomains, "
                   f"{_count(solver['dofs'])} degrees of freedom"),
        ("Iterations", f"{sum(iterations)} in {len(iterations)} states, to {solver['rtol']:g}"),
        ("Time", ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in document["timings"].items())),
        ("Version", f"feti-homog {document['version']}, layout {document['schema']}"),
    ]  # fmt: skip


def answers(document: Document, most: int = MOST_ROWS) -> list[Table]:
    """Return the tables of a result: stiffness with moduli and bounds, points of an angle or path, or onsets.

    Tables of points have at most so many rows.
    """
    label = in_brackets(document["case"].get("output", {}).get("stress_unit", ""))
    return reported(document).tables(document, label, most)


def notebook(document: Document) -> str:
    """Title, tables, checks and status as HTML."""
    rows = [[check.law, f"{check.error:.1e}"] for check in checks(document)]
    errors = Table("Largest relative errors", [Column("law"), Column("error")], rows)
    tables = [table.html for table in (*answers(document, NOTEBOOK_ROWS), errors)]
    return "\n".join([f"<h4>{escape(title_of(document))}</h4>", *tables, f"<p>{escape(document['status'])}</p>"])


def _count(number: int) -> str:
    return f"{number:,}".replace(",", "\N{NO-BREAK SPACE}")
