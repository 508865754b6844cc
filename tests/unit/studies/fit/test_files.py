"""Faults and remarks of a fit: unknowns that measured values hardly determine, and bounds far from these."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest
from support.base_case import BASE

from feti_homog.studies.fit import files
from feti_homog.studies.fit.description import parse
from feti_homog.studies.fit.estimation import summarize

TEXT = (
    "[unknown]\nmaterial.fibre.young = {start = 150.0, lower = 50.0, upper = 500.0}\n"
    "[measured]\nC11 = {value = 150.0, std = 1.5}\n"
)


@pytest.mark.parametrize(("slope", "status"), [(0.1, "done"), (1e-3, "not converged")])
def test_an_unknown_with_a_scatter_beyond_its_bounds_is_named(slope, status):
    """Compare standard deviations of 1.5 / slope, 15 and 1500, with bounds 450 apart."""
    fit = parse(tomllib.loads(BASE + TEXT), Path())
    bounds = np.array([50.0]), np.array([500.0])
    measured = np.array([150.0]), np.array([1.5])
    found = files.content(fit, summarize(np.array([200.0]), measured[0], measured, np.array([[slope]]), bounds))
    assert found["status"] == status
    assert "Remark" not in files.text(found)
    assert [line.partition(": its")[0] for line in found["faults"]] == (
        [] if status == "done" else ["[unknown] material.fibre.young: the measured values hardly determine it"]
    )


@pytest.mark.parametrize(("computed", "words"), [(146.0, ""), (140.0, "C11 is 6.67 standard deviations off")])
def test_a_fit_that_its_bounds_keep_from_the_data_has_a_remark(computed, words):
    fit = parse(tomllib.loads(BASE + TEXT), Path())
    bounds, measured = (np.array([50.0]), np.array([500.0])), (np.array([150.0]), np.array([1.5]))
    found = summarize(bounds[1], np.array([computed]), measured, np.array([[1.0]]), bounds)
    last = files.text(files.content(fit, found)).splitlines()[-1]
    assert last.endswith(words) and ("material.fibre.young at its upper bound" in last) == bool(words)
