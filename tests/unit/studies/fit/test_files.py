"""Faults and remarks of a fit: unknowns that measured values hardly determine, and bounds far from these."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from support.base_case import BASE
from unit.case.faulty_bonding import PATH, SOFTENING, of_type

from feti_homog.report.text import study_tables
from feti_homog.studies import estimation, fit, pictures
from feti_homog.studies.estimation import summarize
from feti_homog.studies.fit_file import parse
from feti_homog.studies.study import Evaluator

TEXT = (
    "[unknown]\nmaterial.fibre.young = {start = 150.0, lower = 50.0, upper = 500.0}\n"
    "[measured]\nC11 = {value = 150.0, std = 1.5}\n"
)


@pytest.mark.parametrize(
    ("slope", "status"), [(0.1, "done"), (0.0199, "done"), (0.0191, "done"), (1e-3, "not converged")]
)
def test_an_unknown_with_a_scatter_beyond_its_bounds_is_named(slope, status):
    """Compare standard deviations of 1.5 / slope, 15 to 1500, with bounds 450 apart.

    Intervals of 1.96 standard deviations reach from 200 beyond 50 for slopes below 0.0196.
    """
    fit = parse(tomllib.loads(BASE + TEXT), Path())
    bounds = np.array([50.0]), np.array([500.0])
    measured = np.array([150.0]), np.array([1.5])
    found = estimation.fit_document(
        fit.unknowns, fit.data, summarize(np.array([200.0]), measured[0], measured, np.array([[slope]]), bounds)
    )
    assert found["status"] == status
    remark = "Remark: material.fibre.young: the interval reaches beyond the bounds, which it ignores"
    assert study_tables.fit_text(found).endswith(remark) == (slope < 0.0196)
    assert "  material.fibre.young (GPa)  " in study_tables.fit_text(found, stress_unit="GPa")
    assert [line.partition(": its")[0] for line in found["faults"]] == (
        [] if status == "done" else ["[unknown] material.fibre.young: the measured values hardly determine it"]
    )


@pytest.mark.parametrize(("computed", "words"), [(146.0, ""), (145.0, "C11 is 3.33 standard deviations off")])
def test_a_fit_that_its_bounds_keep_from_the_data_has_a_remark(computed, words):
    fit = parse(tomllib.loads(BASE + TEXT), Path())
    bounds, measured = (np.array([50.0]), np.array([500.0])), (np.array([150.0]), np.array([1.5]))
    found = summarize(bounds[1], np.array([computed]), measured, np.array([[1.0]]), bounds)
    content = estimation.fit_document(fit.unknowns, fit.data, found)
    last = study_tables.fit_text(content).splitlines()[-1]
    assert study_tables.fit_text(content, "C11 is ...").endswith("deviations off; C11 is ...") == bool(words)
    assert last.endswith(words) and ("material.fibre.young at its upper bound" in last) == bool(words)


@pytest.mark.parametrize("slope", [1.0, 0.0])
@pytest.mark.parametrize(("residual", "is_fault"), [(4.0, True), (3.0, False)])
def test_residuals_that_a_correct_model_hardly_has_are_a_fault(slope, residual, is_fault):
    """One unknown, two values: chi^2 of one degree of freedom has a chance of 1e-3 at 3.29^2."""
    fit = parse(tomllib.loads(BASE + TEXT + "C22 = {value = 150.0, std = 1.5}\n"), Path())
    y, std, J = np.full(2, 150.0), np.full(2, 1.5), np.array([[slope], [0.0]])
    bounds = np.array([50.0]), np.array([500.0])
    estimates = summarize(np.array([200.0]), y + 1.5 * residual * np.array([0.0, 1.0]), (y, std), J, bounds)
    found = estimation.fit_document(fit.unknowns, fit.data, estimates)
    stalls = slope == 0.0  # and two degrees of freedom: exp(-x / 2) = 1e-3 at 3.72^2
    words = "stalled at material.fibre.young = 200, " if stalls else "or other starts fit better (chance"
    expected = [words] if is_fault else ["no measured value depends"] * stalls
    assert len(found["faults"]) == len(expected) and all(w in f for w, f in zip(expected, found["faults"], strict=True))
    assert ("interval?" in study_tables.fit_text(found)) == (is_fault and not stalls)
    cure = "; teeth = 6 makes the curve a staircase: more teeth (softening_tolerance) make it smooth"
    stepped = estimation.fit_document(fit.unknowns, fit.data, estimates, "teeth = 6")
    assert stepped["faults"] == [f"{fault}{cure}" for fault in found["faults"]]
    if slope:  # computed in GPa, measured in MPa
        scaled = summarize(np.array([200.0]), y / 1000.0, (y, std), J, bounds)
        (fault,) = estimation.fit_document(fit.unknowns, fit.data, scaled)["faults"]
        assert fault.endswith("; measured values are about 1e+03 times the computed ones: check their unit")


@pytest.mark.parametrize("steps", ["teeth = 6", "softening_tolerance = 0.5", ""])
def test_a_fault_of_a_fit_names_the_key_that_makes_steps(tmp_path, monkeypatch, steps):
    """No measured value depends on the only unknown."""
    unknown = TEXT.replace("C11", "peak_S11")
    law = ["[interface]", *SOFTENING, "normal_toughness = 1.0", steps]
    asked = parse(tomllib.loads(of_type("path", PATH, *law) + unknown), Path())
    bounds, measured = (np.array([50.0]), np.array([500.0])), (np.array([150.0]), np.array([1.5]))
    estimates = summarize(np.array([200.0]), measured[0], measured, np.array([[0.0]]), bounds)

    def estimate(evaluations):
        evaluations.answers[200.0,] = []
        return estimates

    monkeypatch.setattr(fit.Evaluations, "estimate", estimate)
    monkeypatch.setattr(pictures, "draw_fit", lambda *_: None)
    (fault,) = asked.answer(Evaluator(tmp_path, MPI.COMM_SELF, 1, False, True))["faults"]
    assert (f"; {steps} makes the curve a staircase" in fault) == bool(steps) and "depends on it" in fault


def test_every_printed_number_is_that_of_the_normal_equations():
    """Two unknowns of three values: estimates, intervals, shares, correlation and residuals, in their columns."""
    more = "material.matrix.young = {start = 90.0, lower = 50.0, upper = 120.0}\n[measured]"
    values = "C22 = {value = 160.0, std = 3.0}\nG12 = {value = 40.0, std = 0.5}\n"
    asked = parse(tomllib.loads(BASE + TEXT.replace("[measured]", more) + values), Path())
    x, y, std = np.array([200.0, 88.0]), np.array([150.0, 160.0, 40.0]), np.array([1.5, 3.0, 0.5])
    J, computed = np.array([[0.2, 1.0], [0.4, 0.5], [0.05, 0.3]]), y + np.array([3.0, -1.5, 0.25])
    bounds = np.array([50.0, 50.0]), np.array([500.0, 120.0])
    estimates = summarize(x, computed, (y, std), J, bounds)
    document = estimation.fit_document(asked.unknowns, asked.data, estimates)
    text = study_tables.fit_text(document)
    assert [(datum["test"], datum["name"]) for datum in document["measured"]] == [(1, "C11"), (1, "C22"), (1, "G12")]
    covariance = np.linalg.inv(J.T @ (J / std[:, None] ** 2))
    deviation, shares = np.sqrt(covariance.diagonal()), (covariance @ J.T / std) ** 2
    blocks = [[line.split() for line in part.splitlines()] for part in text.split("\n\n")]
    unknowns, correlation, measured, (last,) = blocks[1:5]
    assert [row[0] for row in unknowns[1:]] == [row[0] for row in correlation[1:]] == [*asked.unknowns]
    assert correlation[0] == ["Correlation", "1", "2"]
    for k, row in enumerate(unknowns[1:]):
        ends = x[k] + 1.959964 * deviation[k] * np.array([-1, 1])
        np.testing.assert_allclose([float(cell) for cell in row[1:5]], [x[k], deviation[k], *ends], rtol=1e-4)
        order = np.argsort(-shares[k])
        total = shares[k] / covariance[k, k]
        named = dict(zip(row[5::2], row[6::2], strict=True))
        expected = {("C11", "C22", "G12")[j]: f"{total[j]:.0%}" for j in order if total[j] >= 0.01}
        assert {name: share.rstrip(",") for name, share in named.items()} == expected and [*named] == [*expected]
    cross = covariance[0, 1] / deviation.prod()
    found = np.array([[float(cell) for cell in row[1:]] for row in correlation[1:]])
    np.testing.assert_allclose(found, [[1.0, cross], [cross, 1.0]], atol=6e-4)
    rows = [[float(cell) for cell in row[1:]] for row in measured[1:]]
    assert rows == [[*own] for own in zip(y, std, computed, [2.0, -0.5, 0.5], strict=True)]
    assert measured[0][1:] == ["value", "std", "computed", "in", "std"] and last[:4] == ["Sum", "of", "squares", "4.5,"]
