"""`mpirun -n 3 python -m differential [--cases N] [--seed S] [--only NUMBER] [--keep FOLDER]`, with tests/ on PYTHONPATH.

Exit code 1 if a relation fails, or none of a kind was compared in a run of the default length or more.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import warnings
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from differential.job import FAILED, RUNS, case_text, complaints, examine, table
from differential.relations import DRAWN

from feti_homog.api import launch
from feti_homog.common.mpi_errors import on_root

CASES, SEED = 40, 1
MOST_REFUSED = 0.1  # share of cases that may be refused


def parser() -> argparse.ArgumentParser:
    """The words of the command."""
    words = argparse.ArgumentParser(prog="python -m differential", description=__doc__)
    words.add_argument("--cases", type=int, default=CASES, help="how many cases, from --first")
    words.add_argument("--first", type=int, default=0, help="number of the first case")
    words.add_argument("--seed", type=int, default=SEED, help="of all cases")
    words.add_argument("--only", type=int, help="one case by its number, with all its relations")
    words.add_argument("--keep", type=Path, help="a new folder in which the files stay")
    return words


def main(words: argparse.Namespace, comm: Any) -> None:
    """Examine the cases and tell.  Collective."""
    warnings.filterwarnings("ignore", category=RuntimeWarning)
    numbers = [words.only] if words.only is not None else range(words.first, words.first + words.cases)
    of_each = len(DRAWN) if words.only is not None else None
    with ExitStack() as stack:
        folder = Path(on_root(comm, lambda: _folder(stack, words.keep)))
        rows = examine(comm, words.seed, numbers, folder, **({} if of_each is None else {"of_each": of_each}))
        comm.barrier()
        if comm.rank == 0:
            print(complaints(words.seed, rows, lambda number: case_text(words.seed, number, folder)))
            print(table(rows), flush=True)
    refused = sum(row.relation == RUNS and row.verdict != "held" for row in rows)
    missing = {relation.name for relation in DRAWN} - {row.relation for row in rows}
    if comm.rank == 0 and (refused > MOST_REFUSED * len(numbers) + 1 or (missing and len(numbers) >= CASES)):
        print(f"{refused} cases were refused; nothing was compared of: {', '.join(missing) or 'none'}")
    if any(row.verdict == FAILED for row in rows) or refused > MOST_REFUSED * len(numbers) + 1 or (
        missing and len(numbers) >= CASES
    ):  # fmt: skip
        raise SystemExit(1)


def _folder(stack: ExitStack, keep: Path | None) -> str:
    if keep is None:
        return stack.enter_context(tempfile.TemporaryDirectory())
    keep.mkdir(parents=True)
    return str(keep)


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
