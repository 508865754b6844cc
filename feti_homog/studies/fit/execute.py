"""Running a fit: every evaluation is a sweep of its tests, kept in a folder of its own, so that a fit resumes.

DIR/evaluation-0001           as of a sweep: a case for each test
DIR/differences-0001          the same at values beside those of an evaluation, where no derivative is exact
DIR/fit.json, measured.csv, fit.png
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feti_homog.errors import ConvergenceError
from feti_homog.results import output_folder
from feti_homog.studies.fit import estimation, files
from feti_homog.studies.fit.description import DIGITS, Fit
from feti_homog.studies.fit.estimation import Estimates
from feti_homog.studies.fit.predictions import exact_derivatives, predicted
from feti_homog.studies.sweep import execute, store
from feti_homog.studies.sweep.plan import Sweep
from feti_homog.system.parallel.mpi_errors import on_root, on_root_only
from feti_homog.system.runtime.standard_streams import complain, say
from feti_homog.typing import Float

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

Point = tuple[float, ...]
DIFFERENCE = 0.01  # of a value, or of the width of its bounds where it is 0: meshes differ on both sides


def run(fit: Fit, directory: Path, comm: Intracomm, ranks_per_case: int, retry: bool, quiet: bool) -> dict[str, Any]:
    """Run a fit, or go on with it, and return the content of fit.json on every rank.  Collective.

    Raises:
        CaseError: the folder is of another fit, holds files of others, or another run writes there; a test has not what
            was measured.
        ConvergenceError: a case failed, or there is no minimum, or unknowns that the data do not determine; in the
            latter cases the files are written.
    """
    execute.check_groups(comm, ranks_per_case)
    on_root(comm, output_folder.usable, directory)
    digest = on_root(comm, fit.digest)
    with output_folder.held(directory, comm, lambda line: complain(line) if comm.rank == 0 else None):
        on_root(comm, files.begin, directory / files.NAME, digest)
        if comm.rank == 0 and not quiet and (line := fit.axes()):
            say(f"remark: {line}")
        estimates = Evaluations(fit, directory, comm, ranks_per_case, retry, quiet).estimate()
        document = on_root(comm, files.write, directory, digest, fit, estimates)
    if comm.rank == 0 and not quiet:
        say(files.text(document))
    if document["faults"]:
        raise ConvergenceError(*document["faults"])
    return dict(document)


@dataclass(frozen=True)
class Answer:
    """The content of result.json of a test, and (m,) what it has in place of the data of the test."""

    document: Mapping[str, Any]
    values: Float


@dataclass
class Evaluations:
    """Values of the data and their derivatives at values of the unknowns; rank 0 asks, all ranks compute.

    Attributes:
        answers: on rank 0 those of all tests by the values of the unknowns, in the order of the evaluations.
    """

    fit: Fit
    directory: Path
    comm: Intracomm
    ranks_per_case: int
    retry: bool
    quiet: bool
    answers: dict[Point, list[Answer]] = field(default_factory=dict)

    def estimate(self) -> Estimates | None:
        """Return the estimates on rank 0.  Collective: the other ranks serve its questions."""
        if self.comm.rank:
            while (wanted := self.comm.bcast(None)) is not None:
                self._run(*wanted)
            return None
        unknowns = [*self.fit.unknowns.values()]
        y, std = (np.array([getattr(datum, name) for datum in self.fit.data]) for name in ("value", "std"))
        start, *bounds = (np.array([getattr(u, name) for u in unknowns]) for name in ("start", "lower", "upper"))
        found = estimation.estimate(self.values, self.jacobian, (y, std), start, (bounds[0], bounds[1]))
        self.comm.bcast(None)
        return found

    def values(self, x: Float) -> Float:
        """(m,) values of the data where the unknowns are x (n,).  On rank 0."""
        key = _rounded(x)
        if key not in self.answers:
            number = len(self.answers) + 1
            self.answers[key] = self._ask(f"evaluation-{number:04d}", [(t, key) for t in range(len(self.fit.tests))])
            self._print(number, key)
        return np.concatenate([answer.values for answer in self.answers[key]])

    def jacobian(self, x: Float) -> Float:
        """(m, n) their derivatives: those of results, by differences where a result has none.  On rank 0."""
        key, names = _rounded(x), [*self.fit.unknowns]
        found = np.zeros((len(self.values(x)), len(key)))
        missing = list[tuple[int, int]]()
        for (test, answer), (k, name) in product(enumerate(self.answers[key]), enumerate(names)):
            column = exact_derivatives(answer.document, self.fit.data_of(test), name)
            if column is None:
                missing.append((test, k))
            else:
                found[self.fit.rows_of(test), k] = column
        if missing:
            self._add_differences(key, missing, found)
        return found

    def _add_differences(self, key: Point, missing: Sequence[tuple[int, int]], found: Float) -> None:
        """Set columns of tests by differences of cases beside x, within the bounds."""
        wanted = [(test, side) for test, k in missing for side in self._beside(key, k)]
        answers = self._ask(f"differences-{[*self.answers].index(key) + 1:04d}", wanted)
        for n, (test, k) in enumerate(missing):
            (below, above), ((_, low), (_, high)) = answers[2 * n : 2 * n + 2], wanted[2 * n : 2 * n + 2]
            found[self.fit.rows_of(test), k] = (above.values - below.values) / (high[k] - low[k])

    def _beside(self, key: Point, k: int) -> list[Point]:
        """Return x with its k-th value less and more, within its bounds."""
        unknown = [*self.fit.unknowns.values()][k]
        step = DIFFERENCE * (abs(key[k]) or unknown.upper - unknown.lower)
        ends = max(key[k] - step, unknown.lower), min(key[k] + step, unknown.upper)
        return [_rounded([*key[:k], end, *key[k + 1 :]]) for end in ends]

    def _ask(self, name: str, wanted: Sequence[tuple[int, Point]]) -> list[Answer]:
        self.comm.bcast((name, wanted))
        return self._run(name, wanted)

    def _run(self, name: str, wanted: Sequence[tuple[int, Point]]) -> list[Answer]:
        """Run the cases of tests at values of the unknowns; returns their results on rank 0.  Collective."""
        sweep = on_root(self.comm, self.fit.cases, wanted)
        folder = self.directory / name
        execute.run_all(sweep, folder, self.comm, self.ranks_per_case, self.retry, quiet=True)
        return on_root_only(self.comm, self._answers, folder, sweep, [test for test, _ in wanted]) or []

    def _answers(self, folder: Path, sweep: Sweep, tests: Sequence[int]) -> list[Answer]:
        """Return the answers of every case of a finished sweep."""
        documents = [store.case_state(folder, entry).document or {} for entry in sweep.entries]
        pairs = zip(documents, tests, strict=True)
        return [Answer(document, predicted(document, self.fit.data_of(test))) for document, test in pairs]

    def _print(self, number: int, key: Point) -> None:
        if not self.quiet:
            values = zip(self.fit.unknowns, key, strict=True)
            say(f"evaluation {number}: {', '.join(f'{name} = {value:.6g}' for name, value in values)}")


def _rounded(x: Sequence[float] | Float) -> Point:
    """Return x to the digits of its cases."""
    return tuple(float(f"{value:.{DIGITS}g}") for value in x)
