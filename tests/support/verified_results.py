"""Results of every kind of analysis, as the command line writes them, and falsified copies of them."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

MATRIX, FIBRE = {"young": 88.0, "poisson": 0.299}, {"young": 200.0, "poisson": 0.222}
TURNED = {
    "E1": 15.0, "E2": 20.0, "E3": 200.0, "nu12": 0.3, "nu13": 0.02, "nu23": 0.03, "G12": 7.0, "angle": 30.0,
}  # fmt: skip
# A phase in space, and how it expands: along its axes, and along the fibres and across.
TURNED_IN_SPACE = TURNED | {"G13": 4.0, "G23": 5.0, "expansion": [30e-6, 20e-6, -1e-6]}
CARBON = {
    "E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25, "G_axial": 28.0,
    "expansion_axial": -0.9e-6, "expansion_transverse": 9e-6,
}  # fmt: skip
WARM, WARM_FIBRE = MATRIX | {"expansion": 23e-6}, FIBRE | {"expansion": 5e-6}
HEXAGONAL = {"geometry": "hexagonal", "fibre_fraction": 0.4, "mesh_size": 0.2}
SQUARE = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.15}
RANDOM = {"geometry": "random", "fibres": 4, "fibre_fraction": 0.3, "mesh_size": 0.15, "radius_spread": 0.3}
ARC = {"fibre": "all", "centre": 20.0}
SPRINGS = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0}
STRENGTHS = {"normal_strength": 5.0, "tangential_strength": 5.0}
WAYPOINTS = [[0.2, 0.0, 0.0], [0.1, 0.05, 0.05], [0.0, 0.0, 0.0], [-0.1, 0.0, 0.1]]

CASES: dict[str, dict[str, Any]] = {
    "bonded": {"cell": HEXAGONAL | {"order": 2}, "decomposition": {"subdomains": 6}},
    "rubber": {"cell": HEXAGONAL, "matrix": {"young": 0.1, "poisson": 0.49999999}},
    "plane": {"cell": HEXAGONAL | {"bodies": "plane", "refine": 1}, "plane": "stress"},
    "contact": {"cell": SQUARE | {"order": 2}, "interface": {"debonded": [ARC | {"angle": 110.0}]}},
    "overlap": {"cell": SQUARE, "interface": {"contact": False, "debonded": [ARC | {"angle": 200.0}]}},
    "angle": {"cell": RANDOM, "fibre": TURNED, "interface": {"debonded": [ARC]}, "angle": {"values": [0, 120, 360]}},
    "path": {"cell": SQUARE, "interface": STRENGTHS, "path": {"waypoints": WAYPOINTS}},
    "thinned": {"cell": SQUARE, "interface": STRENGTHS, "path": {"waypoints": WAYPOINTS}, "states": 7},
    "peaks": {"cell": SQUARE, "interface": STRENGTHS, "path": {"strain": [0.2, 0.0, 0.1]}, "states": "peaks"},
    "springs": {
        "cell": SQUARE | {"order": 2},
        "interface": {"normal_stiffness": 900.0, "tangential_stiffness": 300.0, "debonded": [ARC | {"angle": 110.0}]},
    },
    "energy": {
        "cell": SQUARE,
        "interface": {
            "normal_stiffness": 900.0,
            "tangential_stiffness": 300.0,
            "criterion": "energy",
            "toughness": 0.02,
        },
        "path": {"waypoints": WAYPOINTS},
    },
    "softening": {
        "cell": SQUARE,
        "interface": {
            "law": "bilinear",
            "normal_stiffness": 900.0,
            "tangential_stiffness": 300.0,
            **STRENGTHS,
            "normal_toughness": 0.06,
            "tangential_toughness": 0.1,
            "teeth": 3,
        },
        "path": {"waypoints": WAYPOINTS},
    },
    "pairs": {
        "cell": SQUARE | {"coating": 0.2},
        "material": {"matrix": MATRIX, "fibre": FIBRE, "coating": {"young": 120.0, "poisson": 0.25}},
        "interface": [
            SPRINGS | {"between": ["coating", "matrix"], "criterion": "energy", "toughness": 0.02},
            SPRINGS | {"between": ["fibre", "coating"], "criterion": "energy", "toughness": 0.018},
        ],
        "path": {"strain": [0.15, 0.0, 0.05]},
    },
    "springs' energy": {
        "cell": RANDOM | {"order": 2},
        "interface": SPRINGS | {"criterion": "energy", "toughness": 0.02, "growth": "springs"},
        "path": {"strain": [0.1, 0.0, 0.05], "method": "increments", "increments": 10},
    },
    "loaded angle": {
        "cell": SQUARE,
        "interface": SPRINGS | {"debonded": [ARC]},
        "angle": {"values": [0, 120], "strain": [0.01, 0.0, 0.0]},
    },
    "envelope": {
        "cell": RANDOM,
        "interface": STRENGTHS | {"criterion": "quadratic"},
        "envelope": {"plane": ["S22", "S12"], "directions": 8},
    },
    "envelope by energy": {
        "cell": SQUARE,
        "interface": SPRINGS
        | {"criterion": "energy", "toughness": 0.02, "contact": False, "debonded": [ARC | {"angle": 60}]},
        "envelope": {"plane": ["E22", "E11"], "directions": 6},
    },
    "envelope in space": {
        "cell": RANDOM,
        "matrix": WARM,
        "fibre": CARBON,
        "plane": "generalized",
        "interface": STRENGTHS | {"axial_strength": 3.0},
        "envelope": {"plane": ["S33", "S13"], "directions": 8, "temperature": -100.0},
    },
    "spatial": {
        "cell": HEXAGONAL | {"order": 2},
        "matrix": WARM,
        "fibre": TURNED_IN_SPACE,
        "plane": "generalized",
        "decomposition": {"subdomains": 6},
    },
    "spatial contact": {
        "cell": SQUARE,
        "matrix": WARM,
        "fibre": CARBON,
        "plane": "generalized",
        "interface": {"debonded": [ARC | {"angle": 110.0}]},
    },
    "spatial springs": {
        "cell": SQUARE | {"order": 2, "width": 2.0},
        "matrix": WARM,
        "fibre": CARBON,
        "plane": "generalized",
        "interface": SPRINGS | {"debonded": [ARC]},
        "angle": {"values": [0, 120]},
    },
    "increments": {
        "cell": SQUARE,
        "interface": STRENGTHS | {"criterion": "quadratic"},
        "path": {"waypoints": WAYPOINTS, "method": "increments", "increments": 12},
    },
}
RUBBING = {
    "cell": SQUARE,
    "interface": STRENGTHS | {"friction": 0.3, "debonded": [ARC | {"angle": 150.0}]},
    "path": {"waypoints": [{"E22": -0.05}, {"E22": -0.05, "gamma12": 0.08}, {"E22": -0.05, "gamma12": -0.02}]},
}
CASES |= {
    "friction": RUBBING,
    "friction by steps": RUBBING | {"path": RUBBING["path"] | {"method": "increments", "increments": 12}},
}

IN_SPACE = {"cell": SQUARE, "matrix": WARM, "fibre": WARM_FIBRE, "plane": "generalized"}
COOLED = [{"temperature": -1000.0}, {"S22": 6.0}, {"S22": -1.0}, {"temperature": 0.0, "S22": 1.0}]
BY_ENERGY = {"criterion": "energy", "toughness": 0.002}
MIXED_PATHS: dict[str, dict[str, Any]] = {
    "mixed": {
        "cell": SQUARE,
        "interface": STRENGTHS,
        "path": {"waypoints": [{"S11": 6.0}, {"S11": -3.0}, {"S11": 7.5, "E22": 0.02}]},
    },
    "jump": {  # a face opens at point 8 and overloads the last bond, a tip
        "cell": {"geometry": "square", "fibre_fraction": 0.37, "mesh_size": 0.4},
        "interface": SPRINGS
        | {"criterion": "energy", "toughness": 0.001, "debonded": [{"fibre": "all", "centre": 140.0, "angle": 277.0}]},
        "path": {
            "waypoints": [{"S11": -1.22, "S22": 0.57, "S12": 0.84}, {"E11": -0.01, "E22": 0.035, "gamma12": 0.004}]
        },
    },
    "uneven steps": {  # no step meets the first waypoint, and contact changes within steps
        "cell": SQUARE,
        "interface": STRENGTHS,
        "path": {"waypoints": [{"E11": 0.1}, {"E11": -0.05}, {"S11": 2.0}], "method": "increments", "increments": 11},
    },
    "cooled": IN_SPACE | {"interface": STRENGTHS, "path": {"waypoints": COOLED}},
    "cooled, thinned": IN_SPACE | {"interface": STRENGTHS, "path": {"waypoints": COOLED}, "states": 7},
    "cooled by steps": IN_SPACE
    | {"interface": STRENGTHS, "path": {"waypoints": COOLED[:2], "method": "increments", "increments": 8}},
    "axial": IN_SPACE
    | {
        "interface": STRENGTHS | {"axial_strength": 2.0, "criterion": "quadratic"},
        "path": {"to": {"S13": 3.0, "S11": 2.0}},
    },
    "axial energy": IN_SPACE
    | {"interface": SPRINGS | BY_ENERGY, "path": {"waypoints": [{"S13": 3.0, "S22": 1.0}, {"S13": -1.0}]}},
    "axial springs": IN_SPACE
    | {
        "interface": SPRINGS | BY_ENERGY | {"growth": "springs"},
        "path": {"to": {"S13": 3.0, "S22": 1.0}, "method": "increments", "increments": 8, "release": "worst"},
    },
}
LOADS: dict[str, dict[str, Any]] = {
    "load": IN_SPACE | {"load": {"to": {"E11": 0.02, "S13": 0.1, "temperature": -50.0}}},
    "load with contact": {
        "cell": SQUARE,
        "interface": {"debonded": [ARC | {"angle": 110.0}]},
        "load": {"to": {"E11": -0.02, "S22": 0.5}},
    },
}
# Derivatives of constants, and those of energies under contact.
DERIVATIVES: dict[str, dict[str, Any]] = {
    "derivatives": IN_SPACE
    | {"interface": SPRINGS, "output": {"sensitivities": True}, "petsc": {"feti_ksp_rtol": 1e-10}},
    "derivatives under contact": {
        "cell": SQUARE,
        "interface": SPRINGS | {"debonded": [ARC | {"angle": 90.0}]},
        "output": {"sensitivities": True},
    },
}
CASES |= MIXED_PATHS | LOADS | DERIVATIVES


def document(kind: str) -> dict[str, Any]:
    """Return the case of a kind of result."""
    parts = dict(CASES[kind])
    analysis = next((name for name in ("angle", "path", "envelope", "load") if name in parts), "stiffness")
    material = {"matrix": parts.pop("matrix", MATRIX), "fibre": parts.pop("fibre", FIBRE)}
    plane = {"type": analysis, "plane": parts.pop("plane", "strain")}
    output = {"pictures": False} | ({"states": parts.pop("states", "all")} if "path" in parts else {})
    output |= parts.pop("output", {})
    return {"name": kind, "material": material, "analysis": plane, "output": output} | parts


def write(kind: str, folder: Path) -> Path:
    """Compute a result on this rank alone and write it to a folder; returns the folder."""
    from mpi4py import MPI

    from feti_homog import Case, run

    run(Case.parse(document(kind)), MPI.COMM_SELF, out=folder)
    return folder


def falsified(folder: Path, copy: Path, edit: Callable[[dict[str, Any], Any], object]) -> Path:
    """Return a copy of a result after edit(document of result.json, open result.h5); returns its folder.

    Both files have the case: an edit of that in the document is one of both.
    """
    import h5py

    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("*.csv"))
    path = copy / "result.json"
    content = json.loads(path.read_text())
    case = json.dumps(content["case"])
    with h5py.File(copy / "result.h5", "r+") as file:
        edit(content, file)
        if json.dumps(content["case"]) != case:
            file.attrs["case"] = json.dumps(content["case"])
    path.write_text(json.dumps(content))
    return copy
