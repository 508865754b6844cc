"""Scatter of a result by uncertain numbers of its case, beside that between random cells and the error of the mesh.

Derivatives are those of results where they have exact ones; else differences of whole runs, one standard deviation less
and more.  Random cells of one seed may have other arrangements then: their slopes have a standard error over the cells.

DIR/means                     as of a sweep: the case, of random cells each realisation
DIR/differences               the same with each such number less and more
DIR/uncertainty.json
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from feti_homog.case.document import TomlPath, read_document, to_document
from feti_homog.case.sections import SWEEP
from feti_homog.case.uncertainty import (
    DIFFERENTIABLE,
    SECTIONS,
    UNCERTAINTY,
    Uncertainty,
    number_at,
    read_uncertainty,
    with_number,
)
from feti_homog.errors import CaseError
from feti_homog.report.text.constant_tables import mesh_errors
from feti_homog.results import atomic, output_folder, seals
from feti_homog.schema.wording import toml_value
from feti_homog.studies.fit.files import begin
from feti_homog.studies.fit.predictions import Datum, exact_derivatives, responses
from feti_homog.studies.sweep import description, execute, plan, store
from feti_homog.studies.sweep.plan import Sweep
from feti_homog.studies.sweep.points import Assignment, read_points
from feti_homog.studies.uncertainty.scatter_table import text
from feti_homog.system.parallel.mpi_errors import on_root, on_root_only
from feti_homog.system.runtime.standard_streams import complain, say
from feti_homog.typing import Float
from feti_homog.version import __version__

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

NAME = "uncertainty.json"
OWN = re.compile(r"uncertainty\.json|means|differences")
SILENT = {"fields": False, "pictures": False, "report": False}


@dataclass(frozen=True)
class Study:
    """A case at the means of its uncertain numbers, and its realisations if it is a random cell."""

    document: Mapping[str, Any]
    folder: Path
    uncertainty: Uncertainty
    means: Mapping[str, float]
    realisations: int | None

    def cases(self, points: Sequence[Assignment], **output: bool) -> Sweep:
        """Return the cases at some values, every realisation of each. Raises CaseError with their faults."""
        faults: list[str] = []
        document = {**self.document, "output": self.document["output"] | output}
        documents = plan.case_documents(document, points, self.realisations, faults, UNCERTAINTY)
        if faults:
            raise CaseError(*dict.fromkeys(faults))
        return plan.checked(str(self.document.get("name", "case")), documents, self.folder)

    def beside(self, names: Sequence[str]) -> Sweep:
        """Return the cases with each of these numbers less and more by its standard deviation."""
        ends = [(name, self.means[name] + sign * self.uncertainty.std[name]) for name in names for sign in (-1, 1)]
        points = [dict([with_number(self.document, _path(name), end)]) for name, end in ends]
        return self.cases(points, mesh_error=False)

    def faults_beside(self) -> Iterator[str]:
        """Yield the faults of cases that may be run beside the means."""
        is_exact = bool(self.document["output"].get("sensitivities"))
        for name, std in self.uncertainty.std.items():
            if is_exact and name.partition(".")[0] in SECTIONS:
                continue
            try:
                self.beside([name])
            except CaseError as error:
                place = f"[{UNCERTAINTY}] {name} = {self.means[name]:g} +- {std:g}"
                yield from (f"{place}: {fault}" for fault in error.faults)

    def digest(self) -> str:
        """Short name of the study: the same for the same cases and uncertain numbers."""
        content = [[entry.identity for entry in self.cases([{}]).entries], self.uncertainty.to_table()]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()[:16]


def load(path: Path) -> Study:
    """Return the study of a file. Raises CaseError with its faults."""
    return parse(read_document(path), path.parent)


def parse(values: Mapping[str, Any], folder: Path) -> Study:
    """Return the study of nested dictionaries. Raises CaseError as `load`."""
    document, faults = to_document(values), list[str]()
    realisations = _realisations(document.pop(SWEEP, None), faults)
    uncertainty = read_uncertainty(document, faults)
    output = document.setdefault("output", {})
    if not isinstance(output, dict):
        faults.append(f"output = {toml_value(output)}: expected a section [output]")
    if not uncertainty.std and not faults:
        faults.append("expected KEY = {mean, std} in place of some number")
    if faults:
        raise CaseError(*faults)
    output |= SILENT
    case = plan.checked("case", plan.case_documents(document, [{}], None, []), folder).cases[0]
    places = {name.partition(".")[0] for name in uncertainty.std}
    if case.analysis.type in DIFFERENTIABLE and (places & {*SECTIONS} or "cell.fibre_fraction" in uncertainty.std):
        output["sensitivities"] = True
    means = {name: number_at(document, _path(name)) or 0.0 for name in uncertainty.std}
    study = Study(document, folder, uncertainty, means, realisations)
    if faults := [*study.faults_beside()]:
        raise CaseError(*faults)
    return study


def is_study(values: Mapping[str, Any]) -> bool:
    """Return whether a document has uncertain numbers."""
    document = to_document(values)
    return UNCERTAINTY in document or bool(read_uncertainty(document, []).std)


def of_document(document: Mapping[str, Any], folder: Path, comm: Intracomm) -> str:
    """Describe a study, and its first case at the means; empty except on rank 0.  Collective.

    Raises:
        CaseError, MeshError: the document is faulty, or the cell of its first case.
    """
    study = on_root(comm, parse, document, folder)
    words = f"scatter    {len(study.means)} uncertain numbers, for `feti-homog uncertainty`; the case at their means:"
    return description.first_of(on_root(comm, study.cases, [{}]), words, comm)


def _realisations(table: object, faults: list[str]) -> int | None:
    """Return the realisations that a section [sweep] asks for, and nothing else."""
    if not isinstance(table, dict):
        faults += [] if table is None else [f"{SWEEP} = {toml_value(table)}: expected a section [{SWEEP}]"]
        return None
    points, settings = read_points(table, faults)
    if not faults and any(points):
        faults.append(f"[{SWEEP}]: expected realisations alone")
    return settings.realisations


def run(study: Study, directory: Path, comm: Intracomm, group: int, retry: bool, quiet: bool) -> dict[str, Any]:
    """Run a study, or go on with it, and return the content of uncertainty.json on every rank.  Collective.

    Raises:
        CaseError: the folder is of another study, or another run writes there.
        ConvergenceError: cases failed.
    """
    execute.check_groups(comm, group)
    on_root(comm, output_folder.usable, directory)
    options, digest = (comm, group, retry), on_root(comm, study.digest)
    with output_folder.held(directory, comm, lambda line: complain(line) if comm.rank == 0 else None):
        on_root(comm, begin, directory / NAME, digest, OWN, "study of scatter")
        found = _results(on_root(comm, study.cases, [{}]), directory / "means", *options)
        missing = on_root(comm, _inexact, study, found)
        beside = on_root(comm, study.beside, missing) if missing else None
        others = [] if beside is None else _results(beside, directory / "differences", *options)
        document = {"version": __version__, "digest": digest, "status": "done"}
        document |= on_root(comm, _content, study, found, missing, others)
        on_root_only(comm, atomic.replace_text, directory / NAME, seals.dumps(document))
    if comm.rank == 0 and not quiet:
        say(text(document))
    return dict(document)


def _results(sweep: Sweep, folder: Path, comm: Intracomm, group: int, retry: bool) -> list[Mapping[str, Any]]:
    """Run the cases of a sweep and return their results on rank 0.  Collective."""
    execute.run_all(sweep, folder, comm, group, retry, quiet=True)
    return on_root_only(comm, lambda: [store.case_state(folder, entry).document or {} for entry in sweep.entries]) or []


def _data(documents: Sequence[Mapping[str, Any]]) -> list[Datum]:
    """Return the names that all results have, as data without values."""
    found = [responses(document) for document in documents]
    return [Datum(0, name, 0.0, 1.0) for name in found[0] if all(name in each for each in found)]


def _inexact(study: Study, documents: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the uncertain numbers by which some result has no exact derivative."""
    data = _data(documents)
    return [
        name
        for name in study.uncertainty.std
        if any(exact_derivatives(document, data, name) is None for document in documents)
    ]


