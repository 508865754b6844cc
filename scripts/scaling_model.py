"""A cost model of the solver on more ranks than there are here, with rates measured on few.

Every term is one that the program has today: a mesh and a tearing on rank 0, work on subdomains that ranks share, a
coarse problem that every rank factors to solve for some load cases, or all together if it is large, and messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from typing import Any

from scaling_report import COARSE_SUMS, GATHERS, SCALARS, SUMS, SUMS_TOGETHER, VALUE_BYTES, Row

from feti_homog.feti.thresholds import DEFAULTS

MESH, LOCAL, COARSE, MESSAGES = "mesh on rank 0", "subdomains", "coarse problem", "messages"
# Powers: of the coarse unknowns, in their factorization; of the ranks, by which they are faster together.
COARSE_POWER, TOGETHER = 1.5, 0.5


@dataclass(frozen=True)
class Machine:
    """The network: seconds of a message, bytes per second."""

    latency: float
    bandwidth: float


@dataclass(frozen=True)
class Rates:
    """Measured: seconds per unit of work, and sizes per dof.

    Attributes:
        mesh: seconds per coarse triangle.
        assemble, setup, apply: seconds per dof, `apply` of an iteration.
        factor, solve: seconds per n^1.5 of the coarse unknowns n, and per n log2 n and load case.
        loads: load cases solved together.
        triangles, subdomains, vectors, coarse, coarse_bytes: per dof.
        largest_coarse: most coarse unknowns that were timed.
        iterations: most of all runs.
        surface: values that a rank tells or hears in an exchange per root of its dofs.
        neighbours: ranks told or heard of in an exchange.
        imbalance: dofs of the fullest rank relative to the mean.
    """

    mesh: float
    assemble: float
    setup: float
    apply: float
    factor: float
    solve: float
    loads: int
    triangles: float
    subdomains: float
    vectors: float
    coarse: float
    coarse_bytes: float
    largest_coarse: int
    iterations: int
    surface: float
    neighbours: int
    imbalance: float


def measured(rows: Sequence[Row], cores: int) -> Rates:
    """Rates from the rows: times from those whose ranks each have a core, sizes and counts from all."""
    return Rates(**_times(rows, cores), **_per_dof(rows), **_counts(rows, cores))


def _times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Seconds per unit of work: of the subdomains on one rank, of mesh and coarse problem on all that have a core."""
    timed = [row for row in rows if row.ranks <= cores]
    alone = [row for row in rows if row.ranks == 1]
    return dict(
        mesh=_rate((row.seconds["mesh"], row.triangles) for row in timed),
        assemble=_rate((row.seconds["assemble"], row.dofs) for row in alone),
        setup=_rate((row.seconds["set-up"] - row.coarse_factor, row.dofs) for row in alone),
        apply=_rate(
            (row.seconds["solve"] - row.iterations * row.coarse_solve, row.iterations * row.dofs) for row in alone
        ),
        factor=_rate((row.coarse_factor, _factored(row.coarse, row.vectors, row.ranks)) for row in timed),
        solve=_rate((row.coarse_solve, _solved(row.coarse, row.vectors, row.ranks, row.loads)) for row in timed),
    )


def _per_dof(rows: Sequence[Row]) -> dict[str, Any]:
    """Sizes per dof."""
    several = [row for row in rows if row.ranks > 1] or rows
    return dict(
        triangles=_rate((row.triangles, row.dofs) for row in rows),
        subdomains=_rate((row.subdomains, row.dofs) for row in rows),
        vectors=_rate((row.vectors, row.dofs) for row in rows),
        coarse=_rate((row.coarse, row.dofs) for row in rows),
        coarse_bytes=_rate((row.coarse_bytes, row.dofs) for row in several),
    )


