"""Sensitivities are verified from the fields; one derivative that is false breaks their law."""

import numpy as np
import pytest
from mpi4py import MPI
from support.falsifications import broken
from support.verified_results import CARBON, FIBRE, HEXAGONAL, MATRIX, SPRINGS, SQUARE, TENSOR, TURNED, WARM, falsified

from feti_homog import Case, run
from feti_homog.verify.certificate import verify

pytestmark = pytest.mark.slow

INCOMPRESSIBLE = {"young": 3.0, "poisson": 0.45}
SIZING = {"young": 120.0, "poisson": 0.25, "expansion": 3e-5, "conductivity": 0.7}
CONDUCTORS = {"matrix": {"conductivity": TENSOR}, "fibre": {"conductivity": {"axial": 10.0, "transverse": 1.0}}}
TOUCHING = {"contact": True, "debonded": [{"fibre": "all", "centre": 20.0, "angle": 90.0}]}
LOADS = {
    "load": {"E11": -0.01, "E22": 0.02, "gamma12": 0.0},
    "stresses": {"S11": -0.1, "E22": 0.02, "S33": 0.2, "gamma23": 0.01},
    "heated": {"S11": -0.1, "E22": 0.02, "S33": 0.2, "temperature": -50.0},
}
CASES = {
    "space": ("generalized", SQUARE | {"order": 2}, {"matrix": WARM, "fibre": CARBON}, SPRINGS),
    "pairs": (
        "generalized",
        HEXAGONAL | {"coating": 0.2},
        {"matrix": WARM, "fibre": CARBON, "coating": SIZING},
        [SPRINGS | {"between": ["coating", "matrix"]}, SPRINGS | {"between": ["fibre", "coating"]}],
    ),
    "conduction": ("conduction", SQUARE | {"order": 2}, CONDUCTORS, {"conductance": 0.7, "debonded": []}),
    "strain": ("strain", SQUARE | {"order": 2}, {"matrix": INCOMPRESSIBLE, "fibre": TURNED}, None),
    "contact": ("generalized", SQUARE, {"matrix": WARM, "fibre": CARBON}, SPRINGS | TOUCHING),
    "load": ("strain", SQUARE, {"matrix": MATRIX, "fibre": FIBRE}, TOUCHING),
    "stresses": ("generalized", SQUARE, {"matrix": MATRIX, "fibre": CARBON}, SPRINGS | TOUCHING),
    "heated": ("generalized", SQUARE, {"matrix": WARM, "fibre": CARBON}, TOUCHING),
    "stress": ("stress", SQUARE, {"matrix": {"stiffness": [[10, 2, 0], [2, 8, 0], [0, 0, 3]]}, "fibre": FIBRE}, None),
}


@pytest.mark.parametrize("kind", CASES)
def test_sensitivities_are_verified(tmp_path, kind):
    plane, cell, materials, interface = CASES[kind]
    case = {
        "cell": cell | {"mesh_size": 0.25},
        "material": materials,
        "analysis": {"type": "conductivity" if plane == "conduction" else "stiffness", "plane": plane},
        "output": {"sensitivities": True, "pictures": False, "mesh_error": False},
        "petsc": {}
        if kind in LOADS or kind == "contact"
        else {"feti_ksp_rtol": 1e-10},  # fields are as good as the solver
    } | ({} if interface is None else {"interface": interface})
    if kind in LOADS:
        case["analysis"]["type"], case["load"] = "load", {"to": LOADS[kind]}
    run(Case.parse(case), MPI.COMM_SELF, out=tmp_path / "own")
    certificate = verify(tmp_path / "own")
    assert certificate.holds, certificate.text
    law = "constants" if kind == "heated" else "sensitivities"
    assert law in {finding.name for finding in certificate.findings}

    def edit(document, _):
        table = document["sensitivities"]
        rows = np.abs(np.array(table["derivatives"]) * table["parameter_values"])
        k = next(k for k, name in enumerate(table["constants"]) if name in ("stored", "E1", "C22", "k22"))
        table["derivatives"][k][int(rows[k].argmax())] *= 1 + 1e-3

    def doubled(document, _):
        table = document["sensitivities"]
        table["derivatives"] = (2 * np.array(table["derivatives"])).tolist()

    def tripled(document, _):
        table = document["sensitivities"]
        table["constant_values"] = (3 * np.array(table["constant_values"])).tolist()

    def cut(document, _):
        table = document["sensitivities"]
        table["parameters"], table["parameter_values"] = table["parameters"][:1], table["parameter_values"][:1]
        table["derivatives"] = [row[:1] for row in table["derivatives"]]

    falsehoods = {edit: {"sensitivities"}, cut: {"tables"}}
    falsehoods |= {doubled: {"sensitivities"}, tripled: {"constants"}} if kind in LOADS else {}
    falsehoods = {tripled: {"constants"}} if kind == "heated" else falsehoods
    for number, (each, laws) in enumerate(falsehoods.items()):
        assert broken(falsified(tmp_path / "own", tmp_path / f"copy{number}", each)) == laws | {"files"}
