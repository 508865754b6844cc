"""Checkpoints: what is read is what was written, or is refused."""

from __future__ import annotations

import random
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from feti_homog.errors import CaseError, ConvergenceError
from feti_homog.results import atomic, checkpoint_file
from feti_homog.results.checkpoint import EVENTS_AT_ONCE, Checkpoint
from feti_homog.results.checkpoint_file import FORMAT, USER_BLOCK
from feti_homog.results.checkpoint_folder import refuse_others
from feti_homog.results.events_in_memory import EventsInMemory

EVENTS = 4


def written(folder: Path, signature: str = "this run") -> Checkpoint:
    checkpoint = Checkpoint(folder, MPI.COMM_SELF, signature)
    for number in range(EVENTS):
        checkpoint.write(number, {"path": [0.1 * number, 1.0]}, {"lam": np.arange(5.0) * number, "jump": np.zeros(0)})
    return checkpoint


def same(events) -> bool:
    return all(
        event["path"].tolist() == [0.1 * number, 1.0]
        and event["lam"].tolist() == (np.arange(5.0) * number).tolist()
        and event["jump"].shape == (0,)
        for number, event in enumerate(events)
    )


def test_what_was_written_is_read(tmp_path):
    checkpoint = written(tmp_path)
    assert checkpoint.count() == EVENTS and same(map(checkpoint.read, range(EVENTS)))
    assert checkpoint.clear() == EVENTS and checkpoint.count() == 0 and checkpoint.clear() == 0
    assert list(tmp_path.iterdir()) == []


def test_a_million_events_are_read_in_their_order(tmp_path):
    """Names have six digits, or seven."""
    checkpoint = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    checkpoint.folder.mkdir()
    for start, end in ((0, 999_999), (999_999, 1_000_000), (1_000_000, 1_000_002)):
        events = {"number": np.arange(start, end)}
        checkpoint_file.write(checkpoint.folder / f"{start:06d}.h5", events, "this run", start)
    assert checkpoint.count() == 1_000_002 and checkpoint.read(1_000_001)["number"] == 1_000_001
    checkpoint.keep(1_000_001)
    assert checkpoint.count() == 1_000_001 and checkpoint.clear() == 1_000_001


def test_light_events_are_written_together(tmp_path):
    checkpoint, last = Checkpoint(tmp_path, MPI.COMM_SELF, "this run"), EVENTS_AT_ONCE + 5
    for number in range(last):
        event = {"path": [0.1 * number, 1.0]}, {"lam": np.arange(5.0) * number, "jump": np.zeros(0)}
        checkpoint.write(number, *event, light=number not in (2, last - 1))
        assert same([*map(checkpoint.read, range(number + 1))])
    files = sorted(path.name for path in (tmp_path / "checkpoint").iterdir())
    assert files == ["000000.h5", "000003.h5", f"{3 + EVENTS_AT_ONCE:06d}.h5"]
    resumed = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    assert resumed.count() == last and same(map(resumed.read, range(last)))
    resumed.write(last, {"path": [0.1 * last, 1.0]}, {"lam": np.arange(5.0) * last, "jump": np.zeros(0)}, light=True)
    resumed.flush()
    assert resumed.count() == last + 1 and resumed.clear() == last + 1


@pytest.mark.parametrize(("error", "kept"), [(ConvergenceError, 2), (RuntimeError, 0)])
def test_light_events_are_kept_where_all_ranks_raise(tmp_path, error, kept):
    checkpoint = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    with pytest.raises(error, match="off"), checkpoint:
        for number in range(2):
            event = {"path": [0.1 * number, 1.0]}, {"lam": np.arange(5.0) * number, "jump": np.zeros(0)}
            checkpoint.write(number, *event, light=True)
        raise error("off")
    resumed = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")
    assert resumed.count() == kept and same(map(resumed.read, range(kept)))


