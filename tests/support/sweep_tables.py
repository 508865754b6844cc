"""Tables of sweeps made up of documents, without runs."""

from __future__ import annotations

import numpy as np

from feti_homog.studies.outputs import outputs
from feti_homog.studies.sweep_table import SweepTable

MATERIAL = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}


def document(fraction, fibres, shift):
    """Write the files of a run with a stiffness slightly above that of Reuss."""
    C = np.array([[120.0 + 80 * fraction, 50.0, 0.0], [50.0, 120.0 + 80 * fraction, 0.0], [0.0, 0.0, 35.0]]) + shift
    cell = {"geometry": "random", "fibre_fraction": fraction, "fibres": fibres}
    return {
        "case": {"cell": cell, "material": MATERIAL, "analysis": {"type": "stiffness", "plane": "strain"}},
        "cell": {"fibre_fraction": fraction, "elements": 10, "nodes": 9},
        "solver": {"ranks": 1, "subdomains": 2, "dofs": 18, "multipliers": 4, "iterations": [3, 4, 5]},
        "effective_stiffness": C, "moduli": {"bulk": 85.0 + 60 * fraction + shift, "shear": 35.0 + shift},
        "checks": {"hill": 1e-12}, "timings": {"solve": 0.1}, "memory": 1000,
    }  # fmt: skip


def collected(inputs, documents, point, realisation):
    found = [outputs(d) if d else {} for d in documents]
    names = dict.fromkeys(name for row in found for name in row)
    return SweepTable(
        name="test", stress_unit="GPa", folder=[f"case-{k + 1:04d}" for k in range(len(documents))],
        point=point, realisation=realisation, status=["done" if d else "waiting" for d in documents],
        reason=[""] * len(documents), inputs=inputs, documents=documents,
        outputs={name: np.array([row.get(name, np.nan) for row in found]) for name in names},
    )  # fmt: skip


def fractions():
    """Two fractions with three realisations each, of which one still waits."""
    documents = [document(c, 8, shift) for shift in (0.0, 0.5, 1.0) for c in (0.2, 0.4)]
    documents[-1] = None
    inputs = {"cell.fibre_fraction": [0.2, 0.4] * 3, "cell.seed": [0, 0, 1, 1, 2, 2]}
    return collected(inputs, documents, [1, 2] * 3, [1, 1, 2, 2, 3, 3])


def spatial_document(fraction, shift):
    """Write the files of a run in generalized plane strain."""
    found = document(fraction, 1, 0.0)
    C = np.diag([150.0 + shift, 150.0, 210.0, 50.0, 50.0, 45.0]) + 1e-3 * np.arange(36).reshape(6, 6)
    thermal = {"thermal_stress": [-1.0] * 6, "thermal_expansion": [1e-5] * 6}
    case = found["case"] | {"analysis": {"type": "stiffness", "plane": "generalized"}}
    about_fibres = {"E_axial": 200.0, "E_transverse": 120.0, "G_axial": 50.0, "G_transverse": 46.0}
    constants = {"constants": {"E3": 200.0}, "transversely_isotropic": about_fibres | {"expansion_axial": None}}
    del found["moduli"]
    return found | {"case": case, "effective_stiffness": C} | thermal | constants
