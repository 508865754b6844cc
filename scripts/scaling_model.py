"""A cost model of the solver on more ranks than there are here, with rates measured on few.

Every term is one that the program has today: a mesh and a tearing of which some share is dealt to the ranks, work on
subdomains that ranks share, a coarse problem that every rank factors to solve for some load cases, or all together if
it is large, and messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from statistics import median
from typing import Any

from scaling_fit import Power, Shares, fit_power, fit_shares
from scaling_report import COARSE_SUMS, GATHERS, SCALARS, SUMS, VALUE_BYTES, Row

from feti_homog.cell.tiles import DEFAULT_TILES
from feti_homog.feti.thresholds import DEFAULTS

MESH, LOCAL, COARSE, MESSAGES = "mesh", "subdomains", "coarse problem", "messages"


@dataclass(frozen=True)
class Machine:
    """The network: seconds of a message, bytes per second."""

    latency: float
    bandwidth: float


@dataclass(frozen=True)
class Rates:
    """Measured: seconds per unit of work, and sizes per dof.

    Attributes:
        mesh: of a coarse triangle.
        assemble, setup, apply: seconds per dof, `apply` of an iteration.
        factor, solve: of the coarse unknowns on one rank, `solve` of one load case.
        factor_together, solve_together: on all ranks, per unknown to the powers of `factor` and `solve`.
        loads: load cases solved together.
        triangles, subdomains, vectors, coarse, coarse_bytes: per dof.
        largest_coarse: most coarse unknowns that were timed.
        iterations: most of all runs.
        surface: values that a rank tells or hears in an exchange per root of its dofs.
        neighbours: ranks told or heard of in an exchange.
        imbalance: dofs of the fullest rank relative to the mean.
    """

    mesh: Shares
    assemble: float
    setup: float
    apply: float
    factor: Power
    solve: Power
    factor_together: Shares
    solve_together: Shares
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
    """Rates from the rows: times from those whose ranks each have a core, sizes and counts from all.

    Raises:
        ValueError: the timed rows are on too few numbers of ranks, or of too few sizes.
    """
    if not any(row.ranks == 1 and not row.together for row in rows):
        raise ValueError("rates of subdomains need a run on one rank")
    return Rates(**_local_times(rows, cores), **_coarse_times(rows, cores), **_per_dof(rows), **_counts(rows, cores))


def network(rows: Sequence[Row], cores: int) -> Machine:
    """Medians of the messages that were timed between two ranks that each have a core.

    Raises:
        ValueError: there is no such run.
    """
    timed = [row for row in rows if 1 < row.ranks <= cores]
    if not timed:
        raise ValueError("times of messages need a run on two ranks with a core each")
    return Machine(median(row.latency for row in timed), median(row.bandwidth for row in timed))


def _local_times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Seconds per unit of work: of the subdomains on one rank, of the mesh on all that have a core."""
    timed = [row for row in rows if row.ranks <= cores]
    alone = [row for row in timed if row.ranks == 1 and not row.together]
    cells = _meshed_alike(timed)
    return dict(
        mesh=fit_shares(
            [row.triangles for row in cells], [row.ranks for row in cells], [row.seconds["mesh"] for row in cells]
        ),
        assemble=_rate((row.seconds["assemble"], row.dofs) for row in alone),
        setup=_rate((row.seconds["set-up"] - row.coarse_factor, row.dofs) for row in alone),
        apply=_rate(
            (row.seconds["solve"] - row.iterations * row.coarse_solve, row.iterations * row.dofs) for row in alone
        ),
    )


def _meshed_alike(rows: Sequence[Row]) -> Sequence[Row]:
    """Those of cells so large that all ranks mesh them, as those of the forecast; all rows, if there are too few."""
    large = [row for row in rows if row.fibres >= DEFAULT_TILES.least_discs]
    return large if len({row.ranks for row in large}) > 1 else rows


def _coarse_times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Powers of the coarse unknowns where every rank factors, and shares that ranks deal out where all do together."""
    timed = [row for row in rows if row.ranks <= cores]
    single, together = ([row for row in timed if row.together is wanted] for wanted in (False, True))
    unknowns = [row.coarse for row in single]
    factor = fit_power(unknowns, [row.coarse_factor for row in single])
    solve = fit_power(unknowns, [row.coarse_solve / ceil(row.loads / row.ranks) for row in single])
    return dict(
        factor=factor,
        solve=solve,
        factor_together=_dealt(together, factor, [row.coarse_factor for row in together]),
        solve_together=_dealt(together, solve, [row.coarse_solve / row.loads for row in together]),
    )


def _dealt(rows: Sequence[Row], power: Power, seconds: Sequence[float]) -> Shares:
    """Shares of what takes the runs so many seconds, for work that is this power of the coarse unknowns."""
    return fit_shares([row.coarse**power.exponent for row in rows], [row.ranks for row in rows], seconds)


def _per_dof(rows: Sequence[Row]) -> dict[str, Any]:
    """Sizes per dof."""
    several = [row for row in rows if row.ranks > 1 and not row.together] or rows
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


def predict(rates: Rates, machine: Machine, dofs: float, ranks: int, together: bool | None = None) -> Prediction:
    """What a cell of `dofs` takes on `ranks`; with one coarse factor on all if `together`, by default as the program
    chooses."""
    subdomains = max(rates.subdomains * dofs, 1.0)
    # A rank has whole subdomains, and none is cut for its sake.
    whole = ceil(subdomains / ranks) * ranks / subdomains
    own = dofs / ranks * max(rates.imbalance if ranks > 1 else 1.0, whole)
    coarse = max(rates.coarse * dofs, 2.0)
    if together is None:
        together = ranks > 1 and not DEFAULTS.replicates(rates.vectors * dofs, ranks)
    if together:
        factor = rates.factor_together.seconds(coarse**rates.factor.exponent, ranks)
        solve = rates.loads * rates.solve_together.seconds(coarse**rates.solve.exponent, ranks)
    else:
        factor = rates.factor.seconds(coarse)
        solve = ceil(rates.loads / ranks) * rates.solve.seconds(coarse)
    return Prediction(
        dofs=dofs,
        ranks=ranks,
        mesh=rates.mesh.seconds(rates.triangles * dofs, ranks),
        assemble=rates.assemble * own,
        setup=rates.setup * own,
        coarse_factor=factor,
        apply=rates.iterations * rates.apply * own,
        coarse_solve=rates.iterations * solve,
        messages=_messages(rates, machine, dofs, ranks) if ranks > 1 else 0.0,
    )


def _messages(rates: Rates, machine: Machine, dofs: float, ranks: int) -> float:
    """Seconds of all messages: those of the iterations, and the coarse matrix that every rank is told."""
    values = rates.surface * sqrt(dofs / ranks)
    exchange = machine.latency * rates.neighbours + VALUE_BYTES * values / machine.bandwidth
    tree = machine.latency * ceil(log2(ranks))
    # A sum of a long vector over ranks moves it twice.
    coarse_sum = tree + 2 * VALUE_BYTES * rates.coarse * dofs * rates.loads / machine.bandwidth
    iteration = (GATHERS + SUMS) * exchange + COARSE_SUMS * coarse_sum + SCALARS * tree
    return rates.iterations * iteration + rates.coarse_bytes * dofs / machine.bandwidth
