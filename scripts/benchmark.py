"""This program against other solvers, on the same mesh and with the same tolerance.

Each tool is an MPI job of its own that meshes, tears, refines and assembles the case with this program's functions
("mesh", "assemble": the same for all) and then goes its own way: the others glue the subdomains to one periodic
matrix ("glue"), set up and solve for one to three unit strains.  A tool may be followed by @ and its number of
ranks.  Memory is the largest resident memory of each rank, summed over ranks.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmark_report import Row, compare, notes, plot, table, write
from peers import PEERS

HERE = Path(__file__).parent
TOOLS = "feti,cholmod,mumps@1,mumps,gamg,hypre,hypre_rigid,fetidp,bddc"


def main() -> int:
    """Run the tools in turns; print and write what they took."""
    parser = _parser()
    arguments = parser.parse_args()
    if not arguments.case.is_file():
        parser.error(f"{arguments.case}: no such file")
    rows = list(best(arguments).values())
    compare(rows)
    print("", *table(rows), *notes(rows), sep="\n")
    arguments.out.mkdir(parents=True, exist_ok=True)
    files = arguments.out / "benchmark.csv", arguments.out / "benchmark.png"
    write(files[0], rows)
    plot(files[1], rows, f"{arguments.case.stem}, {arguments.loads} loads, rtol {arguments.rtol:g}")
    print(*files)
    return int(any(row.tool == "feti" and row.status != "done" for row in rows))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=Path, nargs="?", default=HERE / "cases/benchmark.toml", metavar="CASE.toml")
    parser.add_argument("--tools", default=TOOLS, type=_tools, help=f"of feti, {', '.join(PEERS)}; default {TOOLS}")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--loads", type=int, choices=(1, 2, 3), default=3, help="unit strains to solve for")
    parser.add_argument("--rtol", type=float, default=1e-8)
    parser.add_argument("--repeat", type=int, default=1, help="the fastest of so many runs of each tool counts")
    parser.add_argument("--timeout", type=float, default=300.0, metavar="S", help="seconds that a run may take")
    parser.add_argument("--out", type=Path, default=Path("results"), metavar="DIR")
    return parser


def _tools(text: str) -> str:
    specs = text.split(",")
    if len(set(specs)) < len(specs):
        raise argparse.ArgumentTypeError(f"{text}: expected each tool once")
    for spec in specs:
        tool, _, ranks = spec.partition("@")
        if tool not in ("feti", *PEERS) or (ranks and not ranks.isdecimal()):
            raise argparse.ArgumentTypeError(f"{spec}: expected one of feti, {', '.join(PEERS)}, or one with @RANKS")
    return text


def best(arguments: argparse.Namespace) -> dict[str, Row]:
    """The fastest run of each tool, or one that did not end well, after which it gets no other.

    The tools take turns, so that none has the quiet minutes of a machine to itself.
    """
    rows: dict[str, Row] = {}
    for _ in range(arguments.repeat):
        for spec in arguments.tools.split(","):
            if spec in rows and rows[spec].status != "done":
                continue
            tool, _, ranks = spec.partition("@")
            alone = tool in PEERS and PEERS[tool].sequential
            row = run(tool, int(ranks or (1 if alone else arguments.ranks)), arguments)
            print(f"{row.name:14}{row.total:9.1f} s  {row.status}", flush=True)
            rows[spec] = min(rows.get(spec, row), row, key=lambda row: (row.status == "done", row.solver))
    return rows


def run(tool: str, ranks: int, arguments: argparse.Namespace) -> Row:
    """One run of a tool."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        words = [HERE / "benchmark_tool.py", tool, arguments.case, report]
        fault = job(ranks, [*words, "--loads", arguments.loads, "--rtol", arguments.rtol], arguments.timeout)
        if fault:
            return Row(tool, ranks, fault)
        document = json.loads(report.read_text())
    status = "done" if document.pop("converged") else "not converged"
    return Row(tool, ranks, status, **document)


def job(ranks: int, words: Sequence[object], timeout: float) -> str:
    """Run a Python script with its arguments as an MPI job of its own; why it failed, empty if it did not."""
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, *map(str, words)]
    with tempfile.TemporaryFile("w+") as told:
        process = subprocess.Popen(command, stdout=told, stderr=told)
        try:
            process.wait(timeout)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun ends its ranks
            process.wait()
            return f"not done in {timeout:g} s"
        told.seek(0)
        return f"failed: {_reason(told.read()) or f'exit code {process.returncode}'}" if process.returncode else ""


def _reason(words: str) -> str:
    """The last line that tells of an error, empty if there is none."""
    lines = [line.strip() for line in words.splitlines() if "rror" in line and "mpirun" not in line]
    return lines[-1] if lines else ""


if __name__ == "__main__":
    sys.exit(main())
