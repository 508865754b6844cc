"""Statistics over realisations: against scipy, as collect prints them, and of paths that rise to their end."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from support.sweep_tables import collected, path_document

from feti_homog.studies import case_folders, collect, pictures
from feti_homog.studies.sweep_table import Statistics


def test_statistics_are_scipys():
    samples = np.random.default_rng(0).normal(5.0, 2.0, (7, 3))
    found = Statistics.of(samples)
    for k, column in enumerate(samples.T):
        low, high = stats.t.interval(0.95, len(column) - 1, loc=column.mean(), scale=stats.sem(column))
        assert (found.mean[k], found.std[k]) == pytest.approx((column.mean(), column.std(ddof=1)))
        assert found.mean[k] + np.array([-1, 1]) * found.ci95[k] == pytest.approx([low, high])


def test_a_table_prints_as_a_line():
    assert repr(samples(1.0)).startswith("SweepTable('") and len(repr(samples(1.0))) < 120


def test_statistics_of_too_few_values_are_nan():
    found = Statistics.of(np.array([[1.0, 2.0, np.nan], [np.nan, 4.0, np.nan]]))
    assert found.count.tolist() == [1, 2, 0]
    assert found.mean[:2].tolist() == [1.0, 3.0] and math.isnan(found.mean[2])
    assert np.isnan(found.std[[0, 2]]).all() and found.std[1] == pytest.approx(2**0.5)
    assert found.ci95[1] == pytest.approx(12.706, rel=1e-4)


def samples(scale):
    """Collect three realisations of a path with peaks of 3, 4 and 5 times a scale; S11 is noise."""
    documents = [path_document(4, 0.0) for _ in range(3)]
    for number, each in enumerate(documents):
        moduli = {phase: {"young": scale * 70.0, "poisson": 0.2} for phase in ("matrix", "fibre")}
        each["case"] = each["case"] | {"material": moduli}
        each["path"] = [
            point | {"stress": [scale * (-1) ** k * 2e-13, scale * (3 + number) * share, scale * 0.5 * share]}
            for k, (point, share) in enumerate(zip(each["path"], (0.5, 0.4, 1.0, 0.5), strict=True))
        ]
    return collected({"cell.seed": [0, 1, 2]}, documents, [1] * 3, [1, 2, 3])


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_noise_and_costs_have_no_statistics(tmp_path, scale):
    """A stress far below the other stresses of its path is noise, in any unit."""
    table = samples(scale)
    assert table.outputs["peak_S11"].tolist() == table.outputs["onset_S11"].tolist() == [0.0] * 3
    collect.write(tmp_path, table)
    rows = {row["output"]: row for row in csv.DictReader((tmp_path / "statistics.csv").read_text().splitlines())}
    assert not {"peak_S11", "end_S11", "memory", "seconds_solve", "check_hill"} & {*rows}
    assert float(rows["peak_S12"]["mean"]) == pytest.approx(scale / 2)
    assert [float(rows["peak_S22"][name]) for name in ("mean", "std")] == pytest.approx([4 * scale, scale])
    title, head, *printed = [line for line in collect.means(table) if line]
    assert title == "All realisations" and head.split() == ["output", "cases", "mean", "std", "95", "%", "+-"]
    (peak,) = [line.split() for line in printed if "peak_S22" in line]
    count, *numbers = map(float, peak[2:])
    half = stats.t.ppf(0.975, 2) * scale / 3**0.5
    assert count == 3 and numbers == pytest.approx([4 * scale, scale, half], rel=1e-4)
    assert {line.split()[0] for line in printed} == {"onset_S12", "onset_S22", "peak_S12", "peak_S22", "peak_E11"}


def test_numbers_so_far_of_an_unfinished_case_are_in_its_row_alone():
    table = replace(whole := samples(1.0), documents=[*whole.documents[:2], None])
    assert table.outputs["peak_S22"].tolist() == [3.0, 4.0, 5.0]
    found = table.statistics["peak_S22"]
    assert (found.count, found.mean, found.std) == pytest.approx((2.0, 3.5, 0.5**0.5))


def test_a_single_realisation_has_no_scatter(tmp_path):
    table = collected({"cell.order": [1]}, [path_document(2, 0.0)], [1], [1])
    collect.write(tmp_path, table)
    rows = {row["output"]: row for row in csv.DictReader((tmp_path / "statistics.csv").read_text().splitlines())}
    assert [rows["peak_S11"][name] for name in ("count", "mean", "std", "ci95")] == ["1", "4.0", "", ""]
    _, title, heads, *rows = collect.means(table)
    assert title == "Results" and "std" not in heads and "peak_S11" in heads and len(rows) == 1
    assert collect.means(collected({"cell.order": [1]}, [None], [1], [1])) == []


def test_the_first_of_many_points_are_printed():
    count = collect.MOST_ROWS + 10
    steps = [*range(1, count + 1)]
    _, title, _, *rows = collect.means(collected({"cell.order": steps}, [path_document(2, 0.0)] * count, steps, steps))
    assert title == f"Results, {collect.MOST_ROWS} of {count} points" and len(rows) == collect.MOST_ROWS


@pytest.mark.parametrize("breaks", [True, False])
@pytest.mark.parametrize("rising", [0, 1, 2])
def test_paths_whose_stress_does_not_fall_are_counted(tmp_path, monkeypatch, rising, breaks):
    falling = path_document(2, 0.0)
    short = falling | {"path": [point if breaks else point | {"broke": 0} for point in falling["path"][:1]]}
    entries = tuple(case_folders.SweepCase(k, 1, k, {"cell.seed": k}, "") for k in (1, 2))
    documents = [*[short] * rising, *[falling] * (2 - rising)]
    found = [case_folders.CaseState(case_folders.Status.DONE, "", document) for document in documents]
    index = case_folders.Sweep("test", "GPa", entries)
    monkeypatch.setattr(collect, "_index_and_states", lambda _: (index, found))
    remark = f"remark: {rising} of 2 paths end before their stress falls: load them further for a peak"
    assert collect.collect(tmp_path, pictures=False).count(remark) == (rising > 0)


@pytest.mark.parametrize("rising", [0, 1])
def test_onsets_and_peaks_are_drawn_over_fractions(tmp_path, rising):
    """Peaks only if all paths have passed theirs."""
    documents = [path_document(2, 0.0), path_document(2, 1.0)]
    documents[1] |= {"path": documents[1]["path"][: 1 if rising else None]}
    table = collected({"cell.fibre_fraction": [0.2, 0.4]}, documents, [1, 2], [1, 1])
    assert [path.name for path in pictures.draw_over_fractions(tmp_path, table)] == ["peaks.png"]
    labels = [axes.get_ylabel() for axes in pictures.figure_over_fractions(table).axes if axes.get_ylabel()]
    assert labels == [f"{mark} $S_{{11}}$\n(GPa)" for mark in ("onset", "peak")][: 2 - rising]
