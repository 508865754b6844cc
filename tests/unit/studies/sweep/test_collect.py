"""Statistics over realisations, and the tables and pictures of a sweep."""

import csv

import numpy as np
import pytest
from matplotlib.image import imread
from scipy import stats
from support.sweep_tables import collected, document, path_document

from feti_homog.materials.voigt import SPATIAL_STRESSES
from feti_homog.report.plots import plot_helpers
from feti_homog.report.text.tables import unit, with_unit
from feti_homog.studies import case_folders, collect, pictures
from feti_homog.studies.outputs import numbers, outputs
from feti_homog.studies.sweep_table import Statistics, series_over


def sheared(fibres, compliance):
    """Under a given stress S13 in generalized plane strain: at load 0.5 the strain jumps to twice as much."""
    points = [
        {"load_factor": t, "strain": [0, 0, 0, 0, 4 * t * f * compliance, 0], "stress": [0, 0, 0, 0, 4 * t, 0],
         "broke": 1, "dissipated": 0.1, "work": 0.3, "bonded": 9, "open": 1, "closed": 0}
        for t, f in ((0.5, 1.0), (0.4, 1.5), (1.0, 2.0))
    ]  # fmt: skip
    base = document(0.4, fibres, 0.0)
    case = base["case"] | {"path": {"method": "events", "to": {"S13": 4.0}}}
    case["analysis"] = case["analysis"] | {"type": "path", "plane": "generalized"}
    del base["effective_stiffness"], base["moduli"]
    return base | {"case": case, "path": points}


@pytest.mark.slow
def test_curves_of_a_given_stress_have_six_components(tmp_path):
    documents = [sheared(fibres, e) for e in (0.1, 0.2) for fibres in (2, 4)]
    table = collected({"cell.fibres": [2, 4, 2, 4], "cell.seed": [0, 0, 1, 1]}, documents, [1, 2, 1, 2], [1, 1, 2, 2])
    collect.write(tmp_path, table)
    assert table.outputs["onset_S13"].tolist() == [2.0] * 4 and table.outputs["work"].tolist() == [0.3] * 4
    assert table.outputs["end_gamma13"].tolist() == pytest.approx([0.8, 0.8, 1.6, 1.6])
    strain, stress = table.curves(1)
    stresses = stress[:, :, SPATIAL_STRESSES.index("S13")]
    assert strain[-1] == pytest.approx(0.8) and stresses.shape == (2, len(strain))
    # To the load 2 at the compliance 0.1, then a jump, then half as steep; of the other twice as soft.
    assert np.interp([0.1, 0.3, 0.6], strain, stresses[0]) == pytest.approx([1.0, 2.0, 3.0])
    assert np.interp([0.2, 0.6], strain, stresses[1]) == pytest.approx([1.0, 2.0])


def test_columns_of_a_path_are_its_first_point_its_peaks_and_its_end():
    path = path_document(2, 0.0)
    path["path"][-1] |= {"stress": [-7.0, 1.0, 0.5], "bonded": 5, "open": 3, "closed": 2, "friction_heat": 0.7}
    found = outputs(path)
    assert [found[f"{place}_S11"] for place in ("onset", "peak", "end")] == [4.0, 4.0, -7.0]
    assert found["peak_E11"] == pytest.approx(0.02)  # whose stress falls behind it
    assert [found[f"peak_{name}"] for name in ("S22", "S12")] == pytest.approx([5.0 / 3, 0.5])
    assert (found["onset_E11"], found["end_E11"], found["friction_heat"]) == pytest.approx((0.02, 0.2, 0.7))
    assert [found[f"end_{state}"] for state in ("bonded", "open", "closed")] == [5.0, 3.0, 2.0]
    path["path"] = [point | {"broke": 0} for point in path["path"]]
    assert {*found} - {*outputs(path)} == {name for name in found if name.startswith("onset_")}
    path["path"][1]["softened"] = 1
    assert outputs(path)["onset_S11"] == 2.0


def test_columns_of_bounds_are_the_lower_and_the_upper():
    sides = {"reuss": np.diag([1.0, 2.0, 3.0]), "voigt": np.diag([4.0, 5.0, 6.0])}
    found = outputs(document(0.4, 2, 0.0) | {"bounds": sides | {"hashin_shtrikman": {"bulk": [7.0, 8.0]}}})
    assert [found[f"C{i}{i}_{side}"] for side in sides for i in (1, 2, 3)] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert (found["bulk_lower"], found["bulk_upper"]) == (7.0, 8.0)


