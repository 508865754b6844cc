"""Random cases of every kind of analysis, small enough to be run by the dozen."""

from __future__ import annotations

from typing import Any

import numpy as np

from support.random_cells import random_cell, random_strain

SECTIONS = ("plane", "matrix", "fibre", "decomposition")


def random_document(rng: np.random.Generator) -> dict[str, Any]:
    """A case of 1 to 6 fibres: bonded, debonded arcs, angles, or a path of up to three legs."""
    cell = random_cell(rng)
    parts = {name: cell.pop(name) for name in SECTIONS}
    cell["mesh_size"] = min(1.3 * cell["mesh_size"], 0.5)
    if rng.random() < 0.3 and cell["order"] == 1:
        cell["refine"] = 1
    kind = str(rng.choice(["bonded", "debonded", "angle", "path"], p=[0.2, 0.2, 0.2, 0.4]))
    document: dict[str, Any] = {
        "cell": cell,
        "material": {"matrix": parts["matrix"], "fibre": parts["fibre"]},
        "analysis": {"type": {"bonded": "stiffness", "debonded": "stiffness"}.get(kind, kind), "plane": parts["plane"]},
        "decomposition": parts["decomposition"],
        "output": {"pictures": False},
        "petsc": {"feti_ksp_rtol": float(rng.choice([1e-8, 1e-6, 1e-10]))},
    }
    if kind == "bonded":
        return document
    arcs = [{"fibre": "all", "centre": rng.uniform(0, 360)} for _ in range(rng.integers(1, 3))]
    interface: dict[str, Any] = {"contact": bool(rng.random() < 0.7)}
    if kind == "angle":
        document["angle"] = {"values": [0.0, *sorted(rng.uniform(10, 170, 2).tolist()), 360.0]}
        if rng.random() < 0.5:
            document["angle"]["strain"] = random_strain(rng).tolist()
    else:
        arcs = [arc | {"angle": float(rng.choice([rng.uniform(10, 200), 360.0]))} for arc in arcs]
    if kind == "path":
        arcs = arcs if rng.random() < 0.4 else []
        interface |= {
            "normal_strength": rng.uniform(0.005, 0.1),
            "tangential_strength": rng.uniform(0.005, 0.1),
            "criterion": str(rng.choice(["max", "quadratic"])),
        }
        legs = int(rng.integers(1, 4))
        document["path"] = {"waypoints": [(0.1 * random_strain(rng)).tolist() for _ in range(legs)]}
        if rng.random() < 0.4:
            release = str(rng.choice(["all", "worst"]))
            document["path"] |= {"method": "increments", "increments": 6, "release": release}
    return document | {"interface": interface | {"debonded": arcs}}
