"""A process is recognised by its machine, its number and when it began."""

import os
import subprocess
import sys

from feti_homog.system.runtime import file_locks


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
