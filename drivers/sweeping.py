"""Shared parts of the sweep drivers: options, sections, and the steps from cases to tables and pictures."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from figures import EQUATION_38, add_output_options, written
from mpi4py.MPI import Intracomm

from feti_homog import collect_sweep, run_sweep

STIFFNESS = {"material": EQUATION_38, "analysis": {"type": "stiffness", "plane": "strain"}}


def parser(description: str, name: str) -> argparse.ArgumentParser:
    """Return the common options; results go to results/`name` by default."""
    options = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("results") / name, metavar="DIR")
    options.add_argument("--refine", type=int, default=0, help="times that every element is cut in four")
    options.add_argument("--order", type=int, choices=(1, 2), default=2, help="of the elements; 2 are curved")
    options.add_argument("--ranks-per-case", type=int, metavar="R", help="by default all")
    add_output_options(options)
    options.add_argument("--quiet", action="store_true", help="do not print a line for every case")
    return options


def swept(
    given: argparse.Namespace, comm: Intracomm, document: dict[str, Any], report: Callable[[Any], list[str]],
    draw: Callable[[Path, Any], Path] | None = None,
) -> None:  # fmt: skip
    """Run the sweep, print the report of its table, and draw; `draw` adds a picture of the table to a folder."""
    document["output"] = written(given)
    table = run_sweep(document, given.out, comm, ranks_per_case=given.ranks_per_case, retry=True, quiet=given.quiet)
    lines = [*report(table), *collect_sweep(given.out, comm)]
    if comm.rank == 0:
        print(*lines, *([draw(given.out, table)] if draw else []), sep="\n")
