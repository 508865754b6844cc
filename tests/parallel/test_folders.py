"""Folders that results cannot go to are refused before the work, in one line; odd names are no hindrance."""

import json
import os
from pathlib import Path

import pytest
from support.base_case import BASE
from support.ranks import parallel_assert, told_once

from feti_homog import cli
from feti_homog.results import output_folder

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


CASE = BASE.replace("mesh_size = 0.05", "mesh_size = 0.3") + "[output]\npictures = false\n"
LONG = "a" * 300


def make(folder, name, content):
    """Make a folder with a file of that name, or with a folder if there is no content."""
    folder.mkdir()
    if content is None:
        (folder / name).mkdir()
    else:
        (folder / name).write_text(content)


REFUSED = {
    "file": (lambda path: path.write_text("mine"), "is a file"),
    "below a file": (lambda path: path.parent.write_text("mine"), "is a file"),
    "dangling link": (lambda path: path.symlink_to("nowhere"), "is a link that leads nowhere"),
    "below a dangling link": (lambda path: path.parent.symlink_to("nowhere"), "is a link that leads nowhere"),
    "link to itself": (lambda path: path.symlink_to(path.name), "Too many levels of symbolic links"),
    "result.json is a folder": (lambda path: make(path, "result.json", None), "result.json is a folder there"),
    "result.h5 is a folder": (lambda path: make(path, "result.h5", None), "result.h5 is a folder there"),
    "result.lock is a folder": (lambda path: make(path, "result.lock", None), "result.lock is a folder there"),
    "path.csv is a folder": (lambda path: make(path, "path.csv", None), "path.csv is a folder there"),
    "checkpoint of others": (
        lambda path: path.mkdir() or make(path / "checkpoint", "model.pt", "mine"),
        "no run of this program wrote checkpoint/model.pt",
    ),
    "result leads nowhere": (
        lambda path: path.mkdir() or (path / "result.json").symlink_to("none"),
        "result.json is a link there that leads nowhere",
    ),
    "checkpoint is a file": (lambda path: make(path, "checkpoint", "mine"), "checkpoint is a file there"),
    "somebody's picture": (lambda path: make(path, "cell.png", "mine"), "no run of this program wrote cell.png"),
    "somebody's table": (lambda path: make(path, "path.csv", "mine"), "no run of this program wrote path.csv"),
    "somebody's log": (lambda path: make(path, "events.log", "mine"), "no run of this program wrote events.log"),
    "other JSON": (lambda path: make(path, "result.json", '{"result": 1}'), "wrote result.json"),
    "JSON no table": (lambda path: make(path, "result.json", "[1, 2]"), "wrote result.json"),
    "no JSON": (lambda path: make(path, "result.json", "result: 1"), "wrote result.json"),
    "no HDF5": (lambda path: make(path, "result.h5", "mine"), "wrote result.h5"),
}


def tree(folder):
    """All that is there, links not followed, with the texts."""
    found = {}
    for path, folders, names in os.walk(folder):
        for name in [*folders, *names]:
            place = Path(path, name)
            found[place] = place.read_text() if place.is_file() else place.is_symlink()
    return found


def run(comm, folder, out):
    """Return the exit code of the tiny case, the same on all ranks."""
    if comm.rank == 0:
        (folder / "cell.toml").write_text(CASE)
    comm.barrier()
    code = cli.main(["run", str(folder / "cell.toml"), "--out", str(out), "--quiet"])
    parallel_assert(comm, comm.bcast(code) == code, f"exit code {code}")
    return code


def refused(comm, folder, out, capsys, message):
    assert run(comm, folder, out) == 2
    told_once(comm, capsys, message)


@pytest.mark.parametrize("name", REFUSED)
def test_folders_that_cannot_be_used_are_refused_and_left_as_they_are(comm, shared_path, capsys, name):
    prepare, message = REFUSED[name]
    out = shared_path / "above" / "out" if "below" in name else shared_path / "out"
    if comm.rank == 0:
        (shared_path / "cell.toml").write_text(CASE)
        prepare(out)
    comm.barrier()
    before = tree(shared_path)
    comm.barrier()
    refused(comm, shared_path, out, capsys, message)
    parallel_assert(comm, tree(shared_path) == before)


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("", '"" is not a folder name'),
        ("a\0b", "names have no null characters"),
        ("/proc/results", "--out /proc/results: cannot be made"),
        ("/dev/null/results", "is a file"),
        (f"/tmp/{LONG}", "File name too long"),
        ("/tmp/" + "/".join(["a" * 100] * 41), "File name too long"),
    ],
    ids=["empty", "null", "proc", "device", "long component", "long path"],
)
def test_names_that_no_folder_can_have_are_refused(comm, shared_path, capsys, out, message):
    refused(comm, shared_path, out, capsys, message)


@pytest.mark.parametrize(
    "name",
    ["a" * 255, "/".join(["deep" * 25] * 30), "-- sp ace\n'\"`$(x)\\ %s {0} ü→\udcff #?*&;|<>"],
    ids=["long", "deep", "signs"],
)
def test_folders_may_have_any_name(comm, shared_path, name):
    """MPI-IO's buffers hold 255 characters."""
    out = shared_path / name
    assert run(comm, shared_path, out) == 0
    if comm.rank == 0:
        written = sorted(path.name for path in out.iterdir())
        assert written == ["interface.xdmf", "result.h5", "result.json", "result.xdmf"]
        assert json.loads((out / "result.json").read_text())["status"] == "done"


def test_own_files_beside_the_results_are_nobodys_business(comm, shared_path):
    out = shared_path / "out"
    if comm.rank == 0:
        make(out, "notes.txt", "mine")
        (out / "figures").mkdir()
    comm.barrier()
    assert run(comm, shared_path, out) == 0
    parallel_assert(comm, (out / "notes.txt").read_text() == "mine" and (out / "figures").is_dir())


@pytest.mark.parametrize(
    "left", [["result.h5"], ["result.json", "cell.png"], ["result.lock", "path.csv"], ["events.log", "path.csv"]]
)
def test_what_a_run_left_may_be_replaced(comm, shared_path, left):
    """A run that was killed may leave any of its files."""
    if comm.rank == 0:
        header = b"\x89HDF\r\n\x1a\n" + b"\0" * 500 + b"feti_homog"
        contents = {"result.h5": header, "result.json": b'{"version": "0", "case": {}, "solver": {}}'}
        contents["events.log"] = b"# feti-homog: events of cell, version 0\n"
        for name in left:
            (shared_path / name).write_bytes(contents.get(name, b"x"))
        output_folder.refuse_files_of_others(shared_path)
    comm.barrier()
