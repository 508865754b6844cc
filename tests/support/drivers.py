"""Drivers as tests run them."""

import csv
from pathlib import Path

import numpy as np
from matplotlib.image import imread

from support.jobs import ROOT, mpirun


def driven(name: str, folder: Path, *options: str, ranks: int = 1) -> list[dict[str, str]]:
    """Run a driver and return its table; what all do on several ranks is in one module."""
    job = mpirun(ranks, ROOT / f"drivers/{name}.py", "--quick", "--out", folder, *options)
    assert job.returncode == 0, job.stderr
    assert job.stdout.split()[-2:] == [str(folder / f"{name}.csv"), str(folder / f"{name}.png")]
    picture = imread(folder / f"{name}.png")
    assert min(picture.shape[:2]) > 500 and picture[..., :3].std() > 0.05
    with (folder / f"{name}.csv").open(encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def column(rows: list[dict[str, str]], name: str) -> np.ndarray:
    return np.array([float(row[name]) for row in rows])
