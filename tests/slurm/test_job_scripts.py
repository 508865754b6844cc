"""The job scripts of SLURM on a real one: where they look, what they return, where their logs are, what they keep."""

import json
import os
import re
from pathlib import Path

from support import events
from support.base_case import with_lines
from support.jobs import ROOT
from support.one_node_slurm import Job, wait
from support.small_path import SHEET_PATH
from support.sweep_files import BY_BODIES, CASE, FAILING, FAILING_POINTS, rows, sweep_file

SCRIPTS = ROOT / "scripts/slurm"
DONE, FAILED = Job("COMPLETED", 0), Job("FAILED", 3)
PATH_CASE = with_lines(
    SHEET_PATH,
    *("[cell] mesh_size = 0.03", "[interface] normal_strength = 5.0", "[interface] tangential_strength = 5.0"),
    *("[path] strain = [0.2, 0.0, 0.0]", '[output] states = "all"'),
)


def submitted(slurm, folder: Path, script: str, *words: str, **variables: str) -> list[str]:
    """Return the numbers of the jobs that a script of submission names."""
    output = slurm.run(SCRIPTS / script, *words, cwd=folder, **variables)
    return re.findall(r"job (?:array )?(\d+)", output)


def log(out: Path, job: str, name: str = "feti_homog") -> str:
    return (out / "logs" / f"{name}-{job}.out").read_text()


def test_a_case_is_run_from_any_folder(slurm, elsewhere):
    """A relative file and folder, with the scripts' own four ranks; the queue is empty afterwards."""
    sweep_file(elsewhere, "", CASE, "case")
    (job,) = submitted(slurm, elsewhere, "submit_case", "case.toml", "out", "--", "-feti_ksp_rtol", "1e-9")
    assert slurm.ended(job) == [DONE], log(elsewhere / "out", job)
    assert "Effective stiffness (GPa)" in log(elsewhere / "out", job)
    result = json.loads((elsewhere / "out/result.json").read_text())
    assert result["status"] == "done" and result["solver"]["ranks"] == 4
    assert sorted(path.name for path in elsewhere.iterdir()) == ["case.toml", "out"] and not slurm.queued()


def test_a_case_submitted_by_hand_finds_the_repository(slurm, tmp_path):
    """sbatch runs a copy of the script, in the folder that it is called from.

    Ranks may run on every core, for others may have the first one.
    """
    sweep_file(tmp_path, "", CASE, "case")
    (tmp_path / "sitecustomize.py").write_text("import os\nprint('cores', sorted(os.sched_getaffinity(0)))\n")
    words = ["sbatch", "--parsable", "--ntasks=1", SCRIPTS / "case", "case.toml", "out"]
    job = slurm.run(*words, cwd=tmp_path, PYTHONPATH=str(tmp_path)).strip()
    assert slurm.ended(job) == [DONE] and (tmp_path / "out/result.json").exists()
    cores = re.findall("^cores (.*)$", (tmp_path / f"feti_homog-{job}.out").read_text(), re.MULTILINE)
    assert set(cores) == {str(sorted(os.sched_getaffinity(0)))}


def test_without_pmi_srun_is_refused_with_a_remedy(slurm, elsewhere):
    sweep_file(elsewhere, "", CASE, "case")
    (job,) = submitted(slurm, elsewhere, "submit_case", "case.toml", "out", "-n2", FETI_HOMOG_LAUNCH="srun --mpi=none")
    assert slurm.ended(job) == [Job("FAILED", 2)] and not (elsewhere / "out/result.json").exists()
    words = "`srun --mpi=none` does not start one MPI job of 2 ranks", "Unset FETI_HOMOG_LAUNCH, and mpirun starts"
    assert all(word in log(elsewhere / "out", job) for word in words)


def test_faults_are_found_before_the_queue(slurm, elsewhere):
    sweep_file(elsewhere, "", CASE.replace("young = 88.0", "young = -1"), "case")
    output = slurm.run(SCRIPTS / "submit_case", "case.toml", "out", cwd=elsewhere, code=2)
    assert "[material.matrix] young" in output and not (elsewhere / "out").exists() and not slurm.queued()


def test_an_array_goes_on_past_a_failed_case_and_is_collected(slurm, elsewhere):
    """Then the failed one alone, and only if it is asked for."""
    sweep_file(elsewhere, FAILING_POINTS, FAILING)
    sweep, out = ("submit_sweep", "sweep.toml", "out"), elsewhere / "out"
    array, collect = submitted(slurm, elsewhere, *sweep)
    assert slurm.ended(collect) == [DONE] and slurm.jobs(array) == [DONE, FAILED, DONE]
    assert [row["status"] for row in rows(out)][:3] == ["done", "failed", "done"] and (out / "moduli.png").exists()
    assert "case-0001 of 3: done" in log(out, f"{array}_1", "feti_homog_sweep")
    assert "MeshError" in (out / "case-0002/error.txt").read_text()
    assert "2 done, 1 failed" in log(out, collect, "feti_homog_collect")
    output = slurm.run(SCRIPTS / sweep[0], *sweep[1:], cwd=elsewhere)
    assert "no case of 3 is open, 1 failed: --retry computes them again" in output
    first = (out / "case-0002/error.txt").stat().st_mtime_ns
    array, collect = submitted(slurm, elsewhere, *sweep, "--retry")
    assert slurm.ended(collect) == [DONE] and slurm.jobs(array) == [FAILED]
    assert (out / "logs" / f"feti_homog_sweep-{array}_2.out").exists()
    assert (out / "case-0002/error.txt").stat().st_mtime_ns > first


def test_cases_without_convergence_are_done_after_a_retry(slurm, elsewhere):
    sweep_file(elsewhere, "cell.fibre_fraction = [0.2, 0.3]\n", CASE + BY_BODIES)
    array, collect = submitted(slurm, elsewhere, "submit_sweep", "sweep.toml", "out", "--", "-feti_ksp_max_it", "2")
    assert slurm.ended(collect) == [DONE] and slurm.jobs(array) == [FAILED, FAILED]
    array, collect = submitted(slurm, elsewhere, "submit_sweep", "sweep.toml", "out", "--retry")
    assert slurm.ended(collect) == [DONE] and slurm.jobs(array) == [DONE, DONE]
    assert [row["status"] for row in rows(elsewhere / "out")][:2] == ["done", "done"]


def test_a_cancelled_path_goes_on_with_what_it_had(slurm, elsewhere):
    (elsewhere / "case.toml").write_text(PATH_CASE)
    out = elsewhere / "out"
    path = ("submit_case", "case.toml", "out", "--ntasks=2")
    (job,) = submitted(slurm, elsewhere, *path)
    wait(lambda: events.count(out) >= 5, 30, "the path has no events")
    slurm.run("scancel", job)
    assert slurm.ended(job)[0].state == "CANCELLED"
    kept = events.count(out)
    (job,) = submitted(slurm, elsewhere, *path, "--", "--resume")
    assert slurm.ended(job) == [DONE], log(out, job)
    result = json.loads((out / "result.json").read_text())
    assert result["resumed"] == kept >= 5 and len(result["path"]) > kept
    assert f"{kept} events are taken from the checkpoint" in log(out, job)
