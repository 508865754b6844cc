"""Laws of what a state shows to viewers: it follows from displacements, stresses, tractions and jumps."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float
from feti_homog.verification.constitutive_law import out_of_plane
from feti_homog.verification.discrete_cell import DiscreteCell
from feti_homog.verification.elements import ElementFields
from feti_homog.verification.field_laws import ROUNDED_TERMS, in_plane, largest_displacement
from feti_homog.verification.ledger import Ledger, relative
from feti_homog.verification.reading import State


def check_derived(ledger: Ledger, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """What is out of the plane, von Mises and principal stresses, vectors, and the faces' displacements."""
    _check_elements(ledger, cell, state, fields)
    _check_interface(ledger, cell, state)


def _check_elements(ledger: Ledger, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    element = f"{state.name}, element {{}}".format
    phase, shown = cell.files.mesh.phase, state.derived
    rules = out_of_plane(cell.files.case, cell.files.phases)[phase]
    (S33, E33), (S33_terms, E33_terms) = (
        np.einsum("eci,ei->ce", rule, stress)
        for rule, stress in ((rules, state.stress), (np.abs(rules), np.abs(state.stress)))
    )
    ledger.record("stress 33", _off(shown["stress_33"], S33, S33_terms), element)
    tensors = np.zeros((len(S33), 3, 3))
    tensors[:, :2, :2] = state.stress[:, [[0, 2], [2, 1]]]
    tensors[:, 2, 2] = np.nan_to_num(S33)
    principal = np.linalg.eigvalsh(tensors)
    deviator = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    mises = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    size = np.abs(tensors).max(axis=(1, 2))
    unknown = np.where(np.isnan(S33), np.nan, 0.0)
    for name, values in (("von_mises", mises), *((f"principal_{3 - i}", principal[:, i]) for i in range(3))):
        ledger.record("shown", _off(shown[name], values + unknown, size), element)
    strain = np.column_stack([fields.strain * [1.0, 1.0, 0.5], E33])
    scale = np.abs(strain[:, :3]).max(axis=1) + ROUNDED_TERMS * fields.strain_size
    terms = np.column_stack([scale, scale, scale, E33_terms])
    for column in range(4):
        ledger.record("shown", _off(shown["element_strain"][:, column], strain[:, column], terms[:, column]), element)


def _check_interface(ledger: Ledger, cell: DiscreteCell, state: State) -> None:
    node = f"{state.name}, interface node {{}}".format
    shown, opening = state.derived, in_plane(cell, state.jump)
    fibre = state.displacement[cell.files.faces[:, 0]]
    moved = largest_displacement(cell, state) + float(np.abs(fibre).max(initial=0.0))
    pulled = float(np.abs(state.traction).max(initial=0.0))
    for name, vectors, scale in (
        ("traction_vector", in_plane(cell, state.traction), pulled),
        ("jump_vector", opening, moved),
        ("displacement_fibre", fibre, moved),
        ("displacement_matrix", fibre + opening, moved),
    ):
        off = shown[name] - np.pad(vectors, [(0, 0), (0, 1)])
        ledger.record("vectors", relative(np.abs(off).max(axis=1), scale), node)


def _off(shown: Float, true: Float, terms: Float) -> Float:
    """(m,) relative errors of what is shown; none where both are unknown, or too large for single precision."""
    same = (np.isnan(true) & np.isnan(shown)) | (np.isinf(shown) & (true.astype(shown.dtype) == shown))
    return np.where(same, 0.0, relative(np.where(same, 0.0, shown - true), np.where(same, 1.0, terms)))
