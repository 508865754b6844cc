"""The runs of the scaling study, as tables and a CSV file."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

VALUE_BYTES = 8
STAGES = ("mesh", "assemble", "set-up", "solve")
COLUMNS = (
    "fibres", "ranks", "dofs", "subdomains", "vectors", "kernel", "iterations", "converged", "memory", "sent",
    "messages", "way", "coarse_setup", "coarse_factor", "coarse_solve", "natural_factor", "natural_solve",
    "inner", "solver", "total",
)  # fmt: skip
COARSE_TIMES = {
    "coarse set-up": "coarse_setup", "of which its factor": "coarse_factor", "a coarse solve": "coarse_solve"
}  # fmt: skip
# What one iteration does: exchanges of multipliers (a gather and a sum each for the operator and the preconditioner),
# and sums over ranks of single numbers by the Krylov method.
GATHERS, SUMS, SCALARS = 2, 2, 3
# How the coarse problem is solved: by one factor of all ranks, or with multigrid.
FACTOR, MULTIGRID = ("factor", "multigrid")


@dataclass(frozen=True)
class Row:
    """A run: its parameters, sizes, seconds of each stage, and the counts of `scaling_tool`.

    `wanted` are the requested dofs, `fullest` the dofs of the fullest rank; `way` is the coarse solver, with `inner`
    iterations.  `coarse_...` are seconds of the coarse problem (set-up includes modes and factor), `natural_...` of the
    problem of rigid-body motions, which is solved twice in an iteration.  `peaks` are the MB of each rank by stage,
    `coarse_memory` the growth by both factors.  `latency` (s) and `bandwidth` (bytes / s) describe messages between two
    ranks.  `alone` are the seconds of the mesh in which rank 0 works and others wait.
    """

    fibres: int
    wanted: int
    refine: int
    loads: int
    ranks: int
    dofs: int
    fullest: int
    triangles: int
    subdomains: int
    vectors: int
    kernel: int
    iterations: int
    converged: bool
    seconds: dict[str, float]
    peaks: dict[str, list[float]]
    outgoing: tuple[int, ...]
    incoming: tuple[int, ...]
    neighbours: tuple[int, ...]
    exchanges: int
    logged: tuple[float, ...]
    coarse_setup: float
    coarse_factor: float
    coarse_solve: float
    natural_factor: float
    natural_solve: float
    coarse_memory: list[float]
    inner: int
    way: str
    latency: float
    bandwidth: float
    alone: float

    @property
    def solver(self) -> float:
        """Seconds of set-up and solve."""
        return self.seconds["set-up"] + self.seconds["solve"]

    @property
    def total(self) -> float:
        """Seconds of all stages."""
        return sum(self.seconds.values())

    @property
    def memory(self) -> float:
        """MB of all ranks, each at its peak."""
        return sum(max(of_a_rank) for of_a_rank in zip(*self.peaks.values(), strict=True))

    @property
    def coarse(self) -> int:
        """Unknowns of the coarse problem: vectors and kernel modes."""
        return self.vectors + self.kernel

    @property
    def values(self) -> int:
        """Values that the busiest rank sends and receives in an exchange."""
        return max(outgoing + incoming for outgoing, incoming in zip(self.outgoing, self.incoming, strict=True))

    @property
    def sent(self) -> int:
        """Bytes of multipliers that the busiest rank sends in an iteration."""
        pairs = zip(self.outgoing, self.incoming, strict=True)
        return VALUE_BYTES * max(GATHERS * outgoing + SUMS * incoming for outgoing, incoming in pairs)

    @property
    def messages(self) -> int:
        """Messages with multipliers that the busiest rank sends and receives in an iteration."""
        return (GATHERS + SUMS) * max(self.neighbours)

    @property
    def miscounted(self) -> float:
        """Relative difference of the counted bytes from the bytes in PETSc's log, on the worst rank."""
        counted = [VALUE_BYTES * self.exchanges * sum(pair) for pair in zip(self.outgoing, self.incoming, strict=True)]
        return max(abs(a - b) / max(b, 1.0) for a, b in zip(counted, self.logged, strict=True))


