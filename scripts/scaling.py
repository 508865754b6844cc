"""Weak and strong scaling by ranks, cost by size, and a cost model for 64 and 1 024 ranks.

Each run is a separate MPI job: a random cell of fibre fraction 0.6 with gaps of 4 %, cut as by default, solves three
unit strains together to 1e-8.  `multigrid` is the strong study with multigrid (PETSc's GAMG in CG) in place of one
coarse factor by MUMPS, on at most one rank per core; `large` also runs the largest cell on one rank.  `events` runs the
first events of paths of random cells that debond.  With more ranks than cores, iterations and messages count, but times
do not.  `--threshold` holds for all runs of the studies; give such runs a separate folder.  A run with a report in
DIR/scaling is not made again, so that a long list can be worked off in parts.  The tables, the picture and the model
cover all finished runs of the studies.  Remove the folder to measure again.
"""

import argparse
import json
import os
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmark import job
from scaling_events import study as study_events
from scaling_forecast import assumptions, checks, forecast, table, verdict
from scaling_model import Machine, Prediction, measured, network
from scaling_plot import plot
from scaling_report import FACTOR, MULTIGRID, Row, by_ranks, by_size, memory, speedups, write

HERE = Path(__file__).parent
EVENTS = "events"
# Memory of all ranks of a run, over the dofs that are asked for; share of the free memory that is used first.
BYTES_OF_A_DOF, SHARE_USED = 1500, 0.8
STUDIES = {
    "weak": "weak scaling: as many dofs on every rank",
    "strong": "strong scaling: one cell",
    MULTIGRID: "strong scaling with the coarse problem solved by multigrid",
    "sizes": "cost by size: microseconds of a rank per dof",
    "large": "the largest of these cells, on one rank too",
}


class Run(NamedTuple):
    """A cell of about `dofs` dofs, on `ranks` ranks."""

    fibres: int
    dofs: int
    refine: int
    ranks: int
    way: str | None = None

    def report(self, out: Path) -> Path:
        """Return the path of the report."""
        name = f"{self.fibres}_fibres_{self.dofs}_dofs_refine_{self.refine}_ranks_{self.ranks}"
        return out / "scaling" / f"{name}{f'_{self.way}' if self.way else ''}.json"


def main() -> int:
    """Make the runs of the chosen studies; print and write the results of all studies."""
    parser = _parser()
    arguments = parser.parse_args()
    if unknown := set(arguments.studies) - {*STUDIES, EVENTS}:
        parser.error(f"{', '.join(unknown)}: expected some of {', '.join((*STUDIES, EVENTS))}")
    arguments.out.joinpath("scaling").mkdir(parents=True, exist_ok=True)
    runs = planned(arguments)
    wanted = dict.fromkeys(run for study in arguments.studies if study != EVENTS for run in runs[study])
    use_memory(wanted, arguments.out)
    done = [work_off(run, arguments) for run in wanted]
    found = {study: rows_of(study, some, arguments) for study, some in runs.items()}
    if any(found.values()):
        print(*report(found, arguments), sep="\n")
        write(arguments.out / "scaling.csv", found)
    if EVENTS in arguments.studies:
        complete, lines = study_events(arguments)
        print("", *lines, sep="\n")
        done.append(complete)
    return int(not all(done) or any(not row.converged for rows in found.values() for row in rows))


def planned(arguments: argparse.Namespace) -> dict[str, list[Run]]:
    """Return the runs of each study; strong scaling has the cell of weak scaling on most ranks."""
    fibres, dofs, refine, most = arguments.fibres, arguments.dofs, arguments.refine, max(arguments.ranks)
    ladder = [(max(1, round(fibres * size / dofs)), size) for size in arguments.sizes]
    return {
        "weak": [Run(fibres * p, dofs * p, refine, p) for p in arguments.ranks],
        "strong": [Run(fibres * most, dofs * most, refine, p) for p in arguments.ranks],
        MULTIGRID: [
            Run(fibres * most, dofs * most, refine, p, MULTIGRID) for p in arguments.ranks if p <= arguments.cores
        ],
        "sizes": [Run(*cell, refine, arguments.size_ranks) for cell in ladder],
        "large": [Run(*ladder[-1], refine, p) for p in (1, arguments.size_ranks)],
    }


def use_memory(runs: Iterable[Run], out: Path) -> None:
    """Write once to as much memory as the runs without a report need, or to all available memory.

    A virtual machine may need seconds for each gigabyte that it has not used before, which would distort the times of
    the largest runs.
    """
    page, most = os.sysconf("SC_PAGE_SIZE"), max((run.dofs for run in runs if not run.report(out).exists()), default=0)
    there = int(SHARE_USED * page * os.sysconf("SC_AVPHYS_PAGES"))
    np.empty(min(there, BYTES_OF_A_DOF * most), np.uint8)[::page] = 1


