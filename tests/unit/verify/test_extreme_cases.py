"""Right results of extreme phases hold, by limits of the case's own rounding; changes of a millionth do not."""

import contextlib

import pytest
from mpi4py import MPI
from support.verified_results import FIBRE, MATRIX, SQUARE, falsified

from feti_homog import Case, ConvergenceError, run
from feti_homog.verify.certificate import verify

CASES = {
    "poisson's ratio near -1": ({"young": 4.0, "poisson": -0.9999999}, FIBRE, "strain"),
    "ratio in space": ({"young": 4.0, "poisson": -0.9999999}, FIBRE, "generalized"),
    "stiff fibre of such a ratio": (MATRIX, {"young": 70.0, "poisson": -0.9999999}, "generalized"),
    "contrast 1e9": (MATRIX, {"young": 4e9, "poisson": 0.2}, "generalized"),
    "contrast 1e12": (MATRIX, {"young": 4e12, "poisson": 0.2}, "strain"),
    "necks between fibres": ({"young": 3.0, "poisson": 0.35}, {"young": 3e4, "poisson": 0.2}, "strain"),
}
# Other cells than SQUARE.
CELLS = {"necks between fibres": {"geometry": "square", "fibre_fraction": 0.785}}


def scale(place, key):
    place[key] = place[key] * (1 + 1e-6)


CHANGES = {
    "stress": lambda document, file: file["state/0/stress"].write_direct(file["state/0/stress"][()] * (1 + 1e-6)),
    "mean stress": lambda document, file: scale(file["state/0"].attrs, "stress"),
    "displacement": lambda document, file: file["state/0/displacement"].write_direct(
        file["state/0/displacement"][()] * (1 + 1e-6)
    ),
    "a constant": lambda document, file: scale(
        *((document["moduli"], "E1") if "moduli" in document else (document["transversely_isotropic"], "nu_axial"))
    ),
    "the stiffness": lambda document, file: document.update(
        effective_stiffness=[[entry * (1 + 1e-6) for entry in row] for row in document["effective_stiffness"]]
    ),
}


@pytest.fixture(scope="module", params=CASES)
def extreme(request, tmp_path_factory):
    """Provide the folder of an extreme result; its own checks may refuse what rounding leaves."""
    matrix, fibre, plane = CASES[request.param]
    cell, material = CELLS.get(request.param, SQUARE), {"matrix": matrix, "fibre": fibre}
    document = {"cell": cell, "material": material, "output": {"pictures": False}}
    folder = tmp_path_factory.mktemp("extreme") / "out"
    with contextlib.suppress(ConvergenceError):
        run(Case.parse(document | {"analysis": {"type": "stiffness", "plane": plane}}), MPI.COMM_SELF, out=folder)
    return folder


def broken(folder):
    return [finding.line() for finding in verify(folder).findings if not finding.holds and finding.name != "files"]


def test_extreme_phases_break_no_law(extreme):
    assert broken(extreme) == []


@pytest.mark.parametrize("change", CHANGES)
def test_changes_of_a_millionth_break_a_law(extreme, tmp_path, change):
    assert broken(falsified(extreme, tmp_path / "copy", CHANGES[change]))
