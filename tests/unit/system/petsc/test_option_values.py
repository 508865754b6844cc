"""Paths that can be opened for writing are accepted, others refused, as opening them shows."""

import os

import pytest

from feti_homog.system.petsc.option_values import can_be_written

NAMES = {
    "new": True, "there": True, "folder": False, "folder/": False, "folder/new": True, "none/new": False,
    "new/": False, "there/": False, "there/new": False, "": False, "a\0b": False, "link to new": True,
    "link to nowhere": False, "link to itself": False, "a" * 300: False, "pipe": False,
}  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "folder").mkdir()
    (tmp_path / "there").touch()
    (tmp_path / "link to new").symlink_to("folder/other")
    (tmp_path / "link to nowhere").symlink_to("none/other")
    (tmp_path / "link to itself").symlink_to("link to itself")
    os.mkfifo(tmp_path / "pipe")
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("name", NAMES)
def test_names_are_reported_apart(folder, name):
    assert can_be_written(name) is NAMES[name]
    if "\0" not in name and name != "pipe":
        try:
            open(name, "w").close()
            opened = True
        except OSError:
            opened = False
        assert opened is NAMES[name]


def test_a_pipe_can_be_written_while_somebody_reads(folder):
    reader = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
    assert can_be_written("pipe")
    os.close(reader)
    assert can_be_written("/dev/null")
