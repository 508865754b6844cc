"""A cost model of the solver on more ranks than there are here, with rates measured on few.

Every term is one that the program has today: a mesh and a tearing of which some share is dealt to the ranks, work on
subdomains that ranks share, a coarse problem that every rank factors to solve for some load cases, or all together if
it is large, and messages.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from statistics import median
from typing import Any

from scaling_fit import Power, Shares, fit_power, fit_shares
from scaling_report import COARSE_SUMS, COPIES, GATHERS, MULTIGRID, SCALARS, SHARED, SUMS, VALUE_BYTES, Row

from feti_homog.cell.tiles import DEFAULT_TILES
from feti_homog.feti.thresholds import DEFAULTS

MESH, LOCAL, COARSE, MESSAGES = "mesh", "subdomains", "coarse problem", "messages"
# Exchanges with neighbours in one cycle of multigrid: on each of about five levels six, for the products and smoothers
# before and after the coarser level, the residual and the transfers.
CYCLE_EXCHANGES = 30


@dataclass(frozen=True)
class Machine:
    """The network: seconds of a message, bytes per second."""

    latency: float
    bandwidth: float


@dataclass(frozen=True)
class Multigrid:
    """Seconds per coarse vector of set-up, and of a solve of one load, which takes `inner` iterations at any size."""

    setup: Shares
    solve: Shares
    inner: int


@dataclass(frozen=True)
class Rates:
    """Measured: seconds per unit of work, and sizes per dof.

    Attributes:
        mesh: of a coarse triangle.
        assemble, setup, apply: seconds per dof, `apply` of an iteration.
        factor, solve: of the coarse vectors on one rank, `solve` of one load case.
        factor_shared, solve_shared: on all ranks, per vector to the powers of `factor` and `solve`.
        natural_factor, natural_solve: of the rigid-body motions, `natural_solve` of an iteration and all loads.
        multigrid: if it was timed.
        loads: load cases solved together.
        triangles, subdomains, vectors, kernel, coarse_bytes: per dof.
        largest_coarse: most coarse vectors that were timed.
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
    factor_shared: Shares
    solve_shared: Shares
    natural_factor: Power
    natural_solve: Power
    multigrid: Multigrid | None
    loads: int
    triangles: float
    subdomains: float
    vectors: float
    kernel: float
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
    if not any(row.ranks == 1 and row.way == COPIES for row in rows):
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
    alone = [row for row in timed if row.ranks == 1 and row.way == COPIES]
    cells = _meshed_alike(timed)
    return dict(
        mesh=fit_shares(
            [row.triangles for row in cells], [row.ranks for row in cells], [row.seconds["mesh"] for row in cells]
        ),
        assemble=_rate((row.seconds["assemble"], row.dofs) for row in alone),
        setup=_rate((row.seconds["set-up"] - row.coarse_factor - row.natural_factor, row.dofs) for row in alone),
        apply=_rate(
            (
                row.seconds["solve"] - row.iterations * (row.coarse_solve + row.natural_solve),
                row.iterations * row.dofs,
            )
            for row in alone
        ),
    )


def _meshed_alike(rows: Sequence[Row]) -> Sequence[Row]:
    """Those of cells so large that all ranks mesh them, as those of the forecast; all rows, if there are too few."""
    large = [row for row in rows if row.fibres >= DEFAULT_TILES.least_discs]
    return large if len({row.ranks for row in large}) > 1 else rows


