"""Run parallel tests on every rank: rank 0 alone reports them, and a rank that fails does not hang the others."""

import os
import sys
from collections import Counter
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from support import jobs

from feti_homog.system.parallel.mpi_errors import others_come

# The same examples in every run and on every rank; `--hypothesis-profile=search` looks for new ones.
settings.register_profile("suite", derandomize=True, deadline=None, max_examples=60, database=None)
settings.register_profile("search", deadline=None, max_examples=2000, database=None)
settings.load_profile("suite")

RANK = int(os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", "0")))
PATIENCE = 60.0  # seconds that a failing rank waits for the others to end the same test, also on a busy machine


@cache
def report_comm() -> Any:
    """Return a communicator of its own: reports never meet what a test left unfinished on the world's."""
    from mpi4py import MPI

    return MPI.COMM_WORLD.Dup()


@pytest.fixture
def comm() -> Any:
    from mpi4py import MPI

    return MPI.COMM_WORLD


@pytest.fixture
def shared_path(comm: Any, tmp_path: Path) -> Path:
    """Rank 0's temporary folder, on every rank."""
    return Path(comm.bcast(tmp_path, root=0))


@pytest.fixture
def elsewhere(tmp_path: Path) -> Path:
    """Provide a folder far from the repository, with a name that shells and schedulers could misread."""
    folder = tmp_path / "a place, 100%j"
    folder.mkdir()
    return folder


@pytest.fixture
def mpirun() -> Callable[..., Any]:
    return jobs.mpirun


def pytest_addoption(parser: pytest.Parser) -> None:
    words = "of the cases of each parametrized test only every N-th, from the first"
    parser.addoption("--every", type=int, default=1, metavar="N", help=words)
    words = "or from another one: of a test with fewer cases from as many less"
    parser.addoption("--from-case", type=int, default=0, metavar="K", help=words)
    words = "of those not the cases that `-m 'not few_ranks' --every N` runs on more ranks"
    parser.addoption("--but-every", type=int, metavar="N", help=words)
    words = "of tests with several cases not those that `-m 'not one_rank' --every N` runs on several ranks"
    parser.addoption("--but-shared", type=int, metavar="N", help=words)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what --every, --but-every and --but-shared do, of the tests that marks and names have left."""
    every, others, shared, first = map(config.getoption, ("every", "but_every", "but_shared", "from_case"))
    count = Counter(item.nodeid.partition("[")[0] for item in items)
    chosen: list[pytest.Item] = []
    dropped: list[pytest.Item] = []
    cases: Counter[str] = Counter()
    for item in items:
        test = item.nodeid.partition("[")[0]
        runs_elsewhere = others and cases[test] % others == 0 and item.get_closest_marker("few_ranks") is None
        is_shared = shared and cases[test] % shared == 0 and count[test] > 1 and not item.get_closest_marker("one_rank")
        is_chosen = cases[test] % every == first % min(every, count[test])
        (chosen if is_chosen and not runs_elsewhere and not is_shared else dropped).append(item)
        cases[test] += 1
    items[:] = chosen
    if dropped:
        config.hook.pytest_deselected(items=dropped)


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    if RANK != 0:
        config.get_terminal_writer()._file = open(os.devnull, "w")  # noqa: SIM115 (open to the end)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """If a rank fails a phase of a parallel test, all do, and rank 0 reports for them."""
    report = yield
    if item.get_closest_marker("parallel") is None:
        return report
    comm = report_comm()
    failure = f"rank {comm.rank}:\n{report.longreprtext}" if report.failed else ""
    if not others_come(comm, PATIENCE if failure else float("inf")):
        print(f"{item.nodeid}: the other ranks do not end this test;\n{failure}", file=sys.__stderr__, flush=True)
        comm.Abort(1)
    failures = [text for text in comm.allgather(failure) if text]
    if failures:
        report.outcome = "failed"
        report.longrepr = "\n\n".join(failures)
    return report
