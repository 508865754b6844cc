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

HASHIN = {
    "axial_tension": 3.5, "axial_compression": 2.5, "axial_shear": 0.08, "transverse_tension": 0.06,
    "transverse_compression": 0.15, "transverse_shear": 0.07,
}  # fmt: skip
IN_SPACE = {"matrix": WARM, "fibre": CARBON, "plane": "generalized"}
BY_ENERGY = SPRINGS | {"criterion": "energy", "toughness": 0.02}
LEGS = {"waypoints": WAYPOINTS}


def debonded(angle: float) -> dict[str, Any]:
    return {"debonded": [ARC | {"angle": angle}]}


def stepped(path: dict[str, Any], increments: int, **more: Any) -> dict[str, Any]:
    return path | {"method": "increments", "increments": increments} | more


CASES: dict[str, dict[str, Any]] = {
    "bonded": {"cell": HEXAGONAL | {"order": 2}, "decomposition": {"subdomains": 6}},
    "rubber": {"cell": HEXAGONAL, "matrix": {"young": 0.1, "poisson": 0.49999999}},
    "plane": {"cell": HEXAGONAL | {"bodies": "plane", "refine": 1}, "plane": "stress"},
    "contact": {"cell": SQUARE | {"order": 2}, "interface": debonded(110.0)},
    "overlap": {"cell": SQUARE, "interface": debonded(200.0) | {"contact": False}},
    "angle": {"cell": RANDOM, "fibre": TURNED, "interface": {"debonded": [ARC]}, "angle": {"values": [0, 120, 360]}},
    "path": {"cell": SQUARE, "interface": STRENGTHS, "path": LEGS},
    "thinned": {"cell": SQUARE, "interface": STRENGTHS, "path": LEGS, "states": 7},
    "peaks": {"cell": SQUARE, "interface": STRENGTHS, "path": {"strain": [0.2, 0.0, 0.1]}, "states": "peaks"},
    "springs": {"cell": SQUARE | {"order": 2}, "interface": SPRINGS | debonded(110.0)},
    "energy": {"cell": SQUARE, "interface": BY_ENERGY, "path": LEGS},
    "softening": {
        "cell": SQUARE,
        "interface": SPRINGS
        | STRENGTHS
        | {"law": "bilinear", "normal_toughness": 0.06, "tangential_toughness": 0.1, "teeth": 3},
        "path": LEGS,
    },
    "pairs": {
        "cell": SQUARE | {"coating": 0.2},
        "material": {"matrix": MATRIX, "fibre": FIBRE, "coating": {"young": 120.0, "poisson": 0.25}},
        "interface": [
            BY_ENERGY | {"between": ["coating", "matrix"]},
            BY_ENERGY | {"between": ["fibre", "coating"], "toughness": 0.018},
        ],
        "path": {"strain": [0.15, 0.0, 0.05]},
    },
    "springs' energy": {
        "cell": RANDOM | {"order": 2},
        "interface": BY_ENERGY | {"growth": "springs"},
        "path": stepped({"strain": [0.1, 0.0, 0.05]}, 10),
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
        "interface": BY_ENERGY | {"contact": False} | debonded(60),
        "envelope": {"plane": ["E22", "E11"], "directions": 6},
    },
    "envelope in space": IN_SPACE
    | {
        "cell": RANDOM,
        "interface": STRENGTHS | {"axial_strength": 3.0},
        "envelope": {"plane": ["S33", "S13"], "directions": 8, "temperature": -100.0},
    },
    "spatial": IN_SPACE
    | {"cell": HEXAGONAL | {"order": 2}, "fibre": TURNED_IN_SPACE, "decomposition": {"subdomains": 6}},
    "spatial contact": IN_SPACE | {"cell": SQUARE, "interface": debonded(110.0)},
    "spatial springs": IN_SPACE
    | {
        "cell": SQUARE | {"order": 2, "width": 2.0},
        "interface": SPRINGS | {"debonded": [ARC]},
        "angle": {"values": [0, 120]},
    },
    "increments": {"cell": SQUARE, "interface": STRENGTHS | {"criterion": "quadratic"}, "path": stepped(LEGS, 12)},
}
RUBBING = {
    "cell": SQUARE,
    "interface": STRENGTHS | {"friction": 0.3} | debonded(150.0),
    "path": {"waypoints": [{"E22": -0.05}, {"E22": -0.05, "gamma12": 0.08}, {"E22": -0.05, "gamma12": -0.02}]},
}
CASES |= {"friction": RUBBING, "friction by steps": RUBBING | {"path": stepped(RUBBING["path"], 12)}}

