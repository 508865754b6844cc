"""The sections of a case file: which keys they have and what each accepts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.schema import Kind, boolean, choice, integer, key, real, text

MESH_FILE = Kind("the name of a .msh file", lambda v: text.accepts(v) and v.endswith(".msh"), Path)
CIRCULAR = ("square", "hexagonal", "random")
TOUCHING = {"square": math.pi / 4, "hexagonal": math.pi / math.sqrt(12), "random": math.pi / math.sqrt(12)}
"""Fibre fraction at which the fibres touch; of a random cell, that of the densest packing of circles."""


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Geometry of the periodic cell and its mesh.

    `mesh_size` is in widths of the cell, `min_gap` in diameters of a fibre; a radius differs from the mean by
    at most `radius_spread` of that. Of the keys of another geometry nothing is meant.
    """

    geometry: str = key(choice(*CIRCULAR, "mesh"))
    fibre_fraction: float | None = key(real(above=0.0, below=1.0), only=CIRCULAR)
    mesh_size: float = key(real(least=1e-4, most=0.5), default=0.05, only=CIRCULAR)
    refine: int = key(integer(least=0, most=8), default=0)
    order: int = key(integer(least=1, most=2), default=1)
    bodies: str = key(choice("torus", "plane"), default="torus")
    fibres: int | None = key(integer(least=1, most=100_000), only=("random",))
    min_gap: float = key(real(least=0.0, most=1.0), default=0.05, only=("random",))
    seed: int = key(integer(least=0), default=0, only=("random",))
    radius_spread: float = key(real(least=0.0, most=0.5), default=0.0, only=("random",))
    file: Path | None = key(MESH_FILE, only=("mesh",))


@dataclass(frozen=True, kw_only=True)
class Analysis:
    """What is computed, and in which plane state."""

    type: str = key(choice("stiffness"))
    plane: str = key(choice("strain", "stress"))


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Into how many subdomains the bodies are cut, or the most unknowns of one; neither: by the ranks."""

    subdomains: int | None = key(integer(least=1, most=1_000_000), default=None)
    max_dofs: int | None = key(integer(least=100), default=None)


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is written. The units are labels only; a deformation scale of None is chosen automatically."""

    fields: bool = key(boolean, default=True)
    pictures: bool = key(boolean, default=True)
    stress: str = key(choice("S11", "S22", "S12"), default="S11")
    deformation_scale: float | None = key(real(least=0.0), default=None)
    length_unit: str = key(text, default="")
    stress_unit: str = key(text, default="")


SECTIONS: dict[str, type[Any]] = {
    "cell": Cell,
    "analysis": Analysis,
    "decomposition": Decomposition,
    "output": Output,
}
