"""The mesh, the interface nodes and the fibres as result.h5 has them."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.typing import AnyInt, Float, Int


@dataclass(frozen=True)
class Mesh:
    """n nodes and m elements; each subdomain has nodes of its own.

    Attributes:
        points: (n, 2).
        triangles: (m, 3 or 6) vertices, then the nodes on the sides 01, 12, 20.
        subdomain, phase, body: (m,) of the elements; phase 0 is the matrix.
    """

    points: Float
    triangles: Int
    subdomain: AnyInt
    phase: AnyInt
    body: AnyInt


@dataclass(frozen=True)
class InterfaceRows:
    """The k interface nodes.

    Attributes:
        points: (k, 2).
        normal: (k, 2) from fibre to matrix.
        length: (k,) tributary length.
        fibre: (k,) number of the fibre, from 1.
        body: (k,) of the fibre, or of its coating.
        pair: (k,) place of its section among those of the interfaces.
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
