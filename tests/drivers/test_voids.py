"""The drivers of voids, coats, estimates and windows meet theory, and their results obey every law."""

import csv

import numpy as np
from matplotlib.image import imread
from support.command_line import assert_verified
from support.drivers import column, driven
from support.jobs import ROOT, mpirun


def test_voids_soften_as_mori_and_tanaka_say(tmp_path):
    """From below, as for stiff fibres, by less than a fifth; all folders are verified."""
    job = mpirun(0, ROOT / "drivers/voids.py", "--out", tmp_path / "out", "--quick", "--fields", "--fibres", "9")
    assert job.returncode == 0, job.stderr
    with (tmp_path / "out/voids.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["porosity"]) for row in rows] == [0.0, float(rows[1]["porosity"])]
    for row in rows:
        for name in ("K", "G"):
            assert 1.0 < float(row[name]) / float(row[f"{name} Mori-Tanaka"]) < 1.2, (row["porosity"], name)
    assert all(float(rows[1][name]) < float(rows[0][name]) for name in ("K", "G"))
    assert np.std(imread(tmp_path / "out/voids.png")[..., :3]) > 0.05
    assert_verified(*(path.parent for path in (tmp_path / "out").glob("*/result.h5")))


def test_the_driver_meets_composite_cylinders(tmp_path):
    job = mpirun(0, ROOT / "drivers/coated_fibres.py", "--out", tmp_path / "out", "--quick", "--fields")
    assert job.returncode == 0, job.stderr
    with (tmp_path / "out/coated_fibres.csv").open(newline="") as stream:
        ratio, bulk, cylinders, shear, inner, outer = np.array(list(csv.reader(stream))[1:], float).T
    assert np.abs(bulk / cylinders - 1).max() < 2e-3 and np.all(np.diff(shear) > 0)
    # A soft coating shields both of its faces.
    assert inner[0] > inner[1] and outer[0] > outer[1] and ratio[1] < 1 < ratio[2]
    assert imread(tmp_path / "out/coated_fibres.png")[..., :3].std() > 0.05
    assert_verified(tmp_path / "out/bonded-2.85", tmp_path / "out/fibre-2.85")


def test_cells_lie_where_theory_wants_them(tmp_path):
    rows = driven("micromechanics", tmp_path, "--fields")
    for fraction in ("0.3", "0.5"):
        found = {row["geometry or method"]: row for row in rows if row["fibre_fraction"] == fraction}
        value = {name: {key: float(row[key]) for key in row if "_" in key} for name, row in found.items()}
        hexagonal, cylinders, shear = value["hexagonal"], value["composite_cylinders"], "G_transverse"
        # Mori and Tanaka's moduli are the lower bounds of stiff fibres; fractions of coarse meshes differ by 1e-5.
        for name in ("E_axial", "G_axial", shear):
            assert (1.0 - 1e-4) * value["mori_tanaka"][name] < hexagonal[name], name
        # Hexagonal cells are next to composite cylinders where these are exact.
        for name in ("E_axial", "nu_axial", "expansion_axial", "expansion_transverse"):
            assert abs(hexagonal[name] / cylinders[name] - 1.0) < 2e-3, name
        assert hexagonal[shear] < value["self_consistent"][shear] < 1.1 * hexagonal[shear]
        # Uniform fields: Hill's relation holds between any two arrangements.
        a, b = (value[name] for name in ("hexagonal", "random"))
        assert abs(a["E_axial"] / b["E_axial"] - 1.0) < 1e-3
    assert np.isnan(column([found["chamis"]], "G_axial")).sum() == 0
    assert_verified(*(path.parent for path in tmp_path.glob("*/result.h5")))


def test_bounds_of_windows_close_in_on_the_periodic_cell(tmp_path):
    options = ("--sizes", "1", "2", "--mesh-size", "0.4", "--fields")
    job = mpirun(2, ROOT / "drivers/window_size.py", "--out", tmp_path, *options)
    assert job.returncode == 0, job.stderr
    rows = [line.split() for line in job.stdout.splitlines() if "." in line]
    table = {tuple(row[:-2]): np.array(row[-2:], float) for row in rows}
    periodic, gaps = table["periodic",], []
    for n in ("1", "4"):
        low, high = table[n, "traction"], table[n, "displacement"]
        assert (low < 1.01 * periodic).all() and (high > 0.99 * periodic).all()
        gaps.append(high - low)
    assert (gaps[1] < 0.8 * gaps[0]).all()
    assert imread(tmp_path / "window_size.png")[..., :3].std() > 0.05
    assert_verified(*(path.parent for path in tmp_path.glob("*/result.h5")))
