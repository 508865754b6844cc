"""A process is recognised by its machine, its number and when it began."""

from __future__ import annotations

import os
import subprocess
import sys

from feti_homog.system.runtime import owners


def test_only_processes_of_this_machine_are_known_to_have_ended():
    host, process, began = owners.tag().rsplit(".", 2)
    assert int(process) == os.getpid() and not owners.has_ended(owners.tag())
    assert owners.has_ended(f"{host}.{process}.{int(began) + 1}"), "its number is another process's now"
    assert not owners.has_ended(f"else.where.{process}.{int(began) + 1}") and not owners.has_ended("my notes")


def test_a_process_that_has_ended(tmp_path):
    words = "from feti_homog.system.runtime import owners; print(owners.tag())"
    other = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert owners.has_ended(other.stdout.strip())


def test_files_of_the_process_are_removed(tmp_path):
    path = tmp_path / "part"
    path.write_text("half")
    owners.files.add(path)
    owners.remove_files()
    owners.files.discard(path)
    assert not path.exists()