def _coarse_times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Powers of the coarse vectors where every rank factors, and shares that ranks deal out where all do together."""
    timed = {way: [row for row in rows if row.ranks <= cores and row.way == way] for way in (COPIES, SHARED, MULTIGRID)}
    alone, shared = timed[COPIES], timed[SHARED]
    factor = _power(alone, "vectors", lambda row: row.coarse_factor)
    solve = _power(alone, "vectors", lambda row: row.coarse_solve / ceil(row.loads / row.ranks))
    return dict(
        factor=factor,
        solve=solve,
        factor_shared=_dealt(shared, factor.exponent, lambda row: row.coarse_factor),
        solve_shared=_dealt(shared, solve.exponent, lambda row: row.coarse_solve / row.loads),
        natural_factor=_power(alone, "kernel", lambda row: row.natural_factor),
        natural_solve=_power(alone, "kernel", lambda row: row.natural_solve),
        multigrid=_multigrid(timed[MULTIGRID]),
    )


def _multigrid(rows: Sequence[Row]) -> Multigrid | None:
    """Of the rows by multigrid, None without any."""
    if not rows:
        return None
    setup = _dealt(rows, 1.0, lambda row: row.coarse_factor)
    return Multigrid(setup, _dealt(rows, 1.0, lambda row: row.coarse_solve / row.loads), max(r.inner for r in rows))


def _power(rows: Sequence[Row], unknowns: str, seconds: Callable[[Row], float]) -> Power:
    """The power of so many unknowns, an attribute of the rows, that takes them so many seconds."""
    return fit_power([getattr(row, unknowns) for row in rows], [seconds(row) for row in rows])


def _dealt(rows: Sequence[Row], exponent: float, seconds: Callable[[Row], float]) -> Shares:
    """Shares of what takes the runs so many seconds, for work that is this power of the coarse vectors."""
    return fit_shares(
        [row.vectors**exponent for row in rows], [row.ranks for row in rows], [seconds(row) for row in rows]
    )


def _per_dof(rows: Sequence[Row]) -> dict[str, Any]:
    """Sizes per dof."""
    several = [row for row in rows if row.ranks > 1 and row.way == COPIES] or rows
    return dict(
        triangles=_rate((row.triangles, row.dofs) for row in rows),
        subdomains=_rate((row.subdomains, row.dofs) for row in rows),
        vectors=_rate((row.vectors, row.dofs) for row in rows),
        kernel=_rate((row.kernel, row.dofs) for row in rows),
        coarse_bytes=_rate((row.coarse_bytes, row.dofs) for row in several),
    )


def _counts(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """The largest counts of all rows."""
    most = max(rows, key=lambda row: (row.ranks, row.dofs))
    return dict(
        loads=rows[0].loads,
        largest_coarse=max(row.vectors for row in rows if row.ranks <= cores),
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


def predict(rates: Rates, machine: Machine, dofs: float, ranks: int, way: str | None = None) -> Prediction:
    """What a cell of `dofs` takes on `ranks`, with that way to solve the coarse problem, by default the program's."""
    subdomains = max(rates.subdomains * dofs, 1.0)
    # A rank has whole subdomains, and none is cut for its sake.
    whole = ceil(subdomains / ranks) * ranks / subdomains
    own = dofs / ranks * max(rates.imbalance if ranks > 1 else 1.0, whole)
    kernel = max(rates.kernel * dofs, 2.0)
    factor, solve = _coarse_seconds(rates, dofs, ranks, way)
    return Prediction(
        dofs=dofs,
        ranks=ranks,
        mesh=rates.mesh.seconds(rates.triangles * dofs, ranks),
        assemble=rates.assemble * own,
        setup=rates.setup * own,
        coarse_factor=factor + rates.natural_factor.seconds(kernel),
        apply=rates.iterations * rates.apply * own,
        coarse_solve=rates.iterations * (solve + rates.natural_solve.seconds(kernel)),
        messages=_messages(rates, machine, dofs, ranks, way) if ranks > 1 else 0.0,
    )


def _coarse_seconds(rates: Rates, dofs: float, ranks: int, way: str | None) -> tuple[float, float]:
    """Seconds of the coarse factor or of multigrid's set-up, and of a solve of all loads.

    Raises:
        ValueError: multigrid was not timed.
    """
    vectors = max(rates.vectors * dofs, 2.0)
    if way == MULTIGRID:
        if rates.multigrid is None:
            raise ValueError("multigrid was not timed")
        setup, solve = (shares.seconds(vectors, ranks) for shares in (rates.multigrid.setup, rates.multigrid.solve))
        return setup, rates.loads * solve
    is_shared = ranks > 1 and not DEFAULTS.replicates(vectors, ranks) if way is None else way == SHARED
    if is_shared:
        factor = rates.factor_shared.seconds(vectors**rates.factor.exponent, ranks)
        return factor, rates.loads * rates.solve_shared.seconds(vectors**rates.solve.exponent, ranks)
    return rates.factor.seconds(vectors), ceil(rates.loads / ranks) * rates.solve.seconds(vectors)


def _messages(rates: Rates, machine: Machine, dofs: float, ranks: int, way: str | None) -> float:
    """Seconds of all messages: those of the iterations, and the coarse matrix that every rank is told."""
    values = rates.surface * sqrt(dofs / ranks)
    exchange = machine.latency * rates.neighbours + VALUE_BYTES * values / machine.bandwidth
    tree = machine.latency * ceil(log2(ranks))
    # A sum of a long vector over ranks moves it twice.
    coarse = (rates.vectors + rates.kernel) * dofs
    coarse_sum = tree + 2 * VALUE_BYTES * coarse * rates.loads / machine.bandwidth
    iteration = (GATHERS + SUMS) * exchange + COARSE_SUMS * coarse_sum + SCALARS * tree
    if way == MULTIGRID and rates.multigrid is not None:
        cycle = CYCLE_EXCHANGES * machine.latency * rates.neighbours + SCALARS * tree
        iteration += rates.loads * rates.multigrid.inner * cycle
    return rates.iterations * iteration + rates.coarse_bytes * dofs / machine.bandwidth
