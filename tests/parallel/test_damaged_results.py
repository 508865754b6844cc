"""Results that are missing, damaged or foreign: one line and exit code 2; nothing is drawn or computed."""

import json
import os
import shutil
import time

import numpy as np
import pytest
from support.base_case import BASE
from support.ranks import parallel_assert, told_once
from support.small_path import PATH

from feti_homog import cli

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]


def path_run(comm, folder, text, *words):
    """Return the exit code of `run` of a path on all ranks; its results are in folder/out."""
    if comm.rank == 0:
        (folder / "path.toml").write_text(text)
    comm.barrier()
    code = cli.main(["run", str(folder / "path.toml"), "--out", str(folder / "out"), "--quiet", *words])
    parallel_assert(comm, comm.bcast(code) == code)
    return code


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Provide the folder of two finished runs, `one` and `other`, on every rank."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("finished"))
    if comm.size <= 2:
        for name, strength in (("one", "4.0"), ("other", "4.1")):
            assert path_run(comm, folder, PATH.replace("4.0", strength)) == 0
            comm.barrier()
            if comm.rank == 0:
                (folder / "out").rename(folder / name)
            comm.barrier()
    return folder


def cut(path, size):
    path.write_bytes(path.read_bytes()[:size])


def flip(path, place, bit=3):
    content = bytearray(path.read_bytes())
    content[place] ^= 1 << bit
    path.write_bytes(content)


def exchange(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


def gone(path):
    path.unlink()
    path.mkdir()


def other(out, name):
    shutil.copy(out.parent / "other" / name, out / name)


DAMAGES = {
    "result.h5 cut": (
        lambda out: cut(out / "result.h5", 5000),
        "result.h5: it is damaged, or of another run: it has 5000",
    ),
    "bit of its superblock": (lambda out: flip(out / "result.h5", 20), "result.h5: it is damaged"),
    "bit of its numbers": (lambda out: flip(out / "result.h5", 9000), "its checksum is wrong"),
    "result.h5 of another run": (lambda out: other(out, "result.h5"), "result.h5: it is damaged, or of another run"),
    "result.json cut": (lambda out: cut(out / "result.json", 900), "cannot read"),
    "another number": (lambda out: exchange(out / "result.json", "4.0", "4.5"), "its checksum is wrong"),
    "no UTF-8": (lambda out: flip(out / "result.json", 30, 7), "codec can't decode"),
    "other JSON": (lambda out: (out / "result.json").write_text('{"a": [1]}'), "its schema is none"),
    "JSON of this schema": (lambda out: (out / "result.json").write_text('{"schema": 1}'), "no result of this program"),
    "lists in lists": (lambda out: (out / "result.json").write_text("[" * 99_999), "nested too deeply"),
    "no table": (lambda out: (out / "result.json").write_text("[]"), "no table"),
}
OF_PLOT = {
    "neither": (
        lambda out: [(out / name).unlink() for name in ("result.json", "result.h5")],
        "result.h5: it is missing; run the case again",
    ),
    "result.json is a folder": (lambda out: gone(out / "result.json"), "Is a directory"),
    "no result.h5": (lambda out: (out / "result.h5").unlink(), "result.h5: it is missing; run the case again"),
    "result.h5 is a folder": (
        lambda out: gone(out / "result.h5"),
        "result.h5: it is missing; run the case again",
    ),
    "result.json of another run": (
        lambda out: other(out, "result.json"),
        "result.h5: it is damaged, or of another run",
    ),
    "no folder": (shutil.rmtree, "out: no such folder"),
    "unfinished": (
        lambda out: [(out / name).rename(out / f"{name}.vm.1.part") for name in ("result.json", "result.h5")],
        "result.h5: it is missing; run the case again",
    ),
}
OF_RESUME = {"result of another case": (lambda out: other(out, "result.json"), "holds the result of another case")}


def damaged(comm, finished, damage):
    """Return a copy of the finished run, damaged."""
    out = finished / "out"
    if comm.rank == 0:
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(finished / "one", out)
        damage(out)
    comm.barrier()
    return out


def times(folder):
    """Return the files of a folder and their times."""
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()} if folder.exists() else {}


OF_BOTH = ("result.h5 cut", "bit of its numbers", "result.json cut", "another number", "no table")
REFUSED = [*(("plot", name) for name in DAMAGES | OF_PLOT), *(("resume", name) for name in (*OF_BOTH, *OF_RESUME))]


@pytest.mark.parametrize(("command", "name"), REFUSED)
def test_damaged_and_foreign_results_are_refused(comm, finished, capsys, command, name):
    damage, message = (DAMAGES | OF_PLOT | OF_RESUME)[name]
    out = damaged(comm, finished, damage)
    before = times(out)
    comm.barrier()
    capsys.readouterr()
    code = cli.main(["plot", str(out)]) if command == "plot" else path_run(comm, finished, PATH, "--resume")
    parallel_assert(comm, code == 2 and times(out) == before, f"exit code {code}")
    assert not told_once(comm, capsys, message)