def fractions():
    """Two fractions with three realisations each, of which one still waits."""
    documents = [document(c, 8, shift) for shift in (0.0, 0.5, 1.0) for c in (0.2, 0.4)]
    documents[-1] = None
    inputs = {"cell.fibre_fraction": [0.2, 0.4] * 3, "cell.seed": [0, 0, 1, 1, 2, 2]}
    return collected(inputs, documents, [1, 2] * 3, [1, 1, 2, 2, 3, 3])


def test_tables_hold_cases_and_statistics_of_points(tmp_path):
    table = fractions()
    assert [path.name for path in collect.write(tmp_path, table)] == ["cases.csv", "statistics.csv"]
    rows, statistics = (
        list(csv.DictReader((tmp_path / name).read_text().splitlines())) for name in ("cases.csv", "statistics.csv")
    )
    assert [row["case"] for row in rows] == list("123456") and rows[0]["elements"].isdigit()
    assert rows[5]["status"] == "waiting" and rows[5]["bulk"] == "" and rows[5]["cell.fibre_fraction"] == "0.4"
    assert [*statistics[0]] == ["point", "cell.fibre_fraction", "output", "unit", "count", "mean", "std", "ci95"]
    bulk = [row for row in statistics if row["output"] == "bulk"]
    assert [float(row["mean"]) for row in bulk] == pytest.approx([97.5, 109.25])
    assert [(row["point"], row["cell.fibre_fraction"], row["unit"], row["count"]) for row in bulk] == [
        ("1", "0.2", "GPa", "3"),
        ("2", "0.4", "GPa", "2"),
    ]
    (first, second) = [row for row in statistics if row["output"] == "C11"]
    halves = [stats.t.ppf(0.975, 2) * 0.5 / 3**0.5, stats.t.ppf(0.975, 1) * 0.25]
    assert [float(row["mean"]) for row in (first, second)] == [136.5, 152.25]
    assert [float(row["ci95"]) for row in (first, second)] == pytest.approx(halves)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["cases.csv", "statistics.csv"]


def test_each_case_is_listed_by_its_status_and_done_ones_alone_count(tmp_path, monkeypatch):
    """A running path has numbers in its row; a refused or damaged result has none in any table."""
    states = {status: (f"because {status}", path_document(2, 0.0)) for status in case_folders.Status}
    entries = [case_folders.SweepCase(k, 1, k, {"cell.seed": k}, "") for k, _ in enumerate(states, start=1)]
    index = case_folders.Sweep("test", "GPa", tuple(entries))
    found = [case_folders.CaseState(status, *more) for status, more in states.items()]
    monkeypatch.setattr(collect, "_index_and_states", lambda _: (index, found))
    first, *lines = collect.collect(tmp_path, pictures=False)
    assert first == "7 cases: " + ", ".join(f"1 {status}" for status in states)
    text = "\n".join(lines)
    assert all(f"because {status}" in text for status in ("failed", "not converged", "damaged", "running"))
    assert "3 failed:" in lines and "because done" not in text
    table = collect.read(tmp_path)
    assert table.finished == [states["done"][1]]
    known = [status for status, peak in zip(table.status, table.outputs["peak_S11"], strict=True) if np.isfinite(peak)]
    assert known == ["done", "running", "interrupted"] and table.statistics["peak_S11"].count == 1.0


def test_notes_that_differ_in_numbers_alone_are_printed_once(tmp_path, monkeypatch):
    """Each with its first case and the number of cases; warnings come first."""
    notes = [["[cell] order = 1: 2.6% less", "utilisation"], ["[cell] order = 1: 0.9% less"], None]
    documents = [lines and path_document(2, 0.0) | {"remarks": lines, "warnings": ["rtol"]} for lines in notes]
    entries = tuple(case_folders.SweepCase(k, 1, k, {"cell.seed": k}, "") for k in (1, 2, 3))
    status = [case_folders.Status.DONE, case_folders.Status.DONE, case_folders.Status.WAITING]
    found = [case_folders.CaseState(*pair) for pair in zip(status, [""] * 3, documents, strict=True)]
    index = case_folders.Sweep("test", "GPa", entries)
    monkeypatch.setattr(collect, "_index_and_states", lambda _: (index, found))
    assert [line for line in collect.collect(tmp_path, pictures=False) if "case-000" in line] == [
        "warning: case-0001: rtol (2 cases)",
        "remark: case-0001: [cell] order = 1: 2.6% less (2 cases, some with other numbers)",
        "remark: case-0001: utilisation",
    ]


