"""Compute the scatter of results due to uncertain inputs, beside the scatter of random cells and the mesh error.

Derivatives are exact where results have them, else central differences of runs one standard deviation off the mean.
A random cell may change its arrangement between these runs: then the slopes have a large standard error over the cells.

DIR/means                     sweep folder: the case, or all realisations of a random cell
DIR/differences               sweep folder: two cases for each number without exact derivatives
DIR/uncertainty.json          the answer: standard deviations, derivatives, shares of the numbers
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.case import sections, toml_files
from feti_homog.errors import CaseError
from feti_homog.report.text import constant_tables, study_tables
from feti_homog.results import landmarks
from feti_homog.schema import wording
from feti_homog.studies.axes import Assignment, read_points
from feti_homog.studies.predictions import Datum, exact_derivatives, responses
from feti_homog.studies.study import SILENT, Evaluator, Study
from feti_homog.studies.sweep_cases import Sweep, cases_at
from feti_homog.studies.uncertain_numbers import SECTIONS, Uncertainty, number_at, read_uncertainty
from feti_homog.system.parallel import mpi_errors
from feti_homog.typing import Float

Documents = Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class ScatterStudy(Study):
    """A study of the scatter that the uncertain numbers of a case cause; `means` has their means by dotted key."""

    KIND, FILE = "study of scatter", "uncertainty.json"
    ENTRIES = re.compile(r"uncertainty\.json|means|differences")

    uncertainty: Uncertainty
    means: Mapping[str, float]
    realisations: int | None

    def cases(self, points: Sequence[Assignment], **output: bool) -> Sweep:
        """Return all realisations at points of the inputs; keywords set keys of [output].  Raises CaseError."""
        document = {**self.document, "output": self.document["output"] | output}
        return cases_at(document, points, self.folder, self.realisations, section=sections.UNCERTAINTY)

    def first_cases(self) -> Sweep:
        return self.cases([{}])

    def differing(self, names: Sequence[str]) -> Sweep:
        """Return two cases for each of `names`: a standard deviation below and above its mean, others at means."""
        ends = [(name, self.means[name] + sign * self.uncertainty.std[name]) for name in names for sign in (-1, 1)]
        return self.cases([{tuple(name.split(".")): end} for name, end in ends], mesh_error=False)

    def identity(self, cases: list[str]) -> Any:
        return [cases, self.uncertainty.to_table()]

    def heading(self) -> str:
        numbers = f"{len(self.means)} uncertain numbers"
        return f"scatter    {numbers}, for `feti-homog uncertainty`; the case at their means:"

    def answer(self, evaluator: Evaluator) -> dict[str, Any]:
        comm = evaluator.comm
        means = evaluator.results("means", mpi_errors.on_root(comm, self.first_cases))

        def without_derivatives() -> list[str]:
            data = _data(means)
            stds = self.uncertainty.std
            return [name for name in stds if any(exact_derivatives(document, data, name) is None for document in means)]

        inexact = mpi_errors.on_root(comm, without_derivatives)
        ends = evaluator.results("differences", mpi_errors.on_root(comm, self.differing, inexact)) if inexact else []
        return mpi_errors.on_root(comm, self._content, means, inexact, ends)

    def text(self, document: Mapping[str, Any]) -> str:
        return study_tables.scatter_text(document)

    def _content(self, means: Documents, inexact: Sequence[str], ends: Documents) -> dict[str, Any]:
        """Return the content of uncertainty.json without its digest and warnings.

        `ends` are results one standard deviation below and above the means of the `inexact` numbers.
        """
        data, uncertainty, count = _data([*means, *ends]), self.uncertainty, len(means)
        values, mesh_errors = _values(means, data), [constant_tables.mesh_errors(document) for document in means]
        sides = _values(ends, data).reshape(count, len(inexact), 2, len(data))
        slopes, bends = np.zeros((count, len(data), len(uncertainty.std))), np.zeros((len(data), len(uncertainty.std)))
        for k, (name, std) in enumerate(uncertainty.std.items()):
            if name in inexact:
                below, above = np.moveaxis(sides[:, inexact.index(name)], 1, 0)
                slopes[:, :, k] = (above - below) / (2 * std)
                bends[:, k] = ((above + below) / 2 - values).mean(axis=0)
            else:
                slopes[:, :, k] = [exact_derivatives(document, data, name) for document in means]
        J = slopes.mean(axis=0)
        errors = slopes.std(axis=0, ddof=1) / count**0.5 if count > 1 else None
        deviations, shares = uncertainty.propagated(J)
        of_cells = values.std(axis=0, ddof=1) if count > 1 else np.zeros(len(data))

        def mean_error(name: str) -> float | None:
            estimates = [errors.get(name) for errors in mesh_errors]
            return None if None in estimates else float(np.mean(np.array(estimates, float)))

        return {
            "status": "done",
            "name": self.name,
            "stress_unit": str(self.document["output"].get("stress_unit", "")),
            "parameters": [
                {"name": name, "mean": self.means[name], "std": std,
                 "by": "differences" if name in inexact else "derivatives"}
                for name, std in uncertainty.std.items()
            ],
            "correlation": uncertainty.matrix().tolist(),
            "cells": count,
            "results": [
                {"name": datum.name, "value": float(values[:, k].mean()), "std_inputs": float(deviations[k]),
                 "std_cells": float(of_cells[k]) if count > 1 else None,
                 "std": float(np.hypot(deviations[k], of_cells[k])), "mesh_error": mean_error(datum.name),
                 "derivatives": J[k].tolist(), "derivative_errors": None if errors is None else errors[k].tolist(),
                 "bends": bends[k].tolist(), "shares": shares[k].tolist()}
                for k, datum in enumerate(data)
            ],
        }  # fmt: skip


def load(path: Path) -> ScatterStudy:
    """Load a study of scatter from a file.  Raises CaseError with the faults of the file."""
    return parse(toml_files.read_document(path), path.parent)


def parse(values: Mapping[str, Any], folder: Path) -> ScatterStudy:
    """Build a study of scatter from a document, with file names relative to `folder`.  Raises CaseError like `load`."""
    document, faults = {"name": "case", **toml_files.to_document(values)}, list[str]()
    settings = sections.SweepSection()
    if sections.SWEEP in document:
        points, settings = read_points(document.pop(sections.SWEEP), faults)
        if not faults and any(points):
            faults.append(f"[{sections.SWEEP}]: expected realisations alone")
    uncertainty = read_uncertainty(document, faults)
    output = document.setdefault("output", {})
    if not isinstance(output, dict):
        faults.append(f"output = {wording.toml_value(output)}: expected a section [output]")
    if not uncertainty.std and not faults:
        faults.append("expected KEY = {mean, std} in place of some number")
    if faults:
        raise CaseError(*faults)
    output |= SILENT
    case = cases_at(document, [{}], folder).cases[0]
    places = {name.partition(".")[0] for name in uncertainty.std}
    # No derivatives of utilisations exist.
    is_utilised = case.analysis.type == "load" and any(material.strength for material in case.materials.values())
    is_differentiable = case.analysis.type in sections.DIFFERENTIABLE and not is_utilised
    if is_differentiable and (places & {*SECTIONS} or "cell.fibre_fraction" in uncertainty.std):
        output["sensitivities"] = True
    means = {name: number_at(document, tuple(name.split("."))) or 0.0 for name in uncertainty.std}
    study = ScatterStudy(document, folder, uncertainty, means, settings.realisations)
    for name, std in uncertainty.std.items():  # cases one standard deviation from the means
        if not output.get("sensitivities") or name.partition(".")[0] not in SECTIONS:
            try:
                study.differing([name])
            except CaseError as error:
                place = f"[{sections.UNCERTAINTY}] {name} = {means[name]:g} +- {std:g}"
                faults += [f"{place}: {fault}" for fault in error.faults]
    if faults:
        raise CaseError(*faults)
    return study


def is_study(values: Mapping[str, Any]) -> bool:
    """Return whether a document has a section [uncertainty] or uncertain numbers, sound or faulty."""
    document = toml_files.to_document(values)
    with_means = dict(document)
    read_uncertainty(with_means, [])
    return with_means != document


def _data(documents: Documents) -> list[Datum]:
    """Name the numbers that all results have, as data without values.

    Of paths these are only loads and the components at the peak.  Raises CaseError if only some paths break or fall.
    """
    named = [responses(document) for document in documents]
    names = [name for name in named[0] if all(name in values for values in named)]
    if "path" in documents[0]:  # others are largest at other points, or differ from zero by the mesh alone
        peak = landmarks.peak_of(documents[0])
        breaks = {"onset_load_factor" in values for values in named}
        falls = {"stress_left" in landmarks.peak_of(document) for document in documents}
        if len(breaks) > 1 or len(falls) > 1:
            raise CaseError("[path]: bonds break, or the stress falls, in some runs and not in others; load it further")
        ends = "load_factor", "temperature", peak["stress_name"], peak["strain_name"]
        names = [n for n in names if n.partition("_")[2] in ends and any(values[n] for values in named)]
    return [Datum(0, name, 0.0, 1.0) for name in names]


def _values(documents: Documents, data: Sequence[Datum]) -> Float:
    """Return the values (r, n) of n data in each of r results."""
    named = [responses(document) for document in documents]
    return np.array([[values[datum.name] for datum in data] for values in named], float)
