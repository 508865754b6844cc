"""Results of every kind, computed once."""

import fcntl
import os

import pytest
from support.verified_results import write


@pytest.fixture(scope="session")
def results(tmp_path_factory):
    """kind -> folder of a result, computed when first asked for, by one of the processes that run these tests."""
    own = tmp_path_factory.getbasetemp()
    common = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "results"
    common.mkdir(exist_ok=True)

    def folder(kind):
        with open(common / f"{kind}.lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            result = common / kind
            return result if (result / "result.json").exists() else write(kind, result)

    return folder
