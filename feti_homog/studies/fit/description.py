"""A fit file: cases with unknown constants, and what was measured of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from feti_homog.case.case import Case
from feti_homog.case.document import TomlPath, read_document, to_document
from feti_homog.case.loads import TEMPERATURE
from feti_homog.case.sections import CURVE, MEASURED, SWEEP, TEST, UNKNOWN, Unknown
from feti_homog.errors import CaseError
from feti_homog.materials.constants import FORMER, axes_line
from feti_homog.materials.voigt import PLANE_STATES, voigt_names
from feti_homog.results.path_curves import SAME_LOAD
from feti_homog.schema.wording import suggestion, toml_key
from feti_homog.studies.fit.predictions import Datum, available
from feti_homog.studies.fit.reading import FitReader
from feti_homog.studies.sweep import description, plan
from feti_homog.studies.sweep.plan import Sweep
from feti_homog.studies.sweep.points import Assignment
from feti_homog.system.parallel.mpi_errors import on_root

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

DIGITS = 12  # of a value of an unknown, so that a repeated fit makes the same cases
SILENT = {"fields": False, "pictures": False, "report": False}


@dataclass(frozen=True)
class Fit:
    """The unknowns of a fit, by dotted key, its tests as changes of one document, and the data of all tests."""

    name: str
    document: Mapping[str, Any]
    folder: Path
    unknowns: Mapping[str, Unknown]
    paths: Sequence[TomlPath]
    tests: Sequence[Assignment]
    data: Sequence[Datum]

    def at(self, x: Sequence[float]) -> Sweep:
        """Return the cases of all tests where the unknowns are x (n,). Raises CaseError as `cases`."""
        return self.cases([(test, x) for test in range(len(self.tests))])

    def cases(self, wanted: Sequence[tuple[int, Sequence[float]]]) -> Sweep:
        """Return the cases of tests at values of the unknowns.

        Raises:
            CaseError: with the faults of all of them.
        """
        points = [
            self.tests[test] | {path: float(f"{v:.{DIGITS}g}") for path, v in zip(self.paths, x, strict=True)}
            for test, x in wanted
        ]
        faults: list[str] = []
        documents = plan.case_documents(self.document, points, None, faults, UNKNOWN)
        if faults:
            raise CaseError(*dict.fromkeys(faults))
        for each in documents:
            given = each.document.get("output", {})
            if isinstance(given, dict):
                each.document["output"] = {"mesh_error": False} | given | SILENT | {"sensitivities": _is_linear(each)}
        return plan.checked(self.name, documents, self.folder)

    def data_of(self, test: int) -> list[Datum]:
        """Return the data of a test."""
        return [datum for datum in self.data if datum.test == test]

    def rows_of(self, test: int) -> slice:
        """Return the place of the data of a test among all."""
        first = next(k for k, datum in enumerate(self.data) if datum.test == test)
        return slice(first, first + len(self.data_of(test)))

    def axes(self) -> str:
        """Return the axes of measured values that could be of a ply, in a line; empty without any."""
        cases = self.at([each.start for each in self.unknowns.values()]).cases
        spatial = [each for each in self.data if PLANE_STATES[cases[each.test].analysis.plane].is_spatial]
        line = axes_line(name for each in spatial for name in (each.name, each.strain_name))
        return f"[{MEASURED}] {line}" if line else ""

    def digest(self) -> str:
        """Short name of the fit: the same for the same cases, unknowns and data."""
        start = self.at([each.start for each in self.unknowns.values()])
        content = {
            "cases": [entry.identity for entry in start.entries],
            "unknowns": {name: asdict(each) for name, each in self.unknowns.items()},
            "data": [asdict(each) for each in self.data],
        }
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def _is_linear(case: plan.CaseDocument) -> bool:
    """Return whether a case has exact derivatives: a stiffness without contact of debonded faces."""
    analysis = case.document.get("analysis")
    is_stiffness = isinstance(analysis, dict) and analysis.get("type") == "stiffness"
    return is_stiffness and not _may_touch(case.document)


def _may_touch(document: Mapping[str, Any]) -> bool:
    """Return whether faces in contact may be debonded from the start: arcs, or lines of a user's mesh."""
    cell, given = document.get("cell"), document.get("interface", [])
    is_mesh = isinstance(cell, dict) and cell.get("geometry") == "mesh"
    sections = [each for each in (given if isinstance(given, list) else [given]) if isinstance(each, dict)]
    return any(each.get("contact") is not False for each in sections if is_mesh or each.get("debonded"))


def load(path: Path) -> Fit:
    """Return the fit in a file. Raises CaseError with all faults of its tables, or else of its cases."""
    return parse(read_document(path), path.parent)


