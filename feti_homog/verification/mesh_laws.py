"""Laws of the mesh, and of the interface nodes on it."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import AnyInt, Float, Int
from feti_homog.verification.discrete_cell import DiscreteCell
from feti_homog.verification.ledger import Ledger, relative


def check_mesh(ledger: Ledger, cell: DiscreteCell) -> None:
    """Elements have positive areas that add up to the cell, and every torn side has one opposite partner."""
    elements, sides = cell.elements, cell.sides
    ledger.record("mesh", np.where(elements.least_jacobian > 0, 0.0, np.inf), "element {}".format)
    ledger.record("mesh", relative(elements.area.sum() - cell.area, cell.area), "the sum of all areas")
    ledger.record("mesh", sides.mismatch, lambda i: f"a side of element {sides.element[i]}")


def check_interface(ledger: Ledger, cell: DiscreteCell) -> None:
    """Each place where one fibre meets the matrix has one interface node, of that fibre, and there are no others."""
    rows, faces = cell.files.interface, cell.faces
    at = "interface node {}".format
    ledger.record("interface", faces.distance / cell.files.size.max(), at)
    count = np.bincount(faces.place[faces.place >= 0], minlength=cell.nodes.places)
    wrong = np.flatnonzero(count != faces.breakable)
    first = [int(cell.nodes.node[np.argmax(cell.nodes.place == place)]) for place in wrong[:1]]
    words = f"{len(wrong)} places with another number of interface nodes than one, the first at mesh node {first}"
    ledger.record("interface", np.where(len(wrong), np.inf, 0.0), words)
    ledger.record("interface", np.abs(np.hypot(*rows.normal.T) - 1.0), at)
    ledger.record("interface", np.where(rows.length > 0, 0.0, np.inf), at)
    ledger.record("interface", _strangers(cell), at)


def _strangers(cell: DiscreteCell) -> Float:
    """(k,) with how many nodes each shares its fibre on the mesh, or its number of the fibre, but not the other."""
    nodes, faces, fibre = cell.nodes, cell.faces, cell.files.interface.fibre
    own = (faces.row >= 0) & faces.is_fibre
    part = np.full(len(fibre), -1)
    part[faces.row[own]] = cell.constituent[nodes.subdomain[own]]
    alike = _alike(part * (int(fibre.max(initial=0)) + 1) + fibre)
    return np.asarray(np.maximum(_alike(part), _alike(fibre)) - alike, float)


def _alike(labels: AnyInt) -> Int:
    """(k,) how many have the same label as each."""
    _, inverse, count = np.unique(labels, return_inverse=True, return_counts=True)
    return np.asarray(count[inverse.ravel()])