def write_for_lean(checkpoint: Checkpoint, number: int) -> None:
    """Events 2, 6, 10, ... are settled, and so are 3, 7, ...; every other one is light."""
    event = {"path": [0.1 * number], "alpha": [1.0]}, {"lam": np.arange(50.0) + number, "status": np.arange(5) * number}
    checkpoint.write(number, *event, light=number % 2 == 0, settled=number if number % 4 > 1 else -1)


def assert_lean(checkpoint: Checkpoint, count: int, first_whole: int) -> None:
    for number in range(count):
        event = checkpoint.read(number)
        assert event["path"] == [0.1 * number] and (event["status"] == np.arange(5) * number).all()
        assert ("alpha" in event) == ("lam" in event) == (number >= first_whole)
        assert number < first_whole or (event["lam"] == np.arange(50.0) + number).all()


@pytest.mark.parametrize(("files", "first_whole"), [(0.5, 10), (3.5, 6), (None, 0)])
def test_old_events_become_lean(tmp_path, files, first_whole):
    """There is room for so many whole files, of two events each; that of the last settled event stays whole."""
    room = None
    if files is not None:
        one = Checkpoint(tmp_path / "one", MPI.COMM_SELF, "this run")
        for number in range(2):
            write_for_lean(one, number)
        room = int(files * (one.folder / "000000.h5").stat().st_size)
    checkpoint = Checkpoint(tmp_path, MPI.COMM_SELF, "this run", room)
    for number in range(10):
        write_for_lean(checkpoint, number)
    replaced = (checkpoint.folder / "000008.h5").read_bytes()
    for number in range(10, 12):
        write_for_lean(checkpoint, number)
    assert_lean(checkpoint, 12, first_whole)
    # As if killed before it was removed.
    (checkpoint.folder / "000008.h5").write_bytes(replaced)
    resumed = Checkpoint(tmp_path, MPI.COMM_SELF, "this run", room)
    assert resumed.count() == 12
    assert_lean(resumed, 12, first_whole)
    for number in range(12, 16):
        write_for_lean(resumed, number)
    assert_lean(resumed, 16, {10: 14, 6: 14, 0: 0}[first_whole])
    assert resumed.clear() == 16


def test_events_in_memory_become_lean():
    events = EventsInMemory(MPI.COMM_SELF, room=0)
    for number in range(12):
        write_for_lean(events, number)
    assert_lean(events, 12, 11)


@pytest.mark.parametrize("count", [0, 2, 3, 5, 7, 8])
def test_events_are_forgotten_from_one_on(tmp_path, count):
    """Files of three, one, and four events; a kept part of a file is written, and others go on from it."""
    checkpoint = Checkpoint(tmp_path, MPI.COMM_SELF, "this run")

    def write(number):
        event = {"path": [0.1 * number, 1.0]}, {"lam": np.arange(5.0) * number, "jump": np.zeros(0)}
        checkpoint.write(number, *event, light=number not in (2, 3, 7))

    for number in range(8):
        write(number)
    checkpoint.keep(count)
    assert Checkpoint(tmp_path, MPI.COMM_SELF, "this run").count() == count
    for number in range(count, 8):
        assert same(map(checkpoint.read, range(number)))
        write(number)
    assert checkpoint.count() == 8 and same(map(checkpoint.read, range(8)))


def test_the_checkpoint_of_another_run_is_refused(tmp_path):
    written(tmp_path)
    with pytest.raises(CaseError, match=r"--resume: .*000000\.h5 is of another run: expected that; found this run"):
        Checkpoint(tmp_path, MPI.COMM_SELF, "that").count()


def test_a_checkpoint_without_one_of_its_events_is_refused(tmp_path):
    checkpoint = written(tmp_path)
    (tmp_path / "checkpoint" / "000001.h5").unlink()
    with pytest.raises(CaseError, match="--resume: event 000001 is missing"):
        checkpoint.count()


def test_an_unfinished_event_does_not_count(tmp_path):
    checkpoint = written(tmp_path)
    atomic.part_of(tmp_path / "checkpoint" / "000004.h5").write_bytes(b"half")
    assert checkpoint.count() == EVENTS


