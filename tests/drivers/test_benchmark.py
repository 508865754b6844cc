"""The benchmark against other solvers, on small cells."""

import csv
import re

import pytest
from support.base_case import BASE
from support.jobs import ROOT, mpirun

TOOLS = "feti@1,cholmod,mumps@2,gamg@2"


def benchmark(folder, plane, *options):
    case = folder / "small.toml"
    case.write_text(BASE.replace("mesh_size = 0.05", "mesh_size = 0.2").replace('"strain"', f'"{plane}"'))
    words = [ROOT / "scripts/benchmark.py", case, "--out", folder, *options]
    job = mpirun(0, *words)
    rows = []
    if job.returncode == 0:
        with (folder / "benchmark.csv").open(encoding="utf-8") as stream:
            rows = list(csv.DictReader(stream))
    return job, rows


def test_all_tools_agree_on_the_six_strains_and_are_compared_with_plane_strain(tmp_path):
    job, rows = benchmark(tmp_path, "generalized", "--tools", TOOLS)
    assert job.returncode == 0, job.stderr
    assert [row["plane"] for row in rows] == ["strain", "generalized"] * 4
    assert all(row["status"] == "done" and float(row["difference"]) < 1e-6 for row in rows)
    # A displacement more a node, in a matrix of its own; the other two are those of plane strain.
    for plane, space in zip(rows[::2], rows[1::2], strict=True):
        assert int(space["dofs"]) * 2 == int(plane["dofs"]) * 3
    ratios = re.findall(r"feti / cholmod@1: ([\d.]+) under 3 loads \(strain\), ([\d.]+) under 6 loads", job.stdout)
    seconds = [float(row["solver"]) for row in rows[:4]]
    assert [float(r) for r in ratios[0]] == pytest.approx([seconds[0] / seconds[2], seconds[1] / seconds[3]], abs=0.006)


def test_loads_of_space_are_not_chosen_from(tmp_path):
    job, _ = benchmark(tmp_path, "generalized", "--loads", "2")
    assert job.returncode == 2 and "--loads: all loads" in job.stderr
