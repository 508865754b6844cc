"""States of result.h5 as viewers want them, with the fields that follow from those of the file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from feti_homog.errors import CaseError
from feti_homog.fem.assembly import element_strain
from feti_homog.fem.problem import AXIAL, PLANE
from feti_homog.materials import voigt
from feti_homog.results import field_file, xdmf
from feti_homog.results.field_views import AXIAL as AXIAL_DISPLACEMENT
from feti_homog.typing import Array, Float
from feti_homog.verify.constitutive_law import out_of_plane


@dataclass(frozen=True, repr=False)
class ViewedState:
    """One state on its mesh: the cell, or the interface as points.

    Attributes:
        points: (n, 3) places of the nodes; nodes are torn between subdomains.
        cells: (m, 3 or 6) nodes of the triangles, mid-side nodes last; (k, 1) of the interface.
        nodes, elements: arrays by name, with (n, ...) and (m, ...) rows; vectors have three columns, tensors nine.
        label: that of the state.
    """

    points: Float
    cells: Array
    nodes: Mapping[str, Array]
    elements: Mapping[str, Array]
    label: str

    def __repr__(self) -> str:
        return f"ViewedState({self.label!r}, {len(self.points)} nodes, {len(self.cells)} cells)"


def read_state(directory: str | Path, state: int = 0) -> ViewedState:
    """Return a state of the cell in a folder of results.  Call on one rank.

    `nodes` has displacement and fluctuation, the periodic part of the displacement (length); `elements` stress and
    strain, tensors of means over the elements, S11, S22, S12, S33, von_mises and principal_1 to 3, the largest first
    (stress), body, fibre_number, phase and subdomain.  Strains include thermal ones.  What the constants of a material
    do not determine is NaN.

    Raises:
        CaseError: there is no result.h5, it cannot be read, or has no such state.
    """
    path = Path(directory) / field_file.NAME
    try:
        with h5py.File(path, "r", locking=False) as file:
            count = len(file.get("state", ()))
            if not 0 <= state < count:
                raise CaseError(f"{path}: has no state {state}: its {count} states are numbered from 0")
            return cell_state(file, state)
    except (OSError, KeyError) as error:
        raise CaseError(f"cannot read {path}: {error}") from error


def cell_state(file: Any, state: int) -> ViewedState:
    """Return a state of the cell of an open result.h5, as `read_state`."""
    group = file[f"state/{state}"]
    more = xdmf.SPATIAL_ELEMENTS if AXIAL_DISPLACEMENT in group else {}
    nodes, elements = (_tables(file, state, names) for names in (xdmf.CELL_NODES, xdmf.CELL_ELEMENTS | more))
    points, triangles, strain = file["mesh/points"][()], file["mesh/triangles"][()], group.attrs["strain"]
    nodes["fluctuation"] = nodes["displacement"] - points @ _gradient(strain).T
    in_plane = group["stress"][()]
    E33 = _strain_33(file, strain, in_plane)
    elements["strain"] = _strains(points, triangles, nodes["displacement"], E33)
    shears = group["axial_stress"][()] if more else np.zeros((len(triangles), 2))
    S33 = elements["S33"]
    elements["von_mises"] = voigt.spatial_von_mises(in_plane, S33, shears)
    principal = voigt.spatial_principal(in_plane, S33, shears) if more else voigt.principal(in_plane, S33)
    elements |= {f"principal_{k + 1}": column for k, column in enumerate(principal.T)}
    return ViewedState(_in_space(points), triangles, nodes, elements, str(group.attrs["label"]))


def interface_state(file: Any, state: int) -> ViewedState:
    """Return a state of the interface nodes of an open result.h5: displacements of both faces, tractions, jumps."""
    group = file[f"state/{state}"]
    more = xdmf.SPATIAL_POINTS if AXIAL_DISPLACEMENT in group else {}
    nodes = _tables(file, state, xdmf.INTERFACE_POINTS | more)
    label = str(group.attrs["label"])
    return ViewedState(_in_space(file["interface/points"][()]), file["interface/vertex"][()], nodes, {}, label)


def _tables(file: Any, state: int, places: Mapping[str, str]) -> dict[str, Array]:
    """Return the tables of a state that the file has; those of earlier versions have fewer."""
    found = {name: place.replace("/K/", f"/{state}/") for name, place in places.items()}
    return {name: file[place][()] for name, place in found.items() if place in file}


def _in_space(points: Float) -> Float:
    return np.pad(points, [(0, 0), (0, 1)])


def _gradient(strain: Float) -> Float:
    """(3, 2) H of the displacements H x of a macroscopic strain (3,) or (6,)."""
    along = np.zeros(2) if len(strain) == len(voigt.STRAINS) else strain[[4, 3]]
    return np.vstack([PLANE.gradient(strain[[0, 1, -1]]), AXIAL.gradient(along)])


def _strain_33(file: Any, strain: Float, in_plane: Float) -> Float:
    """(m,) strains 33 under a macroscopic strain and stresses (m, 3).

    Those of all elements or, in plane strain and stress, as the materials make them.
    """
    if len(strain) > len(voigt.STRAINS):
        return np.full(len(in_plane), strain[2])
    rules = out_of_plane(json.loads(file.attrs["case"]), tuple(map(str, file.attrs["phases"])))
    return np.asarray(np.einsum("ei,ei->e", rules[file["mesh/phase"][()], 1], in_plane))


def _strains(points: Float, triangles: Array, displacement: Float, E33: Float) -> Float:
    """(m, 9) means over the elements of the strains of displacements (n, 3), as tensors."""
    every = np.arange(len(points), dtype=np.int32)
    E11, E22, gamma12 = element_strain(points, triangles, every, displacement[:, :2], PLANE)[0].T
    gamma13, gamma23 = element_strain(points, triangles, every, displacement[:, 2:], AXIAL)[0].T
    E12, E13, E23 = gamma12 / 2, gamma13 / 2, gamma23 / 2
    return np.stack([E11, E12, E13, E12, E22, E23, E13, E23, E33], axis=1)
