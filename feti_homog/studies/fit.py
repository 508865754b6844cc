"""Fit unknown constants to measured values; every evaluation is a sweep over the tests, in a separate folder.

DIR/evaluation-0001           sweep folder: a case for each test
DIR/differences-0001          cases for finite differences, where no derivative is exact
DIR/fit.json, measured.csv, fit.png
"""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from feti_homog.case import interface_section, sections, toml_files
from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.materials import engineering_constants, voigt
from feti_homog.report.text import study_tables
from feti_homog.results import atomic, result_json
from feti_homog.studies import estimation
from feti_homog.studies.axes import Assignment, Axis, rounded, sampled_points
from feti_homog.studies.predictions import Datum, exact_derivatives, predicted
from feti_homog.studies.study import SILENT, Evaluator, Study
from feti_homog.studies.sweep_cases import Sweep, cases_at
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.runtime import standard_streams
from feti_homog.typing import Float

STARTS = 12  # including the given start; tests/parallel/test_fit.py has a cohesive law that needs further starts
DIFFERENCE = 0.01  # step / value, or / width of the bounds for a value of 0; smaller steps would see mesh noise
Point = tuple[float, ...]


@dataclass(frozen=True)
class Fit(Study):
    """A least-squares fit of unknown constants to measured values.

    Attributes:
        unknowns: starts and bounds of the unknowns, by dotted key.
        paths: key of each unknown, as a path in the case document.
        tests: changes that each test makes to the case document.
        data: measured values, ordered by test.
    """

    KIND, FILE = "fit", "fit.json"
    ENTRIES = re.compile(r"fit\.(json|png)|measured\.csv|(evaluation|differences)-\d{4,}")

    unknowns: Mapping[str, sections.Unknown]
    paths: Sequence[toml_files.TomlPath]
    tests: Sequence[Assignment]
    data: Sequence[Datum]

    def at(self, x: Sequence[float]) -> Sweep:
        """Return the cases of all tests at the unknowns x (n,).  Raises CaseError with the faults of all cases."""
        return self.cases([(test, x) for test in range(len(self.tests))])

    def cases(self, places: Sequence[tuple[int, Sequence[float]]]) -> Sweep:
        """Return a case for each pair of test number and unknowns (n,).  Raises CaseError with all faults."""

        def set_output(document: dict[str, Any]) -> None:
            """Reduce [output] of a document, in place, to numbers, with derivatives of linear constants."""
            cell, analysis, output = (document.get(name, {}) for name in ("cell", "analysis", "output"))
            if isinstance(output, dict):
                kind = analysis.get("type") if isinstance(analysis, dict) else None
                # Faces in contact may be debonded from the start: arcs, or lines of a user's mesh.
                is_mesh = isinstance(cell, dict) and cell.get("geometry") == "mesh"
                tables = [table for table in interface_section.interface_tables(document) if isinstance(table, dict)]
                touching = [table.get("contact") is not False for table in tables if is_mesh or table.get("debonded")]
                has_derivatives = kind == "conductivity" or (kind == "stiffness" and not any(touching))
                document["output"] = {"mesh_error": False} | output | SILENT | {"sensitivities": has_derivatives}

        points = [self.tests[test] | dict(zip(self.paths, _rounded(x), strict=True)) for test, x in places]
        return cases_at(self.document, points, self.folder, section=sections.UNKNOWN, complete=set_output)

    def first_cases(self) -> Sweep:
        return self.at([unknown.start for unknown in self.unknowns.values()])

    def data_of(self, test: int) -> list[Datum]:
        """Return the measured values of a test."""
        return [datum for datum in self.data if datum.test == test]

    def axes(self) -> str:
        """Return a remark on names in the data that mean something else in ply axes; "" without such names."""
        cases = self.first_cases().cases
        spatial = [datum for datum in self.data if voigt.PLANE_STATES[cases[datum.test].analysis.plane].is_spatial]
        line = engineering_constants.axes_line(name for datum in spatial for name in (datum.name, datum.strain_name))
        return f"[{sections.MEASURED}] {line}" if line else ""

    def identity(self, cases: list[str]) -> Any:
        unknowns = {name: asdict(unknown) for name, unknown in self.unknowns.items()}
        return {"cases": cases, "unknowns": unknowns, "data": [asdict(datum) for datum in self.data]}

    def heading(self) -> str:
        remark = f"remark     {axes}\n" if (axes := self.axes()) else ""
        counts = f"{len(self.unknowns)} unknowns, {len(self.data)} measured values of {len(self.tests)} tests"
        return f"{remark}fit        {counts}; the first at the start:"

    def answer(self, evaluator: Evaluator) -> dict[str, Any]:
        if evaluator.comm.rank == 0 and not evaluator.quiet and (line := self.axes()):
            standard_streams.say(f"remark: {line}")

        evaluations = Evaluations(self, evaluator)

        def write(estimates: estimation.ParameterEstimates) -> dict[str, Any]:
            from feti_homog.studies import pictures  # only a rank that draws loads Matplotlib

            tables, keys = interface_section.interface_tables(self.document), ("teeth", "softening_tolerance")
            steps = next((f"{key} = {table[key]:g}" for table in tables for key in keys if key in table), "")
            document = {"name": self.name, **estimation.fit_document(self.unknowns, self.data, estimates, steps)}
            rows = [[datum[name] for name in estimation.HEAD] for datum in document["measured"]]
            atomic.replace_text(evaluator.directory / "measured.csv", result_json.csv_text([estimation.HEAD, *rows]))
            pictures.draw_fit(evaluator.directory / "fit.png", document, evaluations.answers[_rounded(estimates.x)])
            return document

        return mpi_errors.on_root(evaluator.comm, write, evaluations.estimate())

    def text(self, document: Mapping[str, Any]) -> str:
        return study_tables.fit_text(document, self.axes(), self.first_cases().stress_unit)


