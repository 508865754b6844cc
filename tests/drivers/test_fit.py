"""`feti-homog fit` and `uncertainty`: kill -9 takes no evaluation; fits of the drivers return what made their data."""

import json
import re

import pytest
from support.command_line import command_line, in_process
from support.hooks import KILL, WAIT, Hook, HookedJob, hooked
from support.jobs import ROOT, mpirun

COMMIT = "feti_homog.results.atomic:commit"
# Before the lock under which a study checks its folder and writes its document.
CLAIM = Hook("feti_homog.system.runtime.file_locks:Lock._take", WAIT, when="args[0].path.name == 'index.lock'")
FIT = """
[cell]
geometry = "square"
fibre_fraction = 0.4
mesh_size = 0.5
[material]
matrix = {young = 3.0, poisson = 0.35}
fibre = {young = 70.0, poisson = 0.2}
[analysis]
type = "stiffness"
plane = "strain"
[unknown]
material.matrix.young = {start = 2.5, lower = 1.0, upper = 5.0}
[measured]
C11 = {value = 9.0, std = 0.1}
"""


def test_a_fit_that_is_killed_goes_on(tmp_path):
    """Kill a fit before the second result, while another is refused, and again before fit.json."""
    path, out = tmp_path / "fit.toml", tmp_path / "out"
    path.write_text(FIT)
    words = ("fit", path, "--out", out)
    checked = in_process("check", path)
    assert checked.stdout.startswith(
        "fit        1 unknowns, 1 measured values of 1 tests; the first at the start:\ncase "
    )
    assert checked.returncode == 0 and checked.stdout.endswith("the case is valid\n") and not out.exists()
    second = "args[1].name == 'result.json' and args[1].parts[-3] == 'evaluation-0002'"
    with HookedJob(0, [Hook(COMMIT, WAIT, when=second)], *words) as job:
        assert job.reported() == "0 here"
        refused = in_process(*words)
        assert refused.returncode == 2 and "another run writes its results there" in refused.stderr
        assert f"process {job.process.pid}" in refused.stderr
        job.killed()
    results = {each: each.stat().st_mtime_ns for each in out.glob("evaluation-*/case-*/result.json")}
    assert len(results) == 1 and json.loads((out / "fit.json").read_text())["status"] == "running"
    job = hooked(0, [Hook(COMMIT, KILL, when="args[1].name == 'fit.json'")], *words, "--quiet")
    assert job.returncode not in (0, 2, 3) and json.loads((out / "fit.json").read_text())["status"] == "running"
    job = in_process(*words)
    assert job.returncode == 0, job.stderr
    document = json.loads((out / "fit.json").read_text())
    found = {each: each.stat().st_mtime_ns for each in out.glob("evaluation-*/case-*/result.json")}
    assert results.items() <= found.items() and len(found) == document["evaluations"]
    assert document["status"] == "done" and not (out / "result.lock").exists()
    (out / "fit.json").unlink()  # the evaluations stay
    assert in_process(*words).returncode == 0 and json.loads((out / "fit.json").read_text()) == document
    assert found == {each: each.stat().st_mtime_ns for each in out.glob("evaluation-*/case-*/result.json")}


@pytest.mark.parametrize(("kind", "first"), [("fit", "sweep"), ("fit", "fit"), ("uncertainty", "sweep")])
def test_of_two_studies_that_begin_in_one_folder_one_goes_on(tmp_path, kind, first):
    """Stop a sweep and another study, both past the checks of the folder, before `first` writes its document."""
    cell, out = FIT.partition("[unknown]")[0], tmp_path / "out"
    sweep = cell + '[sweep]\n"cell.fibre_fraction" = [0.3]\n'
    scatter = cell.replace("0.4", "{mean = 0.4, std = 0.02}")
    for name, text in {"fit": FIT, "sweep": sweep, "uncertainty": scatter}.items():
        (tmp_path / f"{name}.toml").write_text(text)
    words = {name: (name, tmp_path / f"{name}.toml", "--out", out, "--quiet") for name in ("sweep", kind)}
    (second,), document = words.keys() - {first}, f"{first}.json"
    stops = {first: Hook(COMMIT, WAIT, when=f"args[1].name == '{document}'"), second: CLAIM}
    with HookedJob(0, [stops["sweep"]], *words["sweep"]) as of_sweep:
        assert of_sweep.reported() == "0 here"
        with HookedJob(0, [stops[kind]], *words[kind]) as other:
            assert other.reported() == "0 here"
            jobs = {"sweep": of_sweep, kind: other}
            for job in (jobs[second], jobs[first]):
                job.release()
            assert jobs[first].ended().returncode == 0
            end = jobs[second].ended()
    assert end.returncode == 2 and len(end.stderr.splitlines()) == 1, end.stderr
    assert f"holds another study, whose file is {document}" in end.stderr
    assert not list(out.glob("*.lock")) and {path.name for path in out.glob("*.json")} == {document}


