"""`feti-homog export`: cards printed and written, faults reported once."""

import pytest
from support.card_readers import READERS
from support.command_line import command_line, in_process
from support.effective_results import DISTINCT, document

from feti_homog.report.cards import export
from feti_homog.results import result_json


@pytest.fixture
def folder(tmp_path):
    result_json.write(tmp_path / "results", document(DISTINCT))
    return tmp_path / "results"


@pytest.mark.quick
def test_the_card_is_printed(folder):
    job = command_line(2, "export", folder, "--format", "calculix")
    assert (job.returncode, job.stderr) == (0, "")
    assert job.stdout == export.card(folder, "calculix", "orthotropic") + "\n"


def test_the_card_is_written(folder, tmp_path):
    path = tmp_path / "card.mac"
    job = in_process("export", folder, "--format", "ansys", "--transversely-isotropic", "--out", path)
    assert (job.returncode, job.stdout) == (0, f"{path}\n")
    assert path.read_text() == export.card(folder, "ansys", "transversely isotropic") + "\n"
    READERS["ansys"](path.read_text())


def test_faults_are_reported_once_and_nothing_is_written(folder, tmp_path):
    result_json.write(folder, document(DISTINCT, status="not converged", faults=["jump"]))
    job = command_line(2, "export", folder, "--format", "csv", "--out", tmp_path / "card.csv")
    assert (job.returncode, job.stdout) == (2, "") and not (tmp_path / "card.csv").exists()
    assert job.stderr.count('its status is "not converged": jump; run the case again') == 1


@pytest.mark.parametrize(("words", "reported"), [([], "--format"), (["--format", "nastran"], "--format nastran")])
def test_unknown_formats_are_refused(folder, words, reported):
    job = in_process("export", folder, *words)
    assert (job.returncode, job.stderr) == (2, f"error: {reported}: expected one of {', '.join(export.FORMATS)}\n")
