"""Root-only calls and agreement of exceptions, at any number of ranks."""

import numpy as np
import pytest

from feti_homog.errors import CaseError, MeshError
from feti_homog.system.parallel.distributed_arrays import gather, scatter
from feti_homog.system.parallel.mpi_errors import RemoteError, agree, on_root, on_root_only

pytestmark = pytest.mark.parallel


def fail(*faults):
    raise CaseError(*faults)


def test_parts_are_dealt_to_their_ranks(comm):
    parts = [(r, np.full(3, r), np.arange(10)[::-2]) for r in range(comm.size)] if comm.rank == 0 else []
    number, threes, backwards = scatter(comm, parts)
    assert number == comm.rank and not parts
    assert gather(comm, number) == (list(range(comm.size)) if comm.rank == 0 else [])
    assert np.array_equal(threes, [comm.rank] * 3) and np.array_equal(backwards, [9, 7, 5, 3, 1])


def test_results_of_the_root_and_of_each_come_back(comm):
    assert on_root(comm, lambda: (comm.rank, "text")) == (0, "text")
    assert on_root(comm, divmod, 17, 5) == (3, 2)
    assert agree(comm, lambda: comm.rank) == comm.rank


def test_on_root_raises_everywhere_with_faults(comm):
    with pytest.raises(CaseError) as caught:
        on_root(comm, fail, "one", "two")
    assert caught.value.faults == ("one", "two")


def test_on_root_tells_the_traceback_of_a_defect(comm):
    kind = ZeroDivisionError if comm.rank == 0 else RemoteError
    with pytest.raises(kind) as caught:
        on_root(comm, lambda: 1 / 0)
    assert comm.rank == 0 or "ZeroDivisionError" in str(caught.value)


def test_on_root_only_keeps_its_result(comm):
    assert on_root_only(comm, lambda: 5) == (5 if comm.rank == 0 else None)
    with pytest.raises(CaseError):
        on_root_only(comm, fail, "one")


def test_agree_raises_the_first_ranks_error(comm):
    def fail_above_first():
        if comm.rank >= min(1, comm.size - 1):
            raise MeshError(f"rank {comm.rank}")

    with pytest.raises(MeshError, match=f"^rank {min(1, comm.size - 1)}$"):
        agree(comm, fail_above_first)


def test_agree_prefers_a_defect(comm):
    def misbehave():
        if comm.rank == comm.size - 1:
            raise KeyError("lost")
        raise MeshError("bad mesh")

    with pytest.raises(KeyError if comm.rank == comm.size - 1 else RemoteError, match="lost"):
        agree(comm, misbehave)


def test_all_go_on_after_an_error(comm):
    for _ in range(3):
        with pytest.raises(CaseError):
            on_root(comm, fail, "again")
    assert comm.allreduce(1) == comm.size
