"""The drivers run as in their docstrings: sweeps, errors, iterations, and the laws that their numbers obey."""

import re

import numpy as np
import pytest
from matplotlib.image import imread
from reference.references import BONDED
from support.command_line import assert_verified
from support.jobs import ROOT, mpirun
from support.sweep_files import means


def driven(name, folder, *options):
    job = mpirun(2, ROOT / f"drivers/{name}.py", "--out", folder, "--quiet", "--ranks-per-case", "1", *options)
    assert job.returncode == 0, job.stderr
    return job.stdout


def test_fibre_fraction_sweep_reaches_the_references(tmp_path):
    options = ("--fractions", "0.2", "0.4", "--fibres", "3", "--realisations", "2", "--mesh-size", "0.25", "--fields")
    output = driven("fibre_fraction_sweep", tmp_path, *options)
    found = {
        (m[1], float(m[2])): [float(x) for x in m[3].split()]
        for m in re.finditer(r"^(square|hexagonal|random) +([\d.]+) (.*)$", output, re.MULTILINE)
    }
    assert len(found) == 6 and all(len(v) == (6 if key[0] == "random" else 4) for key, v in found.items())
    assert found["hexagonal", 0.4][:3] == pytest.approx(BONDED["hexagonal", "strain"].value, rel=1e-3)
    assert found["square", 0.4][:3] == pytest.approx(BONDED["square", "strain"].value, rel=1e-3)
    assert found["hexagonal", 0.2][3] < 1e-3 < 1e-2 < found["square", 0.2][3]
    assert all(output.count(str(tmp_path / name)) == 1 for name in ("statistics.csv", "moduli.png"))
    assert imread(tmp_path / "moduli.png")[..., :3].std() > 0.05
    results = [path.parent for path in tmp_path.rglob("result.h5")]
    assert len(results) == 8
    assert_verified(*results)


def test_representative_cell_prints_what_scatters(tmp_path):
    options = ("--fibres", "2", "8", "--realisations", "4", "--tolerance", "0.5", "--fields")
    output = driven("representative_cell", tmp_path, *options)
    lines = re.findall(r"^ +\d+ +\d+\..*$", output, re.MULTILINE)
    table = np.array([[float(x) for x in line.split()] for line in lines])
    assert table.shape == (2, 10) and table[:, 0].tolist() == [2, 8]
    assert (table[:, 2::3] > 0).all() and (table[:, 3::3] > 0).all()
    assert "one cell scatters by less than 50 %: from 2 fibres on" in output
    assert output.count("C11 - C22 = ") == output.count("bulk between ") == 2
    assert imread(tmp_path / "representative_cell.png")[..., :3].std() > 0.02
    assert_verified(*(path.parent for path in tmp_path.rglob("result.h5")))
    assert means(tmp_path, "bulk") == pytest.approx(table[:, 4], rel=1e-4)


def test_effective_stiffness_prints_errors_below_2e_5(tmp_path):
    job = mpirun(0, ROOT / "drivers/effective_stiffness.py", "--out", tmp_path, "--fields", "--fractions", "0.2", "0.4")
    assert job.returncode == 0, job.stderr
    rows = re.findall(r"^(square|hexagonal) +(strain|stress) (.*)$", job.stdout, re.MULTILINE)
    assert len(rows) == 4
    for *_, columns in rows:
        assert max(map(float, columns.split()[1::2])) < 2e-5
    results = [path.parent for path in tmp_path.glob("*/result.h5")]
    assert len(results) == 5
    assert_verified(*results)
    assert imread(tmp_path / "entries.png")[..., :3].std() > 0.05


def test_iterations_prints_a_row_for_every_refinement(tmp_path):
    words = ["--out", tmp_path, "--refine", "0", "1", "--mesh-size", "0.1", "--fields"]
    job = mpirun(2, ROOT / "drivers/iterations.py", *words)
    assert job.returncode == 0, job.stderr
    rows = [line.replace(",", "").split() for line in job.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == ["0", "1"]
    assert int(rows[1][1]) > 3 * int(rows[0][1])
    assert_verified(*(tmp_path / f"refine_{refine}" for refine in (0, 1)))


def test_help_ends_with_0_and_faults_with_2(tmp_path):
    job = mpirun(2, ROOT / "drivers/iterations.py", "--help")
    assert job.returncode == 0 and job.stdout.count("usage:") == 1
    job = mpirun(2, ROOT / "drivers/iterations.py", "--out", tmp_path / "new", "--mesh-size", "7")
    assert job.returncode == 2 and job.stderr.count("[cell] mesh_size = 7.0: expected a number") == 1
    assert not (tmp_path / "new").exists()
