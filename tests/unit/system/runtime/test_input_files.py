"""Files that never end, wait for a writer or are too long are refused; nothing of them is kept."""

import os

import pytest

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.system.runtime import input_files


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
