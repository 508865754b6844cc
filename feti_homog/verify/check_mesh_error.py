"""Law of the estimated error of the mesh: that of stresses averaged at the nodes of each subdomain.

Of linear elements alone, whose stresses are their means; those of quadratic ones are not in the files, nor is what
sides make of arcs, so that the entries of `mesh_error` in result.json are not computed anew.
"""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.findings import Findings
from feti_homog.verify.reading import State

# Relative errors of the energy below this are rounding, of fields that are uniform.
LEAST = 1e-9


def check_mesh_error(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check the sum of the elements' shares under a unit load of a stiffness, for one is the other within a factor."""
    energy = float(state.strain @ state.mean_stress) * cell.area
    is_linear = cell.files.mesh.triangles.shape[1] == 3 and cell.files.case["analysis"]["type"] == "stiffness"
    if not is_linear or energy <= 0 or np.isnan(state.mesh_error).all():
        return
    written, own = float(state.mesh_error.sum()), _averaged(cell, state) / energy
    ratio = (written + LEAST) / (own + LEAST)
    findings.record("mesh error", max(ratio, 1 / ratio) - 1, state.name)


def _averaged(cell: DiscreteCell, state: State) -> float:
    """int d : S : d, d the stresses that are linear between averages at the nodes less those of the elements."""
    mesh, area = cell.files.mesh, cell.elements.area
    corners, n = mesh.triangles[:, :3], len(mesh.points)
    weights = np.bincount(corners.ravel(), np.repeat(area, 3), n)
    columns = [np.bincount(corners.ravel(), np.repeat(area * column, 3), n) for column in state.stress.T]
    averages = np.stack(columns, axis=1) / np.where(weights > 0, weights, 1.0)[:, None]
    off: Float = averages[corners] - state.stress[:, None]
    places = np.concatenate([off, off.sum(axis=1, keepdims=True)], axis=1)
    compliance = np.linalg.inv(cell.stiffnesses)[mesh.phase]
    return float(np.einsum("e,eai,eij,eaj->", area / 12, places, compliance, places))
