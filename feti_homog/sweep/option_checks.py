"""PETSc's options of all cases of a sweep, checked before any of them runs."""

from __future__ import annotations

import json

from feti_homog.errors import CaseError
from feti_homog.petsc.options import case_options
from feti_homog.sweep.plan import Sweep, case_names


def check_options(sweep: Sweep) -> None:
    """Raises CaseError with the faults of the options of all cases, each with the cases that have it."""
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
