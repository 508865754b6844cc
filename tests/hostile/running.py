"""Attempts run: one after the other in one job, or each in a process of its own; and what is wrong with their ends."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import matplotlib as mpl
from support.jobs import ROOT, environment, mpirun

from hostile.attempts import LIMIT_S, PATIENCE_S, Attempt, Outcome, entries

DESCENDANTS = Path(__file__).with_name("descendants.py")
MOST_TOLD = 1500  # characters of what a faulty attempt printed


def make(attempts: Sequence[Attempt], folder: Path) -> None:
    """Make the files of attempts, on the main thread, which gmsh needs."""
    (folder / "cwd").mkdir(parents=True)
    for number, attempt in enumerate(attempts):
        attempt.make(folder / str(number))


def in_one_job(attempts: Sequence[Attempt], ranks: int, folder: Path) -> dict[str, Outcome]:
    """Return the outcomes of made attempts, one after the other on so many ranks, up to one that ends the job."""
    here = folder / "cwd"
    places = [folder / str(number) for number in range(len(attempts))]
    before = [entries(place) for place in places]
    commands = folder / "commands"
    commands.write_text(json.dumps([a.command(place) for a, place in zip(attempts, places, strict=True)]))
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks), sys.executable]
    words = Path(__file__).with_name("job.py"), commands, str(LIMIT_S), str(PATIENCE_S)
    job = mpirun(0, DESCENDANTS, *launcher, *words, cwd=here)
    found = {}
    for number, (attempt, place) in enumerate(zip(attempts, places, strict=True)):
        answers = [Path(f"{commands}.{number}.{end}") for end in ("code", "1", "2")]
        end, output, errors = (path.read_text(errors="replace") if path.exists() else "" for path in answers)
        code, seconds, mib = end.split() or ("", "0", "0")
        written = (entries(place) - before[number]) | set(here.iterdir())
        name = f"{attempt.kind}: {attempt.name}, {ranks} ranks"
        used = float(seconds), int(mib)
        faults = attempt.faults(int(code) if code else None, output, errors, written, *used)
        found[name] = Outcome(faults, *used)
        if faults:
            faults.append(f"{output[:300]}{errors[-MOST_TOLD:]}")
        if not code:
            faults.append(f"the job ended: {job.stderr[-300:]}")
            break
    if "left: " in job.stderr:
        found[f"left: after the job, {ranks} ranks"] = Outcome([job.stderr[-MOST_TOLD:]])
    return found


def in_processes(attempts: Sequence[Attempt], folder: Path, pool: Executor) -> dict[str, Outcome]:
    """Return the outcomes of attempts in processes of their own, which the threads of a pool start."""
    for name in ("bin", "home"):
        (folder / name).mkdir(parents=True)
        (folder / name).chmod(0o777)
    for path in Path(mpl.get_cachedir()).glob("fontlist*"):  # which takes long to make
        shutil.copy(path, folder / "home")
    program = folder / "bin/feti"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m feti_homog "$@"\n')
    program.chmod(0o755)
    found = pool.map(lambda pair: _in_process(pair[1], folder / str(pair[0])), enumerate(attempts))
    return {f"{a.kind}: {a.name}": Outcome(faults) for a, faults in zip(attempts, found, strict=True)}


def _in_process(attempt: Attempt, place: Path) -> list[str]:
    """Run its shell, in a name space of its own where that may be, so that what it mounts ends with it."""
    attempt.make(place)
    before = entries(place)
    home, path = str(place.parent / "home"), f"{place.parent / 'bin'}:{os.environ['PATH']}"
    own = {"PATH": path, "PYTHONPATH": str(ROOT), "HOME": home, "MPLCONFIGDIR": home}
    mounts = ["unshare", "--mount"] if attempt.kind == "disks" else []
    shell = f"ulimit -t {LIMIT_S}; {attempt.shell}"
    words = [sys.executable, "-IS", str(DESCENDANTS), "timeout", "--signal=KILL", str(PATIENCE_S), *mounts]
    job = subprocess.run(
        [*words, "bash", "-c", shell],
        cwd=place,
        env=environment() | own,
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
    )
    faults = attempt.faults(job.returncode, job.stdout, job.stderr, entries(place) - before)
    return [*faults, f"{job.stdout[-300:]}{job.stderr[-MOST_TOLD:]}"] if faults else []