def test_entries_beside_cases_in_space_have_the_names_of_space(tmp_path):
    """The third strain of the plane is the sixth of space."""
    plane = document(0.4, 8, 0.0)
    plane["effective_stiffness_compression"] = 2 * plane["effective_stiffness"]
    plane["bounds"] = {side: plane["effective_stiffness"] for side in ("reuss", "voigt")}
    plane["angle"] = [{"angle": 30.0, "stiffness": plane["effective_stiffness"]}]
    space = document(0.4, 8, 0.0) | {"effective_stiffness": np.arange(36.0).reshape(6, 6), "moduli": {}}
    space["case"]["analysis"]["plane"] = "generalized"
    own = numbers(["strain", "generalized"])
    found, beside = outputs(plane, own), outputs(space, own)
    assert (found["C66"], found["C66_compression"], found["angle_30_C66"], found["C66_voigt"]) == (35, 70, 35, 35)
    assert (beside["C66"], beside["C33"]) == (35, 14) and not [name for name in found if "C33" in name or "C13" in name]
    for alone in (["strain", "stress"], [None, None]):
        assert outputs(plane, numbers(alone)) == outputs(plane)
    assert (outputs(plane)["C33"], outputs(plane)["C33_reuss"], outputs(space)["C33"]) == (35, 35, 14)


@pytest.mark.slow
def test_mean_curves_keep_the_bonded_branch(tmp_path):
    documents = [path_document(fibres, shift) for shift in (0.0, 1.0) for fibres in (2, 4)]
    table = collected({"cell.fibres": [2, 4, 2, 4], "cell.seed": [0, 0, 1, 1]}, documents, [1, 2, 1, 2], [1, 1, 2, 2])
    collect.write(tmp_path, table)
    assert table.outputs["onset_S11"].tolist() == [4.0, 4.0, 5.0, 5.0]
    assert table.outputs["peak_S11"].tolist() == [4.0, 4.0, 5.0, 5.0]  # before the fall
    assert table.outputs["end_S11"].tolist() == [8.0, 8.0, 9.0, 9.0]
    strain, stress = table.curves(1)
    found = Statistics.of(stress[:, :, 0])
    assert strain[[0, -1]].tolist() == [0.0, 0.2] and stress.shape[:2] == (2, len(strain))
    assert found.mean[[0, -1]] == pytest.approx([0.0, 8.5])
    # The bonded branch: from zero to the mean of the first breaks.
    assert np.interp(0.01, strain, found.mean) == pytest.approx(2.25)
    assert found.ci95[-1] == pytest.approx(stats.t.ppf(0.975, 1) * 0.5**0.5 / 2**0.5)


@pytest.mark.slow
def test_moduli_are_drawn(tmp_path):
    assert_drawn(tmp_path, fractions(), ["moduli.png"])
    assert not pictures.draw_over_fractions(tmp_path, collected({"cell.order": [1]}, [document(0.4, 8, 0)], [1], [1]))
    waiting = collected({"cell.fibre_fraction": [0.1, 0.2]}, [None] * 2, [1, 2], [1] * 2)
    assert not pictures.draw_over_fractions(tmp_path, waiting)


def test_bars_are_the_mean_errors_of_the_mesh():
    errors = ({"constants": {"bulk": error, "nu31": 1.0}, "energy": 0.01} for error in (2.0, 4.0, 1.0, 3.0))
    documents = [document(c, 8, shift) for shift in (0.0, 1.0) for c in (0.2, 0.4)]
    documents = [each | {"mesh_error": error} for each, error in zip(documents, errors, strict=True)]
    table = collected({"cell.fibre_fraction": [0.2, 0.4] * 2}, documents, [1, 2] * 2, [1, 1, 2, 2])
    assert "nu31_mesh_error" not in table.outputs  # of a constant that has no column
    panel = (figure := pictures.figure_over_fractions(table)).axes[pictures.PANELS.index("bulk")]
    shear = figure.axes[pictures.PANELS.index("C33")].get_ylabel()
    assert shear.startswith(r"$C_{33}$ ($\gamma_{12}$)") and "gamma" not in panel.get_ylabel()
    assert {"realisations", "95 % confidence of the mean"} <= {each.get_text() for each in figure.legends[0].texts}
    (bars,) = (each for each in panel.containers if each.get_label() == "estimated error of the mesh")
    (ends,) = (lines.get_segments() for lines in bars.lines[2])
    assert [end[:, 1].tolist() for end in ends] == [pytest.approx([96.0, 99.0]), pytest.approx([106.0, 113.0])]


