"""Files that killed writers left are removed, no others; errors of writes name a reason."""

import errno
import os
from types import SimpleNamespace

import pytest
from mpi4py import MPI

from feti_homog.errors import FetiHomogError
from feti_homog.results import atomic, output_folder
from feti_homog.system.runtime import file_locks


def test_unfinished_files_are_removed(tmp_path):
    kept = [tmp_path / name for name in ("result.json", "my.part", "cases.csv", "notes.host.12.part")]
    unfinished = ("result.h5", "case_minus_temperature.png", "load.csv")
    for path in [*kept, *(atomic.part_of(tmp_path / name) for name in unfinished)]:
        path.write_text("")
    with output_folder.held(tmp_path, MPI.COMM_SELF, print):
        assert {path.name for path in tmp_path.iterdir()} == {path.name for path in kept} | {output_folder.LOCK}
    assert sorted(tmp_path.iterdir()) == sorted(kept)


def test_only_what_dead_writers_left_is_removed_beside_others(tmp_path):
    host, process, began = file_locks.tag().rsplit(".", 2)
    dead = f"{host}.{process}.{int(began) + 1}"
    names = ("cell.png.%s.part", "mine.png.%s.part", "cell.png.%s.txt")
    for name in (*(words % dead for words in names), names[0] % file_locks.tag(), names[0] % f"else.{dead}"):
        (tmp_path / name).write_text("")
    before = set(tmp_path.iterdir())
    atomic.remove_unfinished(tmp_path, output_folder.RESULT_FILE, alone=False)
    assert before - set(tmp_path.iterdir()) == {tmp_path / (names[0] % dead)}


def test_a_committed_file_has_its_name_only(tmp_path):
    part = atomic.part_of(tmp_path / "table.csv")
    part.write_text("a,b\n")
    atomic.commit(part, tmp_path / "table.csv")
    assert [path.read_text() for path in tmp_path.iterdir()] == ["a,b\n"]


@pytest.mark.parametrize(
    ("error", "blocks", "reason"),
    [
        (OSError("Can't write data (file write failed)"), 0, os.strerror(errno.ENOSPC)),
        (OSError("Can't write data (file write failed)"), 9, "Can't write data (file write failed)"),
        (OSError(errno.EFBIG, os.strerror(errno.EFBIG)), 0, os.strerror(errno.EFBIG)),
    ],
    ids=["full", "not full", "another reason"],
)
def test_a_full_disk_is_the_reason_where_hdf5_gives_none(tmp_path, monkeypatch, error, blocks, reason):
    """Through MPI-IO, HDF5 loses the reason of a write error."""
    monkeypatch.setattr(os, "statvfs", lambda folder: SimpleNamespace(f_bavail=blocks))
    with pytest.raises(FetiHomogError) as caught, atomic.file_errors("write", tmp_path / "result.h5"):
        raise error
    assert caught.value.faults == (f"cannot write {tmp_path / 'result.h5'}: {reason}",)
