"""Time of a sweep with one case on each rank, against the same cases one after the other on one rank.

Both are whole commands, start-up included, run in turns; the ratio is that of the shortest times.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import tomli_w
from composite import STIFFNESS

CELL = {"geometry": "random", "fibre_fraction": 0.5, "fibres": 20, "mesh_size": 0.1}


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--refine", type=int, default=2)
    parser.add_argument("--ranks", type=int, default=2)
    parser.add_argument("--repeats", type=int, default=2)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "sweep.toml"
        document = {"cell": CELL | {"refine": given.refine}, "sweep": {"realisations": given.cases}} | STIFFNESS
        path.write_text(tomli_w.dumps(document))
        times: dict[int, list[float]] = {1: [], given.ranks: []}
        for repeat in range(given.repeats):
            for ranks, found in times.items():
                found.append(seconds(path, Path(folder) / f"{ranks} {repeat}", ranks))
    alone, together = (min(found) for found in times.values())
    print(f"{given.cases} cases, 1 rank, one after the other     {alone:8.2f} s")
    print(f"{given.cases} cases, {given.ranks} ranks, --ranks-per-case 1     {together:8.2f} s")
    print(f"ratio                                     {alone / together:8.2f}")


def seconds(path: Path, out: Path, ranks: int) -> float:
    """Wall time of the sweep."""
    launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)]
    words = [sys.executable, "-m", "feti_homog", "sweep", path, "--out", out, "--ranks-per-case", "1", "--quiet"]
    start = time.perf_counter()
    subprocess.run([*launcher, *map(str, words)], check=True)
    return time.perf_counter() - start


if __name__ == "__main__":
    main()
