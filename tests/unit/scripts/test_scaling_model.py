"""The cost model of the scaling study: from runs that were made up of known constants, it finds these again."""

import json
from dataclasses import asdict, replace

import pytest
from scaling import read
from scaling_fit import fit_power, fit_shares
from scaling_forecast import assumptions, checks, forecast
from scaling_model import LOCAL, Machine, measured, network, predict
from scaling_report import FACTOR, MULTIGRID, Row, by_ranks, memory

CORES = 2
NETWORK = Machine(2e-6, 1e10)
ITERATIONS, LOADS = 20, 3


def made_up(dofs: int, ranks: int, way: str = FACTOR) -> Row:
    """Return a run whose seconds follow constants that the tests know; its messages take no time."""
    triangles, coarse, kernel = dofs // 50, dofs // 500, dofs // 1000
    factor, solve = (1.0 + 4.0 / ranks) * 1e-6 * coarse**1.5, (2.0 + 1.0 / ranks) * 1e-7 * coarse**1.2
    natural_factor, natural_solve = (0.5 + 0.5 / ranks) * 2e-5 * kernel, 3e-6 * kernel
    if way == MULTIGRID:
        factor, solve = 1e-5 * coarse * (0.5 + 0.5 / ranks), 3e-5 * coarse / ranks
    own = dofs / ranks
    seconds = {
        "mesh": 1e-5 * triangles * (0.25 + 0.75 / ranks),
        "assemble": 2e-6 * own,
        "set-up": 5e-6 * own + factor + natural_factor,
        "solve": ITERATIONS * (3e-7 * own + solve + natural_solve),
    }
    return Row(
        fibres=1, wanted=dofs, refine=2, loads=LOADS, ranks=ranks, dofs=dofs, fullest=dofs // ranks,
        triangles=triangles, subdomains=dofs // 1000, vectors=coarse, kernel=kernel, iterations=ITERATIONS,
        converged=True, seconds=seconds, peaks={stage: [100.0 + r for r in range(ranks)] for stage in seconds},
        outgoing=(0,) * ranks, incoming=(0,) * ranks, neighbours=(0,) * ranks, exchanges=0, logged=(0.0,) * ranks,
        coarse_setup=2 * factor, coarse_factor=factor, coarse_solve=solve,
        natural_factor=natural_factor, natural_solve=natural_solve,
        coarse_memory=[1.0] * ranks, inner=17 if way == MULTIGRID else 0, way=way,
        latency=NETWORK.latency, bandwidth=NETWORK.bandwidth, alone=0.25e-5 * triangles,
    )  # fmt: skip


ROWS = [
    *(made_up(dofs, ranks) for dofs in (100_000, 1_000_000) for ranks in (1, 2)),
    *(made_up(1_000_000, ranks, MULTIGRID) for ranks in (1, 2)),
]


def test_shares_of_amdahl():
    """Fit the shares of 3 w (0.2 + 0.8 / p), at any sizes."""
    runs = [(w, p, 3 * w * (0.2 + 0.8 / p)) for w, p in [(10, 1), (700, 2), (30, 4)]]
    found = fit_shares(*zip(*runs, strict=True))
    assert (found.serial, found.parallel) == pytest.approx((0.6, 2.4))
    assert found.seconds(100, 8) == pytest.approx(300 * (0.2 + 0.1))


def test_shares_and_powers_are_fitted():
    # Work that gets slower with ranks has no parallel share; the serial one is the geometric mean.
    found = fit_shares([1, 1], [1, 2], [1.0, 2.0])
    assert found.parallel == pytest.approx(0.0, abs=1e-4)
    assert found.serial == pytest.approx(2**0.5, rel=1e-4)
    found = fit_power([10, 100, 1000], [2e-3 * n**1.4 for n in (10, 100, 1000)])
    assert (found.factor, found.exponent) == pytest.approx((2e-3, 1.4))


@pytest.mark.parametrize(
    "fit", [lambda: fit_shares([1, 2], [2, 2], [1, 2]), lambda: fit_power([5, 5], [1, 2]), lambda: network(ROWS, 1)]
)
def test_runs_that_do_not_tell_a_constant(fit):
    with pytest.raises(ValueError, match="need"):
        fit()


def test_no_run_on_one_rank():
    with pytest.raises(ValueError, match="one rank"):
        measured([row for row in ROWS if row.ranks > 1], CORES)