def test_a_study_of_scatter_that_is_killed_goes_on(tmp_path):
    """Kill and resume on two ranks, a case on each; a file of that name of others stays."""
    path, out = tmp_path / "case.toml", tmp_path / "out"
    path.write_text(FIT.partition("[unknown]")[0].replace("0.4", "{mean = 0.4, std = 0.02}"))
    words = ("uncertainty", path, "--out", out, "--ranks-per-case", "1")
    checked = in_process("check", path)
    assert checked.returncode == 0 and checked.stdout.startswith("scatter    1 uncertain numbers"), checked.stderr
    hook = Hook(COMMIT, KILL, rank=None, when="args[1].parts[-2] == 'case-0001'")  # either rank may take the case
    job = hooked(2, [hook], *words)
    assert job.returncode not in (0, 2, 3) and json.loads((out / "uncertainty.json").read_text())["status"] == "running"
    job = command_line(2, *words)
    assert job.returncode == 0 and "By differences of runs: none" in job.stdout, job.stderr
    assert json.loads((out / "uncertainty.json").read_text())["status"] == "done"
    (out / "uncertainty.json").write_text("{}")
    job = in_process(*words)
    assert job.returncode == 2 and (out / "uncertainty.json").read_text() == "{}"


SCATTERED = FIT.partition("[unknown]")[0].replace("young = 70.0", "young = {mean = 70.0, cv = 0.05}")
STUDIES = {
    "sweep": SCATTERED.replace("{mean = 70.0, cv = 0.05}", "70.0") + "[sweep]\ncell.fibre_fraction = [0.3, 0.4]\n",
    "fit": FIT,
    "uncertainty": SCATTERED.replace("0.4", "{mean = 0.4, std = 0.02}"),
}
FULL = "raise OSError(28, os.strerror(28))"


@pytest.mark.parametrize(("kind", "name", "call"), [
    ("fit", "result.json", 2), ("fit", "measured.csv", 1), ("fit", "fit.json", 2), ("fit", "sweep.json", 1),
    ("uncertainty", "result.json", 1), ("uncertainty", "uncertainty.json", 2),
])  # fmt: skip
def test_a_study_whose_disk_is_full_goes_on(tmp_path, kind, name, call):
    """The file is named once, and results that are there are neither lost nor computed again."""
    path, out = tmp_path / "case.toml", tmp_path / "out"
    path.write_text(STUDIES[kind])
    hook = Hook(COMMIT, FULL, call=call, when=f"args[1].name == {name!r}")
    job = hooked(0, [hook], kind, path, "--out", out)
    faults = [line for line in job.stderr.splitlines() if "No space left on device" in line]
    assert job.returncode == 1 and len(faults) == 1 and faults[0].startswith("error: cannot write "), job.stderr
    assert name in faults[0] and "Traceback" not in job.stderr and not list(out.rglob("*.part"))
    results = {each: each.stat().st_mtime_ns for each in out.rglob("case-*/result.json")}
    assert bool(results) == (name != "sweep.json" and (kind, name) != ("uncertainty", "result.json"))
    again = in_process(kind, path, "--out", out)
    assert again.returncode == 0, again.stderr
    assert results.items() <= {each: each.stat().st_mtime_ns for each in out.rglob("case-*/result.json")}.items()
    assert json.loads((out / f"{kind}.json").read_text())["status"] == "done"


@pytest.mark.parametrize(("first", "other"), [("sweep", "fit"), ("fit", "uncertainty")])
def test_a_second_study_in_the_folder_of_another_ends_in_one_line(tmp_path, first, other):
    """The first one waits before its first result, and ends as if it were alone."""
    for name, text in STUDIES.items():
        (tmp_path / f"{name}.toml").write_text(text)
    out = tmp_path / "out"
    wait = Hook(COMMIT, WAIT, when="args[1].name == 'result.json'")
    with HookedJob(0, [wait], first, tmp_path / f"{first}.toml", "--out", out) as job:
        assert job.reported() == "0 here"
        before = {each: each.stat().st_mtime_ns for each in out.rglob("*")}
        refused = in_process(other, tmp_path / f"{other}.toml", "--out", out)
        assert refused.returncode == 2 and refused.stderr.startswith("error: ") and refused.stderr.count("\n") == 1
        assert {each: each.stat().st_mtime_ns for each in out.rglob("*")} == before
        job.release()
        assert job.ended().returncode == 0


TRUTH = {
    "carbon_fibre": {"E_transverse": 14.0, "nu_transverse": 0.25, "G_axial": 28.0},
    "interface_toughness": {"toughness": 2.0, "strength in opening": 90.0},
}


@pytest.mark.parametrize("driver", TRUTH)
def test_estimates_are_what_the_data_were_made_of(tmp_path, driver):
    job = mpirun(0, ROOT / f"drivers/{driver}.py", "--out", tmp_path, "--quick")
    assert job.returncode == 0, job.stderr
    rows = re.findall(r"^(\w[\w ]*?) +[\d.]+ +([\d.]+)(?: +\S+)?$", job.stdout, re.MULTILINE)
    found = {name: float(value) for name, value in rows}
    assert {name: found[name] for name in TRUTH[driver]} == pytest.approx(TRUTH[driver], rel=3e-3)
