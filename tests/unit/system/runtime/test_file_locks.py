"""A lock whose file is there only while it is held excludes others; who holds it is known by machine and process."""

import os
import subprocess
import sys
import threading

import pytest
from support.jobs import PATIENCE

from feti_homog.system.runtime import file_locks
from feti_homog.system.runtime.file_locks import Lock, LockHeld, holder, this_process


def test_the_file_is_there_only_while_the_lock_is_held(tmp_path):
    path = tmp_path / "lock"
    assert holder(path) is None
    with Lock(path):
        assert holder(path) == path.read_text() == this_process()
        with pytest.raises(LockHeld, match=f"process {os.getpid()}"):
            Lock(path, timeout=0.02).acquire()
        assert path.exists(), "who is refused must not remove the file of the holder"
    assert holder(path) is None and not path.exists()


def test_a_file_that_is_left_behind_is_no_lock(tmp_path):
    path = tmp_path / "lock"
    path.write_text("a process that was killed")
    assert holder(path) is None
    with Lock(path):
        assert holder(path) == this_process()


def test_one_at_a_time(tmp_path):
    """Holders that remove the file while others wait for it do not let two in at once."""
    inside, most, mutex = 0, 0, threading.Lock()

    def work() -> None:
        nonlocal inside, most
        for _ in range(20):
            with Lock(tmp_path / "lock", timeout=PATIENCE):
                with mutex:
                    inside += 1
                    most = max(most, inside)
                with mutex:
                    inside -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == 1 and not list(tmp_path.iterdir())


def test_the_holder_names_its_job(monkeypatch):
    monkeypatch.setenv("SLURM_JOB_ID", "4711")
    assert this_process().endswith(", job 4711")


def test_only_processes_of_this_machine_are_known_to_have_ended(tmp_path):
    host, process, began = file_locks.tag().rsplit(".", 2)
    assert int(process) == os.getpid() and not file_locks.has_ended(file_locks.tag())
    assert file_locks.has_ended(f"{host}.{process}.{int(began) + 1}"), "its number is another process's now"
    assert not file_locks.has_ended(f"else.where.{process}.{int(began) + 1}") and not file_locks.has_ended("my notes")
    words = "from feti_homog.system.runtime import file_locks; print(file_locks.tag())"
    other = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert file_locks.has_ended(other.stdout.strip())


def test_files_of_the_process_are_removed(tmp_path):
    path = tmp_path / "part"
    path.write_text("half")
    file_locks.files.add(path)
    file_locks.remove_files()
    file_locks.files.discard(path)
    assert not path.exists()