def assert_drawn(folder, table, names):
    paths = pictures.draw_over_fractions(folder, table)
    assert [path.name for path in paths] == names
    for path in paths:
        picture = imread(path)
        assert min(picture.shape[:2]) > 500 and picture[..., :3].std() > 0.03


def spatial_document(fraction, shift):
    """Write the files of a run in generalized plane strain."""
    found = document(fraction, 1, 0.0)
    C = np.diag([150.0 + shift, 150.0, 210.0, 50.0, 50.0, 45.0]) + 1e-3 * np.arange(36).reshape(6, 6)
    thermal = {"thermal_stress": [-1.0] * 6, "thermal_expansion": [1e-5] * 6}
    case = found["case"] | {"analysis": {"type": "stiffness", "plane": "generalized"}}
    about_fibres = {"E_axial": 200.0, "E_transverse": 120.0, "G_axial": 50.0, "G_transverse": 46.0}
    constants = {"constants": {"E3": 200.0}, "transversely_isotropic": about_fibres | {"expansion_axial": None}}
    del found["moduli"]
    return found | {"case": case, "effective_stiffness": C} | thermal | constants


def test_stiffnesses_in_space_fill_columns_and_are_drawn(tmp_path):
    documents = [spatial_document(c, shift) for shift in (0.0, 1.0) for c in (0.2, 0.4)]
    table = collected({"cell.fibre_fraction": [0.2, 0.4] * 2, "cell.seed": [0, 0, 1, 1]}, documents, [1, 2] * 2, [1, 2])
    stiffness = documents[0]["effective_stiffness"]
    assert [table.outputs[f"C{i}{j}"][0] for i in range(1, 7) for j in range(1, 7)] == stiffness.ravel().tolist()
    assert table.outputs["anisotropy_normal"] == pytest.approx([-0.007, -0.007, 0.993, 0.993])
    assert table.outputs["anisotropy_shear"][0] == pytest.approx(45.035 - (150.0 + 150.007 - 2 * 0.001) / 4)
    assert table.outputs["thermal_S33"].tolist() == [-1.0] * 4 and table.outputs["expansion_gamma12"][0] == 1e-5
    assert (table.outputs["E3"][0], table.outputs["G_axial"][0]) == (200.0, 50.0)
    assert "bulk" not in table.outputs
    assert pictures.panels_of(table) == ("E_axial", "E_transverse", "G_axial", "G_transverse")
    assert_drawn(tmp_path, table, ["moduli.png"])
    single = collected({"cell.fibre_fraction": [0.2, 0.4]}, documents[:2], [1, 2], [1, 1])
    for printed in ("\n".join(collect.means(each)) for each in (table, single)):
        # Names that mean the same in the axes of a cell and of a ply.
        assert "E_transverse" in printed and "G_axial" in printed and "E3" not in printed and "fraction 0.4" in printed


def test_bands_are_the_mean_bounds_in_the_results():
    documents = [spatial_document(c, shift) for shift in (0.0, 1.0) for c in (0.2, 0.4)]
    for each, low in zip(documents, (1.0, 2.0, 3.0, 6.0), strict=True):
        each["fibre_bounds"] = {"E_axial": [low, 2 * low], "nu_axial": None}
    table = collected({"cell.fibre_fraction": [0.2, 0.4] * 2, "cell.seed": [0, 0, 1, 1]}, documents, [1, 2] * 2, [1, 2])
    axes = pictures.figure_over_fractions(table).axes
    ends = [[line for line in panel.lines if line.get_label() == "Hill and Hashin bounds"] for panel in axes]
    assert [len(each) for each in ends[:4]] == [2, 0, 0, 0]
    assert [line.get_xydata().tolist() for line in ends[0]] == [[[0.2, 2.0], [0.4, 4.0]], [[0.2, 4.0], [0.4, 8.0]]]
    sides = {
        "reuss": np.eye(3),
        "voigt": 2 * np.eye(3),
        "hashin_shtrikman": {"bulk": [1.25, 1.5], "shear": [0.5, 0.75]},
    }
    found = {"C11": (1.0, 2.0), "C33": (1.0, 2.0), "bulk": [1.25, 1.5], "shear": [0.5, 0.75]}
    assert pictures.bounds_of({"bounds": sides}) == found and pictures.bounds_of({"bounds": None}) == {}