def test_constants_are_found_again():
    """Also where runs on more ranks than cores, whose seconds are no measure, are among the rows."""
    slow = replace(made_up(1_000_000, 4), seconds=dict.fromkeys(ROWS[0].seconds, 1e3), coarse_factor=1e3)
    rates = measured([*ROWS, slow], CORES)
    assert (rates.mesh.serial, rates.mesh.parallel) == pytest.approx((2.5e-6, 7.5e-6))
    assert (rates.assemble, rates.setup, rates.apply) == pytest.approx((2e-6, 5e-6, 3e-7))
    for found, shares, power in (
        (rates.coarse.factor, (1e-6, 4e-6), (rates.coarse.factor_power, 1.5)),
        (rates.coarse.solve, (2e-7, 1e-7), (rates.coarse.solve_power, 1.2)),
        (rates.natural.factor, (1e-5, 1e-5), (rates.natural.factor_power, 1.0)),
        (rates.natural.solve, (3e-6, 0.0), (rates.natural.solve_power, 1.0)),
    ):
        assert (found.serial, found.parallel) == pytest.approx(shares, rel=1e-3, abs=1e-9)
        assert power[0] == pytest.approx(power[1], rel=1e-3)
    assert (rates.multigrid.setup.serial, rates.multigrid.setup.parallel) == pytest.approx((5e-6, 5e-6))
    assert rates.multigrid.solve.seconds(1000, 50) == pytest.approx(3e-5 * 1000 / 50, rel=1e-2)
    assert rates.multigrid.inner == 17
    assert network(ROWS, CORES) == NETWORK


def test_mesh_is_of_cells_that_all_ranks_mesh():
    """In runs of 400 fibres rank 0 is alone for 1 s of 8; all others take 1 s on any number of ranks."""
    small = [replace(row, seconds={**row.seconds, "mesh": 1.0}, alone=0.0) for row in ROWS]
    large = [replace(made_up(4_000_000, p), fibres=400, alone=1.0) for p in (1, 2)]
    large = [replace(row, seconds={**row.seconds, "mesh": 1.0 + 7.0 / row.ranks}) for row in large]
    assert measured([*small, *large], CORES).mesh.seconds(80_000, 7) == pytest.approx(2.0)
    assert measured(small, CORES).mesh.serial == 0.0


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.dofs}-{row.ranks}-{row.way}")
def test_model_gives_the_runs_that_it_is_of(row):
    """With messages that take no time, as in the runs that were made up."""
    p = predict(measured(ROWS, CORES), Machine(0.0, float("inf")), row.dofs, row.ranks, row.way)
    assert p.total == pytest.approx(row.total, rel=1e-3)
    assert p.mesh == pytest.approx(row.seconds["mesh"])
    assert p.setup + p.coarse_factor == pytest.approx(row.seconds["set-up"], rel=1e-3)


def test_multigrid_is_forecast_where_it_was_timed():
    rates = measured([row for row in ROWS if row.way != MULTIGRID], CORES)
    assert rates.multigrid is None
    with pytest.raises(ValueError, match="not timed"):
        predict(rates, NETWORK, 1e6, 4, MULTIGRID)
    futures = forecast(measured(ROWS, CORES), NETWORK, MULTIGRID)
    assert all("multigrid" in title for title in futures)


def test_subdomains_scale_until_each_rank_has_one():
    rates = measured(ROWS, CORES)
    local = [predict(rates, NETWORK, 100_000, ranks).parts[LOCAL] for ranks in (1, 10, 100, 1000)]
    assert local[0] / local[2] == pytest.approx(100)
    assert local[3] == pytest.approx(local[2])


def test_errors_of_the_model_are_reported():
    """A run that took twice as long as its stage should shows as -50 %; one without a core each is left out."""
    rates = measured(ROWS, CORES)
    slow = replace(ROWS[0], seconds={**ROWS[0].seconds, "assemble": 2 * ROWS[0].seconds["assemble"]})
    lines = checks(rates, NETWORK, [slow, replace(ROWS[1], ranks=4)], CORES)
    assert len(lines) == 4
    assert "-50%" in lines[2] and "assemble 50%" in lines[-1]


def test_how_far_the_coarse_problem_is_from_those_timed():
    """Ten million dofs have ten times the coarse unknowns of the largest run, of one million."""
    assert any("n is 10.0 times the largest" in line for line in assumptions(measured(ROWS, CORES), NETWORK))


def test_tables_of_runs():
    """Seconds of ranks that take turns are not shown; memory is of the fullest rank, and of all at their peaks."""
    rows = [ROWS[0], ROWS[1]]
    assert by_ranks(rows, cores=1)[-1].split()[-1] == "-"
    assert ROWS[1].memory == 201.0
    assert memory(rows)[-1].split()[-1] == "201"


def test_a_report_is_read_again_and_one_of_another_version_refused(tmp_path):
    """With a field more, or one less."""
    report = tmp_path / "report.json"
    fields = asdict(ROWS[1])
    report.write_text(json.dumps(fields))
    (row,) = read(report)
    assert row == replace(ROWS[1], outgoing=[0, 0], incoming=[0, 0], neighbours=[0, 0], logged=[0.0, 0.0])
    for other in (fields | {"more": 1}, {name: value for name, value in fields.items() if name != "alone"}):
        report.write_text(json.dumps(other))
        with pytest.raises(SystemExit, match=r"report\.json: a report of another version"):
            read(report)
    assert read(tmp_path / "none.json") == []
