"""Random materials of all forms that a plane state takes, and random cells of all geometries."""

from collections.abc import Mapping
from typing import Any

import numpy as np

Document = dict[str, Any]

# Of the phases beside the matrix, whose modulus is about one.
SOFTEST, STIFFEST = 1e-2, 1e2
FORMS = ("isotropic", "orthotropic", "transversely isotropic", "general")


def random_material(rng: np.random.Generator, plane: str, expands: bool, size: float = 1.0) -> Document:
    """Return the table of a material whose moduli are about `size`."""
    form = str(rng.choice(FORMS, p=[0.55, 0.15, 0.15, 0.15]))
    E, nu = size * rng.uniform(0.5, 2.0), rng.uniform(0.0, 0.4)
    if form == "isotropic":
        material: Document = {"young": E, "poisson": nu}
        return material | ({"expansion": rng.uniform(0, 6e-5)} if expands else {})
    if form == "transversely isotropic":
        material = {"E_axial": E * rng.uniform(0.7, 5), "E_transverse": E, "nu_axial": rng.uniform(0, 0.3),
                    "nu_transverse": nu, "G_axial": E * rng.uniform(0.3, 1)}  # fmt: skip
        if material["nu_axial"] < 0.15:  # without a draw, so that a seed has the same cases
            material["G_transverse"] = E / (2 + 2 * material.pop("nu_transverse"))
        along = {"expansion_axial": rng.uniform(-1e-5, 5e-5), "expansion_transverse": rng.uniform(0, 5e-5)}
        return material | (along if expands else {})
    if form == "orthotropic":
        material = {f"E{i}": E * rng.uniform(0.7, 1.5) for i in (1, 2, 3)}
        material |= {f"nu{ij}": rng.uniform(0.0, 0.3) for ij in (12, 13, 23)}
        material |= {f"G{ij}": E * rng.uniform(0.3, 0.6) for ij in (12, 13, 23)}
        material |= {"angle": rng.uniform(-90, 90)}
    else:
        material = {"stiffness": _stiffness(rng, E, plane)}
    return material | ({"expansion": rng.uniform(0, 5e-5, 3).tolist()} if expands else {})


def _stiffness(rng: np.random.Generator, E: float, plane: str) -> list[list[float]]:
    """Return a random stiffness: 3x3, or 6x6 in which 23 and 13 are coupled to each other alone."""
    spatial = plane == "generalized" or rng.random() < 0.5
    blocks = [[0, 1, 2, 5], [3, 4]] if spatial else [[0, 1, 2]]
    C = np.zeros((6, 6) if spatial else (3, 3))
    for block in blocks:
        A = rng.normal(size=(len(block), len(block)))
        C[np.ix_(block, block)] = E * (np.eye(len(block)) + 0.3 * A @ A.T)
    return np.round(C / E, 12).__mul__(E).tolist()


def random_phases(rng: np.random.Generator, cell: Mapping[str, Any], names: list[str], plane: str) -> Document:
    """[material] of the matrix, the phases of these names, and the coating if the cell has one."""
    expands = plane == "generalized" and rng.random() < 0.7
    phases = {"matrix": random_material(rng, plane, expands)}
    for name in names:
        size = 10.0 ** rng.uniform(np.log10(SOFTEST), np.log10(STIFFEST))
        phases[name] = random_material(rng, plane, expands, size)
    return phases
