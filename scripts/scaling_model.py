"""A cost model of the solver on many ranks, with rates measured on few.

Every term is a part of today's program: a mesh and a tearing that ranks partly share, work on subdomains that ranks
share fully, coarse problems that ranks factor together, and messages.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from math import ceil, log2, sqrt
from statistics import median
from typing import Any

from scaling_fit import Shares, fit_power, fit_shares
from scaling_report import FACTOR, GATHERS, MULTIGRID, SCALARS, SUMS, VALUE_BYTES, Row

from feti_homog.mesh.tiles.tiling import DEFAULT_TILES

MESH, LOCAL, COARSE, MESSAGES = "mesh", "subdomains", "coarse problem", "messages"
# Exchanges with neighbours in one cycle of multigrid: on each of about five levels six, for the products and smoothers
# before and after the coarser level, the residual and the transfers.
CYCLE_EXCHANGES = 30
# Solves for rigid-body motions in an iteration.
NATURAL_SOLVES = 2


@dataclass(frozen=True)
class Machine:
    """The network: seconds of a message, bytes per second."""

    latency: float
    bandwidth: float


@dataclass(frozen=True)
class Factor:
    """Seconds of the factor of n unknowns and of the solves of an iteration.

    They are shares of powers of n; runs on one rank give the exponents.
    """

    factor: Shares
    factor_power: float
    solve: Shares
    solve_power: float

    def seconds(self, n: float, ranks: int) -> tuple[float, float]:
        """Return the seconds of the factor and of the solves."""
        return self.factor.seconds(n**self.factor_power, ranks), self.solve.seconds(n**self.solve_power, ranks)


@dataclass(frozen=True)
class Multigrid:
    """Seconds per coarse vector of set-up, and of a solve of `inner` iterations per load, at any size."""

    setup: Shares
    solve: Shares
    inner: int


@dataclass(frozen=True)
class Rates:
    """Measured: seconds per unit of work, and sizes per dof.

    Attributes:
        mesh: seconds per coarse triangle.
        assemble, setup, apply: seconds per dof, `apply` of an iteration.
        coarse, natural: factors of the coarse vectors, and of the rigid-body motions.
        multigrid: rates of multigrid, if timed.
        loads: load cases solved together.
        triangles, subdomains, vectors, kernel: per dof.
        largest_coarse: largest timed number of coarse vectors.
        iterations: largest number in all runs.
        surface: values that a rank sends or receives in an exchange / square root of its dofs.
        neighbours: ranks that a rank sends to or receives from in an exchange.
        imbalance: dofs of the fullest rank relative to the mean.
    """

    mesh: Shares
    assemble: float
    setup: float
    apply: float
    coarse: Factor
    natural: Factor
    multigrid: Multigrid | None
    loads: int
    triangles: float
    subdomains: float
    vectors: float
    kernel: float
    largest_coarse: int
    iterations: int
    surface: float
    neighbours: int
    imbalance: float


def measured(rows: Sequence[Row], cores: int) -> Rates:
    """Return the rates: times from rows whose ranks each have a core, sizes and counts from all rows.

    Raises:
        ValueError: the timed rows are on too few numbers of ranks, or of too few sizes.
    """
    if not any(row.ranks == 1 and row.way == FACTOR for row in rows):
        raise ValueError("rates of subdomains need a run on one rank")
    return Rates(**_local_times(rows, cores), **_coarse_times(rows, cores), **_per_dof(rows), **_counts(rows, cores))


def network(rows: Sequence[Row], cores: int) -> Machine:
    """Return medians of the messages that were timed between two ranks with a core each.

    Raises:
        ValueError: there is no such run.
    """
    timed = [row for row in rows if 1 < row.ranks <= cores]
    if not timed:
        raise ValueError("times of messages need a run on two ranks with a core each")
    return Machine(median(row.latency for row in timed), median(row.bandwidth for row in timed))


def _local_times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Return seconds per unit of work: of subdomains on one rank, of the mesh on all ranks with a core."""
    timed = [row for row in rows if row.ranks <= cores]
    alone = [row for row in timed if row.ranks == 1 and row.way == FACTOR]
    cells = _meshed_alike(timed)
    return dict(
        mesh=Shares(
            serial=_rate((row.alone, row.triangles) for row in cells),
            parallel=_rate((row.ranks * (row.seconds["mesh"] - row.alone), row.triangles) for row in cells),
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
    """Return rows of cells so large that all ranks mesh them, as in the forecast, or else all rows."""
    return [row for row in rows if row.fibres >= DEFAULT_TILES.least_discs] or rows


def _coarse_times(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Return the times of one factor of all ranks and, if it was timed, of multigrid."""
    factored, grids = ([row for row in rows if row.way == way and row.ranks <= cores] for way in (FACTOR, MULTIGRID))
    return dict(
        coarse=_factor(factored, "vectors", "coarse_factor", "coarse_solve"),
        natural=_factor(factored, "kernel", "natural_factor", "natural_solve"),
        multigrid=_multigrid(grids),
    )


def _factor(rows: Sequence[Row], unknowns: str, factor: str, solve: str) -> Factor:
    """Fit a factor to the attributes of rows with these names."""

    def fitted(seconds: str) -> tuple[Shares, float]:
        alone = [(getattr(row, unknowns), getattr(row, seconds)) for row in rows if row.ranks == 1]
        power = fit_power(*zip(*alone, strict=True)).exponent
        return _dealt(rows, lambda row: getattr(row, unknowns) ** power, lambda row: getattr(row, seconds)), power

    return Factor(*fitted(factor), *fitted(solve))


def _multigrid(rows: Sequence[Row]) -> Multigrid | None:
    """Return the times of the rows by multigrid, or None."""
    if not rows:
        return None
    setup, solve = (
        _dealt(rows, lambda row: row.vectors, lambda row, name=name: getattr(row, name))
        for name in ("coarse_factor", "coarse_solve")
    )
    return Multigrid(setup, solve, max(r.inner for r in rows))


def _dealt(rows: Sequence[Row], work: Callable[[Row], float], seconds: Callable[[Row], float]) -> Shares:
    """Return the serial and parallel shares for the runs' seconds and work."""
    return fit_shares([work(row) for row in rows], [row.ranks for row in rows], [seconds(row) for row in rows])


def _per_dof(rows: Sequence[Row]) -> dict[str, Any]:
    """Return sizes per dof."""
    return dict(
        triangles=_rate((row.triangles, row.dofs) for row in rows),
        subdomains=_rate((row.subdomains, row.dofs) for row in rows),
        vectors=_rate((row.vectors, row.dofs) for row in rows),
        kernel=_rate((row.kernel, row.dofs) for row in rows),
    )


def _counts(rows: Sequence[Row], cores: int) -> dict[str, Any]:
    """Return the largest counts of all rows."""
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
    """Return all seconds / all work, so that large runs count most."""
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
        """The seconds of each part."""
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
    """Predict the time of a cell of `dofs` on `ranks`, by default with the coarse solver of the program."""
    subdomains = max(rates.subdomains * dofs, 1.0)
    # A rank has whole subdomains, and none is cut for its sake.
    whole = ceil(subdomains / ranks) * ranks / subdomains
    own = dofs / ranks * max(rates.imbalance if ranks > 1 else 1.0, whole)
    natural = rates.natural.seconds(max(rates.kernel * dofs, 2.0), ranks)
    factor, solve = _coarse_seconds(rates, dofs, ranks, way)
    return Prediction(
        dofs=dofs,
        ranks=ranks,
        mesh=rates.mesh.seconds(rates.triangles * dofs, ranks),
        assemble=rates.assemble * own,
        setup=rates.setup * own,
        coarse_factor=factor + natural[0],
        apply=rates.iterations * rates.apply * own,
        coarse_solve=rates.iterations * (solve + natural[1]),
        messages=_messages(rates, machine, dofs, ranks, way) if ranks > 1 else 0.0,
    )


def _coarse_seconds(rates: Rates, dofs: float, ranks: int, way: str | None) -> tuple[float, float]:
    """Return the seconds of the coarse factor or of multigrid's set-up, and of a solve of all loads.

    Raises:
        ValueError: this coarse solver was not timed.
    """
    vectors = max(rates.vectors * dofs, 2.0)
    if way == MULTIGRID:
        if rates.multigrid is None:
            raise ValueError("multigrid was not timed")
        setup, solve = (shares.seconds(vectors, ranks) for shares in (rates.multigrid.setup, rates.multigrid.solve))
        return setup, solve
    return rates.coarse.seconds(vectors, ranks)


def _messages(rates: Rates, machine: Machine, dofs: float, ranks: int, way: str | None) -> float:
    """Return the seconds of all messages of the iterations; the coarse factor's shares include its own messages."""
    values = rates.surface * sqrt(dofs / ranks)
    exchange = machine.latency * rates.neighbours + VALUE_BYTES * values / machine.bandwidth
    tree = machine.latency * ceil(log2(ranks))
    iteration = (GATHERS + SUMS) * exchange + SCALARS * tree
    # A sum of a long vector over ranks moves it twice; the solution is sent to all.  Motions are solved for twice.
    unknowns = (rates.vectors + NATURAL_SOLVES * rates.kernel) * dofs
    iteration += (1 + NATURAL_SOLVES) * tree + 3 * VALUE_BYTES * unknowns * rates.loads / machine.bandwidth
    if rates.multigrid is not None and way == MULTIGRID:
        cycle = CYCLE_EXCHANGES * machine.latency * rates.neighbours + SCALARS * tree
        iteration += rates.loads * rates.multigrid.inner * cycle
    return rates.iterations * iteration
