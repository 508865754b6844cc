"""Times and memory of the benchmark's tools, as a table, a CSV file and a picture."""

import csv
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

import matplotlib as mpl
import numpy as np
from peers import PEERS

mpl.use("Agg")

import matplotlib.pyplot as plt

STAGES = ("mesh", "assemble", "glue", "set-up", "solve")
INK = ("#c9c9c9", "#9a9a9a", "#d9b38c", "#1f4e9c", "#c44e00")
# A result that is farther from the direct solvers' than this is wrong whatever the tool reports.
WRONG = 1e-4


@dataclass
class Row:
    """Cost of a tool: seconds of each stage, iterations of each load (none for a direct solver), MB.

    Attributes:
        plane: the plane state.
        stresses: a column for each unit strain, then one for a unit temperature.
        difference: largest difference of a column, relative to the largest entry of the column.
    """

    tool: str
    ranks: int
    plane: str
    status: str
    dofs: int = 0
    subdomains: int = 0
    seconds: dict[str, float] = field(default_factory=dict)
    iterations: tuple[int, ...] = ()
    memory: float = 0.0
    stresses: tuple[tuple[float, ...], ...] = ()
    difference: float = float("nan")

    @property
    def solver(self) -> float:
        """Seconds of set-up and solves."""
        return self.seconds.get("set-up", 0.0) + self.seconds.get("solve", 0.0)

    @property
    def total(self) -> float:
        """Seconds of all stages."""
        return sum(self.seconds.values())

    @property
    def name(self) -> str:
        """The tool and its ranks."""
        return f"{self.tool}@{self.ranks}"

    @property
    def loads(self) -> int:
        """Unit loads that were solved for."""
        return len(self.stresses[0]) if self.stresses else 0


def compare(rows: Sequence[Row]) -> None:
    """Compute the `difference` of each row from its reference, and mark wrong results.

    The reference is the first direct solver that has finished in the same plane state, or else the first tool.
    """
    done = [row for row in rows if row.status == "done"]
    for row in done:
        of_plane = [other for other in done if other.plane == row.plane]
        direct = [other for other in of_plane if other.tool in PEERS and PEERS[other.tool].direct]
        exact = np.array((direct or of_plane)[0].stresses)
        apart = np.abs(np.array(row.stresses) - exact).max(axis=0)
        row.difference = float((apart / np.abs(exact).max(axis=0)).max())
    for row in done:
        if not row.difference <= WRONG:
            row.status = "wrong"


def table(rows: Sequence[Row]) -> list[str]:
    """Return aligned lines of the rows, with ratios of this program to each tool.

    Both tools of a ratio solve the same plane state.
    """
    lines = [
        f"{'':47}{'seconds':^50}{'':14}{'':9}  feti / tool",
        f"{'tool@ranks':14}{'dofs':>9}{'domains':>9}  {'plane':<12}{'loads':>5}" + "".join(f"{s:>9}" for s in STAGES)
        + f"{'iterations':>14}{'MB':>8}{'solver':>9}{'total':>7}{'MB':>7}{'difference':>12}  status",
    ]  # fmt: skip
    for row in rows:
        times = "".join(f"{row.seconds[s]:9.2f}" if s in row.seconds else f"{'-':>9}" for s in STAGES)
        ours = _ours(rows, row)
        ratios = f"{'-':>9}{'-':>7}{'-':>7}"
        if ours and row.seconds:
            pairs = [(ours.solver, row.solver), (ours.total, row.total), (ours.memory, row.memory)]
            ratios = "  " + "".join(f"{a / b:7.2f}" for a, b in pairs)
        iterations = "-".join(map(str, sorted({min(row.iterations), max(row.iterations)}))) if row.iterations else ""
        lines.append(
            f"{row.name:14}{row.dofs:9}{row.subdomains:9}  {row.plane:<12}{row.loads:5}{times}{iterations:>14}"
            f"{row.memory:8.0f}{ratios}{row.difference:12.0e}  {row.status}"
        )
    return lines


def _ours(rows: Sequence[Row], row: Row) -> Row | None:
    """Return this program's first finished row of the plane state of `row`."""
    return next((r for r in rows if r.tool == "feti" and r.plane == row.plane and r.status == "done"), None)


def notes(rows: Sequence[Row]) -> list[str]:
    """Return the notes below the table."""
    largest = max((row.difference for row in rows if row.status == "done"), default=0.0)
    peers = dict.fromkeys(row.tool for row in rows if row.tool in PEERS and PEERS[row.tool].note)
    return [
        "",
        "solver: set-up and solves; total: all stages; dofs: feti of the torn cell, the others of the glued one",
        f"largest difference of L^ef between tools that are done: {largest:.1e}; wrong from {WRONG:g}",
        *(f"{tool}: {PEERS[tool].note}" for tool in peers),
        *pairs(rows),
    ]


def pairs(rows: Sequence[Row]) -> list[str]:
    """List, for each tool in two plane states, this program's time / the tool's time of set-up and solves."""
    lines = []
    for name in dict.fromkeys(row.name for row in rows if row.tool in PEERS):
        found = [
            (row, ours) for row in rows if row.name == name and row.status == "done" and (ours := _ours(rows, row))
        ]
        if len(found) > 1:
            ratios = (f"{ours.solver / row.solver:.2f} under {row.loads} loads ({row.plane})" for row, ours in found)
            lines.append(f"feti / {name}: {', '.join(ratios)}")
    return lines


def write(path: Path, rows: Sequence[Row]) -> None:
    """Write the rows as CSV, a column per stage."""
    names = [f.name for f in fields(Row) if f.name not in ("seconds", "stresses")]
    with path.open("w", newline="") as stream:
        writer = csv.DictWriter(stream, [*names, *STAGES, "solver", "total"], extrasaction="ignore")
        writer.writeheader()
        for row in rows:
            iterations = " ".join(map(str, row.iterations))
            writer.writerow(
                asdict(row) | row.seconds | {"iterations": iterations, "solver": row.solver, "total": row.total}
            )


def plot(path: Path, rows: Sequence[Row], title: str) -> None:
    """Write the bars of all tools, from top to bottom in their order."""
    names = [f"{row.name}, {row.plane}" for row in rows]
    height = 1.7 + 0.36 * len(rows)
    figure, (times, memory) = plt.subplots(1, 2, figsize=(9.5, height), sharey=True, width_ratios=(5, 3))
    start = [0.0] * len(rows)
    for stage, ink in zip(STAGES, INK, strict=True):
        seconds = [row.seconds.get(stage, 0.0) for row in rows]
        times.barh(names, seconds, left=start, color=ink, label=stage)
        start = [a + b for a, b in zip(start, seconds, strict=True)]
    memory.barh(names, [row.memory for row in rows], color="#2a7f3f")
    for y, row in enumerate(rows):
        if row.status != "done":
            times.annotate(row.status[:40], (start[y], y), (4, 0), textcoords="offset points", va="center", fontsize=8)
    times.invert_yaxis()
    times.set(xlabel="seconds", title=title)
    memory.set(xlabel="peak memory of all ranks, MB")
    figure.legend(*times.get_legend_handles_labels(), loc="lower left", ncols=5, fontsize=8, frameon=False)
    for axes in (times, memory):
        axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout(rect=(0, 0.3 / height, 1, 1))
    figure.savefig(path, dpi=200)
    plt.close(figure)
