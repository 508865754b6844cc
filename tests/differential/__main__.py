"""Run random cases on all ranks of this job and print what failed, and the worst deviation of each relation.

Exit code 1 if a relation fails, too many cases are refused, or of a relation no case of CASES or more was compared.
"""

import argparse
import json
import sys
import tempfile
import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from differential.job import DRAWN_PER_CASE, FAILED, REFUSED, ROWS, RUNS, Row, examine, table
from differential.relations import ALWAYS, DRAWN, RANKS, STRESS_BACK
from feti_homog.api import launch
from feti_homog.system.parallel.mpi_errors import on_root

CASES, SEED = 40, 1
MOST_REFUSED = 0.1  # share of cases that may be refused


def parser() -> argparse.ArgumentParser:
    """Return the words of the command."""
    words = argparse.ArgumentParser(prog="python -m differential", description=__doc__)
    words.add_argument("--cases", type=int, default=CASES, help="how many cases, from --first")
    words.add_argument("--first", type=int, default=0, help="number of the first case")
    words.add_argument("--seed", type=int, default=SEED, help="of all cases")
    words.add_argument("--only", type=int, help="one case by its number, with all its relations")
    words.add_argument("--soft", action="store_true", help="of these, those whose bonds soften")
    words.add_argument("--keep", type=Path, help="a new folder in which the files stay")
    words.add_argument("--merge", type=Path, nargs="+", help="print the table of what runs with --keep left, no more")
    return words


def main(words: argparse.Namespace, comm: Any) -> None:
    """Examine the cases and print what came of them.  Collective."""
    warnings.filterwarnings("ignore", category=RuntimeWarning)
    if words.merge:
        if comm.rank == 0:
            print(table([row for folder in words.merge for row in read(folder)]))
        return
    alone = words.only is not None
    numbers = [words.only] if alone else range(words.first, words.first + words.cases)
    with ExitStack() as stack:
        folder = Path(on_root(comm, lambda: _folder(stack, words.keep)))
        rows = examine(comm, words.seed, numbers, folder, len(DRAWN) if alone else DRAWN_PER_CASE, words.soft)
        comm.barrier()
        if comm.rank == 0:
            print(table(rows), flush=True)
    faults = too_little(rows, sum(row.relation == RUNS for row in rows), comm.size, words.soft)
    if comm.rank == 0 and faults:
        print("\n".join(faults))
    if faults or any(row.verdict == FAILED for row in rows):
        raise SystemExit(1)


def too_little(rows: Sequence[Row], cases: int, ranks: int, soft: bool = False) -> list[str]:
    """List the relations that so many cases left out, and too many refusals; `soft` cases are none of `stress back`."""
    refused = sum(row.relation == RUNS and row.verdict == REFUSED for row in rows)
    asked = {relation.name for relation in (*ALWAYS, *DRAWN, *[RANKS][: ranks - 1])} - (
        {STRESS_BACK} if soft else set()
    )
    missing = asked - {row.relation for row in rows}
    faults = [f"{refused} of {cases} cases were refused"] if refused > MOST_REFUSED * cases + 1 else []
    return faults + [f"no case was compared: {name}" for name in sorted(missing) if cases >= CASES]


def read(folder: Path) -> list[Row]:
    """Return the rows of the cases that a run in this folder finished."""
    return [Row(**row) for path in sorted(folder.glob(f"case-*/{ROWS}")) for row in json.loads(path.read_text())]


def _folder(stack: ExitStack, keep: Path | None) -> str:
    if keep is None:
        return stack.enter_context(tempfile.TemporaryDirectory())
    keep.mkdir(parents=True)
    return str(keep)


if __name__ == "__main__":
    sys.exit(launch(main, parser()))
