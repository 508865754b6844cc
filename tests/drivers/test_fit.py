"""`feti-homog fit` and `uncertainty`: kill -9 takes no evaluation; fits of the drivers return what made their data."""

import json
import re

import pytest
from support.command_line import command_line
from support.hooks import KILL, WAIT, Hook, HookedJob, hooked
from support.jobs import ROOT, mpirun

COMMIT = "feti_homog.results.atomic:commit"
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
    checked = command_line(0, "check", path)
    assert checked.stdout.startswith(
        "fit        1 unknowns, 1 measured values of 1 tests; the first at the start:\ncase "
    )
    assert checked.returncode == 0 and checked.stdout.endswith("the case is valid\n") and not out.exists()
    second = "args[1].name == 'result.json' and args[1].parts[-3] == 'evaluation-0002'"
    with HookedJob(0, [Hook(COMMIT, WAIT, when=second)], *words) as job:
        assert job.reported() == "0 here"
        refused = command_line(0, *words)
        assert refused.returncode == 2 and "another run writes its results there" in refused.stderr
        assert f"process {job.process.pid}" in refused.stderr
        job.killed()
    results = {each: each.stat().st_mtime_ns for each in out.glob("evaluation-*/case-*/result.json")}
    assert len(results) == 1 and json.loads((out / "fit.json").read_text())["status"] == "running"
    job = hooked(0, [Hook(COMMIT, KILL, when="args[1].name == 'fit.json'")], *words, "--quiet")
    assert job.returncode not in (0, 2, 3) and json.loads((out / "fit.json").read_text())["status"] == "running"
    job = command_line(0, *words)
    assert job.returncode == 0, job.stderr
    document = json.loads((out / "fit.json").read_text())
    found = {each: each.stat().st_mtime_ns for each in out.glob("evaluation-*/case-*/result.json")}
    assert results.items() <= found.items() and len(found) == document["evaluations"]
    assert document["status"] == "done" and not (out / "result.lock").exists()


def test_a_study_of_scatter_that_is_killed_goes_on(tmp_path):
    """Kill and resume on two ranks, a case on each; a file of that name of others stays."""
    path, out = tmp_path / "case.toml", tmp_path / "out"
    path.write_text(FIT.partition("[unknown]")[0].replace("0.4", "{mean = 0.4, std = 0.02}"))
    words = ("uncertainty", path, "--out", out, "--ranks-per-case", "1")
    checked = command_line(0, "check", path)
    assert checked.returncode == 0 and checked.stdout.startswith("scatter    1 uncertain numbers"), checked.stderr
    job = hooked(2, [Hook(COMMIT, KILL, when="args[1].parts[-2] == 'case-0001'")], *words)
    assert job.returncode not in (0, 2, 3) and json.loads((out / "uncertainty.json").read_text())["status"] == "running"
    job = command_line(2, *words)
    assert job.returncode == 0 and "By differences of runs: none" in job.stdout, job.stderr
    assert json.loads((out / "uncertainty.json").read_text())["status"] == "done"
    (out / "uncertainty.json").write_text("{}")
    job = command_line(0, *words)
    assert job.returncode == 2 and (out / "uncertainty.json").read_text() == "{}"


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
