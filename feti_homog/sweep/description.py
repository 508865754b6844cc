"""What `feti-homog check` says of a file: that of a case, or of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from feti_homog.case import case as cases
from feti_homog.case.document import read_document
from feti_homog.case.sweep_section import SWEEP
from feti_homog.homogenization.cell_description import describe
from feti_homog.parallel.mpi_errors import on_root
from feti_homog.petsc.options import case_options
from feti_homog.sweep import plan

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


import json

from feti_homog.errors import CaseError
from feti_homog.sweep.plan import Sweep, case_names


def of_file(path: Path, comm: Intracomm) -> str:
    """Describe the run: the case, or the cases of a sweep and the first one; empty except on rank 0.  Collective.

    Raises:
        CaseError, MeshError: the file is faulty, or the cell of its first case.
    """
    document = on_root(comm, read_document, path)
    if SWEEP in document:
        sweep = on_root(comm, plan.load, path)
        check_options(sweep)
        case, points = sweep.cases[0], len({entry.point for entry in sweep.entries})
        words = f"sweep      {len(sweep.cases)} cases, {points} points, all of them valid; the first:\n"
    else:
        case, words = on_root(comm, cases.load, path), ""
    with case_options(case.petsc):
        text = describe(case, comm)
    return f"{words}{text}" if comm.rank == 0 else ""


def check_options(sweep: Sweep) -> None:
    """Raise CaseError with the faults of the options of all cases, each with the cases that have it."""
    numbers_by_options = dict[str, list[int]]()
    for entry, case in zip(sweep.entries, sweep.cases, strict=True):
        numbers_by_options.setdefault(json.dumps(case.petsc, sort_keys=True), []).append(entry.number)
    faults = []
    for options, numbers in numbers_by_options.items():
        try:
            with case_options(json.loads(options)):
                pass
        except CaseError as error:
            faults += [f"{case_names(numbers)}: {fault}" for fault in error.faults]
    if faults:
        raise CaseError(*faults)