def _counts(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """The largest counts of all rows."""
    most = max(rows, key=lambda row: (row.ranks, row.dofs))
    return dict(
        loads=rows[0].loads,
        largest_coarse=max(row.coarse for row in rows if row.ranks <= cores),
        iterations=max(row.iterations for row in rows),
        surface=max(row.values / sqrt(row.dofs / row.ranks) for row in rows),
        neighbours=max(max(row.neighbours) for row in rows),
        imbalance=most.fullest * most.ranks / most.dofs,
    )


def _factored(coarse: float, vectors: float, ranks: int) -> float:
    """Work of a coarse factorization on the busiest rank: all of it, or a share where ranks do it together."""
    share: float = ranks**TOGETHER if vectors > DEFAULTS.replicated_vectors else 1.0
    return float(coarse**COARSE_POWER) / share


def _solved(coarse: float, vectors: float, ranks: int, loads: int) -> float:
    """Work of the coarse solves on the busiest rank: for the loads that are dealt to it, or a share of all."""
    replicated = vectors <= DEFAULTS.replicated_vectors
    share: float = ceil(loads / ranks) if replicated else loads / ranks**TOGETHER
    return coarse * log2(coarse) * share


def _rate(pairs: Iterable[tuple[float, float]]) -> float:
    """All seconds over all work, so that large runs count most."""
    seconds, work = (float(sum(values)) for values in zip(*pairs, strict=True))
    return max(seconds / work, 0.0)


@dataclass(frozen=True)
class Prediction:
    """Seconds of each part of a run of `dofs` on `ranks`."""

    dofs: float
    ranks: int
    mesh: float
    assemble: float
    setup: float
    coarse_factor: float
    apply: float
    coarse_solve: float
    messages: float

    @property
    def parts(self) -> dict[str, float]:
        """Seconds by what they are spent on."""
        return {
            MESH: self.mesh,
            LOCAL: self.assemble + self.setup + self.apply,
            COARSE: self.coarse_factor + self.coarse_solve,
            MESSAGES: self.messages,
        }

    @property
    def solver(self) -> float:
        """Seconds of set-up and solve."""
        return self.setup + self.coarse_factor + self.apply + self.coarse_solve + self.messages

    @property
    def total(self) -> float:
        """Seconds of all."""
        return sum(self.parts.values())


def predict(rates: Rates, machine: Machine, dofs: float, ranks: int) -> Prediction:
    """What a cell of `dofs` takes on `ranks`."""
    subdomains = max(rates.subdomains * dofs, 1.0)
    # A rank has whole subdomains, and none is cut for its sake.
    whole = ceil(subdomains / ranks) * ranks / subdomains
    own = dofs / ranks * max(rates.imbalance if ranks > 1 else 1.0, whole)
    coarse = max(rates.coarse * dofs, 2.0)
    vectors = rates.vectors * dofs
    sums = SUMS_TOGETHER if vectors > DEFAULTS.replicated_vectors else COARSE_SUMS
    return Prediction(
        dofs=dofs,
        ranks=ranks,
        mesh=rates.mesh * rates.triangles * dofs,
        assemble=rates.assemble * own,
        setup=rates.setup * own,
        coarse_factor=rates.factor * _factored(coarse, vectors, ranks),
        apply=rates.iterations * rates.apply * own,
        coarse_solve=rates.iterations * rates.solve * _solved(coarse, vectors, ranks, rates.loads),
        messages=_messages(rates, machine, dofs, ranks, sums) if ranks > 1 else 0.0,
    )


def _messages(rates: Rates, machine: Machine, dofs: float, ranks: int, sums: int) -> float:
    """Seconds of all messages: those of the iterations, and the coarse matrix that every rank is told."""
    values = rates.surface * sqrt(dofs / ranks)
    exchange = machine.latency * rates.neighbours + VALUE_BYTES * values / machine.bandwidth
    tree = machine.latency * ceil(log2(ranks))
    # A sum of a long vector over ranks moves it twice.
    coarse_sum = tree + 2 * VALUE_BYTES * rates.coarse * dofs * rates.loads / machine.bandwidth
    iteration = (GATHERS + SUMS) * exchange + sums * coarse_sum + SCALARS * tree
    return rates.iterations * iteration + rates.coarse_bytes * dofs / machine.bandwidth
