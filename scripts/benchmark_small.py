"""Table of `scripts/benchmark --table small`: cells of everyday size, bonded, against direct solvers on equal ranks."""

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import NamedTuple

import tomli_w
from benchmark_report import Row
from composite import STIFFNESS

HERE = Path(__file__).parent
Runner = Callable[[str, int, str, argparse.Namespace], Row]


class Compared(NamedTuple):
    """A cell, the ranks of this program and of a direct solver, and the target of the time ratio."""

    case: str
    ranks: int
    peer: str
    aim: float


CELLS = {
    "9 fibres, 0.03, refine 1": (9, 0.03, 1),
    "30 fibres, 0.03, refine 1": (30, 0.03, 1),
    "100 fibres, 0.03, refine 1": (100, 0.03, 1),
    "100 fibres, 0.015, refine 1": (100, 0.015, 1),
    "100 fibres, 0.03, refine 2": (100, 0.03, 2),
    "100 fibres, 0.015, refine 2": (100, 0.015, 2),
}
GENERALIZED = "generalized, 7 loads"
COMPARED = (
    *(Compared(name, 1, "cholmod", aim) for name, aim in zip(CELLS, (1.1, 1.1, 1.1, 1.0, 0.7, 0.6), strict=True)),
    Compared(GENERALIZED, 1, "cholmod", 1.1),
    *(Compared(name, 2, "mumps", aim) for name, aim in zip(list(CELLS)[-2:], (0.6, 0.5), strict=True)),
)


def compare(arguments: argparse.Namespace, run: Runner) -> int:
    """Run both tools of each comparison in turns; print the medians of total times; return 0 if all finish."""
    print(f"{'cell':28}{'dofs':>8}{'domains':>9}{'feti':>12}{'peer':>14}{'ratio':>8}{'aim':>6}")
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for compared in COMPARED:
            arguments.case, plane = _case(Path(folder), compared.case)
            tools = ("feti", compared.peer)
            rows = [run(tool, compared.ranks, plane, arguments) for tool in tools * arguments.repeat]
            failed += any(row.status != "done" for row in rows)
            print(_line(compared, rows[::2], rows[1::2]), flush=True)
    return int(failed > 0)


def _case(folder: Path, name: str) -> tuple[Path, str]:
    """Return the file of a case, and its plane state."""
    if name == GENERALIZED:
        return HERE / "cases/benchmark_generalized.toml", "generalized"
    fibres, size, refine = CELLS[name]
    cell = {"geometry": "random", "fibre_fraction": 0.5, "fibres": fibres, "min_gap": 0.06}
    path = folder / "case.toml"
    path.write_text(tomli_w.dumps({"cell": cell | {"mesh_size": size, "refine": refine}} | STIFFNESS))
    return path, "strain"


def _line(compared: Compared, ours: list[Row], peers: list[Row]) -> str:
    """Return the medians of both tools and their ratio, or what went wrong."""
    wrong = {row.status for row in (*ours, *peers)} - {"done"}
    if wrong:
        return f"{compared.case:28}{'; '.join(sorted(wrong))}"
    own, other = (median(row.total for row in rows) for rows in (ours, peers))
    return (
        f"{compared.case:28}{peers[0].dofs:8}{ours[0].subdomains:9}{own:7.2f} s @{compared.ranks}{other:9.2f} s "
        f"{compared.peer[:2]}@{compared.ranks}{own / other:7.2f}{compared.aim:6.1f}"
    )
