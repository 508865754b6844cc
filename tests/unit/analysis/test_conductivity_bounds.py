"""Conductivities outside their bounds: Hashin and Shtrikman's of isotropic cells, Wiener's of all others."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from feti_homog import Case, run
from feti_homog.analysis import conductivity
from feti_homog.analysis.recorders import CheckRecorder
from feti_homog.errors import ConvergenceError
from feti_homog.materials.phase_bounds import ConductivityEstimates

FORMS = ConductivityEstimates(1.0, (0.5, 2.0), (0.8, 1.5), None)
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])


@pytest.mark.parametrize(
    ("across", "outside"),
    [
        ((1.0, 1.0), []),
        ((1.7, 1.7), ["1.7 is outside its bounds, 0.8 and 1.5"] * 2),
        ((0.6, 1.7), []),
        ((0.4, 1.7), ["0.4 is outside its bounds, 0.5 and 2"]),
        ((0.6, 2.5), ["2.5 is outside its bounds, 0.5 and 2"]),
    ],
)
def test_principal_conductivities_outside_their_bounds_are_faults(across, outside):
    checks, notes = CheckRecorder(1e-8), []
    case = SimpleNamespace(cell=SimpleNamespace(boundary="periodic"))
    k = np.diag([0.0, 0.0, 9.0])
    k[:2, :2] = TURN @ np.diag(across) @ TURN.T
    context = SimpleNamespace(case=case, checks=checks, notes=notes)
    conductivity._note_bounds(context, k, np.full((3, 3), 1e-3), FORMS, 1e-3)
    assert not notes and len(checks.faults) == len(outside)
    assert all(words in line for words, line in zip(outside, checks.faults, strict=True))


def test_a_run_compares_its_conductivity_with_its_bounds(monkeypatch):
    case = {
        "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.3},
        "material": {"matrix": {"conductivity": 1.0}, "fibre": {"conductivity": {"axial": 9.0, "transverse": 2.0}}},
        "analysis": {"type": "conductivity"},
    }
    compared = []  # with the accuracy of the case
    monkeypatch.setattr(conductivity, "note_accuracy", lambda _, energy: compared.append(energy))
    result = run(Case.parse(case), MPI.COMM_SELF)
    assert compared == [result.mesh_error.energy] and not result.faults
    assert result.conductivity_estimates.axial == pytest.approx(result.effective_conductivity[2, 2], rel=1e-12)
    above = ConductivityEstimates(1.4, (5.0, 6.0), (5.0, 6.0), None)
    monkeypatch.setattr(conductivity, "closed_forms", lambda cell: above)
    with pytest.raises(ConvergenceError) as error:
        run(Case.parse(case), MPI.COMM_SELF)
    assert [line.partition(" = ")[0] for line in error.value.faults] == ["k across, least", "k across, largest"]
