"""Write the summary of a result.json and tables for notebooks; register the reported analyses.

Picture modules find an analysis by name, such as in `response_curves.CURVES`.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from math import floor, log10
from pathlib import Path
from textwrap import wrap
from typing import Any

from feti_homog.materials import voigt
from feti_homog.report.text import constant_tables
from feti_homog.report.text.tables import ERROR, UNKNOWN, WIDTH, Column, Table, stress_label, with_micro, without_noise
from feti_homog.typing import Document

LABEL = 12  # characters of the labels at the left
NAME = 28  # characters of the check names
GLUE = "\N{NO-BREAK SPACE}"  # prevents a line break
REMARKS = ("Remark", "Warning", "Fault")
POINTS = 4  # points of a curve in tables of phase stresses
STRESSES = {"principal": "principal", "von_mises": "von Mises", "hydrostatic": "hydrostatic"}


@dataclass(frozen=True)
class ReportedAnalysis:
    """The title and states of an analysis in reports.

    Attributes:
        name: type of the analysis; angle, path, load and envelope have an entry of this name in result.json.
        title: the name in words.
        is_curve: whether the states are points of a curve, shown side by side.
        is_followed: whether the states follow a load path, so that landmarks choose among them.
        picture: name of the picture of a state; "": the picture has the name of the unit load.
    """

    name: str
    title: str
    is_curve: bool = False
    is_followed: bool = False
    picture: str = ""


STIFFNESS = ReportedAnalysis("stiffness", "effective stiffness")
ANGLE = ReportedAnalysis("angle", "debonding angle", is_curve=True)
PATH = ReportedAnalysis("path", "load path", is_curve=True, is_followed=True)
LOAD = ReportedAnalysis("load", "equilibrium under a load", picture="load")
ENVELOPE = ReportedAnalysis("envelope", "onset of debonding or softening")
CONDUCTIVITY = ReportedAnalysis("conductivity", "effective conductivity")
ANALYSES = {entry.name: entry for entry in (ANGLE, PATH, LOAD, ENVELOPE, CONDUCTIVITY, STIFFNESS)}


def reported(document: Document) -> ReportedAnalysis:
    """Return the analysis of a result.json; for an empty document, the stiffness."""
    if document.get("effective_conductivity") is not None:
        return CONDUCTIVITY
    return next((analysis for name, analysis in ANALYSES.items() if document.get(name)), STIFFNESS)


def summary(document: Document) -> str:
    """Return the printed summary of a result.

    The summary has cell, solver, tables of the analysis, checks, timings, memory, remarks, warnings, faults and status.
    Lines have up to 79 characters, tables up to 100, except for long names.  Raises KeyError for a missing key.
    """
    size, solver = document["memory"], document["solver"]
    names = {"ranks": "rank", "subdomains": "subdomain", "dofs": "dof"}
    dual = [_number(solver["multipliers"], "multiplier"), f"kernel {solver['kernel_dim']}"]
    settings = _cell(document) + _field("Solver", [_number(solver[key], name) for key, name in names.items()])
    settings += _field("Dual", [*dual, f"coarse problem {solver['coarse_dim']}"])
    if (count := solver.get("factorizations")) is not None:  # includes the axial problem
        coarse = f"coarse problem {_number(solver.get('coarse_factorizations', 0), 'time')}"
        settings += _field("Factorized", [f"{count} {'matrix' if count == 1 else 'matrices'} of subdomains", coarse])
    settings += _field("Method", [solver["method"]]) if "method" in solver else []
    condition = [f"condition number about {solver['condition']:.3g}"] if "condition" in solver else []
    counts = solver["iterations"]
    if not any(counts):
        settings += _field("Iterations", [f"none in {_number(len(counts), 'state')}"])
    elif len(counts) <= 12:
        settings += _field("Iterations", [*map(str, counts), *condition])
    else:
        a_state = f"{min(counts)} to {max(counts)} a state"
        settings += _field("Iterations", [a_state, f"{sum(counts)} for {len(counts)} states", *condition])
    memory = f"{size / 2**20:.0f} MiB" if size < 2**30 else f"{size / 2**30:.2f} GiB"
    remarks = [(label, str(text)) for label in REMARKS for text in document.get(f"{label.lower()}s", ())]
    costs = _field("Time", [f"{stage}{GLUE}{took:.2f}{GLUE}s" for stage, took in document["timings"].items()])
    costs += _field("Memory", [f"{memory} per rank at most"])
    tables = [*(table.lines for table in answers(document)), checks(document).lines]
    notes = [line for label, text in remarks for line in _field(label, [text])]
    return _joined([_heading(document), settings, *tables, costs, notes, _field("Status", [str(document["status"])])])


def short_summary(document: Document) -> str:
    """Return the title, the tables, the largest check error and the status of a result."""
    law, error = max(document["checks"].items(), key=lambda check: check[1])
    verdict = _field("Checks", [f"largest relative error {error:.1e} ({law})"])
    verdict += _field("Status", [str(document["status"])])
    return _joined([_heading(document), *(table.lines for table in answers(document)), verdict])


def notebook(document: Document) -> str:
    """Return the title, tables, checks and status of a result as HTML.  Tables have at most 20 points."""
    tables = [table.html for table in (*answers(document, 20), checks(document))]
    return "\n".join([f"<h4>{escape(title_of(document))}</h4>", *tables, f"<p>{escape(document['status'])}</p>"])


def answers(document: Document, most: int | None = None) -> list[Table]:
    """Return the tables of a result.

    Tables of points have at most `most` rows, by default as many as in the summary.
    """
    name, tables = reported(document).name, list[Table]()
    if name == "path":
        from feti_homog.report.text.path_table import path_table  # with the landmarks of a path

        tables.append(path_table(document, most))
    elif name == "conductivity":
        tables += constant_tables.conductivity(document)
    elif name != "stiffness":
        from feti_homog.report.text import point_tables

        tables += point_tables.TABLES[name](document, most)
    if name in ("stiffness", "envelope"):
        is_spatial = voigt.plane_state_of(document).is_spatial
        if is_spatial and document.get("constants"):
            tables.append(constant_tables.table(document))
        tables += constant_tables.stiffnesses(document)
        if is_spatial:
            tables += [*constant_tables.thermal(document), *constant_tables.cell_constants(document)]
        elif not document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
            tables += [constant_tables.moduli(document), constant_tables.bounds(document)]
    if (tips := document.get("load", document).get("tips")) and tips["load"]:
        from feti_homog.report.text.point_tables import tip_table  # bonded cells have no tips

        tables.append(tip_table(document, tips))
    return [*tables, *constant_tables.sensitivities(document), *phase_tables(document)]


def title_of(document: Document) -> str:
    """Return a title with case name, analysis and plane state."""
    case = document["case"]
    plane = "" if reported(document) == CONDUCTIVITY else f", {voigt.plane_state_of(document).title}"
    return f"{case.get('name', '')}: {reported(document).title}{plane}".lstrip(": ")


def _heading(document: Document) -> list[str]:
    title = title_of(document)
    return [title, "=" * min(len(title), WIDTH)]


def _joined(blocks: Iterable[Sequence[str]]) -> str:
    return "\n\n".join("\n".join(block) for block in blocks if block).replace(GLUE, " ")


def _cell(document: Document) -> list[str]:
    cell, shape = document["cell"], document["case"]["cell"]
    unit = with_micro(document["case"].get("output", {}).get("length_unit", ""))
    size = f"{cell['width']:.6g} x {cell['height']:.6g} {unit}".rstrip()
    shares = [f"{phase} {share:.6f}" for phase, share in cell.get("fractions", {}).items()]
    shares += [f"voids {cell['porosity']:.6f}"] if cell.get("porosity") else []
    meshed = f"fibre fraction {cell['fibre_fraction']:.6f}" + (f" ({', '.join(shares)})" if shares else "")
    mesh = [_number(cell["elements"], "element"), f"{_number(cell['nodes'], 'node')} of subdomains"]
    mesh += [f"order {shape['order']}"] if "order" in shape else []
    if "refine" in shape:
        mesh.append(f"refine {shape['refine']}")
    elif "accuracy" in shape:  # the program chose the mesh by it
        chosen = f"refine {cell['refine']} of mesh_size {cell['mesh_size']:g}"
        mesh.append(f"{chosen} for accuracy = {shape['accuracy']:g}")
    lines = _field("Cell", [str(shape["geometry"]), size]) + _field("Meshed", [meshed])
    if (distance := cell.get("match_distance")) is not None:
        phrases = f"distances of neighbours differ by {distance:.4f} mean diameters"
        lines += _field("Match", [Path(shape["match"]).name, phrases])
    if factors := [fibre["strength"] for fibre in document.get("fibres", ()) if "strength" in fibre]:
        low, high = (f"{end:.4f} (fibre {factors.index(end) + 1})" for end in (min(factors), max(factors)))
        mean = f"{sum(factors) / len(factors):.4f} on average"
        lines += _field("Strengths", [f"{low} to {high} times those of [interface]", mean])
    return lines + _field("Mesh", mesh)


def checks(document: Document) -> Table:
    """Return a table of the largest relative error in every checked law.

    Contact laws apply only to cells with an interface.  A result without tolerances has no verdicts.
    """
    limit = document.get("check_tolerance")
    contact, rows = document.get("kkt_tolerance", limit), list[list[Any]]()
    for law, error in document["checks"].items():
        of_contact = law.startswith("kkt_")
        if error is None or (of_contact and not document["case"].get("interface")):
            continue
        most = contact if of_contact else limit
        rows.append([law, error] if most is None else [law, error, "pass" if error <= most else "FAIL"])
    title = "Checks"
    if limit is not None:
        differs = contact != limit and any("kkt_" in law for law, *_ in rows)
        title += f" (relative, at most {limit:.1e}{f'; of contact {contact:.1e}' if differs else ''})"
    columns = [Column("law", 2 - NAME, indent=0), Column("error", 14, ERROR), Column("", -8, indent=4)]
    return Table(title, columns, rows, abreast=1)


def _field(label: str, phrases: Iterable[str]) -> list[str]:
    """Join the phrases by commas after a label, and wrap them to WIDTH characters."""
    text = ", ".join(phrases).replace(", (", " (")
    return wrap(text, WIDTH, initial_indent=f"{label:<{LABEL}}", subsequent_indent=" " * LABEL, break_long_words=False)


def _number(count: int, name: str) -> str:
    return f"{count:,} {name}{'' if count == 1 else 's'}".replace(",", " ")


def phase_tables(document: Document) -> list[Table]:
    """Return tables of phase stresses and utilisations, at some points of a curve; [] without stresses."""
    phases = document.get("phase_stresses", ())
    if not phases:
        return []
    labels, states = phases[0]["state"], _states(document, len(phases[0]["state"]))
    pairs = [(phase, k) for k in states for phase in phases]
    names = [f"{labels[k]} {phase['phase']}" if len(labels) > 1 else phase["phase"] for phase, k in pairs]
    first = Column("", -max(16, *(len(name) + 2 for name in names)), indent=0)
    unit, width = with_micro(document["case"].get("output", {}).get("length_unit", "")), document["cell"]["width"]
    head = f"at x, y ({unit})" if unit else "at x, y"
    at = Column(head, max(16, len(head) + 1))
    heads = [first, *(column for title in STRESSES.values() for column in (Column(title), at))]
    rows = [
        [name, *(value for measure in STRESSES for value in _entry(phase, measure, k, width))]
        for name, (phase, k) in zip(names, pairs, strict=True)
    ]
    loads = ""
    if labels[0].split()[-1] in voigt.SPATIAL_STRAINS:
        loads = f", under one unit strain{' or temperature' if 'temperature' in labels else ''}, all others 0"
    title = f"Largest stresses of the phases{stress_label(document)}, tension positive{loads}"
    tables = [Table(title, heads, rows, below=_stress_error(document))]
    has_modes, load = any(phase.get("mode") for phase in phases), document["case"].get("load", {}).get("to", {})
    acting = [name for name, value in load.items() if value]
    # Load factors need stresses in proportion to the load.
    has_factors = "path" not in document and not ("temperature" in acting and len(acting) > 1)
    stresses = [name for name in acting if has_factors and acting == [name] and name.startswith("S")]
    heads, notes = [first, Column("criterion", 20), Column("utilisation"), at], list[str]()
    heads += [Column("mode", 20)] if has_modes else []
    if has_factors:
        heads += [Column("load factor"), *(Column(f"at {name}") for name in stresses)]
        alone = "".join(f", at this {name}," for name in stresses)
        notes.append(f"  load factor: at this multiple of the load{alone} the utilisation is 1")
    rows = []
    for name, (phase, k) in zip(names, pairs, strict=True):
        if "criterion" in phase:
            value, place = _entry(phase, "utilisation", k, width)
            row = [name, phase["criterion"], value, place]
            row += [phase["mode"][k] if phase.get("mode") and value else UNKNOWN] if has_modes else []
            row += [1.0 / value if value else UNKNOWN] if has_factors else []
            rows.append([*row, *(load[stress] / value if value else UNKNOWN for stress in stresses)])
    if rows:
        tables.append(Table(f"Utilisation of the strengths{loads}", heads, rows, below=notes))
    return tables


def _stress_error(document: Document) -> list[str]:
    """Return a note on the relative error of stresses, estimated from the energies, in a list; [] without errors."""
    points = [document.get("load", {}), *document.get("path", ()), *document.get("angle", ())]
    energies = [point.get("mesh_error") for point in points] + [(document.get("mesh_error") or {}).get("energy")]
    error = without_noise(max(energy or 0.0 for energy in energies) ** 0.5)
    estimate = f"about {100 * error:.2g} % in the root mean square, at their peaks perhaps more"
    return [f"  mesh error of stresses: {estimate}"] if error else []


def _states(document: Document, count: int) -> Sequence[int]:
    """Return indices below `count` of the states in tables of phase stresses, of a curve at most POINTS points."""
    if "path" in document and "states" in document:
        from feti_homog.results import landmarks  # only paths have landmarks

        return landmarks.landmark_states(document, POINTS, count)
    points = len(document.get("angle", ())) or (count if "path" in document else 1)
    step, loads = -(-points // POINTS), count // points
    return [point * loads + load for point in range(0, points, step) for load in range(loads)]


def _entry(phase: Document, name: str, k: int, width: float) -> tuple[Any, str]:
    """Return the k-th value of a quantity without noise, and "x, y" to 1e-3 of the cell's `width`; "-" for zero."""
    value, digits = without_noise(phase[name][k]), 3 - floor(log10(width))
    x, y = (round(coordinate, digits) + 0.0 for coordinate in phase[f"{name}_at"][k])
    return value, f"{x:.10g}, {y:.10g}" if value else "-"
