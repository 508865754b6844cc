"""The micrograph of the repository is made, and its driver runs on a table of few fibres."""

import csv
import re

import numpy as np
from matplotlib.image import imread
from support.command_line import assert_verified
from support.jobs import ROOT, mpirun
from support.made_micrograph import text
from support.moved_rows import moved_rows

from feti_homog.microstructure.fibre_table import read_table

TABLE = "# width = 20, height = 16\nx,y,radius\n3,3,2.6\n9,4,2\n15,3,2.5\n4,12,3\n12,11,2.8\n18.5,12,2.4\n"


def test_the_table_is_that_of_the_script():
    path = ROOT / "meshes/micrograph.csv"
    assert path.read_text() == text()
    table = read_table(path)
    rows, far = moved_rows(table)
    assert len(table.row) == 196 and 10 < len(rows) < 60 and far.max() < 1.2 * table.radius.max()


def test_the_driver_prints_and_draws(tmp_path):
    (tmp_path / "t.csv").write_text(TABLE)
    words = ["--out", tmp_path / "out", "--quick", "--fields", "--table", tmp_path / "t.csv"]
    job = mpirun(0, ROOT / "drivers/micrograph.py", *words)
    assert job.returncode == 0, job.stderr
    assert re.search(r"^fibres 6, fraction 0\.\d+; C11", job.stdout, re.MULTILINE)
    with (tmp_path / "out/micrograph.csv").open(newline="") as stream:
        rows = np.array(list(csv.reader(stream))[1:], float)
    assert rows.shape == (6, 6) and np.allclose(rows[:, 3], [2.6, 2.0, 2.5, 3.0, 2.8, 2.4], rtol=1e-8)
    area = np.pi * rows[:, 3] ** 2
    assert abs(np.sum(area / rows[:, 4]) - 320) < 1e-6  # Voronoi cells fill the window
    # In the mean over an interface the traction along the load is about the stress; its largest is above that.
    assert rows[:, 5].min() > 0.5 and rows[:, 5].max() < 10
    assert imread(tmp_path / "out/micrograph.png")[..., :3].std() > 0.05
    assert_verified(tmp_path / "out/stiffness")
