"""The drivers that are sweeps: tables, pictures, and the laws that their numbers obey."""

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
    options = ("--fractions", "0.2", "0.4", "--fibres", "6", "--realisations", "3", "--mesh-size", "0.25", "--fields")
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
    assert len(results) == 10
    assert_verified(*results)
    assert driven("fibre_fraction_sweep", tmp_path, *options) == output


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
