"""Time three whole commands in turns: a sweep on one rank, with one case per rank, and by CHOLMOD.

The times include the start. The loop of CHOLMOD only meshes, assembles, factors and solves: it writes nothing and
estimates no errors. Processor time, which other programs change least, is summed over all ranks.
"""

import argparse
import resource
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from statistics import median

import tomli_w
from composite import STIFFNESS

CELL = {"geometry": "random", "fibre_fraction": 0.5, "fibres": 20, "mesh_size": 0.1}
PEER, RTOL = "cholmod", 1e-8


def main() -> None:
    """Print the medians of the times and their ratios."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--refine", type=int, default=2)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=2)
    parser.add_argument("--loop", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.loop:
        return loop(given.loop)
    names = ("1 rank, one after the other", f"{given.ranks} ranks, a case on each", f"1 rank, loop over {PEER}")
    found: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.toml"
        document = {"cell": CELL | {"refine": given.refine}, "sweep": {"realisations": given.cases}} | STIFFNESS
        path.write_text(tomli_w.dumps(document))
        for repeat in range(given.repeats):
            for name, ranks in zip(names, (1, given.ranks, None), strict=True):
                found[name].append(seconds(path, Path(folder) / f"{ranks} {repeat}", ranks))
    walls, processors = ([median(run[k] for run in runs) for runs in found.values()] for k in range(2))
    print(f"{given.cases} cases{'wall':>33}{'processor':>13}")
    for name, wall, processor in zip(names, walls, processors, strict=True):
        print(f"{name:32}{wall:7.2f} s{processor:11.2f} s")
    for name, own in (("1 rank / the loop", 2), ("1 rank / several", 1)):
        print(f"{name:32}{walls[0] / walls[own]:7.2f}{processors[0] / processors[own]:13.2f}")


def seconds(path: Path, out: Path, ranks: int | None) -> tuple[float, float]:
    """Return wall and processor time of the sweep on `ranks` ranks, or of the loop if None."""
    words = [sys.executable, __file__, "--loop", path]
    if ranks is not None:
        words = [sys.executable, "-m", "feti_homog", "sweep", path, "--out", out, "--ranks-per-case", "1", "--quiet"]
    start, used = time.perf_counter(), _used()
    subprocess.run(["mpirun", "--oversubscribe", "-n", str(ranks or 1), *map(str, words)], check=True)
    return time.perf_counter() - start, _used() - used


def _used() -> float:
    """Return the processor time of the children that have ended."""
    found = resource.getrusage(resource.RUSAGE_CHILDREN)
    return found.ru_utime + found.ru_stime


def loop(path: Path) -> None:
    """Mesh, assemble, factor and solve the cases of a sweep one after the other."""
    from benchmark_tool import PEERS, peer  # starts PETSc
    from mpi4py import MPI

    from feti_homog.studies import sweep_cases
    from feti_homog.system.runtime.standard_streams import Progress

    for case in sweep_cases.expand(tomllib.loads(path.read_text()), path.parent).cases:
        peer(PEERS[PEER], case, Progress(MPI.COMM_WORLD, quiet=True), None, RTOL)


if __name__ == "__main__":
    main()