def test_a_whole_result_is_finished(comm, finished, monkeypatch):
    """Also if the clock goes backwards."""
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now - 1e9)
    out = damaged(comm, finished, lambda out: None)
    before = times(out)
    comm.barrier()
    assert path_run(comm, finished, PATH, "--resume") == 0
    parallel_assert(comm, times(out) == before)


@pytest.mark.parametrize("lost", ["result.h5", "result.json"])
def test_what_is_not_whole_is_not_finished(comm, finished, lost):
    if comm.size > 1 and lost == "result.json":
        pytest.skip("as the other; it takes longer on two ranks")
    out = damaged(comm, finished, lambda out: (out / lost).unlink())
    assert path_run(comm, finished, PATH, "--resume") == 0
    if comm.rank == 0:
        found, expected = (json.loads((finished / f / "result.json").read_text()) for f in ("out", "one"))
        assert (out / "result.h5").exists() and len(found["path"]) == len(expected["path"]) > 2
        np.testing.assert_allclose(found["path"][-1]["stress"], expected["path"][-1]["stress"], rtol=1e-6)
    comm.barrier()


SWEEP = BASE.replace("mesh_size = 0.05", "mesh_size = 0.4") + (
    "[output]\nfields = false\npictures = false\n[sweep]\ncell.fibre_fraction = [0.2, 0.3]\n"
)


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    """Provide the folder of a finished sweep, on every rank."""
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("swept"))
    if comm.rank == 0:
        (folder / "sweep.toml").write_text(SWEEP)
    comm.barrier()
    if comm.size <= 2:
        assert cli.main(["sweep", str(folder / "sweep.toml"), "--out", str(folder / "whole"), "--quiet"]) == 0
    return folder


LISTS = {
    "no list": (lambda path: path.unlink(), "No such file"),
    "a folder": (gone, "Is a directory"),
    "cut": (lambda path: cut(path, 200), "is damaged"),
    "another number": (lambda path: exchange(path, "0.2", "0.4"), "its checksum is wrong"),
    "noise": (lambda path: path.write_bytes(os.urandom(99)), "is damaged"),
    "no table": (lambda path: path.write_text("[]"), "no table"),
    "other JSON": (lambda path: path.write_text('{"cases": [{"a": 1}]}'), "is damaged"),
    "cases are no list": (lambda path: path.write_text('{"cases": 3, "name": "", "stress_unit": ""}'), "is damaged"),
}


def damaged_sweep(comm, swept, damage):
    out = swept / "out"
    if comm.rank == 0:
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(swept / "whole", out)
        damage(out)
    comm.barrier()
    return out


@pytest.mark.parametrize("name", LISTS)
def test_damaged_lists_of_cases_are_refused(comm, swept, capsys, name):
    damage, message = LISTS[name]
    out = damaged_sweep(comm, swept, lambda out: damage(out / "sweep.json"))
    capsys.readouterr()
    parallel_assert(comm, cli.main(["collect", str(out), "--no-pictures"]) == 2)
    assert not told_once(comm, capsys, message)


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda case: exchange(case / "result.json", "0.2", "0.9"), "1 done, 1 damaged"),
        (lambda case: (case / "result.json").write_text('{"schema": 1}'), "1 done, 1 damaged"),
        (lambda case: gone(case / "result.json"), "1 done, 1 damaged"),
        (lambda case: (case / "result.json").rename(case / "error.txt"), "1 done, 1 failed"),
        (lambda case: ((case / "result.json").unlink(), (case / "error.txt").write_bytes(b"\xff\xfe")), "1 failed"),
        (lambda case: ((case / "result.json").unlink(), (case / "error.txt").mkdir()), "1 waiting"),
        (shutil.rmtree, "1 done, 1 waiting"),
        (lambda case: (shutil.rmtree(case), case.write_text("mine")), "1 done, 1 waiting"),
    ],
    ids=["number", "no result", "folder", "error", "no UTF-8", "error is a folder", "no case", "case is a file"],
)
def test_damaged_cases_of_a_sweep_are_counted(comm, swept, capsys, damage, words):
    out = damaged_sweep(comm, swept, lambda out: damage(out / "case-0002"))
    capsys.readouterr()
    parallel_assert(comm, cli.main(["collect", str(out), "--no-pictures"]) == 0)
    output, errors = capsys.readouterr()
    counts = output.splitlines()[0] if output else ""
    parallel_assert(
        comm, not errors and (comm.rank > 0 or all(w in counts for w in words.split(", "))), output + errors
    )
