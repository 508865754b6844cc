"""The job scripts of SLURM and PBS, with stand-ins for the schedulers: variables, indices, dependencies."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.jobs import ROOT, environment
from support.sweep_files import CASE, FAILING, FAILING_POINTS, rows, sweep_file

SCRIPTS = sorted([*(ROOT / "scripts/slurm").iterdir(), *(ROOT / "scripts/pbs").iterdir()])
TWO = "cell.fibre_fraction = [0.2, 0.3]\n"

# Runs what it is given on one rank, and notes the words and the task.
LAUNCH = """#!/bin/bash
echo "$(basename "$0") task=${SLURM_ARRAY_TASK_ID-${PBS_ARRAY_INDEX-}} threads=$OMP_NUM_THREADS $*" >>"$NOTES"
while [[ $1 == -* ]]; do
    [[ $1 == --*=* ]] || shift
    shift
done
exec "$@"
"""
SBATCH = """#!/bin/bash
echo "sbatch $*" >>"$NOTES"
while [[ $1 == -* ]]; do
    [[ $1 == --array=* ]] && array=${1#--array=} && range=${array%\\%*}
    shift
done
export SLURM_SUBMIT_DIR=$PWD SLURM_NTASKS=1 SLURM_JOB_ID=77
cp "$1" "$SPOOL/job" # SLURM runs a copy
cd /
if [[ -n ${range-} ]]; then
    for ((k = ${range%-*}; k <= ${range#*-}; k++)); do
        SLURM_ARRAY_TASK_ID=$k bash "$SPOOL/job" "${@:2}" >&2 || true
    done
else
    bash "$SPOOL/job" "${@:2}" >&2
fi
echo "77;cluster"
"""
QSUB = """#!/bin/bash
echo "qsub $*" >>"$NOTES"
while [[ $1 == -* ]]; do
    [[ $1 == -J ]] && range=$2
    [[ $1 == -v ]] && IFS=, read -ra variables <<<"$2" && export "${variables[@]}"
    shift 2
done
export PBS_O_WORKDIR=$PWD PBS_NODEFILE=$SPOOL/nodes
echo localhost >"$PBS_NODEFILE"
cp "$1" "$SPOOL/job"
cd /
if [[ -n ${range-} ]]; then
    for ((k = ${range%-*}; k <= ${range#*-}; k++)); do PBS_ARRAY_INDEX=$k bash "$SPOOL/job" >&2 || true; done
else
    bash "$SPOOL/job" >&2
fi
echo "77[].server"
"""


@pytest.fixture
def scheduler(tmp_path):
    """The environment with the stand-ins; what they noted is in its NOTES."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, text in {"srun": LAUNCH, "mpirun": LAUNCH, "sbatch": SBATCH, "qsub": QSUB}.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    own = {"PATH": f"{folder}:{os.environ['PATH']}", "NOTES": str(tmp_path / "notes"), "SPOOL": str(tmp_path)}
    return environment() | own


def submitted(scheduler, script, *words, code=0):
    """What the script says, and what the stand-ins noted."""
    job = subprocess.run(
        [str(script), *map(str, words)], cwd=ROOT, env=scheduler, capture_output=True, text=True, timeout=120
    )
    assert job.returncode == code, job.stderr
    notes = Path(scheduler["NOTES"])
    return job, notes.read_text().splitlines() if notes.exists() else []


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_batch_scripts_are_sound_bash(path):
    subprocess.run(["bash", "-n", path], check=True)
    shellcheck = Path(sys.executable).with_name("shellcheck")
    found = str(shellcheck) if shellcheck.exists() else shutil.which("shellcheck")
    if found is None:
        pytest.skip("shellcheck is not installed")
    job = subprocess.run([found, str(path)], capture_output=True, text=True)
    assert job.returncode == 0, job.stdout


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_options_of_the_scheduler_stand_at_the_top(kind):
    for path in (path for path in SCRIPTS if path.parent.name == kind and path.name != "submit_sweep"):
        lines = path.read_text().splitlines()
        options = [k for k, line in enumerate(lines) if re.match(r"#(SBATCH|PBS) -", line)]
        assert options and all(line.startswith("#") for line in lines[: options[-1] + 1])


@pytest.mark.parametrize(("kind", "submit", "launcher"), [("slurm", "sbatch", "srun"), ("pbs", "qsub", "mpirun")])
def test_a_sweep_is_an_array_of_its_cases(tmp_path, scheduler, kind, submit, launcher):
    out = tmp_path / "out"
    path = sweep_file(tmp_path, FAILING_POINTS, FAILING)
    job, notes = submitted(scheduler, ROOT / f"scripts/{kind}/submit_sweep", path, out)
    assert job.stdout.startswith("3 cases in job array 77")
    tasks = [re.search(r"task=(\d*) threads=1 .*--index (\d+)$", note) for note in notes if note.startswith(launcher)]
    assert [task and task.groups() for task in tasks] == [(k, k) for k in "123"] + [None]
    array, collect = [note for note in notes if note.startswith(submit)]
    assert ("--array=1-3%50" if kind == "slurm" else "-J 1-3") in array
    assert ("--dependency=afterany:77 " if kind == "slurm" else "depend=afterany:77[].server") in collect
    assert [row["status"] for row in rows(out)][:3] == ["done", "failed", "done"]
    assert (out / "moduli.png").exists()


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_a_faulty_sweep_is_not_submitted(tmp_path, scheduler, kind):
    path = sweep_file(tmp_path, "cell.fibre_fraction = [0.2, 0.95]\n")
    job, notes = submitted(scheduler, ROOT / f"scripts/{kind}/submit_sweep", path, tmp_path / "out", code=2)
    assert "case-0002: [cell] fibre_fraction" in job.stderr and not notes


def test_a_single_case_is_run_with_its_options(tmp_path, scheduler):
    path, words = sweep_file(tmp_path, "", CASE), ["--resume-not"]
    _, notes = submitted(scheduler, ROOT / "scripts/slurm/case", path, tmp_path / "slurm", "-feti_ksp_rtol", "1e-6")
    assert notes[-1].startswith("srun") and notes[-1].endswith("-feti_ksp_rtol 1e-6")
    variables = scheduler | {"CASE": str(path), "DIR": str(tmp_path / "pbs"), "PBS_NODEFILE": str(tmp_path / "nodes")}
    (tmp_path / "nodes").write_text("a\na\nb\n")
    _, notes = submitted(variables, ROOT / "scripts/pbs/case")
    assert "mpirun task= threads=1 -n 3 .venv/bin/python -m feti_homog run" in notes[-1]
    assert all((tmp_path / kind / "result.json").exists() for kind in ("slurm", "pbs"))
    job, _ = submitted(scheduler, ROOT / "scripts/slurm/case", path, tmp_path / "other", *words, code=2)
    assert "unrecognized arguments: --resume-not" in job.stderr
    job, _ = submitted(scheduler, ROOT / "scripts/slurm/sweep_array", path, tmp_path / "other", code=1)
    assert "submit this as an array" in job.stderr
