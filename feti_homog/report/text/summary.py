"""The printed summary of a result.json, tables for notebooks, and the registry of reported analyses.

Modules of pictures find an analysis by its name: `response_curves.CURVES`.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from textwrap import wrap
from typing import Any

import numpy as np

from feti_homog.materials import voigt
from feti_homog.report.text import phase_tables, point_tables
from feti_homog.report.text.constant_tables import sensitivities, table
from feti_homog.report.text.path_table import ROWS, path_table
from feti_homog.report.text.stiffness_tables import bounds, constants, moduli, stiffnesses, thermal
from feti_homog.report.text.tables import ERROR, Column, Table
from feti_homog.results import landmarks
from feti_homog.typing import Document

LABEL = 12  # columns of the labels at the left
NAME = 28  # columns of the names of checks
STATES = 4  # of a curve whose largest stresses are shown
GLUE = "\N{NO-BREAK SPACE}"  # at which no line is broken
REMARKS = ("Remark", "Warning", "Fault")


def _stiffness_tables(document: Document) -> list[Table]:
    """Return effective stiffness, constants and bounds."""
    last = [*point_tables.tip_table(document, document.get("tips")), *sensitivities(document)]
    if voigt.plane_state_of(document).is_spatial:
        first = [table(document)] if document.get("constants") else []
        return [*first, *stiffnesses(document), *thermal(document), *constants(document), *last]
    if document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
        return [*stiffnesses(document), *last]
    return [*stiffnesses(document), moduli(document), bounds(document), *last]


@dataclass(frozen=True)
class ReportedAnalysis:
    """An analysis; its entry in result.json has its name, except for the stiffness.

    Attributes:
        title: the name in words.
        tables: tables for a result with at most `limit` rows of points; None for the rows of the summary.
        is_curve: whether its states are points of a curve, shown side by side.
        is_followed: whether first and last states matter most.
        picture: picture name of a state, "" for the name of its unit load.
        is_load_given: whether states are under a load of the case, not under unit strains.
        states: numbers of at most `limit` states among the first `count`.
    """

    name: str
    title: str
    tables: Callable[[Document, int | None], list[Table]]
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""
    is_load_given: Callable[[Document], bool] = lambda document: False
    states: Callable[[Document, int, int], list[int]] = lambda document, limit, count: sorted(
        {round(k) for k in np.linspace(0, count - 1, min(limit, count))}
    )


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness", lambda document, limit: _stiffness_tables(document))
ANGLE = ReportedAnalysis(
    "angle",
    "debonding angle",
    lambda document, limit: [point_tables.angle_table(document, limit), *point_tables.angle_tip_table(document)],
    is_curve=True,
    is_load_given=lambda document: document.get("case", {}).get("angle", {}).get("strain") is not None,
)
PATH = ReportedAnalysis(
    "path",
    "load path",
    lambda document, limit: [path_table(document, limit or ROWS)],
    is_curve=True,
    is_followed=True,
    is_load_given=lambda document: True,
    states=landmarks.chosen_states,
)
LOAD = ReportedAnalysis(
    "load",
    "equilibrium under a load",
    lambda document, limit: [
        point_tables.load_table(document),
        *point_tables.tip_table(document, document["load"].get("tips")),
        *sensitivities(document),
    ],
    picture="load",
    is_load_given=lambda document: True,
)
ENVELOPE = ReportedAnalysis(
    "envelope",
    "onset of debonding",
    lambda document, limit: [
        point_tables.envelope_table(document, limit or point_tables.ENVELOPE_ROWS),
        *_stiffness_tables(document),
    ],
)
ANALYSES = {entry.name: entry for entry in (ANGLE, PATH, LOAD, ENVELOPE, STIFFNESS)}


def reported(document: Document) -> ReportedAnalysis:
    """Return the analysis of a result.json; the stiffness for an empty one, which has states alone."""
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)


def summary(document: Document) -> str:
    """Return the printed summary of a result, lines up to 79 columns, tables up to 100 (but for long names).

    Cell, solver, tables of the analysis, checks, timings, memory, remarks, warnings, faults and status.

    Raises:
        KeyError: a key of these is missing.
    """
    size = document["memory"]
    memory = f"{size / 2**20:.0f} MiB" if size < 2**30 else f"{size / 2**30:.2f} GiB"
    remarks = [(label, str(text)) for label in REMARKS for text in document.get(f"{label.lower()}s", ())]
    blocks = [
        _heading(document),
        [*_cell(document), *_solver(document["solver"])],
        *(table.lines for table in answers(document)),
        checks(document).lines,
        [
            *_field("Time", [f"{stage}{GLUE}{took:.2f}{GLUE}s" for stage, took in document["timings"].items()]),
            *_field("Memory", [f"{memory} per rank at most"]),
        ],
        [line for label, text in remarks for line in _field(label, [text])],
        _field("Status", [str(document["status"])]),
    ]
    return _joined(blocks)


def short_summary(document: Document) -> str:
    """Return the tables of a result, its largest check error, and its status."""
    law, error = max(document["checks"].items(), key=lambda check: check[1])
    verdict = _field("Checks", [f"largest relative error {error:.1e} ({law})"])
    return _joined(
        [
            _heading(document),
            *(table.lines for table in answers(document)),
            [*verdict, *_field("Status", [str(document["status"])])],
        ]
    )


def notebook(document: Document) -> str:
    """Return title, tables, checks and status as HTML."""
    tables = [table.html for table in (*answers(document, 20), checks(document))]
    return "\n".join([f"<h4>{escape(title_of(document))}</h4>", *tables, f"<p>{escape(document['status'])}</p>"])


def answers(document: Document, most: int | None = None) -> list[Table]:
    """Return the tables of a result, with at most `most` rows of points."""
    analysis = reported(document)
    count = max((len(phase["state"]) for phase in document.get("phase_stresses", ())), default=0)
    states = analysis.states(document, STATES, count) if analysis.is_curve else range(count)
    return [*analysis.tables(document, most), *phase_tables.phase_tables(document, states)]


def title_of(document: Document) -> str:
    """Return case name, analysis and plane state."""
    case = document["case"]
    what = reported(document).title
    return f"{case.get('name', '')}: {what}, plane {case['analysis']['plane']}".lstrip(": ")


def _heading(document: Document) -> list[str]:
    title = title_of(document)
    return [title, "=" * min(len(title), point_tables.WIDTH)]


def _joined(blocks: Iterable[Sequence[str]]) -> str:
    return "\n\n".join("\n".join(block) for block in blocks if block).replace(GLUE, " ")


def _cell(document: Document) -> list[str]:
    cell, case = document["cell"], document["case"]
    unit = case.get("output", {}).get("length_unit", "")
    size = f"{cell['width']:.6g} x {cell['height']:.6g} {unit}".rstrip()
    shape, fractions = case["cell"], cell.get("fractions", {})
    shares = ", ".join(f"{phase} {share:.6f}" for phase, share in fractions.items())
    mesh = [_number(cell["elements"], "element"), _number(cell["nodes"], "node")]
    mesh += [f"order {shape['order']}"] * ("order" in shape)
    if "refine" in shape:
        mesh.append(f"refine {shape['refine']}")
    elif "accuracy" in shape:  # by which the program chose the mesh
        chosen = f"refine {cell['refine']} of mesh_size {cell['mesh_size']:g}"
        mesh.append(f"{chosen} for accuracy = {shape['accuracy']:g}")
    shares += f", voids {cell['porosity']:.6f}" if cell.get("porosity") else ""
    lines = _field("Cell", [str(shape["geometry"]), size])
    lines += _field("Meshed", [f"fibre fraction {cell['fibre_fraction']:.6f}", *([f"({shares})"] if shares else [])])
    if (distance := cell.get("match_distance")) is not None:
        phrases = f"distances of neighbours differ by {distance:.4f} mean diameters"
        lines += _field("Match", [Path(shape["match"]).name, phrases])
    if factors := [fibre["strength"] for fibre in document.get("fibres", ()) if "strength" in fibre]:
        low, high = (f"{end:.4f} (fibre {factors.index(end) + 1})" for end in (min(factors), max(factors)))
        mean = f"{sum(factors) / len(factors):.4f} in the mean"
        lines += _field("Strengths", [f"{low} to {high} times those of [interface]", mean])
    return lines + _field("Mesh", mesh)


def _solver(solver: Document) -> list[str]:
    names = {"ranks": "rank", "subdomains": "subdomain", "dofs": "dof"}
    lines = _field("Solver", [_number(solver[key], name) for key, name in names.items()])
    dual = [_number(solver["multipliers"], "multiplier"), f"kernel {solver['kernel_dim']}"]
    lines += _field("Dual", [*dual, f"coarse problem {solver['coarse_dim']}"])
    if (count := solver.get("factorizations")) is not None:  # of the axial problem too
        coarse = f"coarse problem {_number(solver.get('coarse_factorizations', 0), 'time')}"
        lines += _field("Factorized", [f"{count} {'matrix' if count == 1 else 'matrices'} of subdomains", coarse])
    counts = solver["iterations"]
    if not any(counts):
        iterations = [f"none in {_number(len(counts), 'state')}"]
    elif len(counts) <= 12:
        iterations = [str(count) for count in counts]
    else:
        iterations = [f"{min(counts)} to {max(counts)} a state", f"{sum(counts)} for {len(counts)} states"]
    return lines + _field("Iterations", iterations)


def checks(document: Document) -> Table:
    """Return the largest relative error of each law; laws of contact need an interface."""
    limit, has_interface = document.get("check_tolerance"), bool(document["case"].get("interface"))
    contact, rows, title = document.get("kkt_tolerance", limit), list[list[Any]](), "Checks"
    for law, error in document["checks"].items():
        of_contact = law.startswith("kkt_")
        if error is None or (of_contact and not has_interface):
            continue
        most = contact if of_contact else limit
        rows.append([law, error, *([] if most is None else ["pass" if error <= most else "FAIL"])])
    if limit is not None:
        of_contact = f"; of contact {contact:.1e}" if contact != limit and any("kkt_" in row[0] for row in rows) else ""
        title = f"Checks (relative, at most {limit:.1e}{of_contact})"
    columns = [Column("law", 2 - NAME, indent=0), Column("error", 14, ERROR), Column("", -8, indent=4)]
    return Table(title, columns, rows, abreast=1)


def _field(label: str, phrases: Sequence[str]) -> list[str]:
    """Return a label and its words, joined by commas and wrapped to WIDTH columns."""
    text = ", ".join(phrases).replace(", (", " (")
    return wrap(
        text,
        point_tables.WIDTH,
        initial_indent=f"{label:<{LABEL}}",
        subsequent_indent=" " * LABEL,
        break_long_words=False,
    )


def _number(count: int, name: str) -> str:
    return f"{count:,} {name}{'' if count == 1 else 's'}".replace(",", " ")