def by_ranks(rows: Sequence[Row], cores: int) -> list[str]:
    """Return aligned lines, without the times of ranks that share cores."""
    lines = [
        f"{'':50}{'iteration of the busiest rank':^31}{'seconds':^45}",
        f"{'ranks':>5}{'fibres':>8}{'dofs':>10}{'domains':>8}{'coarse':>8}{'iterations':>11}{'kB sent':>10}"
        f"{'messages':>10}" + "".join(f"{s:>9}" for s in (*STAGES, "total")),
    ]
    for row in rows:
        times = [*(row.seconds[s] for s in STAGES), row.total]
        shown = (f"{t:9.2f}" if row.ranks <= cores else f"{'-':>9}" for t in times)
        lines.append(
            f"{row.ranks:5}{row.fibres:8}{row.dofs:10}{row.subdomains:8}{row.coarse:8}{row.iterations:11}"
            f"{row.sent / 1e3:10.1f}{row.messages:10}{''.join(shown)}"
        )
    return lines


def memory(rows: Sequence[Row]) -> list[str]:
    """Return aligned lines of memory.

    They give the peak of the fullest rank in each stage, the peaks of rank 0 and of all others in the mesh stage, and
    the memory of the coarse factorization.
    """
    lines = [
        "MB of the rank with most, interpreter and libraries included; of rank 0 and of the others (on average)",
        f"{'ranks':>5}{'dofs':>10}" + "".join(f"{s:>10}" for s in STAGES)
        + f"{'rank 0, mesh':>14}{'others':>8}{'coarse factor':>15}{'all ranks':>11}",
    ]  # fmt: skip
    for row in rows:
        first, *others = row.peaks["mesh"]
        mean = f"{sum(others) / len(others):8.0f}" if others else f"{'-':>8}"
        most = "".join(f"{max(row.peaks[s]):10.0f}" for s in STAGES)
        lines.append(
            f"{row.ranks:5}{row.dofs:10}{most}{first:14.0f}{mean}{max(row.coarse_memory):15.1f}{row.memory:11.0f}"
        )
    return lines


def by_size(rows: Sequence[Row]) -> list[str]:
    """Return aligned lines: microseconds of a rank per dof, and memory of all ranks per dof."""
    lines = [
        f"{'dofs':>10}{'ranks':>6}{'fibres':>8}{'coarse':>8}{'iterations':>11}{'seconds':>9}"
        + "".join(f"{s:>9}" for s in (*STAGES, "total")) + f"{'MB':>9}{'kB/dof':>8}",
    ]  # fmt: skip
    for row in rows:
        each = "".join(f"{_per_dof(row, t):9.2f}" for t in (*(row.seconds[s] for s in STAGES), row.total))
        lines.append(
            f"{row.dofs:10}{row.ranks:6}{row.fibres:8}{row.coarse:8}{row.iterations:11}{row.total:9.2f}{each}"
            f"{row.memory:9.0f}{row.memory * 1024 / row.dofs:8.2f}"
        )
    grown = _per_dof(rows[-1], rows[-1].total) / _per_dof(rows[0], rows[0].total) - 1.0
    return [*lines, f"seconds per dof: {grown:+.0%} from {rows[0].dofs} to {rows[-1].dofs} dofs"]


def _per_dof(row: Row, seconds: float) -> float:
    return 1e6 * row.ranks * seconds / row.dofs


def speedups(rows: Sequence[Row], cores: int) -> list[str]:
    """Return dofs per second / dofs per second on one rank."""
    lines = []
    for one in (row for row in rows if row.ranks == 1):
        for row in (row for row in rows if 1 < row.ranks <= cores):
            pairs = {s: (one.seconds[s], row.seconds[s]) for s in STAGES}
            pairs |= {"set-up and solve": (one.solver, row.solver), "all": (one.total, row.total)}
            pairs |= {name: (getattr(one, at), getattr(row, at)) for name, at in COARSE_TIMES.items()}
            words = (f"{name} {row.dofs / one.dofs * a / b:.2f}" for name, (a, b) in pairs.items())
            lines.append(f"{row.ranks} ranks against one, times the dofs per second: {', '.join(words)}")
    return lines


def write(path: Path, studies: dict[str, list[Row]]) -> None:
    """Write all rows as CSV; bytes and messages are per iteration."""
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["study", *COLUMNS, *STAGES])
        for study, rows in studies.items():
            for row in rows:
                writer.writerow([study, *(getattr(row, c) for c in COLUMNS), *(row.seconds[s] for s in STAGES)])
