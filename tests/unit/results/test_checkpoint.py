"""Checkpoints: what is read is what was written, or is refused."""

import os
import random
import re
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.errors import CaseError
from feti_homog.results import checkpoints
from feti_homog.results.checkpoints import (
    FORMAT,
    PREFIX,
    Checkpoint,
    EventsInMemory,
    packed,
    records,
    refuse_others,
    unpacked,
)

EVENTS = 4


def write(checkpoint: Checkpoint | EventsInMemory, number: int) -> None:
    event = {"path": [0.1 * number, 1.0]}, {"lam": np.arange(5.0) * number, "jump": np.zeros(0)}
    checkpoint.write(number, *event)


def written(folder: Path, signature: str = "this run") -> Checkpoint:
    checkpoint = Checkpoint(folder, MPI.COMM_SELF, signature)
    for number in range(EVENTS):
        write(checkpoint, number)
    return checkpoint


def same(events) -> bool:
    return all(
        event["path"].tolist() == [0.1 * number, 1.0]
        and event["lam"].tolist() == (np.arange(5.0) * number).tolist()
        and event["jump"].shape == (0,)
        for number, event in enumerate(events)
    )


def ends_of(checkpoint: Checkpoint) -> list[int]:
    """Return the ends of the records of the signature and of the events."""
    return [end for end, _ in records(checkpoint.path)]


def test_what_was_written_is_read(tmp_path):
    checkpoint = written(tmp_path)
    assert checkpoint.count() == EVENTS and same(map(checkpoint.read, range(EVENTS)))
    for _ in range(2):
        checkpoint.clear()
        assert checkpoint.count() == 0
    assert list(tmp_path.iterdir()) == []


def test_events_go_on_behind_those_of_an_earlier_run(tmp_path):
    written(tmp_path)
    resumed = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    assert resumed.count() == EVENTS and same(map(resumed.read, range(EVENTS)))
    for number in range(EVENTS, 3 * EVENTS):
        write(resumed, number)
        assert same(map(resumed.read, range(number + 1)))
    assert Checkpoint(tmp_path, MPI.COMM_SELF, "this run").count() == 3 * EVENTS


@pytest.mark.parametrize("room", [0, 300, None])
def test_events_without_room_have_no_multipliers(tmp_path, room):
    """Neither in the file nor in memory."""
    in_file, in_memory = Checkpoint(tmp_path, MPI.COMM_SELF, "this run", room), EventsInMemory(MPI.COMM_SELF, room)
    for events in (in_file, in_memory):
        for number in range(2 * EVENTS):
            write(events, number)
        found = [events.read(number) for number in range(events.count())]
        full = ["lam" in event for event in found]
        assert [event["path"][0] for event in found] == [0.1 * number for number in range(2 * EVENTS)]
        assert all("jump" in event for event in found[: sum(full)]) and full == sorted(full, reverse=True)
        assert not any("jump" in event for event in found[sum(full) :])
        assert all(full) if room is None else not any(full) if room == 0 else 0 < sum(full) < len(full)


@pytest.mark.parametrize("count", range(EVENTS + 1))
def test_an_event_takes_the_place_of_all_from_its_number_on(tmp_path, count):
    checkpoint = written(tmp_path)
    write(checkpoint, count)
    assert checkpoint.count() == count + 1 and same(map(checkpoint.read, range(count + 1)))


def test_replaced_events_give_their_room_back(tmp_path):
    for events in (Checkpoint(tmp_path, MPI.COMM_SELF, "this run", 300), EventsInMemory(MPI.COMM_SELF, 300)):
        for _ in range(4 * EVENTS):
            write(events, 0)
        assert events.count() == 1 and "lam" in events.read(0)


def test_events_with_many_equilibria_or_all_fields_have_no_limit():
    states = {"friction": (True, 2), "all": (False, "all"), "some": (False, 2)}
    cases = {k: SimpleNamespace(has_friction=f, output=SimpleNamespace(states=s)) for k, (f, s) in states.items()}
    limit = checkpoints.WHOLE_BYTES
    assert {k: checkpoints.room_of(case) for k, case in cases.items()} == {"friction": None, "all": None, "some": limit}


def test_events_without_room_keep_what_no_equilibrium_finds_again():
    events = EventsInMemory(MPI.COMM_SELF, 0)
    found = [f"{name}{end}" for name in ("lam", "jump", "used", "alpha") for end in ("", "_axial")]
    events.write(0, {"load": 1.0}, {name: np.zeros(1) for name in (*found, "status", "damage", "sliding")})
    assert {*events.read(0)} == {"load", "status", "damage", "sliding"}


def test_a_power_failure_loses_at_most_a_second(tmp_path, monkeypatch):
    synced, times = [], [0.0, 0.5, 0.999, 1.0, 1.25, 3.0, 3.875]
    monkeypatch.setattr(os, "fsync", lambda descriptor: synced.append(now))
    monkeypatch.setattr(checkpoints, "monotonic", lambda: now)
    checkpoint = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    for number, now in enumerate(times):  # noqa: B007
        write(checkpoint, number)
    assert synced == [0.0, 1.0, 3.0]