def _derivatives(
    study: Study,
    documents: Sequence[Mapping[str, Any]],
    missing: Sequence[str],
    others: Sequence[Mapping[str, Any]],
    data: Sequence[Datum],
) -> Float:
    """(r, n, p) derivatives of n results by p numbers, of r cells."""
    found = list[Any]()
    ends = _table(others, data).reshape(len(documents), len(missing), 2, len(data))
    for name, std in study.uncertainty.std.items():
        if name in missing:
            below, above = np.moveaxis(ends[:, missing.index(name)], 1, 0)
            found.append((above - below) / (2 * std))
        else:
            found.append([exact_derivatives(each, data, name) for each in documents])
    return np.moveaxis(np.array(found, float), 0, 2)


def _content(
    study: Study,
    documents: Sequence[Mapping[str, Any]],
    missing: Sequence[str],
    others: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """Return what is written."""
    data, uncertainty, count = _data([*documents, *others]), study.uncertainty, len(documents)
    values = _table(documents, data)
    slopes = _derivatives(study, documents, missing, others, data)
    J = slopes.mean(axis=0)
    errors = slopes.std(axis=0, ddof=1) / count**0.5 if count > 1 else None
    deviations, shares = uncertainty.propagated(J)
    between = values.std(axis=0, ddof=1) if count > 1 else np.zeros(len(data))
    return {
        "name": str(study.document.get("name", "case")),
        "stress_unit": str(study.document["output"].get("stress_unit", "")),
        "parameters": [
            {"name": name, "mean": study.means[name], "std": std,
             "by": "differences" if name in missing else "derivatives"}
            for name, std in uncertainty.std.items()
        ],
        "correlation": uncertainty.matrix().tolist(),
        "cells": count,
        "results": [
            {"name": each.name, "value": float(values[:, k].mean()), "std_inputs": float(deviations[k]),
             "std_cells": float(between[k]) if count > 1 else None,
             "std": float(np.hypot(deviations[k], between[k])), "mesh_error": _mesh_error(documents, each.name),
             "derivatives": J[k].tolist(), "derivative_errors": None if errors is None else errors[k].tolist(),
             "shares": shares[k].tolist()}
            for k, each in enumerate(data)
        ],
    }  # fmt: skip


def _mesh_error(documents: Sequence[Mapping[str, Any]], name: str) -> float | None:
    """Return the mean estimated error of a constant; None where it is not known."""
    found = [mesh_errors(each).get(name) for each in documents]
    return None if None in found else float(np.mean(np.array(found, float)))


def _table(documents: Sequence[Mapping[str, Any]], data: Sequence[Datum]) -> Float:
    found = [responses(document) for document in documents]
    return np.array([[each[datum.name] for datum in data] for each in found], float)


def _path(name: str) -> TomlPath:
    return tuple(name.split("."))
