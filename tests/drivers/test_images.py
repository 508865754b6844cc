"""Images by the command line: the fibres of a micrograph as a table and a picture, labels as a cell."""

from pathlib import Path

import numpy as np
from matplotlib.image import imread
from support.base_case import BASE
from support.command_line import command_line, in_process
from support.label_images import CIRCLES, labels_of, write_png

ROOT = Path(__file__).parents[2]
HEXAGONAL = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05\n'


def test_fibres_of_a_micrograph_become_a_table_a_picture_and_a_cell(tmp_path):
    image, table = write_png(tmp_path / "a.png", labels_of(CIRCLES, 120)), tmp_path / "fibres.csv"
    job = command_line(2, "fibres", "--image", image, "--pixel", "0.5", "--out", table)
    assert (job.returncode, job.stderr) == (0, "")
    assert job.stdout.splitlines() == [str(table), str(tmp_path / "fibres_circles.png")]
    assert imread(tmp_path / "fibres_circles.png").std() > 0.1
    x, y, radius = np.loadtxt(table, delimiter=",", skiprows=2).T / 60.0
    found = sorted(zip(radius, x, y, strict=True))
    known = sorted((r, a, b) for a, b, r in CIRCLES)
    assert np.abs(np.subtract(found, known)).max() < 0.5 / 120
    cell = 'geometry = "table"\nfile = "fibres.csv"\nwindow = "cut"\nmesh_size = 0.2\n'
    (tmp_path / "case.toml").write_text(BASE.replace(HEXAGONAL, cell) + "[output]\npictures = false\n")
    job = in_process("run", tmp_path / "case.toml", "--out", tmp_path / "out")
    assert job.returncode == 0 and "Status      done" in job.stdout, job.stderr


def test_faulty_images_and_lengths_are_refused_once(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no image")
    job = command_line(2, "fibres", "--image", tmp_path / "a.png", "--out", tmp_path / "a.csv")
    assert (job.returncode, job.stdout) == (2, "") and job.stderr.count("error:") == 1 and "a.png" in job.stderr
    job = in_process("fibres", "--image", tmp_path / "a.png", "--pixel", "-1")
    assert job.returncode == 2 and "expected a length above 0, such as 0.5" in job.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"a.png"}


def test_the_image_of_labels_is_a_verified_cell(tmp_path):
    text = (ROOT / "drivers/labels.toml").read_text().replace("../meshes", str(ROOT / "meshes"))
    text = text.replace("mesh_size = 0.03", "mesh_size = 0.1").replace("[output]", "[output]\npictures = false")
    (tmp_path / "labels.toml").write_text(text)
    job = command_line(2, "run", tmp_path / "labels.toml", "--out", tmp_path / "out")
    assert job.returncode == 0 and "Cell        pixels, 40 x 40" in job.stdout, job.stderr
    assert command_line(0, "verify", tmp_path / "out").returncode == 0
