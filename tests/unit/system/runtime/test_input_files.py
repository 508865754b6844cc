"""Files that crash a library, never end, wait for a writer or are too long are refused in one line."""

import os
import resource
import select
import signal

import pytest
from support.jobs import PATIENCE

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.system.runtime import input_files
from feti_homog.system.runtime.input_files import in_own_process

MEMORY = 1 << 28


def crash(_):
    os.kill(os.getpid(), signal.SIGSEGV)


def refuse(directory):
    raise CaseError(f"{directory}: no")


def ask_for_too_much(_):
    raise MemoryError("256 TiB")


def test_an_answer_comes_back(tmp_path):
    assert in_own_process(tmp_path, os.listdir, MEMORY) == []


@pytest.mark.parametrize(
    ("function", "words"), [(crash, "reads it crashes"), (refuse, "no"), (ask_for_too_much, "256 TiB")]
)
def test_what_goes_wrong_is_reported(tmp_path, function, words):
    with pytest.raises(CaseError, match=f"^{tmp_path}: .*{words}$"):
        in_own_process(tmp_path, function, MEMORY)


def wait(_):
    signal.pause()


def compute(_):
    while True:
        pass


@pytest.mark.parametrize(("function", "seconds"), [(wait, 0.0), (compute, 0.5)])
def test_what_does_not_end_is_ended(tmp_path, function, seconds):
    """A pipe ends when no process can write to it any more."""
    ours, theirs = os.pipe()
    with pytest.raises(CaseError, match=f"damaged, reading does not end within {seconds:g} s"):
        in_own_process(tmp_path, function, MEMORY, seconds)
    os.close(theirs)
    assert os.read(ours, 1) == b""
    os.close(ours)


def test_a_child_ends_with_its_parent(tmp_path):
    """The parent is killed while the child waits; the pipe ends with the last process that has it open."""
    ours, theirs = os.pipe()

    def end_the_parent(_):
        os.kill(os.getppid(), signal.SIGKILL)
        signal.pause()

    parent = os.fork()
    if parent == 0:
        in_own_process(tmp_path, end_the_parent, MEMORY)
    os.close(theirs)
    assert os.waitstatus_to_exitcode(os.waitpid(parent, 0)[1]) == -signal.SIGKILL
    assert select.select([ours], [], [], PATIENCE)[0] and os.read(ours, 1) == b""
    os.close(ours)


def test_the_limit_follows_from_the_size_of_the_file(tmp_path):
    """A sparse file of 5 MB has 10 s of the processor, and 1 s more for each 0.1 MB."""
    (tmp_path / "large").touch()
    os.truncate(tmp_path / "large", 5_000_000)
    assert in_own_process(tmp_path / "large", lambda _: resource.getrlimit(resource.RLIMIT_CPU)[0], MEMORY) == 60
    os.truncate(tmp_path / "large", 1 << 40)
    assert in_own_process(tmp_path / "large", lambda _: 0, MEMORY) == 0  # a clock of years


def test_more_memory_than_allowed_is_refused(tmp_path):
    assert in_own_process(tmp_path, lambda _: len(bytes(1 << 20)), MEMORY) == 1 << 20
    with pytest.raises(CaseError, match="damaged, "):
        in_own_process(tmp_path, lambda _: len(bytes(1 << 30)), MEMORY)


def test_files_are_read_and_pipes_to_the_limit(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    assert input_files.read(tmp_path / "a", 3) == input_files.read(tmp_path / "a", pipes=True) == b"abc"
    with pytest.raises(OSError, match="more than 1 MiB"):
        input_files.read(type(tmp_path)("/dev/zero"), 1 << 20, pipes=True)


@pytest.mark.parametrize("name", ["folder", "pipe", "device", "long", "sparse", "circle", "none"])
def test_what_is_no_file_is_refused(tmp_path, name):
    path = tmp_path / name
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    (tmp_path / "long").write_bytes(b"abcd")
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    with (tmp_path / "sparse").open("wb") as stream:
        stream.truncate(20 << 30)
    with pytest.raises(OSError) as error:
        input_files.read(path, 3)
    assert error.value.strerror and input_files.unreadable(path, error.value).exit_code == 2


def test_files_without_rights_are_a_failure(tmp_path):
    error = input_files.unreadable(tmp_path, PermissionError(13, "Permission denied"))
    assert type(error) is FetiHomogError and not isinstance(error, CaseError)
