"""Locks, files that are written whole or not at all, and cases that several groups of ranks share."""

import csv
import subprocess
import sys
import tomllib
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import pytest
from mpi4py import MPI
from support.base_case import MESH_CELL, changed
from support.sweep_files import sweep_file

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.results import atomic
from feti_homog.studies import case_folders, case_runs, sweep_cases
from feti_homog.studies.case_runs import CaseRunner, Outcome
from feti_homog.system.runtime.file_locks import LOCK_TIMEOUT_S, Lock, LockHeld
from feti_homog.system.runtime.file_locks import holder as holder_of

HOLDER = """
import sys
from pathlib import Path
from feti_homog.system.runtime.file_locks import Lock
Lock(Path(sys.argv[1]), shared={shared}).acquire()
print("held", flush=True)
sys.stdin.read()
"""


def holder(path: Path, shared: bool = False) -> subprocess.Popen[bytes]:
    """Another process that holds the lock."""
    program = [sys.executable, "-c", HOLDER.format(shared=shared), str(path)]
    process = subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
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
        assert bool(holder_of(path)) != theirs
    finally:
        process.communicate()
    with Lock(path):
        assert holder_of(path)
    assert not holder_of(path)


def test_a_lock_that_cannot_be_made_is_reported(tmp_path):
    with pytest.raises(FetiHomogError, match="cannot lock"):
        Lock(tmp_path / "none" / "lock").acquire()
    assert not holder_of(tmp_path / "none" / "lock")


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path):
    path = atomic.replace_text(tmp_path / "file", "old")

    def ends_early(part: Path) -> None:
        part.write_text("ne")
        raise OSError(28, "No space left on device")

    with pytest.raises(FetiHomogError, match=r"cannot write .*file: No space left on device"):
        atomic.replace(path, ends_early)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_a_full_device_is_reported():
    with pytest.raises(FetiHomogError, match="No space left on device"):
        atomic.replace(Path("/dev/shm/feti_homog_none"), lambda part: Path("/dev/full").write_text("x"))


OWN = ["cases.csv", "lock", "statistics.csv", "moduli.png", "peaks.png", "case-0001/notes.txt"]


@pytest.mark.parametrize("name", OWN)
def test_files_that_no_sweep_wrote_are_not_replaced(tmp_path, name):
    sweep, out = sweep_cases.load(sweep_file(tmp_path, '"cell.order" = [1, 2]\n')), tmp_path / "out"
    (out / name).parent.mkdir(parents=True)
    (out / name).write_text("mine")
    with pytest.raises(CaseError, match=f"no sweep of this program wrote {Path(name).parts[0]}, or it is damaged"):
        case_folders.prepare_folder(out, sweep)
    assert [path.read_text() for path in out.rglob("*") if path.is_file()] == ["mine"]


def test_the_folder_of_a_sweep_is_made_whole_again(tmp_path):
    """A sweep may be killed when it has written its list and not yet the table."""
    axes = '"cell.order" = [1, 2]\n"material.fibre.young" = [300.0, 400.0, 500.0]\n'
    sweep, out = sweep_cases.load(sweep_file(tmp_path, axes)), tmp_path / "out"
    case_folders.prepare_folder(out, sweep)
    table = (out / "cases.csv").read_text()
    expected = [
        {"case": f"{k}", "folder": f"case-000{k}", "point": f"{k}", "realisation": "1", "cell.order": order,
         "material.fibre.young": young}
        for k, (order, young) in enumerate(product("12", ("300.0", "400.0", "500.0")), start=1)
    ]  # fmt: skip
    assert list(csv.DictReader(table.splitlines())) == expected
    (out / "cases.csv").unlink()
    (out / "statistics.csv").write_text("collected")
    atomic.part_of(out / "cases.csv").write_text("half")
    case_folders.prepare_folder(out, sweep)
    assert {path.name: path.read_text() for path in out.glob("*.csv*")} == {
        "cases.csv": table,
        "statistics.csv": "collected",
    }
    assert case_folders.read_index(out).entries == sweep.entries


def test_bonds_that_never_break_are_values_of_a_sweep(tmp_path):
    """JSON has no infinite numbers, and the list of cases is such a file."""
    axes = '"interface.debonded" = [[]]\n"interface.normal_stiffness" = [2.0, inf]\n'
    sweep, out = sweep_cases.load(sweep_file(tmp_path, axes)), tmp_path / "out"
    case_folders.prepare_folder(out, sweep)
    assert case_folders.read_index(out).entries == sweep.entries
    case_folders.prepare_folder(out, sweep)


@pytest.mark.parametrize("asked", ["sensitivities = true", "mesh_error = false", "fields = true"])
def test_a_sweep_that_asks_for_more_is_another(tmp_path, asked):
    path, out = sweep_file(tmp_path, '"cell.order" = [1, 2]\n'), tmp_path / "out"
    sweep = sweep_cases.load(path)
    case_folders.prepare_folder(out, sweep)
    old = "fields = false\n" if "fields" in asked else "[output]\n"
    path.write_text(path.read_text().replace(old, f"{old.removeprefix('fields = false')}{asked}\n"))
    with pytest.raises(CaseError, match="its case-0001 differs from this file in keys that do not vary"):
        case_folders.prepare_folder(out, sweep_cases.load(path))


def test_cases_of_others_are_passed_over_at_once_and_tried_again_at_last():
    """The first case is computed elsewhere, somebody looks at the lock of the second."""
    calls, done = [], set()

    def run(entry, timeout, _):
        calls.append((entry, timeout))
        if entry == 1 or (entry == 2 and timeout == 0.0):
            return Outcome.HELD_ELSEWHERE, "another"
        if entry in done:
            return Outcome.FINISHED_BEFORE, ""
        done.add(entry)
        return Outcome.COMPUTED, ""

    runner = SimpleNamespace(run=run, comm=MPI.COMM_SELF, sweep=SimpleNamespace(entries=(1, 2, 3)))
    runner.directory = Path("sweep")
    assert CaseRunner.run_free(runner, shows=False) is None
    assert done == {2, 3}
    rounds = (0.0, (1, 2, 3)), (0.0, (1, 2)), (LOCK_TIMEOUT_S, (1, 2)), (LOCK_TIMEOUT_S, (1,))
    assert calls == [(entry, timeout) for timeout, entries in rounds for entry in entries]


def test_meshes_without_a_material_of_their_matrix_are_refused_before_any_case(tmp_path):
    document = tomllib.loads(changed(MESH_CELL))
    del document["material"]["matrix"]
    files = [str(Path(__file__).parents[4] / "meshes" / f"{name}.msh") for name in ("square", "hexagonal")]
    sweep = sweep_cases.expand(document | {"sweep": {"cell.file": files}}, tmp_path)
    with pytest.raises(CaseError) as caught:
        case_runs.run_all(sweep, tmp_path / "out", MPI.COMM_SELF, 1, retry=False, quiet=True)
    assert caught.value.faults == ("[material.matrix]: missing section; the mesh has this phase",)
    assert not (tmp_path / "out").exists()