def _rounded(x: Sequence[float] | Float) -> Point:
    """Round unknowns as case documents store them, to a tuple that identifies an evaluation."""
    return tuple(map(rounded, x))


@dataclass
class Evaluations:
    """The evaluations of a fit: computed data and derivatives.

    Rank 0 runs the search and asks for evaluations; all ranks compute.

    Attributes:
        answers: on rank 0, unknowns -> result.json of all tests, without failed evaluations.
        folders: on rank 0, unknowns -> folder name, in the order of the evaluations.
        computed: on rank 0, unknowns -> computed data (m,), also for the cases of finite differences.
    """

    fit: Fit
    evaluator: Evaluator
    answers: dict[Point, list[Mapping[str, Any]]] = field(default_factory=dict)
    folders: dict[Point, str] = field(default_factory=dict)
    computed: dict[Point, Float] = field(default_factory=dict)

    def estimate(self) -> estimation.ParameterEstimates | None:
        """Estimate the unknowns on rank 0, which tells other ranks the cases to compute.  Collective.

        Other ranks return None.  All ranks raise CaseError or ConvergenceError if the search fails.
        """
        comm = self.evaluator.comm
        if comm.rank:
            while (question := comm.bcast(None)) is not None:
                if isinstance(question, Exception):
                    raise question
                with suppress(CaseError, ConvergenceError):  # rank 0 has the same error, and decides
                    self._run(*question)
            return None
        try:
            estimates = self._search()
        except (CaseError, ConvergenceError) as error:
            comm.bcast(error)
            raise
        comm.bcast(None)
        return estimates

    def _search(self) -> estimation.ParameterEstimates:
        """Search for the estimates, on rank 0, from the start and, if the fit stays poor, from better points.

        After a CaseError or a chance up to 1 - CONFIDENCE, it begins again at the best of all points and STARTS - 1
        samples; after a misfit, once more at the best point of a simplex, since derivatives mislead where curves jump.
        """
        estimates = None
        y, std = (np.array([getattr(datum, name) for datum in self.fit.data]) for name in ("value", "std"))
        rows = [(unknown.start, unknown.lower, unknown.upper) for unknown in self.fit.unknowns.values()]
        start, low, high = np.array(rows).T

        def residuals(x: Float | Point) -> Float:
            if _rounded(x) not in self.computed:
                with suppress(CaseError, ConvergenceError):
                    self.values(np.array(x))
            return np.asarray((self.computed.get(_rounded(x), np.inf) - y) / std)

        def squares(x: Float | Point) -> float:
            return float(np.square(residuals(x)).sum())

        def better(estimates: estimation.ParameterEstimates, gain: float) -> Point | None:
            best, total = min(self.computed, key=squares), float(np.square(estimates.residuals).sum())
            return best if squares(best) < total - max(gain, estimation.STEP * total) else None

        def search(x: Float | Point) -> estimation.ParameterEstimates:
            estimates = estimation.estimate(self.values, self.jacobian, (y, std), np.array(x), (low, high))
            best = better(estimates, 0.0)
            return replace(estimates, evaluations=len(self.answers)) if best is None else search(best)

        def finished(estimates: estimation.ParameterEstimates) -> estimation.ParameterEstimates:
            if estimates.misfits or all(datum.strain is None for datum in self.fit.data):
                return estimates
            ranged = estimation.with_ranges(estimates, residuals, (y, std), (low, high))
            best = better(estimates, 0.1)  # behind a step of the curve, and not by its roughness
            return replace(ranged, evaluations=len(self.answers)) if best is None else finished(search(best))

        with suppress(CaseError):
            estimates = search(start)
        if estimates is not None and not estimates.is_poor:
            return finished(estimates)
        if not self.evaluator.quiet:
            standard_streams.say("remark: a poor fit, or none, from this start; the next is the best further point:")
        box = [Axis(path, ends=(a, b), log=a > 0.0) for path, a, b in zip(self.fit.paths, low, high, strict=True)]
        for point in sampled_points(box, sections.SweepSection(samples=STARTS - 1)):
            squares(np.array([*point.values()]))
        # Without any sound point the search has the fault of the start again.
        estimates = search(min(self.computed, key=squares, default=tuple(start)))
        if estimates.misfits:
            estimation.descend(squares, start, (low, high))
            estimates = search(min(self.computed, key=squares))
        return finished(estimates)

    def values(self, x: Float) -> Float:
        """Return data (m,) computed at x (n,), once for each x.  Raises CaseError and ConvergenceError.  On rank 0."""
        key = _rounded(x)
        folder = self.folders.setdefault(key, f"evaluation-{len(self.folders) + 1:04d}")
        if key not in self.answers:
            answers = self._ask(folder, [(test, key) for test in range(len(self.fit.tests))])
            self.answers[key] = [document for document, _ in answers]
            self.computed[key] = np.concatenate([values for _, values in answers])
            if not self.evaluator.quiet:
                numbers = ", ".join(f"{name} = {x:.6g}" for name, x in zip(self.fit.unknowns, key, strict=True))
                standard_streams.say(f"evaluation {len(self.folders)}: {numbers}")
        return self.computed[key]

    def jacobian(self, x: Float) -> Float:
        """Return the derivatives (m, n) of the computed data by x (n,), exact or by differences.  On rank 0.

        With a softening law of few teeth, a step may change no value.  This side of the difference is then computed
        again, with the step doubled until a value changes, at most to a tenth of the width of the bounds.
        """
        key, centre = _rounded(x), self.values(x)
        J, unknowns, tests = np.full((len(centre), len(key)), np.nan), self.fit.unknowns, range(len(self.fit.tests))
        for test, (k, name) in product(tests, enumerate(unknowns)):
            column = exact_derivatives(self.answers[key][test], self.fit.data_of(test), name)
            J[[datum.test == test for datum in self.fit.data], k] = np.nan if column is None else column
        bounds = [(unknown.lower, unknown.upper) for unknown in unknowns.values()]
        widths = np.ptp(bounds, axis=1)
        noise = 1e-9 * (np.abs(centre) + [datum.std for datum in self.fit.data])  # rounding, and tolerance of solvers
        inexact = np.flatnonzero(np.isnan(J).any(axis=0)).tolist()
        steps = {(k, side): side * DIFFERENCE * (abs(key[k]) or widths[k]) for k, side in product(inexact, (-1, 1))}

        def end(k: int, step: float) -> Point:
            """Return the unknowns after a step of unknown number k, clipped to its bounds."""
            return _rounded([*key[:k], np.clip(key[k] + step, *bounds[k]), *key[k + 1 :]])

        ends = [end(k, step) for (k, _), step in steps.items()]
        name = self.folders[key].replace("evaluation", "differences")
        answers = iter(self._ask(name, [(test, point) for point in ends for test in tests]) if ends else ())
        self.computed |= {point: np.concatenate([next(answers)[1] for _ in tests]) for point in ends}
        for (k, side), step in steps.items():
            widest = 0.1 * widths[k]
            with suppress(CaseError, ConvergenceError):
                while abs(step) < widest and np.all(abs(self.computed[end(k, step)] - centre) <= noise):
                    step = side * min(2.0 * abs(step), widest)
                    self.values(np.array(end(k, step)))
                    steps[k, side] = step
        for k in inexact:
            low, high = (end(k, steps[k, side]) for side in (-1, 1))
            change = self.computed[high] - self.computed[low]
            slope = change * (np.abs(change) > noise).any() / (high[k] - low[k])
            J[:, k] = np.where(np.isnan(J[:, k]), slope, J[:, k])
        return J

    def _ask(self, name: str, places: Sequence[tuple[int, Point]]) -> list[tuple[dict[str, Any], Float]]:
        self.evaluator.comm.bcast((name, places))
        return self._run(name, places)

    def _run(self, name: str, places: Sequence[tuple[int, Point]]) -> list[tuple[dict[str, Any], Float]]:
        """Run cases in a subfolder; return pairs of result and computed data on rank 0, [] elsewhere.  Collective."""
        comm = self.evaluator.comm
        documents = self.evaluator.results(name, mpi_errors.on_root(comm, self.fit.cases, places))
        data = [self.fit.data_of(test) for test, _ in places]
        pairs = zip(documents, data, strict=False)  # other ranks have no results
        return mpi_errors.on_root_only(comm, lambda: [(r, predicted(r, y)) for r, y in pairs]) or []
