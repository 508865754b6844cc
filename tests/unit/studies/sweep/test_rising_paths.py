"""Paths of a sweep that end before their stress falls."""

import pytest
from support.sweep_tables import collected, path_document

from feti_homog.studies import case_folders, collect, pictures


@pytest.mark.parametrize("breaks", [True, False])
@pytest.mark.parametrize("rising", [0, 1, 2])
def test_paths_whose_stress_does_not_fall_are_counted(tmp_path, monkeypatch, rising, breaks):
    falling = path_document(2, 0.0)
    short = falling | {"path": [point if breaks else point | {"broke": 0} for point in falling["path"][:1]]}
    entries = tuple(case_folders.SweepCase(k, 1, k, {"cell.seed": k}, "") for k in (1, 2))
    documents = [*[short] * rising, *[falling] * (2 - rising)]
    found = [case_folders.CaseState(case_folders.Status.DONE, "", document) for document in documents]
    index = case_folders.SweepIndex("test", "GPa", entries)
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
