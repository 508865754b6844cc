"""Cards of a conductivity: the tensor of the result, turned to the axes of a card."""

import numpy as np
import pytest

from feti_homog.errors import CaseError
from feti_homog.report.cards import export

K = np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 7.0]])
COUPLED = np.array([[1.0, 0.3, 0.1], [0.3, 2.0, -0.2], [0.1, -0.2, 7.0]])
TURN = np.eye(3)[[2, 0, 1]]
"""Rows are the axes of a card in the cell: x3, x1, x2."""


def document(k, **entries):
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
    text = export.card_of(document(K / 3), form)
    assert np.abs(read(text, form) - TURN @ (K / 3) @ TURN.T).max() < 5e-9 * K.max()
    mark, commands = ("!", "MP,") if form == "ansys" else ("**", "*MATERIAL")
    comments = text.partition(commands)[0].splitlines()
    assert len(comments) > 2 and all(line.startswith(f"{mark} ") for line in comments)


@every_format
def test_couplings_have_no_card(form):
    with pytest.raises(CaseError, match=r"couplings in its axes; use --transversely-isotropic"):
        export.card_of(document(COUPLED), form)


def test_other_programs_have_none():
    with pytest.raises(CaseError, match=r"--format moose has no card of a conductivity; expected one of abaqus"):
        export.card_of(document(K), "moose")


@every_format
def test_nearest_transversely_isotropic_conductivity_has_the_mean_across(form):
    text = export.card_of(document(COUPLED), form, "transversely isotropic")
    assert (read(text, form) == np.diag([7.0, 1.5, 1.5])).all()


@every_format
def test_bound_is_named(form):
    line = '[cell] boundary = "traction": the result is a lower bound of the effective one'
    text = export.card_of(document(K, remarks=[line, "[cell] order = 1"]), form)
    assert line in " ".join(text.replace("**", "").replace("!", "").split()) and "order = 1" not in text


def test_noise_of_meshes_is_left_out_and_named():
    noisy = K + 1e-4 * (1 - np.eye(3))
    text = export.card_of(document(noisy, mesh_error={"effective_conductivity": (0.01 * K).tolist()}), "abaqus")
    assert (read(text, "abaqus") == TURN @ K @ TURN.T).all()
    assert "Couplings of up to 7.1e-05 sqrt(kii kjj) are left out." in text
    assert "k11 7.0e-02, k22 1.0e-02, k33 2.0e-02" in text


def test_unfinished_results_have_no_card():
    with pytest.raises(CaseError, match='its status is "not converged": check hill'):
        export.card_of(document(K, status="not converged", faults=["check hill"]), "abaqus")
