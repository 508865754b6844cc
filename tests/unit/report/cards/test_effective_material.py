"""Results that make a material or a conductor, their cards, and `feti-homog export` from a folder to a card."""

import os

import numpy as np
import pytest
from support.effective_results import BORON_ALUMINIUM, COSINES, DISTINCT, changed, document, turned_stiffness

from feti_homog.errors import CaseError
from feti_homog.report.cards import export
from feti_homog.report.cards.effective_material import (
    NEGLIGIBLE,
    in_axes_of_the_cell,
    nearest_transversely_isotropic,
)
from feti_homog.results import output_folder, result_json

both = pytest.mark.parametrize("reading", [in_axes_of_the_cell, nearest_transversely_isotropic])


def coupled(size):
    """Return the entries 16 and 45 of a stiffness are this part of sqrt(C_ii C_jj)."""
    C = DISTINCT.stiffness_in_the_cell
    C[0, 5] = C[5, 0] = size * np.sqrt(C[0, 0] * C[5, 5])
    C[3, 4] = C[4, 3] = -size * np.sqrt(C[3, 3] * C[4, 4])
    return C


def test_negligible_couplings_are_left_out_and_constants_are_those_of_the_compliance():
    C = coupled(0.9 * NEGLIGIBLE)
    material = in_axes_of_the_cell(document(DISTINCT, effective_stiffness=C))
    S = np.linalg.inv(C)
    assert material.is_orthotropic and material.symmetry.startswith("Orthotropic; couplings of shears of up to 0.0009 ")
    assert material.constants["E2"] == pytest.approx(1 / S[0, 0], rel=1e-13)
    assert material.constants["G23"] == pytest.approx(1 / S[5, 5], rel=1e-13)


@pytest.mark.parametrize("form", ["in_axes", "expansion"])
def test_other_couplings_are_kept(form):
    more = {"effective_stiffness": coupled(1.1 * NEGLIGIBLE)}
    if form == "expansion":
        more = {"thermal_expansion": [1e-5, 1e-5, 2e-5, 0.0, 0.0, 3e-8]}
    material = in_axes_of_the_cell(document(DISTINCT, **more))
    assert not material.is_orthotropic and material.symmetry.startswith("Not orthotropic in these axes")
    C = more.get("effective_stiffness", DISTINCT.stiffness_in_the_cell)
    assert np.abs(material.stiffness - turned_stiffness(C, COSINES.T)).max() < 1e-12 * np.abs(C).max()


def test_the_antisymmetric_part_of_the_solution_is_left_out():
    C = BORON_ALUMINIUM.stiffness_in_the_cell
    C[0, 1] += 2e-7
    material = in_axes_of_the_cell(document(BORON_ALUMINIUM, effective_stiffness=C))
    assert np.array_equal(material.stiffness, material.stiffness.T)
    assert material.stiffness[1, 2] == pytest.approx(C[1, 0] + 1e-7, abs=1e-9)


def test_transversely_isotropic_material_is_isotropic_across_the_fibre():
    material = nearest_transversely_isotropic(document(DISTINCT))
    cosines = np.array([[1.0, 0.0, 0.0], [0.0, 0.6, -0.8], [0.0, 0.8, 0.6]])
    turned = turned_stiffness(material.stiffness, cosines)
    assert np.abs(turned - material.stiffness).max() < 1e-14 * np.abs(turned).max()
    first = "The nearest transversely isotropic material, at a relative distance of 0.01."
    assert material.symmetry == first
    ranges = {"E_least": 8092.0, "E_largest": 9419.0, "G_least": 2945.0, "G_largest": 3742.0}
    material = nearest_transversely_isotropic(document(DISTINCT, transverse_moduli=ranges))
    more = "the cell has E from 8092 to 9419, G from 2945 to 3742."
    assert material.symmetry == f"{first} Over all directions across the fibres {more}"


@both
def test_expansions_need_not_be_there(reading):
    zero = in_axes_of_the_cell(document(DISTINCT, thermal_expansion=np.zeros(6))).expansion
    assert zero is not None and not zero.any()
    sample = document(type(DISTINCT)(DISTINCT.constants, None))
    assert reading(sample).expansion is None
    assert reading(sample | {"thermal_expansion": None}).expansion is None


