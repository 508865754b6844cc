"""Uncertain numbers of a document: read, refused with a line, and written so that the same ones are read again."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.base_case import changed

from feti_homog.case.cases import Case
from feti_homog.case.sections import UNCERTAINTY
from feti_homog.case.toml_files import with_values
from feti_homog.errors import CaseError
from feti_homog.studies import uncertainty as scatter
from feti_homog.studies.uncertain_numbers import EXPECTED, Uncertainty, number_at, read_uncertainty

UNCERTAIN = (
    ("young = 88.0", "young = {mean = 88.0, cv = 0.05}"),
    ("young = 200.0", "young = {mean = 200.0, std = 6.0}"),
)
PAIR = '[uncertainty]\ncorrelation = [["material.matrix.young", "material.fibre.young", 0.4]]\n'


def read(document: dict[str, Any]) -> tuple[Case, Uncertainty]:
    """Return the case at the means, and its uncertain numbers, which read alike from the section that lists them."""
    faults: list[str] = []
    uncertainty = read_uncertainty(document, faults)
    if faults:
        raise CaseError(*faults)
    case = Case.parse(document)
    again = case.resolved() | {UNCERTAINTY: uncertainty.to_table()}
    assert read_uncertainty(again, faults) == uncertainty and Case.parse(again) == case and not faults
    return case, uncertainty


def test_means_stay_in_the_case_and_deviations_beside_them():
    case, uncertainty = read(tomllib.loads(changed(*UNCERTAIN, end=PAIR)))
    assert case.materials["matrix"].young == 88.0 and case.materials["fibre"].young == 200.0
    assert uncertainty.std == pytest.approx({"material.matrix.young": 4.4, "material.fibre.young": 6.0})
    assert uncertainty.matrix() == pytest.approx(np.array([[1.0, 0.4], [0.4, 1.0]]))
    section = tomllib.loads(changed(end="[uncertainty]\nmaterial.matrix.young = 4.4\nmaterial.fibre.young = 6.0\n"))
    assert read(section)[1].std == pytest.approx(uncertainty.std)


@pytest.mark.parametrize(("edits", "end"), [((), PAIR), (UNCERTAIN[:1], "")])
def test_a_run_names_the_command_that_takes_scatter(edits, end):
    with pytest.raises(CaseError, match="`feti-homog uncertainty`") as error:
        Case.parse(tomllib.loads(changed(*edits, end=end)))
    assert len(error.value.faults) == 1


def test_the_one_of_several_sections_has_no_number():
    section = "[[interface]]\nnormal_stiffness = {mean = 50.0, std = 5.0}\ntangential_stiffness = 20.0\n"
    assert dict(read(tomllib.loads(changed(end=section)))[1].std) == {"interface.normal_stiffness": 5.0}


def test_entries_of_lists_have_the_names_of_their_derivatives():
    """Both entries beside the diagonal of a stiffness are one number."""
    pair = {"mean": 2.0, "std": 0.2}
    document = tomllib.loads(changed())
    document["material"]["matrix"] = {
        "stiffness": [[{"mean": 10.0, "cv": 0.1}, pair, 0.0], [pair, 8.0, 0.0], [0.0, 0.0, 3.0]]
    }
    case, uncertainty = read(document)
    assert dict(uncertainty.std) == {"material.matrix.stiffness.C11": 1.0, "material.matrix.stiffness.C12": 0.2}
    document = case.resolved() | {"path": {"waypoints": [[1.0, 2.0, 3.0]]}}
    stiffness = ("material", "matrix", "stiffness")
    assert number_at(document, (*stiffness, "C12")) == 2.0
    changes = {(*stiffness, "C12"): 5.0, ("path", "waypoints", "2"): 6.0}
    other = with_values(document, changes, [])
    assert {path: number_at(other, path) for path in changes} == changes
    assert other["material"]["matrix"]["stiffness"] == [[10, 5, 0], [5, 8, 0], [0, 0, 3]]
    assert other["path"]["waypoints"] == [[1, 6, 3]] and number_at(document, (*stiffness, "C12")) == 2.0


@pytest.mark.parametrize(
    ("edits", "end", "line"),
    [
        ([("young = 88.0", "young = {mean = 88.0}")], "",
         "[material.matrix] young = {mean = 88.0}: expected {mean, std}"),
        ([("young = 88.0", "young = {mean = 88.0, std = -1.0}")], "",
         "[material.matrix] young = {mean = 88.0, std = -1.0}"),
        ([("young = 88.0", "young = {mean = 88.0, cv = 5}")], "",
         "[material.matrix] young: cv = 5: expected less than 1; 5 % is 0.05"),
        ([("young = 88.0", "young = {mean = -88.0, std = 1.0}")], "",
         "[material.matrix] young = -88.0: expected a number"),
        ([], "[uncertainty]\nmaterial.fibre.yuong = 1.0\n",
         "[uncertainty] material.fibre.yuong: expected a key of the case"),
        ([], "[uncertainty]\nmaterial.fibre.young = {std = 3.0}\n",
         "[uncertainty] material.fibre.young.std: expected a key of the case whose value is a number; write "
         "material.fibre.young = 3"),
        ([], "[uncertainty]\nmaterial.fibre.young = 0.0\n",
         "[uncertainty] material.fibre.young = 0.0: expected a standard"),
        ([("poisson = 0.299", "poisson = 0.299\nstrength.principal = {mean = 80.0, std = 4.0}")], "",
         "[uncertainty] material.matrix.strength.principal: only the utilisation under a [load]"),
        ([], PAIR, "[uncertainty] correlation = "),
        (UNCERTAIN, PAIR.replace("]]", '], ["material.fibre.young", "material.matrix.young", -0.4]]'),
         '[uncertainty] correlation = ["material.fibre.young", "material.matrix.young", -0.4]: this pair'),
        (UNCERTAIN, "[uncertainty]\nmaterial.fibre.young = 3.0\n",
         "[uncertainty] material.fibre.young: its standard deviation is given twice"),
        ([], "[uncertainty]\nmaterial.matrix.young = 1e-198\n",
         "[uncertainty] material.matrix.young = 1e-198: expected a standard deviation above 0; numbers other than 0 "),
    ],
)  # fmt: skip
def test_faults_have_their_line(edits, end, line):
    document = tomllib.loads(changed(*edits, end=end))
    with pytest.raises(CaseError) as error:
        read(document)
    assert any(fault.startswith(line) for fault in error.value.faults), error.value.faults


@pytest.mark.parametrize("entry", ['{mean = 88.0, std = "5%"}', "{mean = 88.0, cov = 0.05}"])
def test_a_faulty_number_hides_no_study_and_the_sound_ones_are_not_blamed(entry):
    document = tomllib.loads(changed(("young = 88.0", f"young = {entry}"), UNCERTAIN[1]))
    assert scatter.is_study(document)
    with pytest.raises(CaseError) as error:
        scatter.parse(document, Path())
    assert error.value.faults == (f"[material.matrix] young = {entry}: {EXPECTED}",)


def test_impossible_correlations_are_refused():
    third = ("poisson = 0.222", "poisson = {mean = 0.222, std = 0.01}")
    names = ["material.matrix.young", "material.fibre.young", "material.fibre.poisson"]
    pairs = [[names[0], names[1], 0.9], [names[1], names[2], 0.9], [names[0], names[2], -0.9]]
    with pytest.raises(CaseError, match="these correlations are impossible"):
        read(tomllib.loads(changed(*UNCERTAIN, third)) | {"uncertainty": {"correlation": pairs}})


def test_scatter_and_shares_of_first_order_have_their_closed_form():
    """Changes 0.3 and +-0.8 by one deviation each, correlated by 0.5: 0.09 + 0.64 +- 0.24 is the variance."""
    numbers = Uncertainty({"a": 0.1, "b": 0.2}, (("a", "b", 0.5),))
    std, shares = numbers.propagated(np.array([[3.0, 4.0], [0.0, 0.0], [3.0, -4.0]]))
    assert std == pytest.approx([0.97**0.5, 0.0, 0.7]) and shares[1].tolist() == [0.0, 0.0]
    assert shares[[0, 2]] == pytest.approx(np.array([[0.21, 0.76], [-0.03, 0.52]]) / [[0.97], [0.49]])
