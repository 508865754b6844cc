"""The printed summary of result.json's document."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import floor, log10
from pathlib import Path
from textwrap import wrap
from typing import Any

from feti_homog.case.element_sizes import ASKED
from feti_homog.materials.voigt import SPATIAL_STRESSES, STRAINS, STRESSES
from feti_homog.report.text.constants_tables import constants_blocks
from feti_homog.report.text.envelope_table import envelope_table
from feti_homog.report.text.point_tables import angle_table, load_table, path_table
from feti_homog.report.text.spatial_tables import spatial_blocks
from feti_homog.report.text.tip_tables import angle_tip_table, tip_table

WIDTH = 79
LABEL = 12  # columns of the labels at the left
NAME = 28  # columns of the names of table rows
GLUE = "\N{NO-BREAK SPACE}"  # at which no line is broken
STIFF = ("C11", "C22", "C33")
LISTED = 12  # numbers of iterations that are reported one by one
TITLES = {
    "stiffness": "effective stiffness",
    "angle": "debonding angle",
    "path": "load path",
    "load": "equilibrium under a load",
    "envelope": "onset of debonding",
}
MODULI = ("E1", "E2", "G12", "bulk", "shear")  # in the unit of the stresses; the others are ratios

Document = Mapping[str, Any]


def summary(document: Document) -> str:
    """The document in lines of at most 79 columns, tables of at most 100 (but for long names), without a newline at the
    end.

    Cell, solver, effective stiffness with moduli and bounds or else the points of `angle` or `path`, the state of
    `load`, onsets, checks, timings, memory, warnings and status.
    Keys that it does not know are left out. Raises KeyError if one that it prints is missing.
    """
    blocks = [
        _heading(document),
        [*_cell(document), *_solver(document["solver"])],
        *_answer(document),
        _checks(document),
        [
            *_timings(document["timings"]),
            *_field("Memory", [f"{_bytes(document['memory'])} per rank at most"]),
        ],
        [
            *_remarks("Remark", document.get("remarks", ())),
            *_remarks("Warning", document.get("warnings", ())),
            *_remarks("Fault", document.get("faults", ())),
        ],
        _field("Status", [str(document["status"])]),
    ]
    return _joined(blocks)


def short_summary(document: Document) -> str:
    """What was asked for, the largest error of all checks, and the status."""
    law, error = max(document["checks"].items(), key=lambda check: check[1])
    checks = _field("Checks", [f"largest relative error {error:.1e} ({law})"])
    return _joined([_heading(document), *_answer(document), [*checks, *_field("Status", [str(document["status"])])]])


def title_of(document: Document) -> str:
    """Name, analysis and plane state of the case."""
    case = document["case"]
    what = TITLES[case["analysis"]["type"]]
    return f"{case.get('name', '')}: {what}, plane {case['analysis']['plane']}".lstrip(": ")


def _heading(document: Document) -> list[str]:
    title = title_of(document)
    return [title, "=" * min(len(title), WIDTH)]


def _joined(blocks: Iterable[Sequence[str]]) -> str:
    return "\n\n".join("\n".join(block) for block in blocks if block).replace(GLUE, " ")


def _answer(document: Document) -> list[list[str]]:
    """The blocks of what was asked for."""
    unit = document["case"].get("output", {}).get("stress_unit", "")
    stress = f" ({unit})" if unit else ""
    length = document["case"].get("output", {}).get("length_unit", "")
    toughness = f" ({unit} {length})" if unit and length else ""
    if "angle" in document:
        return [angle_table(document["angle"], stress), angle_tip_table(document["angle"], toughness)]
    if "path" in document:
        return [path_table(document, stress)]
    if "load" in document:
        return [load_table(document, stress), tip_table(document["load"].get("tips"), toughness)]
    onsets = [envelope_table(document, stress)] if "envelope" in document else []
    return onsets + _stiffness_blocks(document, stress, toughness)


def _stiffness_blocks(document: Document, stress: str, toughness: str) -> list[list[str]]:
    """The effective stiffness with what follows from it; units in brackets."""
    if len(document["effective_stiffness"]) == len(SPATIAL_STRESSES):
        tables = [*spatial_blocks(document, stress), *constants_blocks(document, stress)]
        return [*tables, tip_table(document.get("tips"), toughness)]
    blocks = [_matrix(f"Effective stiffness{stress}", document["effective_stiffness"])]
    if "effective_stiffness_compression" in document:
        blocks.append(_matrix(f"Under minus E{stress}", document["effective_stiffness_compression"]))
    if document["case"].get("interface"):  # moduli and bounds are of bonded, linear composites
        return [*blocks, tip_table(document.get("tips"), toughness)]
    return [
        *blocks,
        _moduli(f"Engineering moduli{stress}", document["moduli"]),
        _bounds(f"Bounds{stress}", document) if document.get("bounds") else ["Bounds: none of cells with voids"],
    ]


def _cell(document: Document) -> list[str]:
    cell, case = document["cell"], document["case"]
    unit = case.get("output", {}).get("length_unit", "")
    size = f"{cell['width']:.6g} x {cell['height']:.6g} {unit}".rstrip()
    shape, fractions = case["cell"], cell.get("fractions", {})
    shares = ", ".join(f"{phase} {share:.6f}" for phase, share in fractions.items())
    mesh = [_number(cell["elements"], "element"), _number(cell["nodes"], "node")]
    mesh += [f"order {shape['order']}"] * ("order" in shape) + _sizes(shape, cell)
    shares += f", voids {cell['porosity']:.6f}" if cell.get("porosity") else ""
    return [
        *_field("Cell", [str(shape["geometry"]), size]),
        *_field("Meshed", [f"fibre fraction {cell['fibre_fraction']:.6f}", *([f"({shares})"] if shares else [])]),
        *_match(shape, cell),
        *_field("Mesh", mesh),
    ]


def _sizes(shape: Document, cell: Document) -> list[str]:
    """How often elements were split, and the coarse mesh where the program chose it."""
    if "refine" in shape:
        return [f"refine {shape['refine']}"]
    asked = [f"{name} = {shape[name]:g}" for name in ASKED if name in shape]
    return [f"refine {cell['refine']} of mesh_size {cell['mesh_size']:g} for {asked[0]}"] if asked else []


def _match(shape: Document, cell: Document) -> list[str]:
    """How far the fibres are from those of a table."""
    distance = cell.get("match_distance")
    words = f"distances of neighbours differ by {distance or 0:.4f} mean diameters"
    return [] if distance is None else _field("Match", [Path(shape["match"]).name, words])


def _solver(solver: Document) -> list[str]:
    parts = [_number(solver["ranks"], "rank"), _number(solver["subdomains"], "subdomain")]
    dual = [_number(solver["multipliers"], "multiplier"), f"kernel {solver['kernel_dim']}"]
    return [
        *_field("Solver", [*parts, _number(solver["dofs"], "dof")]),
        *_field("Dual", [*dual, f"coarse problem {solver['coarse_dim']}"]),
        *_factorized(solver),
        *_field("Iterations", _iterations(_listed(solver["iterations"]))),
    ]


def _factorized(solver: Document) -> list[str]:
    if "factorizations" not in solver:
        return []
    coarse = f"coarse problem {_number(solver.get('coarse_factorizations', 0), 'time')}"
    return _field("Factorized", [_number(solver["factorizations"], "subdomain"), coarse])


def _iterations(counts: Sequence[int]) -> list[str]:
    if len(counts) <= LISTED:
        return [str(count) for count in counts]
    if not any(counts):
        return [f"0 in each of {len(counts)} states, for the preconditioner is an inverse"]
    return [f"{min(counts)} to {max(counts)} a state", f"{sum(counts)} for {len(counts)} states"]


def _matrix(title: str, rows: Sequence[Sequence[float]]) -> list[str]:
    # All entries to the digit that is the eighth of the largest.
    largest = max(abs(entry) for row in rows for entry in row)
    form = f".{7 - floor(log10(largest))}f" if 1e-4 < largest < 1e8 else ".7e"
    lines = [f"{title:<{NAME}}" + "".join(f"{name:>16}" for name in STRAINS)]
    for name, row in zip(STRESSES, rows, strict=True):
        lines.append(f"  {name:<{NAME - 2}}" + "".join(f"{_signless(entry, form):>16}" for entry in row))
    return lines


def _moduli(title: str, moduli: Document) -> list[str]:
    stiff = [f"{name:<6}{moduli[name]:>13.7g}" for name in MODULI if name in moduli]
    ratios = [f"{name:<11}{_signless(value, '.6f'):>13}" for name, value in moduli.items() if name not in MODULI]
    count = max(len(stiff), len(ratios))
    pairs = zip(stiff + [""] * (count - len(stiff)), ratios + [""] * (count - len(ratios)), strict=True)
    return [title, *(f"  {left:<30}{right}".rstrip() for left, right in pairs)]


def _bounds(title: str, document: Document) -> list[str]:
    moduli, bounds, here = document["moduli"], document["bounds"], document["effective_stiffness"]
    lines = [f"{title:<{NAME}}{'lower':>14}{'computed':>14}{'upper':>14}"]
    for i, name in enumerate(STIFF):
        lower, upper = bounds["reuss"][i][i], bounds["voigt"][i][i]
        inside = lower - 1e-9 * abs(lower) <= here[i][i] <= upper + 1e-9 * abs(upper)
        note = "" if inside else "  outside"
        lines.append(_between(f"{name} Reuss, Voigt", lower, here[i][i], upper) + note)
    # These hold for isotropic cells only, so a value outside is no fault.
    for name, (lower, upper) in (bounds["hashin_shtrikman"] or {}).items():
        lines.append(_between(f"{name} Hashin-Shtr.", lower, moduli[name], upper))
    return lines


def _between(label: str, lower: float, value: float, upper: float) -> str:
    return f"  {label:<{NAME - 2}}{lower:>14.7g}{value:>14.7g}{upper:>14.7g}"


def _checks(document: Document) -> list[str]:
    """The checks that say anything."""
    shown = {name: error for name, error in document["checks"].items() if check_applies(name, document)}
    tolerance = document.get("check_tolerance")
    limit = "" if tolerance is None else f" (relative, at most {tolerance:.1e})"
    lines = [f"Checks{limit}"]
    contact = document.get("kkt_tolerance", tolerance)
    if any(name.startswith("kkt_") for name in shown) and contact != tolerance:
        lines[0] = lines[0].replace(")", f"; of contact {contact:.1e})")
    for name, error in shown.items():
        tolerance = contact if name.startswith("kkt_") else document.get("check_tolerance")
        verdict = "" if tolerance is None else "pass" if error <= tolerance else "FAIL"
        lines.append(f"  {name:<{NAME - 2}}{error:>14.1e}    {verdict}".rstrip())
    return lines


def check_applies(check: str, document: Document) -> bool:
    """Whether a check says anything: those of contact do not where all is bonded."""
    return not check.startswith("kkt_") or bool(document["case"].get("interface"))


def _timings(timings: Document) -> list[str]:
    stages = [f"{stage}{GLUE}{seconds:.2f}{GLUE}s" for stage, seconds in timings.items()]
    return _field("Time", stages)


def _remarks(label: str, remarks: Iterable[str]) -> list[str]:
    return [line for remark in remarks for line in _field(label, [str(remark)])]


def _field(label: str, words: Sequence[str]) -> list[str]:
    """A label and its words, separated by commas, in as many lines as it takes."""
    text = ", ".join(words).replace(", (", " (")
    return wrap(text, WIDTH, initial_indent=f"{label:<{LABEL}}", subsequent_indent=" " * LABEL, break_long_words=False)


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, list | tuple) else [value]


def _signless(value: float, form: str) -> str:
    """The number, without the sign of a zero that it is rounded to."""
    text = f"{value:{form}}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _number(count: int, name: str) -> str:
    return f"{count:,} {name}{'' if count == 1 else 's'}".replace(",", " ")


def _bytes(size: float) -> str:
    return f"{size / 2**20:.0f} MiB" if size < 2**30 else f"{size / 2**30:.2f} GiB"
