"""The mesh, the interface nodes, the fibres and a state as result.h5 has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from feti_homog.typing import AnyInt, Float, Int


@dataclass(frozen=True)
class Mesh:
    """Nodes (n, 2) and elements (m, 3 or 6): vertices, then the nodes on the sides 01, 12, 20; phase 0 is the matrix.

    Each subdomain has nodes of its own.
    """

    points: Float
    triangles: Int
    subdomain: AnyInt
    phase: AnyInt
    body: AnyInt


@dataclass(frozen=True)
class InterfaceRows:
    """The k interface nodes: points, and normals from fibre to matrix, (k, 2); tributary lengths (k,).

    Numbers of the fibre from 1, bodies of the fibre or of its coating, places of sections of interfaces (k,).
    """

    points: Float
    normal: Float
    length: Float
    fibre: AnyInt
    body: AnyInt
    pair: AnyInt


@dataclass(frozen=True)
class Fibres:
    """The f fibres by number.

    Numbers, bodies and phases (f,), centres (f, 2), radii (f,), NaN where there is none; and the strength of their
    bonds / that of the case (f,).
    """

    number: AnyInt
    body: AnyInt
    phase: AnyInt
    centre: Float
    radius: Float
    strength: Float


@dataclass(frozen=True)
class State:
    """A state: what /state/K holds, and `name`, under which a violation is reported.

    Strains and stresses have v = 3 components [11, 22, 12], displacements c = 2; of generalized plane strain 6, in the
    order [11, 22, 33, 23, 13, 12], and 3.  Macroscopic strain and stress (v,); `point` is the number in `path` or
    `angle` of result.json; displacements (n, c), and less those of the strain; means of stresses (m, v); traction and
    jump (k, c) normal, tangential and along the fibres; status (k,) 0 bonded, 1 closed, 2 open; damage (k,) 0 intact to
    1 broken; sliding (k,) the sign of the growing slip of closed nodes that slide; mesh_error (m,) shares of the
    energy's estimated error, NaN of none; stresses 33 (m,); a change of temperature.
    """

    name: str
    strain: Float
    mean_stress: Float
    load_factor: float
    point: int
    displacement: Float
    fluctuation: Float
    stress: Float
    traction: Float
    jump: Float
    status: AnyInt
    damage: Float
    sliding: AnyInt
    mesh_error: Float
    stress_33: Float
    temperature: float = 0.0

    @property
    def along(self) -> float:
        """E33, of generalized plane strain."""
        return float(self.strain[2]) if len(self.strain) > 3 else 0.0


def gradient(strain: Float) -> Float:
    """(c, 2) H of the displacements H x, without rotation in the plane, that make a strain (v,)."""
    E11, E22, gamma12 = strain[[0, 1, -1]]
    plane = [[E11, gamma12 / 2], [gamma12 / 2, E22]]
    return np.array(plane if len(strain) == 3 else [*plane, strain[[4, 3]]])
