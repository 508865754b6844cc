"""The job scripts of SLURM and PBS, with stand-ins for the schedulers: variables, indices, dependencies."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.jobs import PATIENCE, ROOT, environment
from support.sweep_files import CASE, FAILING, FAILING_POINTS, rows, sweep_file

SCRIPTS = sorted([*(ROOT / "scripts/slurm").iterdir(), *(ROOT / "scripts/pbs").iterdir()])
TWO = "cell.fibre_fraction = [0.2, 0.3]\n"

# Notes the words and the task, and runs what it is given on one rank unless NOTES_ONLY is set; MPI, if it is asked, has
# as many ranks as wanted.
LAUNCH = """#!/bin/bash
words="$*"
while [[ $1 == -* ]]; do
    [[ $1 == -n ]] && ranks=$2
    [[ $1 == --*=* ]] || shift
    shift
done
if [[ $2 == -c ]]; then
    echo "ranks: ${RANKS_STARTED:-$ranks}"
    exit
fi
echo "$(basename "$0") task=${SLURM_ARRAY_TASK_ID-${PBS_ARRAY_INDEX-}} threads=$OMP_NUM_THREADS $words" >>"$NOTES"
[[ -n ${NOTES_ONLY-} ]] || exec "$@"
"""
SBATCH = """#!/bin/bash
echo "sbatch $*" >>"$NOTES"
export SLURM_SUBMIT_DIR=$PWD SLURM_NTASKS=1 SLURM_JOB_ID=77
while [[ $1 == -* ]]; do
    [[ $1 == --array=* ]] && array=${1#--array=} && ranges=${array%\\%*}
    [[ $1 == --ntasks=* ]] && SLURM_NTASKS=${1#--ntasks=}
    shift
done
cp "$1" "$SPOOL/job" # SLURM runs a copy, in the folder of submission
if [[ -n ${ranges-} ]]; then
    for k in $(tr , "\\n" <<<"$ranges" | awk -F- '{ for (k = $1; k <= $NF; k++) print k }'); do
        SLURM_ARRAY_TASK_ID=$k bash "$SPOOL/job" "${@:2}" >&2
        echo "exit $?" >>"$NOTES"
    done
else
    bash "$SPOOL/job" "${@:2}" >&2
    echo "exit $?" >>"$NOTES"
fi
echo "77;cluster"
"""

# As OpenPBS does: of qsub's environment the job gets what -v names and no more; a shell in the home folder reads the
# name of a copy of the script; there is a thread for each processor; logs are named by the job in the folder of -o.
QSUB = """#!/bin/bash
echo "qsub $*" >>"$NOTES"
own=()
while [[ $1 == -* ]]; do
    case $1 in
    -J) range=$2 && [[ ${range%-*} -lt ${range#*-} ]] || exit 1 ;;
    -o) [[ $2 == */ && -d $2 ]] && logs=$2 ;;
    -v)
        IFS=, read -ra names <<<"$2"
        for name in "${names[@]}"; do
            if [[ $name == *=* ]]; then own+=("$name"); else own+=("$name=${!name?}"); fi
        done
        ;;
    esac
    shift 2
done
for ((k = 0; k < 4; k++)); do echo localhost; done >"$SPOOL/nodes"
cp "$1" "$SPOOL/77.server.SC"
run() {
    (cd "$HOME" && env -i HOME="$HOME" USER=user PATH="$PATH" NOTES="$NOTES" RANKS_STARTED="${RANKS_STARTED-}" \\
        NOTES_ONLY="${NOTES_ONLY-}" \\
        PBS_O_WORKDIR="$WORKDIR" PBS_NODEFILE="$SPOOL/nodes" PBS_ENVIRONMENT=PBS_BATCH NCPUS=4 OMP_NUM_THREADS=4 \\
        PBS_JOBID="$1" "${own[@]}" "${@:2}" bash --noprofile <<<"$SPOOL/77.server.SC" >"${logs:-$WORKDIR/}$1.OU" 2>&1)
    echo "exit $?" >>"$NOTES"
}
WORKDIR=$PWD
if [[ -n ${range-} ]]; then
    for ((k = ${range%-*}; k <= ${range#*-}; k++)); do run "77[$k].server" PBS_ARRAY_INDEX=$k; done
    echo "77[].server"
else
    run 77.server
    echo "77.server"
fi
"""


@pytest.fixture
def scheduler(tmp_path):
    """Provide the environment with the stand-ins; what they noted is in its NOTES."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name, text in {"srun": LAUNCH, "mpirun": LAUNCH, "sbatch": SBATCH, "qsub": QSUB}.items():
        (folder / name).write_text(text)
        (folder / name).chmod(0o755)
    own = {"PATH": f"{folder}:{os.environ['PATH']}", "NOTES": str(tmp_path / "notes"), "SPOOL": str(tmp_path)}
    return environment() | own


def submitted(scheduler, script, *words, code=0, cwd=ROOT):
    """Return the output of the script and the notes of the stand-ins."""
    job = subprocess.run(
        [str(script), *map(str, words)], cwd=cwd, env=scheduler, capture_output=True, text=True, timeout=PATIENCE
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
    job = subprocess.run([found, "--check-sourced", str(path)], capture_output=True, text=True)
    assert job.returncode == 0, job.stdout


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_options_of_the_scheduler_stand_at_the_top(kind):
    for path in (path for path in SCRIPTS if path.parent.name == kind and not path.name.startswith("submit_")):
        lines = path.read_text().splitlines()
        options = [k for k, line in enumerate(lines) if re.match(r"#(SBATCH|PBS) -", line)]
        assert options and all(line.startswith("#") for line in lines[: options[-1] + 1])


@pytest.mark.parametrize(("kind", "submit"), [("slurm", "sbatch"), ("pbs", "qsub")])
def test_a_sweep_is_an_array_of_its_cases(elsewhere, scheduler, kind, submit):
    out, script = elsewhere / "out", ROOT / f"scripts/{kind}/submit_sweep"
    sweep_file(elsewhere, FAILING_POINTS, FAILING)
    job, notes = submitted(scheduler, script, "sweep.toml", "out", cwd=elsewhere)
    assert job.stdout.startswith("3 of 3 cases in job array 77")
    tasks = [re.search(r"task=(\d*) threads=1 .*--index (\d+)", note) for note in notes if note.startswith("mpirun")]
    assert [task and task.groups() for task in tasks] == [(k, k) for k in "123"] + [None]
    array, collect = [note for note in notes if note.startswith(submit)]
    assert ("--array=1-3%50" if kind == "slurm" else "-J 1-3") in array
    assert ("--dependency=afterany:77 " if kind == "slurm" else "depend=afterany:77[].server") in collect
    assert [row["status"] for row in rows(out)][:3] == ["done", "failed", "done"]
    assert (out / "moduli.png").exists() and sorted(path.name for path in elsewhere.iterdir()) == ["out", "sweep.toml"]
    Path(scheduler["NOTES"]).unlink()
    quick = scheduler | {"NOTES_ONLY": "1"}
    job, notes = submitted(quick, script, "sweep.toml", "out", cwd=elsewhere)
    assert "no case of 3 is open, 1 failed: --retry computes them again" in job.stdout
    assert len([note for note in notes if note.startswith(submit)]) == 1
    job, notes = submitted(quick, script, "sweep.toml", "out", "--retry", cwd=elsewhere)
    assert next(note for note in notes if "--index" in note).endswith("--index 2 --retry")


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_a_faulty_sweep_is_not_submitted(tmp_path, scheduler, kind):
    path = sweep_file(tmp_path, "cell.fibre_fraction = [0.2, 0.95]\n")
    job, notes = submitted(scheduler, ROOT / f"scripts/{kind}/submit_sweep", path, tmp_path / "out", code=2)
    assert "case-0002: [cell] fibre_fraction" in job.stderr and not notes


@pytest.mark.parametrize(("kind", "options"), [("slurm", ["--ntasks=4"]), ("pbs", ["-l", "walltime=02:00:00"])])
def test_a_single_case_is_run_with_its_options(elsewhere, scheduler, kind, options):
    sweep_file(elsewhere, "", CASE, "case")
    words = ["case.toml", "out", *options, "--", "-feti_ksp_rtol", "1e-6"]
    link = elsewhere.parent / "submit"
    link.symlink_to(ROOT / f"scripts/{kind}/submit_case")
    job, notes = submitted(scheduler, link, *words, cwd=elsewhere)
    assert job.stdout == f"job 77{'.server' * (kind == 'pbs')}, log in {elsewhere}/out/logs\n"
    submission, run, code = notes
    assert all(word in submission for word in options) and code == "exit 0"
    assert " -n 4 " in run and run.endswith(f"run {elsewhere}/case.toml --out {elsewhere}/out -feti_ksp_rtol 1e-6")
    assert ("--hostfile" in run) == (kind == "pbs")
    assert (elsewhere / "out/result.json").exists()


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_a_launcher_of_another_mpi_is_reported(elsewhere, scheduler, kind):
    """The launcher starts each rank as a job of its own."""
    sweep_file(elsewhere, "", CASE, "case")
    own = {"RANKS_STARTED": "1", "FETI_HOMOG_LAUNCH": 'mpirun --special="a b" -n $ranks'}
    words = ["case.toml", "out", *(["--ntasks=4"] if kind == "slurm" else [])]
    job, notes = submitted(scheduler | own, ROOT / f"scripts/{kind}/submit_case", *words, cwd=elsewhere)
    output = job.stderr if kind == "slurm" else (elsewhere / "out/logs/77.server.OU").read_text()
    assert (
        "does not start one MPI job of 4 ranks" in output and "launcher of the MPI that mpi4py was built for" in output
    )
    assert notes[-1] == "exit 2" and not (elsewhere / "out/result.json").exists()


@pytest.mark.parametrize("kind", ["slurm", "pbs"])
def test_a_faulty_case_is_not_submitted(elsewhere, scheduler, kind):
    sweep_file(elsewhere, "", CASE.replace("young = 88.0", "young = -1"), "case")
    script = ROOT / f"scripts/{kind}/submit_case"
    job, notes = submitted(scheduler, script, "case.toml", "out", cwd=elsewhere, code=2)
    assert "[material.matrix] young" in job.stderr and not notes and not (elsewhere / "out").exists()
    job, notes = submitted(scheduler, script, "missing/case.toml", "out", cwd=elsewhere, code=2)
    assert "missing/case.toml" in job.stderr and not notes
    for words in (["case.toml"], ["case.toml", "out", "--retry"]):
        job, notes = submitted(scheduler, script, *words, cwd=elsewhere, code=2)
        assert "usage: " in job.stderr and not notes


def test_a_job_that_is_put_back_into_the_queue_resumes(elsewhere, scheduler):
    """A path's events are kept, and only a path has them."""
    sweep_file(elsewhere, "", CASE, "case")
    words = ROOT / "scripts/slurm/submit_case", "case.toml", "out"
    again = scheduler | {"SLURM_RESTART_COUNT": "1", "NOTES_ONLY": "1"}
    _, notes = submitted(again, *words, cwd=elsewhere)
    assert "--resume" not in notes[1]
    (elsewhere / "out/checkpoint").mkdir()
    _, notes = submitted(again, *words, cwd=elsewhere)
    assert notes[-2].endswith("--resume")


@pytest.mark.parametrize(("kind", "submit"), [("slurm", "sbatch"), ("pbs", "qsub")])
def test_job_scripts_work_by_hand(elsewhere, scheduler, kind, submit):
    """Run job scripts of PBS from the top folder or with FETI_HOMOG_ROOT."""
    path, out = sweep_file(elsewhere, "", CASE, "case"), elsewhere / "out"
    script = ROOT / f"scripts/{kind}/case"
    if kind == "slurm":
        scontrol = Path(scheduler["SPOOL"]) / "bin/scontrol"
        scontrol.write_text(f"#!/bin/bash\necho '   Command={script} case.toml out'\n")
        scontrol.chmod(0o755)
        _, notes = submitted(scheduler, "sbatch", script, "case.toml", "out", cwd=elsewhere)
    else:
        _, notes = submitted(
            scheduler, "qsub", "-v", f"CASE=case.toml,DIR=out,FETI_HOMOG_ROOT={ROOT}", script, cwd=elsewhere
        )
    assert notes[-1] == "exit 0" and (out / "result.json").exists() and path.exists()
