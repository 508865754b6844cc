"""One SLURM for all tests of this folder."""

import signal
from collections.abc import Iterator

import pytest
from support.one_node_slurm import NotStartedError, OneNodeSlurm, obstacle, one_node_slurm


@pytest.fixture(scope="session")
def slurm() -> Iterator[OneNodeSlurm]:
    if reason := obstacle():
        pytest.skip(f"no SLURM of one node here: {reason}")
    before = signal.signal(signal.SIGTERM, signal.default_int_handler)  # of `timeout`: SLURM is to be taken down first
    try:
        with one_node_slurm() as running:
            yield running
        assert not running.processes() and not running.folder.exists()
    except NotStartedError as error:
        pytest.skip(f"no SLURM of one node here: {error}")
    finally:
        signal.signal(signal.SIGTERM, before)