@pytest.mark.parametrize("version", [1, FORMAT + 1])
def test_an_event_of_another_format(tmp_path, version):
    checkpoint = written(tmp_path)
    path = tmp_path / "checkpoint" / "000001.h5"
    if version == 1:  # which had no header
        with h5py.File(path, "w") as file:
            file.attrs["format"] = version
    else:
        path.write_bytes(path.read_bytes().replace(b"format %d" % FORMAT, b"format %d" % version, 1))
    found = rf"000001\.h5 has the checkpoints' format {version}, this program reads format {FORMAT};"
    with pytest.raises(CaseError, match=found):
        checkpoint.count()


@pytest.mark.parametrize("content", [b"", b"nothing", None])
def test_an_unreadable_event_is_refused(tmp_path, content):
    checkpoint = written(tmp_path)
    path = tmp_path / "checkpoint" / "000002.h5"
    path.write_bytes(path.read_bytes()[:-200] if content is None else content)
    with pytest.raises(CaseError, match=r"--resume: .*000002\.h5"):
        checkpoint.count()


@pytest.mark.parametrize("bit", range(8))
def test_any_flipped_bit_is_refused_before_hdf5_sees_it(tmp_path, bit):
    """Where a bit is wrong some releases of HDF5 end the process; its own words would be "no readable event"."""
    checkpoint, chance = written(tmp_path), random.Random(bit)
    path = tmp_path / "checkpoint" / "000003.h5"
    content = path.read_bytes()
    for place in [*chance.sample(range(USER_BLOCK, len(content)), 12), content.index(b"sha256") + 10]:
        damaged = bytearray(content)
        damaged[place] ^= 1 << bit
        path.write_bytes(damaged)
        with pytest.raises(CaseError, match=r"--resume: .*000003\.h5 is damaged: its checksum is wrong"):
            checkpoint.count()


def test_bits_that_nobody_reads_are_harmless(tmp_path):
    checkpoint = written(tmp_path)
    path = tmp_path / "checkpoint" / "000003.h5"
    damaged = bytearray(path.read_bytes())
    damaged[USER_BLOCK - 1] ^= 1
    path.write_bytes(damaged)
    assert checkpoint.count() == EVENTS and same(map(checkpoint.read, range(EVENTS)))


@pytest.mark.parametrize(("old", "new"), [(1, 2), (3, 0), (0, EVENTS)])
def test_a_copy_of_another_event_is_refused(tmp_path, old, new):
    checkpoint = written(tmp_path)
    path = tmp_path / "checkpoint" / f"{new:06d}.h5"
    path.write_bytes((tmp_path / "checkpoint" / f"{old:06d}.h5").read_bytes())
    with pytest.raises(CaseError, match=rf"{new:06d}\.h5 is a copy of event {old:06d}: expected event {new:06d}"):
        checkpoint.count()


def test_nothing_but_events_is_removed(tmp_path):
    checkpoint = written(tmp_path)
    (tmp_path / "checkpoint" / "weights.pt").write_text("mine")
    assert checkpoint.clear() == EVENTS
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["weights.pt"]


@pytest.mark.parametrize("name", ["checkpoint", "checkpoint.dropped"])
@pytest.mark.parametrize("content", ["weights.pt", "000000.h5.old", "000009.h5/mine"])
def test_a_folder_of_others_is_refused(tmp_path, name, content):
    written(tmp_path)
    refuse_others(tmp_path)
    path = tmp_path / name / content
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("mine")
    with pytest.raises(CaseError, match=f"no run of this program wrote {name}/"):
        refuse_others(tmp_path)


@pytest.mark.parametrize(("make", "kind"), [(Path.touch, "file"), (lambda path: path.symlink_to("."), "link")])
def test_a_checkpoint_that_is_no_folder_is_refused(tmp_path, make, kind):
    make(tmp_path / "checkpoint")
    with pytest.raises(CaseError, match=f"checkpoint is a {kind} there, and a run makes a folder of that name"):
        refuse_others(tmp_path)