def test_bounds_have_the_colours_of_their_lines_and_leave_the_lines_high():
    """Bounds far above the values are cut off at half of the range of the values; near bounds are not."""
    documents = [spatial_document(c, 0.0) for c in (0.2, 0.4, 0.2, 0.4)]
    keys = {"cell.fibre_fraction": [0.2, 0.4] * 2, "material.fibre.young": [70.0, 70.0, 200.0, 200.0]}
    for each, size in zip(documents, (10.0, 20.0, 11.0, 21.0), strict=True):
        each["transversely_isotropic"] = dict.fromkeys(each["transversely_isotropic"], size)
        each["fibre_bounds"] = {"E_axial": [size - 1.0, size + 2.0], "G_axial": [size, 1000.0]}
    several = pictures.figure_over_fractions(collected(keys, documents, [1, 2, 3, 4], [1] * 4)).axes
    ends = [line for line in several[0].lines if line.get_label() == "Hill and Hashin bounds"]
    assert [line.get_color() for line in ends] == [ink for ink in plot_helpers.INK[:2] for _ in range(2)]
    assert [line.get_ydata().tolist() for line in ends] == [[9.0, 19.0], [12.0, 22.0], [10.0, 20.0], [13.0, 23.0]]
    assert several[0].get_ylim() == pytest.approx((9.0 - 0.06 * 14.0, 23.0 + 0.06 * 14.0))
    assert several[2].get_ylim() == pytest.approx((10.0 - 0.06 * 16.5, 26.5 + 0.06 * 16.5))


def test_secants_in_space_are_drawn_without_bounds(tmp_path):
    documents = [spatial_document(c, 0.0) for c in (0.2, 0.4)]
    for each in documents:
        del each["constants"], each["transversely_isotropic"]
    table = collected({"cell.fibre_fraction": [0.2, 0.4]}, documents, [1, 2], [1, 1])
    assert pictures.panels_of(table) == ("C11", "C33", "C44", "C66")
    figure = pictures.figure_over_fractions(table)
    assert figure.get_suptitle().endswith(": generalized plane strain")
    assert not any("gamma" in axes.get_ylabel() for axes in figure.axes)
    assert_drawn(tmp_path, table, ["moduli.png"])


def test_angles_in_space_have_all_entries():
    point = {"angle": 60.0, "stiffness": np.arange(36.0).reshape(6, 6)}
    base = {name: part for name, part in document(0.4, 8, 0).items() if name != "effective_stiffness"}
    found = outputs(base | {"angle": [point]})
    assert (found["angle_60_C11"], found["angle_60_C33"], found["angle_60_C66"]) == (0.0, 14.0, 35.0)


def test_what_varies_along_is_no_other_series():
    """A key with one value makes no series; the abscissas of a series rise."""
    counts = [8, 4, 4, 8]
    sizes = {"cell.mesh_size": [0.2, 0.3, 0.3, 0.2], "material.fibre.young": [1, 1, 2, 2], "cell.order": [1] * 4}
    documents = [document(0.4, fibres, 0.0) for fibres in counts]
    table = collected({"cell.fibres": counts} | sizes, documents, [1, 2, 3, 4], [1] * 4)
    assert table.label(1) == "8 fibres, mesh size 0.2, fibre young 1 GPa"
    found = series_over(table, "cell.fibres")
    assert [(one.label, one.points, one.x.tolist()) for one in found] == [
        ("fibre young 1 GPa", [2, 1], [4.0, 8.0]), ("fibre young 2 GPa", [3, 4], [4.0, 8.0]),
    ]  # fmt: skip


def test_outputs_have_their_units():
    assert unit("material.fibre.young", "GPa") == "GPa" == unit("C11_compression", "GPa") == unit("onset_S11", "GPa")
    assert unit("material.fibre.E_axial", "GPa") == "GPa" == unit("material.fibre.G13", "GPa")
    assert not unit("material.fibre.nu_axial", "GPa") and not unit("material.fibre.expansion_axial", "GPa")
    assert with_unit("angle_60_C11", "MPa") == "angle_60_C11 (MPa)" and with_unit("bulk", "") == "bulk"
    assert unit("seconds_solve", "GPa") == "s" and unit("material.fibre.angle", "GPa") == "degrees"
    assert not unit("cell.fibre_fraction", "GPa") and not unit("nu12", "GPa") and not unit("check_hill", "GPa")
