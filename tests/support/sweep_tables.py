"""Tables of sweeps from made results: a stiffness, or a path of four events."""

import numpy as np

from feti_homog.studies.outputs import outputs
from feti_homog.studies.sweep_table import SweepTable

MATERIAL = {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}}


def document(fraction, fibres, shift):
    """Write the files of a run with a stiffness slightly above Reuss' bound."""
    C = np.array([[120.0 + 80 * fraction, 50.0, 0.0], [50.0, 120.0 + 80 * fraction, 0.0], [0.0, 0.0, 35.0]]) + shift
    cell = {"geometry": "random", "fibre_fraction": fraction, "fibres": fibres}
    return {
        "case": {"cell": cell, "material": MATERIAL, "analysis": {"type": "stiffness", "plane": "strain"}},
        "cell": {"fibre_fraction": fraction, "elements": 10, "nodes": 9},
        "solver": {"ranks": 1, "subdomains": 2, "dofs": 18, "multipliers": 4, "iterations": [3, 4, 5]},
        "effective_stiffness": C, "moduli": {"bulk": 85.0 + 60 * fraction + shift, "shear": 35.0 + shift},
        "checks": {"hill": 1e-12}, "timings": {"solve": 0.1}, "memory": 1000,
    }  # fmt: skip


def path_document(fibres, shift):
    points = [
        {"load_factor": f, "strain": [0.2 * f, 0, 0], "stress": [s + shift, s / 3, 0.0], "broke": 1,
         "dissipated": 0.1 * f, "work": 0.3 * f, "bonded": 9, "open": 1, "closed": 0}
        for f, s in ((0.1, 4.0), (0.08, 2.0), (0.5, 5.0), (1.0, 8.0))
    ]  # fmt: skip
    base = document(0.4, fibres, 0.0)
    case = base["case"] | {"path": {"method": "events", "strain": [0.2, 0, 0]}}
    case["analysis"] = case["analysis"] | {"type": "path"}
    del base["effective_stiffness"], base["moduli"]
    return base | {"case": case, "path": points}


def collected(inputs, documents, point, realisation):
    found = [outputs(d) if d else {} for d in documents]
    names = dict.fromkeys(name for row in found for name in row)
    return SweepTable(
        name="test", stress_unit="GPa", folder=[f"case-{k + 1:04d}" for k in range(len(documents))],
        point=point, realisation=realisation, status=["done" if d else "waiting" for d in documents],
        reason=[""] * len(documents), inputs=inputs, documents=documents,
        outputs={name: np.array([row.get(name, np.nan) for row in found]) for name in names},
    )  # fmt: skip
