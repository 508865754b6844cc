"""`feti-homog statistics` in processes of its own: printed once, faults reported once."""

from __future__ import annotations

import pytest
from support.base_case import BASE
from support.command_line import command_line

TABLE = "# width = 8, height = 6\nx;y;radius\n1;1;0,5\n4;2,5;0,5\n6,5;3;0,75\n2;5;0,5\n"


@pytest.mark.parametrize("ranks", [0, pytest.param(2, marks=pytest.mark.quick)])
def test_statistics_are_printed_and_written_once(tmp_path, ranks):
    (tmp_path / "fibres.csv").write_text(TABLE)
    words = ("--model", "poisson", "--simulations", "3", "--out", tmp_path / "out")
    job = command_line(ranks, "statistics", tmp_path / "fibres.csv", *words)
    assert (job.returncode, job.stderr) == (0, "")
    assert job.stdout.count("4 in a window, corrected for its edges, of 8 x 6") == 1
    assert f"{tmp_path / 'out' / 'statistics.png'}\n" in job.stdout and (tmp_path / "out" / "statistics.png").is_file()


@pytest.mark.parametrize(
    ("name", "words", "fault"),
    [
        ("fibres.csv", ("--simulations", "0"), "0: expected an integer from 1 to 9999"),
        ("fibres.csv", ("--size", "8", "none"), "none: expected a length above 0"),
        ("fibres.csv", ("--model", "lattice"), "invalid choice: 'lattice'"),
        ("fibres.csv", ("--size", "5", "6"), "fibres.csv: row 5: its centre is outside of the window of 5 x 6"),
        ("case.toml", ("--size", "1", "1"), "--size: only for a table of fibres"),
    ],
)
def test_faults_are_reported_once_and_nothing_is_written(tmp_path, name, words, fault):
    (tmp_path / "fibres.csv").write_text(TABLE)
    (tmp_path / "case.toml").write_text(BASE)
    job = command_line(0, "statistics", tmp_path / name, *words, "--out", tmp_path / "out")
    assert (job.returncode, job.stdout, job.stderr.count(fault)) == (2, "", 1)
    assert not (tmp_path / "out").exists()
