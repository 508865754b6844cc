"""Locks between processes, and files that are written whole or not at all."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from feti_homog.common.file_locks import Lock, LockHeld, is_locked
from feti_homog.errors import FetiHomogError
from feti_homog.output.files import atomic

HOLDER = """
import sys, time
from pathlib import Path
from feti_homog.common.file_locks import Lock
Lock(Path(sys.argv[1]), shared={shared}).acquire()
print("held", flush=True)
time.sleep(60)
"""


def holder(path: Path, shared: bool = False) -> subprocess.Popen[bytes]:
    """Another process that holds the lock."""
    program = [sys.executable, "-c", HOLDER.format(shared=shared), str(path)]
    process = subprocess.Popen(program, stdout=subprocess.PIPE)
    assert process.stdout is not None and process.stdout.readline() == b"held\n"
    return process


@pytest.mark.parametrize(("theirs", "ours", "free"), [
    (False, False, False), (False, True, False), (True, False, False), (True, True, True),
])  # fmt: skip
def test_a_lock_excludes_unless_both_share_it(tmp_path, theirs, ours, free):
    path = tmp_path / "lock"
    process = holder(path, theirs)
    try:
        lock = Lock(path, ours, timeout=0.05)
        if free:
            lock.acquire()
            lock.release()
        else:
            with pytest.raises(LockHeld, match="another process" if theirs else f"process {process.pid}"):
                lock.acquire()
        assert is_locked(path) != theirs
    finally:
        process.kill()
        process.wait()
    with Lock(path):
        assert is_locked(path)
    assert not is_locked(path)


def test_a_lock_that_cannot_be_made_is_told(tmp_path):
    with pytest.raises(FetiHomogError, match="cannot lock"):
        Lock(tmp_path / "none" / "lock").acquire()
    assert not is_locked(tmp_path / "none" / "lock")


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = atomic.replace_text(tmp_path / "file", "old")

    def ends_early(part: Path) -> None:
        part.write_text("ne")
        raise OSError(28, "No space left on device")

    with pytest.raises(FetiHomogError, match=r"cannot write .*file: No space left on device"):
        atomic.replace(path, ends_early)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_a_full_device_is_told():
    with pytest.raises(FetiHomogError, match="No space left on device"):
        atomic.replace(Path("/dev/shm/feti_homog_none"), lambda part: Path("/dev/full").write_text("x"))
