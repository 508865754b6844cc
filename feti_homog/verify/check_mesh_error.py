"""Estimated errors of the mesh.

Elements' shares are held against averages at nodes (Zienkiewicz and Zhu 1987), those of entries, constants and
energies against each other: estimates of elements and of arcs may cancel up to LEAST_SHARE.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from feti_homog.typing import Float, Int
from feti_homog.verify.cell_tables import State
from feti_homog.verify.discrete_cell import DiscreteCell
from feti_homog.verify.elements import PLACES
from feti_homog.verify.findings import Findings

# Relative errors of the energy below this are rounding, of fields that are uniform.
LEAST = 1e-9
# Errors by fits to several elements over those by averages: 1.5 to 1.9 of quadratic elements without a bubble, else
# 0.76 to 1.6, of hexagonal and random cells with contrasts of 1e-3 and 1e3, refined up to twice; of elements as large
# as a fibre, up to a quarter more.
WITHOUT_BUBBLE = 1.7
LEAST_SHARE = 0.05
# Relative difference of an entry of a symmetric matrix of errors and its mirror image that is rounding.
SYMMETRY = 1e-6
# Of linear elements, by nodes: places in which squares of linear functions are integrated exactly.
MIDDLES = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])


def check_mesh_error(findings: Findings, cell: DiscreteCell, state: State) -> None:
    """Check the sum of the elements' shares under a unit load of a stiffness: one estimate is near the other.

    No error of the energy is less than the share of theirs that arcs leave.
    """
    energy, given = float(state.strain @ state.mean_stress) * cell.area, _error_of(cell, state)
    if given is not None and not np.isnan(state.mesh_error).any():
        least = LEAST_SHARE * float(state.mesh_error.sum())
        findings.record("mesh error", (least + LEAST) / (given + LEAST) - 1, f"{state.name}, the error of its energy")
    if cell.files.case["analysis"]["type"] != "stiffness" or energy <= 0 or np.isnan(state.mesh_error).all():
        return
    written, own = float(state.mesh_error.sum()), _averaged(cell, state) / energy
    ratio = (written + LEAST) / (own + LEAST)
    findings.record("mesh error", max(ratio, 1 / ratio) - 1, state.name)


def _error_of(cell: DiscreteCell, state: State) -> float | None:
    """Relative error of the energy of a state in result.json, if it has one."""
    document, k, found = cell.files.document, int(np.abs(state.strain).argmax()), None
    if "path" in document or "load" in document:
        found = (document["path"][state.point] if "path" in document else document["load"]).hint("mesh_error")
    elif "mesh_error" in document and not state.temperature:
        name = f"effective_stiffness{'_compression' if state.strain[k] < 0 else ''}"
        found = document["mesh_error"].hint(name)[k][k] / abs(document.hint(name)[k][k])
    return None if found is None else float(found)


def _averaged(cell: DiscreteCell, state: State) -> float:
    """int d : S : d, d the stresses that functions of nodes blend from averages there less those of the elements."""
    mesh, v = cell.files.mesh, cell.stiffnesses.shape[1]
    weights, sums = np.zeros(len(mesh.points)), np.zeros((len(mesh.points), v))
    for part, r, w, stress in _stresses(cell, state):
        nodes, area = mesh.triangles[part], w.sum(axis=1)
        at_nodes = _at_nodes(r, stress, nodes.shape[1]) * area[:, None, None]
        weights += np.bincount(nodes.ravel(), np.repeat(area, nodes.shape[1]), len(weights))
        for column, values in zip(sums.T, at_nodes.T, strict=True):
            column += np.bincount(nodes.ravel(), values.T.ravel(), len(weights))
    averages = sums / np.where(weights > 0.0, weights, 1.0)[:, None]
    worked_on, total = np.unique(PLACES[v]), 0.0
    flexibility, lost = np.linalg.inv(cell.stiffnesses[:, worked_on[:, None], worked_on]), _lost(cell, worked_on)
    for part, r, w, stress in _stresses(cell, state):
        phase, is_linear = mesh.phase[part], mesh.triangles.shape[1] == 3
        # (q, nodes) N_a, r_a or r_a (2 r_a - 1) and 4 r_a r_b.
        functions = r if is_linear else np.hstack([r * (2 * r - 1), 4 * r * np.roll(r, -1, axis=1)])
        off = (functions @ averages[mesh.triangles[part]] - stress)[..., worked_on]
        off *= lost[phase, None]
        total += float(np.einsum("eq,eqi,eij,eqj->", w, off, flexibility[phase], off, optimize=True))
    return total


def _lost(cell: DiscreteCell, components: Int) -> Float:
    """(phases, components) factors of differences of stresses; bubbles are in the plane."""
    plane, is_linear = PLACES[cell.stiffnesses.shape[1]][:2], cell.files.mesh.triangles.shape[1] == 3
    has_none = ~(cell.elements.mixed[:, None] & np.isin(components, plane)) & (not is_linear)
    return np.asarray(np.where(has_none, np.sqrt(WITHOUT_BUBBLE), 1.0))


def _stresses(cell: DiscreteCell, state: State) -> Iterator[tuple[slice, Float, Float, Float]]:
    """Elements in portions: barycentric coordinates (q, 3), weights (e, q) and stresses there (e, q, v)."""
    elements = cell.elements
    if cell.files.mesh.triangles.shape[1] == 3:
        w, stress = (np.repeat(of[:, None], 3, axis=1) for of in (elements.area / 3, state.stress))
        yield slice(None), MIDDLES, w, stress
    else:
        yield from elements.point_stresses(state.displacement, state.along, cell.free_strains(state))


def _at_nodes(r: Float, stress: Float, nodes: int) -> Float:
    """(e, nodes, v) of the linear functions of r that are nearest to the stresses (e, q, v) of each element."""
    if nodes == 3:
        return stress
    corners = np.linalg.pinv(r) @ stress
    return np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2], axis=1)
