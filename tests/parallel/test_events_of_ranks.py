"""Stored events: every rank reads the part that it wrote, from the file and from memory, with parts of any length."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.ranks import parallel_assert

from feti_homog.errors import CaseError
from feti_homog.results.checkpoints import Checkpoint, EventsInMemory, packed, record, records, unpacked

pytestmark = pytest.mark.parallel


def part(rank: int, number: int) -> dict[str, Any]:
    """Return a rank's arrays of an event; rank 1 has none."""
    n = 0 if rank == 1 else rank + number + 1
    return {"lam": 10.0 * rank + np.arange(n), "jump": np.full((n, 2), rank + number / 8), "status": np.full(n, rank)}


@pytest.fixture(params=["file", "memory"])
def events(request: Any, comm: Any, shared_path: Path) -> EventsInMemory:
    return Checkpoint(shared_path, comm, "this run") if request.param == "file" else EventsInMemory(comm)


def test_every_rank_reads_what_it_wrote(comm: Any, events: EventsInMemory) -> None:
    for number in range(3):
        events.write(number, {"load": number / 4}, part(comm.rank, number))
    parallel_assert(comm, events.count() == 3)
    for number in (2, 0, 1):
        event, expected = events.read(number), part(comm.rank, number) | {"load": np.array(number / 4)}
        is_equal = {*event} == {*expected} and all(np.array_equal(event[name], expected[name]) for name in expected)
        parallel_assert(comm, is_equal, f"event {number}: {event}")


@pytest.mark.parametrize("ranks", [1, 2])
def test_arrays_of_fewer_ranks_are_refused(comm: Any, shared_path: Path, ranks: int) -> None:
    if comm.size == ranks:
        pytest.skip("as many ranks as the file")
    checkpoint = Checkpoint(shared_path, comm, "this run")
    checkpoint.write(0, {"load": 0.25}, part(comm.rank, 0))
    if comm.rank == 0:
        (_, first), (_, content) = records(checkpoint.path)
        event = unpacked(content)
        for name in ("lam", "jump", "status"):
            event[f"{name}_ends"] = event[f"{name}_ends"][-1:].repeat(ranks)
        whole = checkpoint.path.read_bytes()
        checkpoint.path.write_bytes(whole[: whole.index(first) + len(first)] + record(packed(event)))
    again = Checkpoint(shared_path, comm, "this run")
    again.count()
    with pytest.raises(CaseError, match=f"its arrays are not of {comm.size} ranks"):
        again.read(0)
