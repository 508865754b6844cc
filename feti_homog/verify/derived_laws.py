"""Laws of what a state shows to viewers: it follows from displacements, stresses, tractions and jumps."""

from __future__ import annotations

import numpy as np

from feti_homog.typing import Float
from feti_homog.verify.constitutive_law import VOIGT, out_of_plane
from feti_homog.verify.discrete_cell import ROUNDED_TERMS, DiscreteCell
from feti_homog.verify.elements import ElementFields
from feti_homog.verify.field_laws import in_axes, largest_displacement
from feti_homog.verify.ledger import Ledger, relative
from feti_homog.verify.reading import State


def check_derived(ledger: Ledger, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    """What is out of the plane, von Mises and principal stresses, vectors, and the faces' displacements."""
    _check_elements(ledger, cell, state, fields)
    _check_interface(ledger, cell, state)


def _check_elements(ledger: Ledger, cell: DiscreteCell, state: State, fields: ElementFields) -> None:
    element = f"{state.name}, element {{}}".format
    scale = np.abs(fields.strain).max(axis=1) + ROUNDED_TERMS * fields.strain_size
    shown = {"element_strain": fields.strain[:, [0, 1, -1]] * [1.0, 1.0, 0.5]}
    terms = {"element_strain": np.column_stack([scale] * 3)}
    if cell.files.is_spatial:
        tensors = state.stress[:, VOIGT[6]]
        shown["axial_strain"], terms["axial_strain"] = fields.strain[:, [3, 4]] / 2, np.column_stack([scale] * 2)
        E33, E33_terms = fields.strain[:, 2], scale
    else:
        tensors, E33, E33_terms = _out_of_plane(ledger, cell, state)
    shown["element_strain"] = np.column_stack([shown["element_strain"], E33])
    terms["element_strain"] = np.column_stack([terms["element_strain"], E33_terms])
    for name, strains in shown.items():
        for column, (strain, own) in enumerate(zip(strains.T, terms[name].T, strict=True)):
            ledger.record("shown", _off(state.derived[name][:, column], strain, own), element)
    unknown = np.where(np.isnan(tensors[:, 2, 2]), np.nan, 0.0)
    tensors[:, 2, 2] = np.nan_to_num(tensors[:, 2, 2])
    principal = np.linalg.eigvalsh(tensors)
    deviator = tensors - np.trace(tensors, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    mises = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    size = np.abs(tensors).max(axis=(1, 2))
    for name, values in (("von_mises", mises), *((f"principal_{3 - i}", principal[:, i]) for i in range(3))):
        ledger.record("shown", _off(state.derived[name], values + unknown, size), element)


def _out_of_plane(ledger: Ledger, cell: DiscreteCell, state: State) -> tuple[Float, Float, Float]:
    """Stresses (m, 3, 3), strains 33 (m,) and the sizes of their terms (m,), in plane strain and stress."""
    rules = out_of_plane(cell.files.case, cell.files.phases)[cell.files.mesh.phase]
    (S33, E33), (S33_terms, E33_terms) = (
        np.einsum("eci,ei->ce", rule, stress)
        for rule, stress in ((rules, state.stress), (np.abs(rules), np.abs(state.stress)))
    )
    off = _off(state.derived["stress_33"], S33, S33_terms)
    ledger.record("stress 33", off, f"{state.name}, element {{}}".format)
    tensors = np.zeros((len(S33), 3, 3))
    tensors[:, :2, :2], tensors[:, 2, 2] = state.stress[:, VOIGT[3]], S33
    return tensors, E33, E33_terms


def _check_interface(ledger: Ledger, cell: DiscreteCell, state: State) -> None:
    node = f"{state.name}, interface node {{}}".format
    shown, opening = state.derived, in_axes(cell, state.jump)
    fibre = state.displacement[cell.files.faces[:, 0]]
    moved = largest_displacement(cell, state) + float(np.abs(fibre).max(initial=0.0))
    pulled = float(np.abs(state.traction).max(initial=0.0))
    for name, vectors, scale in (
        ("traction_vector", in_axes(cell, state.traction), pulled),
        ("jump_vector", opening, moved),
        ("displacement_fibre", fibre, moved),
        ("displacement_matrix", fibre + opening, moved),
    ):
        off = shown[name] - np.pad(vectors, [(0, 0), (0, 3 - vectors.shape[1])])
        ledger.record("vectors", relative(np.abs(off).max(axis=1), scale), node)


def _off(shown: Float, true: Float, terms: Float) -> Float:
    """(m,) relative errors of what is shown; none where both are unknown, or too large for single precision."""
    same = (np.isnan(true) & np.isnan(shown)) | (np.isinf(shown) & (true.astype(shown.dtype) == shown))
    return np.where(same, 0.0, relative(np.where(same, 0.0, shown - true), np.where(same, 1.0, terms)))
