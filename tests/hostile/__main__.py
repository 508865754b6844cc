"""Try hostile inputs and print how many of each kind there were, and the faults of those that did not end as they must.

Exit code 1 if there are any.
"""

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from support.jobs import mpirun

from hostile import case_files, events, fibre_tables, fuzzer, images, meshes, processes, results
from hostile.attempts import Outcome
from hostile.running import in_one_job, in_processes, make

# Which of the attempts are tried on so many ranks: every one, every fifth.
EVERY = {1: 1, 2: 5}
OF_ONE_RANK = (events.FALSE_KIND, case_files.LONG_KIND)  # which another number of ranks refuses, or which rank 0 reads
CASES, SEED = 100, 1
MOST_IN_A_JOB = 300  # attempts, which end in time on a busy machine, too
AT_ONCE = 2  # jobs, or processes: as many as the cores of a small machine


def parser() -> argparse.ArgumentParser:
    """Return the words of the command."""
    words = argparse.ArgumentParser(prog="python -m hostile", description=__doc__)
    words.add_argument("--cases", type=int, default=CASES, help="how many inputs have random damage")
    words.add_argument("--seed", type=int, default=SEED, help="of these")
    words.add_argument("--only", default="", metavar="WORDS", help="attempts that have these in `kind: name`")
    return words


def prepare(folder: Path) -> None:
    """Make the folders that attempts damage."""
    folder.mkdir()

    def run(name: str) -> None:
        command, case = results.PREPARED[name]
        (folder / f"{name}.toml").write_text(case)
        job = mpirun(0, "-m", "feti_homog", command, folder / f"{name}.toml", "--out", folder / name)
        assert job.returncode == (3 if name == "unfinished" else 0), job.stderr

    with ThreadPoolExecutor(AT_ONCE) as pool:
        list(pool.map(run, results.PREPARED))


def tried(folder: Path, only: str, cases: int, seed: int) -> dict[str, Outcome]:
    """Return the outcomes of all attempts whose kind and name have these words, and of so many at random."""
    prepared = folder / "prepared"
    shared = [*case_files.attempts(), *fibre_tables.attempts(), *meshes.attempts(), *images.attempts()]
    shared += [*results.attempts(prepared), *events.attempts(prepared)]
    shared, alone = (
        [a for a in some if only in f"{a.kind}: {a.name}"] for some in (shared, processes.attempts(prepared))
    )
    jobs = []
    for ranks, step in EVERY.items():
        tried_here = [a for a in shared[::step] if ranks == 1 or a.kind not in OF_ONE_RANK]
        if ranks == 1:
            tried_here += [a for a in fuzzer.attempts(prepared, cases, seed) if only in f"{a.kind}: {a.name}"]
        count = max(AT_ONCE, -(-len(tried_here) // MOST_IN_A_JOB)) if ranks == 1 else 1
        parts = [tried_here[k::count] for k in range(count)]
        jobs += [(part, ranks, folder / f"{ranks} ranks, {k}") for k, part in enumerate(parts) if part]
    for part, _, place in jobs:
        make(part, place)
    with ThreadPoolExecutor(AT_ONCE) as pool:
        in_jobs = [pool.submit(in_one_job, *job) for job in jobs]
        found = in_processes(alone, folder / "processes", pool)
        return {name: outcome for job in in_jobs for name, outcome in job.result().items()} | found


def main() -> int:
    given = parser().parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        folder.chmod(0o755)  # for other users
        prepare(folder / "prepared")
        found = tried(folder, given.only, given.cases, given.seed)
    for kind in dict.fromkeys(name.partition(":")[0] for name in found):
        of_kind = [outcome for name, outcome in found.items() if name.partition(":")[0] == kind]
        seconds, mib = sum(outcome.seconds for outcome in of_kind), max(outcome.mib for outcome in of_kind)
        print(f"{kind:20} {len(of_kind):4} {seconds:6.1f} s {mib:5} MiB")
    faulty = {name: outcome.faults for name, outcome in found.items() if outcome.faults}
    for name, faults in faulty.items():
        print(f"{name}: {'; '.join(faults)}")
    print(f"{len(found)} attempts, {len(faulty)} with faults")
    return 1 if faulty else 0


if __name__ == "__main__":
    sys.exit(main())