WARM_SQUARE = {"cell": SQUARE, "matrix": WARM, "fibre": WARM_FIBRE, "plane": "generalized"}
COOLED = [{"temperature": -1000.0}, {"S22": 6.0}, {"S22": -1.0}, {"temperature": 0.0, "S22": 1.0}]
WEAK = BY_ENERGY | {"toughness": 0.002}
MIXED_PATHS: dict[str, dict[str, Any]] = {
    "mixed": {
        "cell": SQUARE,
        "interface": STRENGTHS,
        "path": {"waypoints": [{"S11": 6.0}, {"S11": -3.0}, {"S11": 7.5, "E22": 0.02}]},
    },
    "jump": {  # a face opens at point 8 and overloads the last bond, a tip
        "cell": {"geometry": "square", "fibre_fraction": 0.37, "mesh_size": 0.4},
        "interface": BY_ENERGY | {"toughness": 0.001, "debonded": [{"fibre": "all", "centre": 140.0, "angle": 277.0}]},
        "path": {
            "waypoints": [{"S11": -1.22, "S22": 0.57, "S12": 0.84}, {"E11": -0.01, "E22": 0.035, "gamma12": 0.004}]
        },
    },
    "uneven steps": {  # no step meets the first waypoint, and contact changes within steps
        "cell": SQUARE,
        "interface": STRENGTHS,
        "path": stepped({"waypoints": [{"E11": 0.1}, {"E11": -0.05}, {"S11": 2.0}]}, 11),
    },
    "cooled": WARM_SQUARE | {"interface": STRENGTHS, "path": {"waypoints": COOLED}},
    "cooled, thinned": WARM_SQUARE | {"interface": STRENGTHS, "path": {"waypoints": COOLED}, "states": 7},
    "cooled by steps": WARM_SQUARE | {"interface": STRENGTHS, "path": stepped({"waypoints": COOLED[:2]}, 8)},
    "axial": WARM_SQUARE
    | {
        "interface": STRENGTHS | {"axial_strength": 2.0, "criterion": "quadratic"},
        "path": {"to": {"S13": 3.0, "S11": 2.0}},
    },
    "axial energy": WARM_SQUARE | {"interface": WEAK, "path": {"waypoints": [{"S13": 3.0, "S22": 1.0}, {"S13": -1.0}]}},
    "axial springs": WARM_SQUARE
    | {
        "interface": WEAK | {"growth": "springs"},
        "path": stepped({"to": {"S13": 3.0, "S22": 1.0}}, 8, release="worst"),
    },
}
LOADS: dict[str, dict[str, Any]] = {
    "load": WARM_SQUARE
    | {
        "matrix": WARM | {"strength": {"tension": 0.08, "compression": 0.12}},
        "fibre": CARBON | {"strength": HASHIN},
        "load": {"to": {"E11": 0.02, "S13": 0.1, "temperature": -50.0}},
    },
    "load with contact": {"cell": SQUARE, "interface": debonded(110.0), "load": {"to": {"E11": -0.02, "S22": 0.5}}},
}
# Derivatives of constants, and those of energies under contact.
DERIVATIVES: dict[str, dict[str, Any]] = {
    "derivatives": WARM_SQUARE
    | {
        "matrix": WARM | {"strength": {"principal": 0.08}},
        "interface": SPRINGS,
        "output": {"sensitivities": True},
        "petsc": {"feti_ksp_rtol": 1e-10},
    },
    "derivatives under contact": {
        "cell": SQUARE,
        "interface": SPRINGS | debonded(90.0),
        "output": {"sensitivities": True},
    },
}
CONDUCTOR, TENSOR = {"conductivity": 0.2}, [[2.0, 0.3, 0.1], [0.3, 1.0, -0.2], [0.1, -0.2, 5.0]]
CONDUCTION: dict[str, dict[str, Any]] = {
    "conductivity": {
        "cell": HEXAGONAL | {"order": 2},
        "matrix": MATRIX | CONDUCTOR | {"strength": {"principal": 1.0}},  # which conduction does not use
        "fibre": {"conductivity": {"axial": 10.0, "transverse": 1.0}},
        "plane": "conduction",
    },
    "conductance": {
        "cell": SQUARE,
        "matrix": CONDUCTOR,
        "fibre": {"conductivity": TENSOR},
        "plane": "conduction",
        "interface": {"conductance": 0.7} | debonded(110.0),
    },
}
CASES |= MIXED_PATHS | LOADS | DERIVATIVES | CONDUCTION


def document(kind: str) -> dict[str, Any]:
    """Return the case of a kind of result."""
    parts = dict(CASES[kind])
    analysis = next((name for name in ("angle", "path", "envelope", "load") if name in parts), "stiffness")
    material = {"matrix": parts.pop("matrix", MATRIX), "fibre": parts.pop("fibre", FIBRE)}
    plane = {"type": analysis, "plane": parts.pop("plane", "strain")}
    if plane["plane"] == "conduction":
        plane = {"type": "conductivity"}
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
