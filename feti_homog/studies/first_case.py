"""Text for `feti-homog check`: a case, or the first case of a sweep."""

import json
from pathlib import Path
from typing import Any

from feti_homog.analysis import description
from feti_homog.case import cases, sections
from feti_homog.errors import CaseError
from feti_homog.studies import sweep_cases
from feti_homog.studies.sweep_cases import Sweep, case_names
from feti_homog.system.parallel import mpi_errors
from feti_homog.system.petsc import options_database
from feti_homog.typing import Intracomm


def of_document(document: dict[str, Any], folder: Path, comm: Intracomm) -> str:
    """Describe a case, or a sweep with its first case; empty except on rank 0.  Collective.

    Raises:
        CaseError, MeshError: the document is faulty, or the cell of its first case.
    """
    if sections.SWEEP not in document:
        return description.describe(mpi_errors.on_root(comm, cases.parse, document, folder), comm)
    sweep = mpi_errors.on_root(comm, sweep_cases.expand, document, folder)
    points = len({entry.point for entry in sweep.entries})
    heading = f"sweep      {len(sweep.cases)} cases, {points} points, all of them valid; the first:"
    return first_of(sweep, heading, comm)


def first_of(sweep: Sweep, heading: str, comm: Intracomm) -> str:
    """Return a heading and the description of the first case.  Collective.  Raises as `describe`."""
    check_options(sweep)
    text = description.describe(sweep.cases[0], comm)
    return f"{heading}\n{text}" if comm.rank == 0 else ""


def check_options(sweep: Sweep) -> None:
    """Raise CaseError with all faulty PETSc options, each with its cases."""
    numbers_by_options = dict[str, list[int]]()
    for entry, case in zip(sweep.entries, sweep.cases, strict=True):
        numbers_by_options.setdefault(json.dumps(case.petsc, sort_keys=True), []).append(entry.number)
    faults = []
    for options, numbers in numbers_by_options.items():
        try:
            with options_database.case_options(json.loads(options)):
                pass
        except CaseError as error:
            faults += [f"{case_names(numbers)}: {fault}" for fault in error.faults]
    if faults:
        raise CaseError(*faults)