@both
@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"status": "not converged", "faults": ["a", "b"]},
            r'its status is "not converged": a \(and 1 more\); run the',
        ),
        ({"effective_stiffness_compression": np.eye(6)}, "its debonded faces touch .*; cards are of linear materials"),
        ({"effective_stiffness": -np.eye(6)}, "is not positive definite; cards are of stable materials"),
        ({"effective_stiffness": None}, 'analysis.type = "stiffness" has no effective stiffness'),
        (
            {"case": changed(document(DISTINCT), "analysis", type="path")["case"], "effective_stiffness": None},
            r'analysis.type = "path" has no effective stiffness; cards need "stiffness"',
        ),
    ],
)
def test_results_without_a_linear_stable_material_are_refused(reading, more, words):
    with pytest.raises(CaseError, match=words):
        reading(document(DISTINCT, **more))


@both
@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_constants_of_the_plane_are_refused(reading, plane):
    plain = changed(document(DISTINCT), "analysis", plane=plane) | {"effective_stiffness": np.eye(3)}
    words = f'plane = "{plane}" gives constants of the plane; cards need plane = "generalized"'
    with pytest.raises(CaseError, match=words):
        reading(plain)


K = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 7.0]])
COUPLED = np.array([[1.0, 0.3, 0.1], [0.3, 2.0, -0.2], [0.1, -0.2, 7.0]])
TURN = np.eye(3)[[2, 0, 1]]
"""Rows are the axes of a card in the cell: x3, x1, x2."""


def conducting(k, **entries):
    """Return a finished result with the conductivity k."""
    case = {"name": "ply", "analysis": {"type": "conductivity", "plane": "conduction"}}
    return {"case": case, "version": "1", "status": "done", "effective_conductivity": k.tolist()} | entries


def read(text, form):
    """Return the conductivity (3, 3) of a card by a reader of its own."""
    if form in ("abaqus", "calculix"):
        block = text.splitlines()[text.splitlines().index("*CONDUCTIVITY, TYPE=ORTHO") + 1]
        return np.diag([float(word) for word in block.split(",")])
    labels = dict(line.split(",")[1::2] for line in text.splitlines() if line.startswith("MP,"))
    return np.diag([float(labels[name]) for name in ("KXX", "KYY", "KZZ")])


every_format = pytest.mark.parametrize("form", ["abaqus", "calculix", "ansys"])


@every_format
def test_tensor_is_read_back_in_axes_of_the_card_with_nine_digits(form):
    text = export.card_of(conducting(K / 3), form)
    assert np.abs(read(text, form) - TURN @ (K / 3) @ TURN.T).max() < 5e-9 * K.max()
    mark, commands = ("!", "MP,") if form == "ansys" else ("**", "*MATERIAL")
    comments = text.partition(commands)[0].splitlines()
    assert len(comments) > 2 and all(line.startswith(f"{mark} ") for line in comments)


@every_format
def test_couplings_have_no_card(form):
    with pytest.raises(CaseError, match=r"couplings in its axes; use --transversely-isotropic"):
        export.card_of(conducting(COUPLED), form)


def test_other_programs_have_none():
    with pytest.raises(CaseError, match=r"--format moose has no card of a conductivity; expected one of abaqus"):
        export.card_of(conducting(COUPLED), "moose")


@every_format
def test_nearest_transversely_isotropic_conductivity_has_the_mean_across(form):
    text = export.card_of(conducting(COUPLED), form, "transversely isotropic")
    assert (read(text, form) == np.diag([7.0, 1.5, 1.5])).all()


@every_format
def test_bound_is_named(form):
    line = '[cell] boundary = "traction": the result is a lower bound of the effective one'
    text = export.card_of(conducting(K, remarks=[line, "[cell] order = 1"]), form)
    assert line in " ".join(text.replace("**", "").replace("!", "").split()) and "order = 1" not in text


def test_noise_of_meshes_is_left_out_and_named():
    noisy = K + 1e-4 * (1 - np.eye(3))
    text = export.card_of(conducting(noisy, mesh_error={"effective_conductivity": (0.01 * K).tolist()}), "abaqus")
    assert (read(text, "abaqus") == TURN @ K @ TURN.T).all()
    assert "Couplings of up to 7.1e-05 sqrt(kii kjj) are left out." in text
    assert "k11 7.0e-02, k22 1.0e-02, k33 2.0e-02" in text


def test_unfinished_results_have_no_card():
    with pytest.raises(CaseError, match='its status is "not converged": check hill'):
        export.card_of(conducting(K, status="not converged", faults=["check hill"]), "abaqus")


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
