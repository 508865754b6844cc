"""Run random cases on all ranks of a job and check the relations that each draws.

First each rank takes cases for itself, as it comes to them; then all ranks, if there are more, solve cases together.
"""

import json
import os
import traceback
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from differential.paths import document_of
from differential.random_cases import ON_ALL_RANKS, RELATIONS, Drawn, draw, stream
from differential.random_softening import softens
from differential.relations import ALWAYS, DRAWN, RANKS, Relation, Setting
from feti_homog import run
from feti_homog.errors import CaseError, FetiHomogError, MeshError, NotCarriedError
from feti_homog.system.parallel.mpi_errors import end_job, on_root

# Relations that a case draws, and the share of cases that try one of these on all ranks.  Of the other cases all ranks
# solve every EVERY_TOGETHER-th.
DRAWN_PER_CASE = 2
SHARE_ON_ALL_RANKS = 0.25
EVERY_TOGETHER = 2
# Of a path that ends since nothing carries the stresses any more, or faces with friction cannot go on.
NOT_CARRIED = "prescribe strains there", "friction: "
HELD, REFUSED, FAILED = "held", "refused", "FAILED"
RUNS = "runs"
ROWS = "rows*.json"  # of a case, in its folder


@dataclass(frozen=True)
class Row:
    """The outcome of a relation of a case; `verdict` is HELD, REFUSED or FAILED."""

    number: int
    relation: str
    verdict: str
    deviation: float = 0.0
    tolerance: float = 0.0
    words: str = ""
    note: str = ""


def examine(
    comm: Any, seed: int, numbers: Sequence[int], folder: Path, of_each: int = DRAWN_PER_CASE, soft: bool = False
) -> list[Row]:
    """Return the rows of all cases, if `soft` of those whose bonds soften, on every rank.

    Collective; `folder` is one that all ranks see.
    """
    from mpi4py import MPI

    own: list[Row] = []
    for number in numbers:
        if _claimed(folder, number):
            found = _alone(MPI.COMM_SELF, seed, number, folder / f"case-{number}", of_each, soft)
            if found:
                report(seed, found, folder)
            own += found
    rows = [row for of_rank in comm.allgather(own) for row in of_rank]
    ran = sorted(row.number for row in rows if row.relation == RUNS and row.verdict == HELD)
    for number in ran if comm.size > 1 else []:
        if len(numbers) > 1 and number % EVERY_TOGETHER and not _tries_more(stream(seed, number, ON_ALL_RANKS)):
            continue
        try:
            found = _together(comm, seed, number, folder / f"case-{number}")
            if comm.rank == 0:
                report(seed, found, folder)
            rows += found
        except Exception as error:  # of one rank, perhaps: the others wait
            print(f"case {number} of seed {seed}, on {comm.size} ranks", flush=True)
            end_job(comm, error)
    return sorted(rows, key=lambda row: row.number)


