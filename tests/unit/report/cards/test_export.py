"""`feti-homog export`: from a folder to a card, and what goes wrong."""

import os

import pytest
from support.effective_results import DISTINCT, document

from feti_homog.errors import CaseError
from feti_homog.report.cards import export
from feti_homog.report.cards.effective_material import in_axes_of_the_cell
from feti_homog.results import output_folder, result_json


@pytest.fixture
def folder(tmp_path):
    result_json.write(tmp_path / "results", document(DISTINCT))
    return tmp_path / "results"


def test_the_card_is_that_of_result_json(folder):
    expected = export.abaqus(in_axes_of_the_cell(document(DISTINCT)))
    assert export.card(folder, "abaqus", "orthotropic") == expected
    assert "The nearest transversely isotropic" in export.card(folder, "abaqus", "transversely isotropic")


def test_a_card_replaces_what_was_there(tmp_path):
    path = tmp_path / "card.inp"
    path.write_text("before")
    assert output_folder.write_product(path, "a\nb") == path
    assert path.read_text() == "a\nb\n" and list(tmp_path.iterdir()) == [path]


def test_a_card_goes_where_a_link_leads(tmp_path):
    (tmp_path / "link.inp").symlink_to(tmp_path / "card.inp")
    assert output_folder.write_product(tmp_path / "link.inp", "a") == tmp_path / "link.inp"
    assert (tmp_path / "link.inp").is_symlink() and (tmp_path / "card.inp").read_text() == "a\n"


def test_devices_and_pipes_are_not_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(CaseError, match="expected a file, but it is a device or a pipe"):
        output_folder.write_product(tmp_path / "pipe", "card")
    assert (tmp_path / "pipe").is_fifo()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("", "expected a file, but it is a folder"),
        ("nowhere/card.inp", "expected a file in an existing folder"),
        ("result.json", "expected another name; results have files of that name"),
    ],
)
def test_cards_are_written_to_files_of_their_own(folder, name, words):
    before = (folder / "result.json").read_text()
    with pytest.raises(CaseError, match=words):
        output_folder.write_product(folder / name, "card")
    assert (folder / "result.json").read_text() == before


def test_faults_name_the_file(folder):
    result_json.write(folder, document(DISTINCT, status="not converged"))
    with pytest.raises(CaseError, match=r"^cannot export .*result\.json: its status is \"not converged\""):
        export.card(folder, "abaqus", "orthotropic")


def test_folders_without_a_result_are_reported(tmp_path):
    with pytest.raises(CaseError, match=r"cannot read .*result\.json: No such file"):
        export.card(tmp_path, "csv", "orthotropic")


@pytest.mark.parametrize(
    "more",
    [
        {"effective_stiffness": [[1.0, 2.0], [3.0]]},
        {"effective_stiffness": "C"},
        {"thermal_expansion": [1e-5, 1e-5]},
        {"case": {}},
        {"case": []},
        {"transversely_isotropic": {"E_axial": 1.0}},
        {"transversely_isotropic": None},
    ],
)
def test_damaged_results_are_reported(folder, more):
    result_json.write(folder, document(DISTINCT, **more))
    faults = []
    for symmetry in export.SYMMETRIES:
        try:
            export.card(folder, "csv", symmetry)
        except CaseError as error:
            faults += error.faults
    assert faults and all("it is damaged, or no result of this program" in fault for fault in faults)
