"""Cost of an event of a debonding path on a number of ranks: runs, table and cost model.

Seconds of an event = c + N (s + q / p) + messages(p) for N dofs on p ranks.  Least squares over the runs whose ranks
each have a core give c, s and q. The messages were counted on p ranks, the latency was measured between two ranks.
"""

import argparse
import json
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from pathlib import Path
from statistics import median

import numpy as np
from benchmark import job
from scaling_fit import nonnegative

HERE = Path(__file__).parent
# Coarse elements of a fibre are as large in all cells: this mesh size in a cell of one fibre and width 1.
MESH_SIZE = 0.16


@dataclass(frozen=True)
class EventRow:
    """Sizes of a path, and means over its events.

    Means per event: seconds, dual problems, Krylov iterations, collective calls, exchanges of multipliers, and
    kilobytes in and out of the busiest rank in these exchanges.

    `worst` are the seconds of the longest event, `setup` the seconds before the first event; `neighbours` the messages
    of the busiest rank in an exchange; `latency` the seconds of one message.
    """

    fibres: int
    ranks: int
    dofs: int
    events: int
    seconds: float
    worst: float
    setup: float
    solves: float
    iterations: float
    exchanges: float
    collectives: float
    kilobytes: float
    neighbours: int
    latency: float


@dataclass(frozen=True)
class EventModel:
    """Seconds of an event: c, s and q per dof of the whole cell, and the latency of messages."""

    constant: float
    serial: float
    parallel: float
    latency: float

    def messages(self, row: EventRow) -> float:
        """Return the seconds of the counted messages: exchanges, and collective calls of depth log2 p."""
        return self.latency * (row.exchanges * row.neighbours + row.collectives * ceil(log2(row.ranks)))

    def seconds(self, row: EventRow) -> float:
        """Return the seconds of an event with the size and the counts of a row."""
        return self.constant + row.dofs * (self.serial + self.parallel / row.ranks) + self.messages(row)


def fitted(rows: Sequence[EventRow], cores: int) -> EventModel:
    """Return the model by least squares of logarithms.

    Raises:
        ValueError: the timed runs are of one size, or on one number of ranks.
    """
    timed = [row for row in rows if row.ranks <= cores]
    if len({row.fibres for row in timed}) < 2 or len({row.ranks for row in timed}) < 2:
        raise ValueError("the model of events needs two sizes, each on two numbers of ranks with a core each")
    latency = median(row.latency for row in timed if row.ranks > 1)
    counted = EventModel(0.0, 0.0, 0.0, latency)
    columns = np.array([(1.0, row.dofs, row.dofs / row.ranks) for row in timed])
    messages = np.array([counted.messages(row) for row in timed])
    found = nonnegative(columns, np.array([row.seconds for row in timed]), messages)
    return EventModel(*map(float, found), latency)


def study(arguments: argparse.Namespace) -> tuple[bool, list[str]]:
    """Make the missing runs; return whether all succeeded, and the table."""
    rows = [
        row
        for fibres in arguments.event_fibres
        for ranks in arguments.ranks
        if (row := work_off(fibres, ranks, arguments)) is not None
    ]
    complete = len(rows) == len(arguments.event_fibres) * len(arguments.ranks)
    return complete, table(rows, arguments.cores) if rows else []


def work_off(fibres: int, ranks: int, arguments: argparse.Namespace) -> EventRow | None:
    """Return the run of a report, made if missing; None if the run fails."""
    name = f"events_{arguments.events}_of_{fibres}_fibres_ranks_{ranks}.json"
    path = arguments.out / "scaling" / name
    if not path.exists():
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / name
            words = ["--fibres", fibres, "--mesh-size", MESH_SIZE / sqrt(fibres), "--refine", 1]
            words += ["--events", arguments.events]
            fault = job(ranks, [HERE / "scaling_events_tool.py", report, *words], arguments.timeout)
            if fault:
                print(f"events of {fibres} fibres on {ranks} ranks: {fault}", flush=True)
                return None
            path.write_text(report.read_text())
        print(f"events of {fibres} fibres on {ranks} ranks: done", flush=True)
    return EventRow(**json.loads(path.read_text()))


def table(rows: Sequence[EventRow], cores: int) -> list[str]:
    """Return lines: counts of all runs, seconds of runs whose ranks each have a core, and the model for all."""
    lines = [
        "events of debonding paths: on average of an event; kB and messages of the busiest rank, in and out",
        f"{'fibres':>7}{'ranks':>6}{'dofs':>9}{'events':>8}{'problems':>10}{'iterations':>12}{'messages':>10}{'collective':>12}{'kB':>9}"
        f"{'set-up s':>10}{'worst ms':>10}{'ms':>8}{'model':>8}{'error':>8}",
    ]
    try:
        model = fitted(rows, cores)
    except ValueError as error:
        return [*lines, f"no model: {error}"]
    for row in sorted(rows, key=lambda row: (row.fibres, row.ranks)):
        forecast = model.seconds(row)
        if row.ranks <= cores:
            times = f"{row.setup:10.2f}{1e3 * row.worst:10.1f}{1e3 * row.seconds:8.1f}"
            error = f"{forecast / row.seconds - 1.0:+8.0%}"
        else:
            times, error = f"{'-':>10}{'-':>10}{'-':>8}", f"{'-':>8}"
        lines.append(
            f"{row.fibres:7}{row.ranks:6}{row.dofs:9}{row.events:8}{row.solves:10.1f}{row.iterations:12.1f}"
            f"{row.exchanges * row.neighbours:10.0f}{row.collectives:12.1f}{row.kilobytes:9.1f}"
            f"{times}{1e3 * forecast:8.1f}{error}"
        )
    return [
        *lines,
        f"model: milliseconds of an event = {1e3 * model.constant:.2f} + dofs / 1000 ({1e6 * model.serial:.3f} + "
        f"{1e6 * model.parallel:.3f} / ranks) + messages of {1e6 * model.latency:.1f} microseconds",
    ]
