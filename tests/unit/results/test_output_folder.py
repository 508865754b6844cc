"""The folder of the results: held by one run, and gone again if nothing was written."""

import errno
import fcntl
import os
from pathlib import Path

import pytest
from mpi4py import MPI

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import output_folder
from feti_homog.system.runtime.file_locks import Lock


def test_folders_that_stay_empty_are_removed(tmp_path):
    with (
        pytest.raises(CaseError, match="bad input"),
        output_folder.held(tmp_path / "new" / "out", MPI.COMM_SELF, print),
    ):
        raise CaseError("bad input")
    assert not list(tmp_path.iterdir())


def test_folders_with_results_or_of_others_stay(tmp_path):
    (tmp_path / "there").mkdir()
    with output_folder.held(tmp_path / "there", MPI.COMM_SELF, print):
        pass
    with output_folder.held(tmp_path / "new" / "out", MPI.COMM_SELF, print):
        (tmp_path / "new" / "out" / "result.json").touch()
    assert [path.name for path in (tmp_path / "new" / "out").iterdir()] == ["result.json"]
    assert not list((tmp_path / "there").iterdir())


def test_a_folder_that_cannot_be_made_is_refused():
    refusal = pytest.raises(CaseError, match="--out /proc/results: cannot be made: ")
    with refusal, output_folder.held(Path("/proc/results"), MPI.COMM_SELF, print):
        pass


def test_files_of_an_earlier_result_are_removed_and_nothing_else(tmp_path):
    earlier = ["result.h5", "result.xdmf", "path.csv", "angle.csv", "path.gif", "path.png", "angle_states.png"]
    earlier += ["envelope.csv", "envelope.png", "load.csv", "load.png", "case_E33.png", "case_minus_temperature.png"]
    earlier += [
        "interface.xdmf",
        "cell.png",
        "cell.pdf",
        "state_3.svg",
        "mesh_error.png",
        "partition.png",
        "sensitivities.png",
        "energy.png",
        "state_3.png",
        "interface.png",
        "case_minus_gamma12.png",
        "case_E11.png",
        "angle_states.png",
    ]
    others = ["case.toml", "my.png", "case_mine.png", "my.svg", "result.h5.old", "statistics.csv"]
    for name in [*earlier, *others, "result.json"]:
        (tmp_path / name).touch()
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "events").touch()  # of a path, which has a log
    output_folder.remove_other_results(tmp_path, {*earlier, "events.log", "result.json"})
    assert (tmp_path / "checkpoint" / "events").exists()
    output_folder.remove_other_results(tmp_path, {"result.json", "path.csv"})
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted([*others, "result.json", "path.csv"])


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
def test_a_file_system_without_locks_is_reported_of(tmp_path, monkeypatch, capsys, code):
    def flock(file, kind):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", flock)
    with output_folder.held(tmp_path / "out", MPI.COMM_SELF, print):
        (tmp_path / "out" / "result.json").touch()
        output_folder.usable(tmp_path / "out")
    printed = capsys.readouterr().out
    assert printed.startswith("warning: cannot lock ") and printed.count("\n") == 1 and os.strerror(code) in printed
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["result.json"]


def test_other_failures_of_the_lock_are_errors(tmp_path, monkeypatch):
    def flock(file, kind):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(fcntl, "flock", flock)
    with pytest.raises(FetiHomogError, match="cannot lock"), output_folder.held(tmp_path, MPI.COMM_SELF, print):
        pass


def test_a_lock_that_is_a_link_is_not_followed(tmp_path):
    mine, out = tmp_path / "mine", tmp_path / "out"
    mine.write_text("mine")
    out.mkdir()
    (out / output_folder.LOCK).symlink_to(mine)
    with pytest.raises(CaseError, match=r"result\.lock is a link there"):
        output_folder.usable(out)
    with pytest.raises(FetiHomogError, match="cannot lock"), Lock(out / output_folder.LOCK):
        pass
    assert mine.read_text() == "mine"


def test_a_study_is_no_result(tmp_path):
    """`verify`, `plot`, `report` and other commands for results name the kind of a folder without result.json."""
    assert output_folder.result_folder(tmp_path) == tmp_path
    (tmp_path / "sweep.json").touch()
    with pytest.raises(CaseError, match=r"such as .*/case-0001, not that of a sweep; `feti-homog collect"):
        output_folder.result_folder(tmp_path)
    (tmp_path / "result.json").touch()
    assert output_folder.result_folder(tmp_path) == tmp_path
    with pytest.raises(CaseError, match="expected the folder of a result, not a file"):
        output_folder.result_folder(tmp_path / "result.json")


def test_commands_in_messages_quote_folders(tmp_path):
    folder = tmp_path / "two words"
    folder.mkdir()
    (folder / "sweep.json").touch()
    with pytest.raises(CaseError, match=r"`feti-homog collect '[^']*two words'` makes tables"):
        output_folder.result_folder(folder)
    (folder / "checkpoint").mkdir()
    with pytest.raises(CaseError, match=r"`feti-homog run CASE --out '[^']*two words'`"):
        output_folder.refuse_begun(folder)