def _claimed(folder: Path, number: int) -> bool:
    """Return True if this rank is the first that comes to a case."""
    try:
        os.close(os.open(folder / f"claimed-{number}", os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        return False
    return True


def _alone(comm: Any, seed: int, number: int, folder: Path, of_each: int, soft: bool) -> list[Row]:
    """Return the rows of a case on one rank, none of one that is not wanted."""
    folder.mkdir()
    try:
        drawn = draw(seed, number, folder)
        if soft and not softens(drawn.document):
            return []
        run(drawn.case, comm, out=folder / "out")
    except Exception as error:
        return [_of_error(number, RUNS, error, (CaseError, MeshError, NotCarriedError))]
    rows, base = [Row(number, RUNS, HELD)], document_of(folder / "out")
    for relation in (*ALWAYS, *chosen(stream(seed, number, RELATIONS), drawn, base, of_each)):
        rows.append(_checked(comm, relation, drawn, base, folder))
    return rows


def chosen(rng: np.random.Generator, drawn: Drawn, base: Any, count: int) -> list[Relation]:
    """Return the relations that a case draws of those that it has, by their weights."""
    having = [relation for relation in DRAWN if relation.applies(drawn, base)]
    weights = np.array([relation.weight for relation in having], float)
    count = min(count, len(having))
    return [having[k] for k in sorted(rng.choice(len(having), count, replace=False, p=weights / weights.sum()))]


def _tries_more(rng: np.random.Generator) -> bool:
    """Return True if a case tries another relation on all ranks, by the first number of this stream."""
    return rng.random() < SHARE_ON_ALL_RANKS


def _together(comm: Any, seed: int, number: int, folder: Path) -> list[Row]:
    """Return the rows of a case on all ranks. Collective."""
    drawn, base = Drawn(seed, number, on_root(comm, lambda: draw(seed, number, folder).document), folder), None
    base = on_root(comm, document_of, folder / "out")
    rows = [_checked(comm, RANKS, drawn, base, folder)]
    rng = stream(seed, number, ON_ALL_RANKS)
    if _tries_more(rng):
        rows += [_checked(comm, relation, drawn, base, folder) for relation in chosen(rng, drawn, base, 1)]
    return rows


def _checked(comm: Any, relation: Relation, drawn: Drawn, base: Any, folder: Path) -> Row:
    """Return the row of a relation; random numbers are those of its name. Collective over `comm`."""
    name = f"{relation.name}, {comm.size} ranks" if comm.size > 1 and relation is not RANKS else relation.name
    work = folder / name.replace(" ", "-")
    on_root(comm, lambda: work.mkdir())
    rng = np.random.default_rng([drawn.seed, drawn.number, *relation.name.encode()])
    try:
        found = relation.check(Setting(drawn, base, folder / "out", comm, rng, work))
    except FetiHomogError as error:
        return _of_error(drawn.number, name, error, relation.refusals)
    except Exception as error:
        if comm.size > 1:
            raise
        return _of_error(drawn.number, name, error, ())
    tolerance = relation.tolerance(drawn.rtol)
    verdict = HELD if found.deviation <= tolerance else FAILED
    return Row(drawn.number, name, verdict, found.deviation, tolerance, found.what, found.note)


def _of_error(number: int, relation: str, error: Exception, refusals: tuple[type[Exception], ...]) -> Row:
    """Return the row of a relation, or a case, whose run raised."""
    refused = isinstance(error, refusals) or (
        isinstance(error, FetiHomogError) and any(words in str(error) for words in NOT_CARRIED)
    )
    words = f"{type(error).__name__}: {error}"
    if not isinstance(error, FetiHomogError):
        words = "".join(traceback.format_exception(error))
    return Row(number, relation, REFUSED if refused else FAILED, np.inf, 0.0, words)


def report(seed: int, rows: Sequence[Row], folder: Path) -> None:
    """Leave the rows of one case in its folder, and print what failed: seed, relation, deviation, and the case file."""
    name = "rows.json" if any(row.relation == RUNS for row in rows) else "rows-of-all.json"
    (folder / f"case-{rows[0].number}" / name).write_text(json.dumps([asdict(row) for row in rows]))
    failed = [row for row in rows if row.verdict == FAILED]
    for row in failed:
        off = f"{row.words}: {row.deviation:.1e}, at most {row.tolerance:.1e}"
        print(f"== case {row.number} of seed {seed}: {row.relation}: {off}", flush=True)
    if failed:
        print(case_text(seed, failed[0].number, folder), flush=True)


def case_text(seed: int, number: int, folder: Path) -> str:
    """Return the case file of a case, as TOML."""
    return tomli_w.dumps(_plain(draw(seed, number, folder).document))


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return value.item() if isinstance(value, np.generic) else value


def table(rows: Sequence[Row]) -> str:
    """Return the worst deviation of each relation, and how many cases were compared, in part, or not at all."""
    head = ("relation", "compared", "in part", "refused", "failed", "worst deviation", "/ tolerance", "case", "of")
    known = [RUNS, *(relation.name for relation in (*ALWAYS, RANKS, *DRAWN))]
    names = dict.fromkeys([*known, *sorted({row.relation for row in rows})])
    lines = [head, ("---",) * len(head), *(_line(name, [r for r in rows if r.relation == name]) for name in names)]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def _line(name: str, rows: Sequence[Row]) -> tuple[Any, ...]:
    """Return the line of a relation."""
    compared = [row for row in rows if row.verdict != REFUSED]
    in_part, failed = (sum(map(bool, of)) for of in ([r.note for r in compared], [r.verdict == FAILED for r in rows]))
    counts = (name, len(compared), in_part, len(rows) - len(compared), failed)
    worst = max(compared, key=lambda row: row.deviation, default=None)
    if worst is None or not worst.deviation:
        return (*counts, 0, "", "", "")
    share = worst.deviation / worst.tolerance if worst.tolerance else np.inf
    return (*counts, f"{worst.deviation:.0e}", f"{share:.0e}", worst.number, worst.words.split("\n")[0][:60])