def test_other_files_are_refused(tmp_path):
    written(tmp_path)
    with pytest.raises(CaseError, match=r"--resume: .*events is of another run: expected that; found this run"):
        Checkpoint(tmp_path, MPI.COMM_SELF, "that").count()
    checkpoint = written(tmp_path)
    checkpoint.path.write_bytes(b"nothing")
    with pytest.raises(CaseError, match=r"--resume: .*events is damaged: it does not begin as an event file"):
        checkpoint.count()


def test_an_unfinished_record_does_not_count(tmp_path):
    """As a run leaves it that is killed while it writes, at whichever byte; the next event takes its place."""
    checkpoint = written(tmp_path)
    content, ends = checkpoint.path.read_bytes(), ends_of(checkpoint)
    for size in range(len(content)):
        checkpoint.path.write_bytes(content[:size])
        count = checkpoint.count()
        assert count == max(sum(end <= size for end in ends) - 1, 0) and same(map(checkpoint.read, range(count)))
        write(checkpoint, count)
        assert checkpoint.count() == count + 1 and same(map(checkpoint.read, range(count + 1)))


def test_a_file_of_another_format_is_refused(tmp_path):
    checkpoint = written(tmp_path)
    content = checkpoint.path.read_bytes().replace(b"format %d" % FORMAT, b"format %d" % (FORMAT + 1), 1)
    checkpoint.path.write_bytes(content)
    expected = rf"events has the checkpoints' format {FORMAT + 1}, this program reads format {FORMAT};"
    with pytest.raises(CaseError, match=expected):
        checkpoint.count()
    checkpoint.clear()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("bit", range(8))
def test_any_flipped_bit_is_refused(tmp_path, bit):
    """Even of a length, by which the last would be an unfinished one; the message says how to keep the others."""
    checkpoint, chance = written(tmp_path), random.Random(bit)
    content, ends = checkpoint.path.read_bytes(), ends_of(checkpoint)
    places = [*chance.sample(range(len(content)), 24), *(end + k for end in ends[:-1] for k in range(PREFIX.size))]
    for place in places:
        damaged = bytearray(content)
        damaged[place] ^= 1 << bit
        checkpoint.path.write_bytes(damaged)
        with pytest.raises(CaseError, match=r"--resume: .*events (is damaged|has the checkpoints' format)") as caught:
            checkpoint.count()
        if size := re.search(r"`truncate -s (\d+) ", str(caught.value)):
            os.truncate(checkpoint.path, int(size[1]))
            assert checkpoint.count() == max(sum(end <= place for end in ends) - 1, 0)


def test_nothing_but_events_is_removed(tmp_path):
    checkpoint = written(tmp_path)
    (tmp_path / "checkpoint" / "weights.pt").write_text("mine")
    checkpoint.clear()
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["weights.pt"]


@pytest.mark.parametrize("name", ["checkpoint", "checkpoint.dropped"])
@pytest.mark.parametrize("content", ["weights.pt", "events.old", "000000.h5.old", "000009.h5/mine"])
def test_a_folder_of_others_is_refused(tmp_path, name, content):
    written(tmp_path)
    refuse_others(tmp_path)
    path = tmp_path / name / content
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine")
    with pytest.raises(CaseError, match=f"no run of this program wrote {name}/"):
        refuse_others(tmp_path)


def test_a_folder_in_the_place_of_events_is_refused(tmp_path):
    (tmp_path / "checkpoint/events").mkdir(parents=True)
    with pytest.raises(CaseError, match="no run of this program wrote checkpoint/events"):
        refuse_others(tmp_path)


@pytest.mark.parametrize(("make", "kind"), [(Path.touch, "file"), (lambda path: path.symlink_to("."), "link")])
def test_a_checkpoint_that_is_no_folder_is_refused(tmp_path, make, kind):
    make(tmp_path / "checkpoint")
    with pytest.raises(CaseError, match=f"checkpoint is a {kind} there, and a run makes that folder"):
        refuse_others(tmp_path)


class SmallerStream:
    """A decompressor with a thousandth of the bound that it is given."""

    def decompress(self, content: bytes, bound: int) -> bytes:
        return zlib.decompressobj().decompress(content, bound >> 10)


def test_events_larger_than_any_run_writes_are_refused(monkeypatch):
    """A few bytes can decompress to gigabytes, and no memory is taken for them."""
    smaller, larger = (packed({"lam": np.zeros(count)}) for count in (1 << 15, 1 << 17))
    monkeypatch.setattr(checkpoints, "zlib", SimpleNamespace(decompressobj=SmallerStream, error=zlib.error))
    assert len(unpacked(smaller)["lam"]) == 1 << 15
    with pytest.raises(CaseError, match="an event of the checkpoint is damaged: buffer is smaller than requested"):
        unpacked(larger)