def work_off(run: Run, arguments: argparse.Namespace) -> bool:
    """Make a run unless its report exists; the fastest set-up and solve counts.  Return whether it succeeded."""
    path = run.report(arguments.out)
    times = arguments.repeat if run.ranks <= arguments.cores else 1
    if path.exists():
        return True
    best: list[tuple[float, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / path.name
        for _ in range(times):
            words = [HERE / "scaling_tool.py", report, "--fibres", run.fibres, "--dofs", run.dofs]
            words += ["--refine", run.refine, *(["--way", run.way] if run.way else [])]
            words += [] if arguments.threshold is None else ["--threshold", arguments.threshold]
            fault = job(run.ranks, words, arguments.timeout)
            if fault:
                print(f"{run.ranks} ranks, {run.dofs} dofs: {fault}", flush=True)
                return False
            best.append((read(report)[0].solver, report.read_text()))
    seconds, text = min(best)
    path.write_text(text)
    print(f"{run.ranks} ranks, {run.dofs} dofs: {seconds:.1f} s set-up and solve", flush=True)
    return True


def read(path: Path) -> list[Row]:
    """Return the run of a report, or no run without a report."""
    if not path.exists():
        return []
    try:
        return [Row(**json.loads(path.read_text()))]
    except TypeError:
        sys.exit(f"{path}: a report of another version of this study; remove it to have the run made again")


def rows_of(study: str, runs: Sequence[Run], arguments: argparse.Namespace) -> list[Row]:
    """Return the finished runs of a study.

    The largest run of weak scaling also belongs to strong scaling; alone it shows nothing.
    """
    rows = [row for run in runs for row in read(run.report(arguments.out))]
    return rows if study in arguments.studies or len(rows) > 1 else []


def report(found: dict[str, list[Row]], arguments: argparse.Namespace) -> list[str]:
    """Return all tables and the forecast of the model; draw the picture."""
    lines = [line for study, rows in found.items() if rows for line in study_tables(study, rows, arguments.cores)]
    rows = list({(row.dofs, row.ranks, row.way): row for some in found.values() for row in some}.values())
    miscounted = max((row.miscounted for row in rows if row.way == FACTOR), default=0.0)
    try:
        rates, here = measured(rows, arguments.cores), network(rows, arguments.cores)
    except ValueError as error:
        return [*lines, "", f"no cost model: {error}"]
    latency, bandwidth = (arguments.latency, arguments.bandwidth)
    machine = Machine(
        here.latency if latency is None else 1e-6 * latency, here.bandwidth if bandwidth is None else 1e9 * bandwidth
    )
    futures, by_multigrid = forecast(rates, machine), forecast(rates, machine, MULTIGRID) if rates.multigrid else {}
    picture = arguments.out / "scaling.png"
    plot(picture, found, futures)
    return [
        *lines,
        *("", f"counted bytes of multipliers and PETSc's log differ by {miscounted:.1%} at most"),
        *("", *assumptions(rates, machine), "", *checks(rates, here, rows, arguments.cores)),
        *forecast_lines(futures | by_multigrid),
        *("", f"{picture} {arguments.out / 'scaling.csv'}"),
    ]


def forecast_lines(futures: dict[str, list[Prediction]]) -> list[str]:
    """Return a table of each series of predictions, then the parts that limit the scaling."""
    tables = [line for title, series in futures.items() for line in ("", *table(title, series))]
    return [*tables, "", *(line for title, series in futures.items() for line in verdict(title, series))]


def study_tables(study: str, rows: Sequence[Row], cores: int) -> list[str]:
    """Return the tables of one study."""
    tables = by_size(rows) if study == "sizes" else [*by_ranks(rows, cores), *speedups(rows, cores), "", *memory(rows)]
    return ["", STUDIES[study], *tables]


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "studies",
        nargs="*",
        default=["weak", "strong"],
        help="of weak, strong, multigrid, sizes, large, events; by default the first two",
    )
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4, 8, 16])
    parser.add_argument("--dofs", type=int, default=40_000, help="of a rank in weak scaling")
    parser.add_argument("--fibres", type=int, default=4, help="for so many dofs, in all studies")
    parser.add_argument("--refine", type=int, default=3)
    parser.add_argument(
        "--sizes", type=int, nargs="+", default=[100_000, 300_000, 1_000_000, 3_000_000, 10_000_000], help="dofs"
    )
    parser.add_argument("--size-ranks", type=int, default=2, help="ranks for sizes")
    parser.add_argument("--threshold", type=float, metavar="TAU", help="of the coarse space; else the program's")
    parser.add_argument("--event-fibres", type=int, nargs="+", default=[12, 48], help="of the cells that debond")
    parser.add_argument("--events", type=int, default=40, help="of each path, the first so many")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="ranks up to which times count")
    parser.add_argument("--repeat", type=int, default=1, help="the fastest of so many timed runs counts")
    parser.add_argument("--timeout", type=float, default=1800.0, metavar="S", help="seconds that a run may take")
    parser.add_argument("--latency", type=float, metavar="US", help="of the forecast, a message; else as measured here")
    parser.add_argument("--bandwidth", type=float, metavar="GB/S", help="of the forecast; else as measured here")
    parser.add_argument("--out", type=Path, default=Path("results"), metavar="DIR")
    return parser


if __name__ == "__main__":
    sys.exit(main())
