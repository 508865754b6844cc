"""The drivers run as in their docstrings and print what these promise."""

import re

import pytest
from matplotlib.image import imread
from support.command_line import assert_verified
from support.jobs import ROOT, mpirun


def test_effective_stiffness_prints_errors_below_2e_5(tmp_path):
    job = mpirun(2, ROOT / "drivers/effective_stiffness.py", "--out", tmp_path, "--fields", "--fractions", "0.2", "0.4")
    assert job.returncode == 0, job.stderr
    rows = re.findall(r"^(square|hexagonal) +(strain|stress) (.*)$", job.stdout, re.MULTILINE)
    assert len(rows) == 4
    for *_, columns in rows:
        assert max(map(float, columns.split()[1::2])) < 2e-5
    results = [path.parent for path in tmp_path.glob("*/result.h5")]
    assert len(results) == 5
    assert_verified(*results)
    assert imread(tmp_path / "entries.png")[..., :3].std() > 0.05


@pytest.mark.parametrize("ranks", [1, 4])
def test_iterations_prints_a_row_for_every_refinement(tmp_path, ranks):
    words = ["--out", tmp_path, "--refine", "0", "1", "--mesh-size", "0.1", "--fields"]
    job = mpirun(ranks, ROOT / "drivers/iterations.py", *words)
    assert job.returncode == 0, job.stderr
    rows = [line.replace(",", "").split() for line in job.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == ["0", "1"]
    assert int(rows[1][1]) > 3 * int(rows[0][1])
    assert_verified(*(tmp_path / f"refine_{refine}" for refine in (0, 1)))


@pytest.mark.parametrize("driver", ["effective_stiffness", "iterations"])
def test_help_ends_with_0_and_faults_with_2(tmp_path, driver):
    job = mpirun(2, ROOT / f"drivers/{driver}.py", "--help")
    assert job.returncode == 0 and job.stdout.count("usage:") == 1
    job = mpirun(2, ROOT / f"drivers/{driver}.py", "--out", tmp_path / "new", "--mesh-size", "7")
    assert job.returncode == 2 and job.stderr.count("[cell] mesh_size = 7.0: expected a number") == 1
    assert not (tmp_path / "new").exists()
