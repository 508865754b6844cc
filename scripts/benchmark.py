"""This program against other solvers, on the same mesh and with the same tolerance.

Each tool runs as a separate MPI job.  All tools mesh, tear, refine and assemble the case with this program's functions
("mesh", "assemble").  The peers then glue the subdomains to one periodic matrix ("glue"), set up and solve for one to
three unit strains, direct solvers for all strains at once.  Generalized plane strain has six strains, and a temperature
if all phases expand; each tool has one matrix for displacements in the plane and one for displacements along the
fibres, and also solves the same cell in plane strain.  TOOL@N runs a tool on N ranks.  Memory is the largest resident
memory of each rank, summed over ranks.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import benchmark_small
from benchmark_report import Row, compare, notes, plot, table, write
from peers import PEERS

from feti_homog.case import cases

HERE = Path(__file__).parent
TOOLS = "feti,cholmod,mumps@1,mumps,gamg,hypre,hypre_rigid,fetidp,bddc"


def main() -> int:
    """Run the tools in turns; print and write their times and memory."""
    parser = _parser()
    arguments = parser.parse_args()
    if arguments.table:
        ignored = ("case", "tools", "ranks", "out")
        if given := [name for name in ignored if getattr(arguments, name) != parser.get_default(name)]:
            parser.error(f"--table {arguments.table}: has its own {', '.join(given)}")
        return benchmark_small.compare(arguments, run)
    if not arguments.case.is_file():
        parser.error(f"{arguments.case}: no such file")
    plane = cases.load(arguments.case).analysis.plane
    if plane == "generalized" and arguments.loads:
        parser.error('--loads: all loads of plane = "generalized" are solved for')
    planes = ("strain", plane) if plane == "generalized" else (plane,)
    rows = list(best(arguments, planes).values())
    compare(rows)
    print("", *table(rows), *notes(rows), sep="\n")
    arguments.out.mkdir(parents=True, exist_ok=True)
    files = arguments.out / "benchmark.csv", arguments.out / "benchmark.png"
    write(files[0], rows)
    plot(files[1], rows, f"{arguments.case.stem}, rtol {arguments.rtol:g}")
    print(*files)
    return int(any(row.tool == "feti" and row.status != "done" for row in rows))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", type=Path, nargs="?", default=HERE / "cases/benchmark.toml", metavar="CASE.toml")
    parser.add_argument("--tools", default=TOOLS, type=_tools, help=f"of feti, {', '.join(PEERS)}; default {TOOLS}")
    parser.add_argument("--table", choices=["small"], help="small cells against direct solvers: medians, and no other")
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--loads", type=int, choices=(1, 2, 3), help="unit strains to solve for; all by default")
    parser.add_argument("--rtol", type=float, default=1e-8)
    parser.add_argument(
        "--repeat", type=int, default=1, help="runs of each tool: the fastest counts, in a table the median"
    )
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


def best(arguments: argparse.Namespace, planes: Sequence[str]) -> dict[tuple[str, str], Row]:
    """Return the fastest run of each tool in each plane state, or its first failed run.

    After a failed run the tool does not run again.

    The tools take turns, so that no tool has the quiet minutes of the machine to itself.
    """
    rows: dict[tuple[str, str], Row] = {}
    turns = [(spec, plane) for spec in arguments.tools.split(",") for plane in planes]
    for key in turns * arguments.repeat:
        if key in rows and rows[key].status != "done":
            continue
        (tool, _, ranks), plane = key[0].partition("@"), key[1]
        alone = tool in PEERS and PEERS[tool].sequential
        row = run(tool, int(ranks or (1 if alone else arguments.ranks)), plane, arguments)
        print(f"{row.name:14}{row.plane:12}{row.total:9.1f} s  {row.status}", flush=True)
        rows[key] = min(rows.get(key, row), row, key=lambda row: (row.status == "done", row.solver))
    return rows


def run(tool: str, ranks: int, plane: str, arguments: argparse.Namespace) -> Row:
    """Run a tool once."""
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report.json"
        words = [HERE / "benchmark_tool.py", tool, arguments.case, report, "--plane", plane, "--rtol", arguments.rtol]
        loads = ["--loads", arguments.loads] if arguments.loads else []
        fault = job(ranks, [*words, *loads], arguments.timeout)
        if fault:
            return Row(tool, ranks, plane, fault)
        document = json.loads(report.read_text())
    status = "done" if document.pop("converged") else "not converged"
    return Row(tool, ranks, plane, status, **document)


def job(ranks: int, words: Sequence[object], timeout: float) -> str:
    """Run a Python script with arguments as a separate MPI job; return the reason of a failure, else ""."""
    command = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable, *map(str, words)]
    with tempfile.TemporaryFile("w+") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output)
        try:
            process.wait(timeout)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun ends its ranks
            process.wait()
            return f"not done in {timeout:g} s"
        output.seek(0)
        return f"failed: {_reason(output.read()) or f'exit code {process.returncode}'}" if process.returncode else ""


def _reason(words: str) -> str:
    """Return the last line that reports an error, or ""."""
    lines = [line.strip() for line in words.splitlines() if "rror" in line and "mpirun" not in line]
    return lines[-1] if lines else ""


if __name__ == "__main__":
    sys.exit(main())