def parse(values: Mapping[str, Any], folder: Path) -> Fit:
    """Return the fit of nested dictionaries; its files are relative to `folder`. Raises CaseError as `load`."""
    document = to_document(values)
    reader = FitReader(folder)
    unknowns = reader.unknowns(document.pop(UNKNOWN, None))
    measured, tests = document.pop(MEASURED, None), document.pop(TEST, None)
    if SWEEP in document:
        reader.faults.append(f"[{SWEEP}]: a fit has no sweep; expected [[{TEST}]] for each test")
    assignments, data = reader.tests(measured, tests, {*unknowns})
    if unknowns and len(data) < len(unknowns) and not reader.faults:
        reader.faults.append(
            f"[{UNKNOWN}]: {len(unknowns)} unknowns, {len(data)} measured values; expected at least as many values"
        )
    if reader.faults:
        raise CaseError(*reader.faults)
    own = {".".join(path): value for path, value in unknowns.items()}
    fit = Fit(str(document.get("name", "fit")), document, folder, own, [*unknowns], assignments, data)
    faults = [*_case_faults(fit)]
    if faults:
        raise CaseError(*dict.fromkeys(faults))
    return fit


def of_document(document: Mapping[str, Any], folder: Path, comm: Intracomm) -> str:
    """Describe a fit, and its first case at the start; empty except on rank 0.  Collective.

    Raises:
        CaseError, MeshError: the document is faulty, or the cell of its first case.
    """
    fit = on_root(comm, parse, document, folder)
    sweep = on_root(comm, fit.at, [each.start for each in fit.unknowns.values()])
    line = f"remark     {axes}\n" if (axes := on_root(comm, fit.axes)) else ""
    counts = f"{len(fit.unknowns)} unknowns, {len(fit.data)} measured values of {len(fit.tests)} tests"
    return description.first_of(sweep, f"{line}fit        {counts}; the first at the start:", comm)


def _case_faults(fit: Fit) -> Iterator[str]:
    """Yield what is wrong with the cases at the start and at the bounds, and with the names of the data."""
    start = [each.start for each in fit.unknowns.values()]
    cases = fit.at(start).cases
    for test, case in enumerate(cases):
        place = f"[[{TEST}]] {test + 1}, {MEASURED}." if len(cases) > 1 else f"[{MEASURED}] "
        yield from _name_faults(place, case, fit.data_of(test))
    digests = [case.digest() for case in cases]
    for k, (name, unknown) in enumerate(fit.unknowns.items()):
        ends = {"lower": unknown.lower, "upper": unknown.upper}
        lines, changed = list[str](), False
        for word, end in ends.items():
            try:
                changed |= [case.digest() for case in fit.at([*start[:k], end, *start[k + 1 :]]).cases] != digests
            except CaseError as error:
                lines += [f"[{UNKNOWN}] {name}, {word} = {end}: {fault}" for fault in error.faults]
        yield from lines if changed or lines else [f"[{UNKNOWN}] {name}: no measured value depends on it"]


def _name_faults(place: str, case: Case, data: Sequence[Datum]) -> Iterator[str]:
    """Yield what the analysis of a test does not give."""
    known = available(case)
    if not known:
        yield f'[analysis] type = "{case.analysis.type}": a fit takes "stiffness" and "path"'
        return
    yield from _curve_faults(place, case, [each for each in data if each.strain is not None])
    for name in dict.fromkeys(each.name for each in data if each.strain is None):
        if name in FORMER:
            yield f"{place}{toml_key(name)}: its name is {FORMER[name]}"
        elif name not in known:
            yield f"{place}{toml_key(name)}: the analysis does not give it; {suggestion(name, known, {})}"


def _curve_faults(place: str, case: Case, points: Sequence[Datum]) -> Iterator[str]:
    """Yield what the analysis of a test does not give of the points of a measured curve."""
    if not points:
        return
    state = PLANE_STATES[case.analysis.plane]
    known = voigt_names(6 if state.is_spatial else 3)
    unknown = sorted({name for each in points for name in (each.strain_name, each.name)}.difference(*known))
    for name in unknown:
        yield f'{place}{CURVE}: plane = "{case.analysis.plane}" has no {name}'
    if case.analysis.type != "path" or len(case.targets) != 1:
        yield f"{place}{CURVE}: expected an analysis of type path, of one leg"
    elif not unknown and (found := _rising(case.targets[0], state.components)) is not None:
        yield from (f"{place}{CURVE}: {fault}" for fault in _strain_faults(points, *found))


def _strain_faults(points: Sequence[Datum], rising: str, end: float, is_strain: bool) -> Iterator[str]:
    """Yield what is wrong with strains of a curve beside what `_rising` returns."""
    if rising != points[0].strain_name:
        yield f"expected the strain that rises along the path, {rising}"
    elif any((each.strain or 0.0) * end < 0 for each in points):
        yield f"expected strains of the sign of the path, which ends at {end:g}"
    elif is_strain and (most := max(abs(each.strain or 0.0) for each in points)) > abs(end) * (1 + SAME_LOAD):
        yield f"a strain of {most:g} is beyond the end of the path at {abs(end):g}"


def _rising(target: Mapping[str, float], components: Sequence[tuple[str, str]]) -> tuple[str, float, bool] | None:
    """Return the strain that leads along one leg, the load of its component, and whether that is the strain.

    The load is 0 where a temperature beside it decides the sign; None if the strain follows from the answer alone.
    """
    given = [(strain, name, target[name]) for strain, stress in components for name in (strain, stress)
             if target.get(name)]  # fmt: skip
    if given and all(name == strain for strain, name, _ in given):
        strain, _, end = max(given, key=lambda each: abs(each[2]))
        return strain, end, True
    return (given[0][0], 0.0 if target.get(TEMPERATURE) else given[0][2], False) if len(given) == 1 else None
