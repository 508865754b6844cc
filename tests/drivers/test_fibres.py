"""`feti-homog fibres`: a cell, its table, and the results of the table."""

import json

import numpy as np
import pytest
from support.base_case import BASE
from support.command_line import command_line, in_process

SQUARE = 'geometry = "square"\nfibre_fraction = 0.4\nmesh_size = 0.2\nwidth = 3.0\n'
HEXAGONAL = 'geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05\n'
TABLE = 'geometry = "table"\nfile = "square.csv"\nmesh_size = 0.2\n'
END = "[output]\npictures = false\nfields = false\n"


@pytest.mark.quick
def test_a_cell_its_table_and_the_table_of_its_result(tmp_path):
    stiffness = []
    for name, cell in (("square", SQUARE), ("table", TABLE)):
        case, out = tmp_path / f"{name}.toml", tmp_path / name
        case.write_text(BASE.replace(HEXAGONAL, cell) + END)
        if name == "square":
            job = command_line(2, "fibres", case, "--out", tmp_path / "square.csv")
            assert (job.returncode, job.stdout, job.stderr) == (0, f"{tmp_path / 'square.csv'}\n", "")
        assert in_process("run", case, "--out", out, "--quiet").returncode == 0
        job = in_process("fibres", out)
        assert (job.returncode, job.stderr) == (0, "")
        printed = [line.split(",") for line in job.stdout.splitlines()[2:]]
        written = [line.split(",") for line in (tmp_path / "square.csv").read_text().splitlines()[2:]]
        assert len(printed) == len(written) == 1 and printed[0][3] == written[0][3] == "fibre"
        numbers = np.array([printed[0][:3], written[0][:3]], float)
        assert np.abs(numbers[0] - numbers[1]).max() < 1e-12
        stiffness.append(json.loads((out / "result.json").read_text())["effective_stiffness"])
    assert np.abs(np.subtract(*stiffness)).max() < 1e-9 * np.max(stiffness)


def test_faults_are_reported_once_and_nothing_is_written(tmp_path):
    (tmp_path / "square.csv").write_text("x,y,radius\n1,2,-3\n1,2\n")
    (tmp_path / "case.toml").write_text(BASE.replace(HEXAGONAL, TABLE))
    job = command_line(2, "fibres", tmp_path / "case.toml", "--out", tmp_path / "out.csv")
    faults = [
        "error: [cell] square.csv: row 3: expected 3 columns, one for each name; it has 2",
        "error: [cell] square.csv: row 2: radius = -3.0: expected a number above 0",
    ]
    assert (job.returncode, job.stdout) == (2, "") and not (tmp_path / "out.csv").exists()
    assert all(job.stderr.count(fault) == 1 for fault in faults)
