"""Paths of a sweep that end before their stress falls."""

import pytest
from support.sweep_tables import path_document

from feti_homog.studies import case_folders, collect


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
