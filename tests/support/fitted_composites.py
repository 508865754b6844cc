"""The four composites of the reference constants as fits: their own constants are measured, those of phases unknown."""

import copy
from typing import Any

import numpy as np

from feti_homog import Case, run

NAMES = ("E1", "E3", "G12", "G23", "nu12", "K_transverse", "expansion_x1", "expansion_axial")
BORON = {"young": 379.3, "poisson": 0.1, "expansion": 8.1}
ALUMINIUM = {"young": 68.3, "poisson": 0.3, "expansion": 23.0}
AS4 = {
    "E_axial": 235.0, "E_transverse": 14.0, "nu_axial": 0.2, "nu_transverse": 0.25, "G_axial": 28.0,
    "expansion_axial": -0.9, "expansion_transverse": 9.0,
}  # fmt: skip
ISOTROPIC = tuple(f"material.{phase}.{name}" for phase in ("fibre", "matrix") for name in BORON)
OF_CARBON = tuple(f"material.fibre.{name}" for name in AS4)
COMPOSITES: dict[str, tuple[str, float, dict[str, float], dict[str, float], tuple[str, ...]]] = {
    "boron/aluminium, square": ("square", 0.47, BORON, ALUMINIUM, ISOTROPIC),
    "boron/aluminium, hexagonal": ("hexagonal", 0.47, BORON, ALUMINIUM, ISOTROPIC),
    "AS4/3501-6": ("hexagonal", 0.6, AS4, {"young": 4.8, "poisson": 0.34, "expansion": 54.0}, OF_CARBON),
    "glass/epoxy": (
        "hexagonal", 0.55, {"young": 73.0, "poisson": 0.22, "expansion": 5.0},
        {"young": 3.45, "poisson": 0.35, "expansion": 54.0}, ISOTROPIC,
    ),
}  # fmt: skip


def case(name: str, mesh_size: float = 0.3) -> dict[str, Any]:
    """Return the document of a composite on a coarse mesh."""
    geometry, fraction, fibre, matrix, _ = COMPOSITES[name]
    return {
        "cell": {"geometry": geometry, "fibre_fraction": fraction, "mesh_size": mesh_size, "order": 1},
        "material": {"fibre": dict(fibre), "matrix": dict(matrix)},
        "analysis": {"type": "stiffness", "plane": "generalized"},
        "output": {"sensitivities": True, "mesh_error": False},
        "petsc": {"feti_ksp_rtol": 1e-11},
    }


def with_values(document: dict[str, Any], values: dict[str, float]) -> dict[str, Any]:
    """Return the document with other constants of phases."""
    changed = copy.deepcopy(document)
    for key, value in values.items():
        _, phase, name = key.split(".")
        changed["material"][phase][name] = float(value)
    return changed


def truth(name: str) -> dict[str, float]:
    """Return the constants of phases that are unknown."""
    document = case(name)
    return {key: document["material"][key.split(".")[1]][key.split(".")[2]] for key in COMPOSITES[name][-1]}


def model(name: str, comm: Any, mesh_size: float = 0.3) -> Any:
    """Return x to the values (8,) of NAMES and their derivatives (8, n).  Collective."""
    document, keys = case(name, mesh_size), COMPOSITES[name][-1]

    def computed(x: Any) -> tuple[Any, Any]:
        found = run(Case.parse(with_values(document, dict(zip(keys, x, strict=True)))), comm).sensitivities
        rows = [found.constants.index(each) for each in NAMES]
        columns = [found.parameters.index(key) for key in keys]
        return found.constant_values[rows], found.derivatives[np.ix_(rows, columns)]

    return computed


def fit(name: str, values: Any, share: float = 0.01, start: float = 1.2) -> dict[str, Any]:
    """Return the document of a fit to values of NAMES, of relative errors of this size, from far away."""
    document = case(name)
    unknown: dict[str, Any] = {}
    for k, (key, value) in enumerate(truth(name).items()):
        del document["material"][key.split(".")[1]][key.split(".")[2]]
        first = value * start ** (-1) ** k
        lower, upper = sorted([value / 3, 3 * value])
        if "poisson" in key or "nu_" in key:
            lower, upper = -0.5, 0.49
        unknown[key] = {"start": first, "lower": lower, "upper": upper}
    measured = {n: {"value": float(v), "std": float(share * abs(v))} for n, v in zip(NAMES, values, strict=True)}
    return document | {"unknown": unknown, "measured": measured}
