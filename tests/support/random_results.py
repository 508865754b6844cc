"""Random cases of every kind of analysis, small enough to be run by the dozen."""

from __future__ import annotations

from typing import Any

import numpy as np

from feti_homog.verification.prescribed import NAMES
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


def random_mixed_document(rng: np.random.Generator) -> dict[str, Any]:
    """A path of one or two legs in any plane state, of strains, stresses and temperatures, events or increments."""
    order = int(rng.integers(1, 3))
    cell = {"geometry": str(rng.choice(["square", "hexagonal"])), "fibre_fraction": rng.uniform(0.2, 0.45)}
    plane = str(rng.choice(["strain", "stress", "generalized"], p=[0.25, 0.25, 0.5]))
    path: dict[str, Any] = {"waypoints": [_random_load(rng, plane) for _ in range(rng.integers(1, 3))]}
    if rng.random() < 0.3:
        path |= {"method": "increments", "increments": 4}
    return {
        "cell": cell | {"mesh_size": 0.25 * order, "order": order},
        "material": {
            "matrix": {"young": 1.0, "poisson": 0.35, "expansion": 6e-5},
            "fibre": {"young": rng.uniform(2.0, 50.0), "poisson": 0.2, "expansion": 5e-6},
        },
        "analysis": {"type": "path", "plane": plane},
        "interface": {
            "normal_strength": rng.uniform(0.004, 0.02),
            "tangential_strength": rng.uniform(0.004, 0.02),
            "criterion": str(rng.choice(["max", "quadratic"])),
        },
        "path": path,
        "output": {"pictures": False, "states": ["all", "peaks", 5][rng.integers(3)]},
    }


def _random_load(rng: np.random.Generator, plane: str) -> dict[str, float]:
    """Of some components a strain or a stress, of a temperature its change."""
    v = 6 if plane == "generalized" else 3
    kinds = rng.choice(3, size=v, p=[0.3, 0.3, 0.4])
    sizes = {name: 0.02 for name in NAMES[v][0]} | {name: 0.015 for name in NAMES[v][1]}
    chosen = [NAMES[v][kind][k] for k, kind in enumerate(kinds) if kind < 2] or ["E11"]
    if v == 6 and rng.random() < 0.5:
        chosen, sizes = [*chosen, "temperature"], sizes | {"temperature": 200.0}
    return {name: sizes[name] * float(rng.normal()) for name in chosen}
