"""The sections of a case file: which keys they have and what each accepts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from feti_homog.config.schema import Kind, are_reals, as_reals, boolean, choice, integer, is_real, key, real, text

Strain = tuple[float, ...]

MESH_FILE = Kind("the name of a .msh file", lambda v: text.accepts(v) and v.endswith(".msh"), Path)
CIRCULAR = ("square", "hexagonal", "random")
TOUCHING = {"square": math.pi / 4, "hexagonal": math.pi / math.sqrt(12), "random": math.pi / math.sqrt(12)}
"""Fibre fraction at which the fibres touch; of a random cell, that of the densest packing of circles."""

FIBRE = integer(least=1)


def _are_fibres(value: Any) -> bool:
    return value == "all" or (isinstance(value, list) and value != [] and all(map(FIBRE.accepts, value)))


def _are_openings(value: Any) -> bool:
    rising = are_reals(value) and all(a < b for a, b in pairwise(value))
    return rising and value != [] and value[0] >= 0 and value[-1] <= 360


FIBRES = Kind(
    'the number of a fibre, counted from 1, a list of numbers, or "all"',
    lambda v: FIBRE.accepts(v) or _are_fibres(v),
    lambda v: v if v == "all" else tuple(v if isinstance(v, list) else [v]),
)
ARCS = Kind(
    "a list of arcs {fibre, centre, angle}",
    lambda v: isinstance(v, list) and all(isinstance(arc, dict) for arc in v),
    tuple,
)
STRENGTH = Kind(
    "a traction above 0, or inf",
    lambda v: (is_real(v) and v > 0) or (isinstance(v, float) and v == math.inf),
    lambda v: None if v == math.inf else float(v),
)
OPENINGS = Kind("a rising list of numbers from 0 to 360", _are_openings, as_reals)
STRAIN = Kind("a list of three numbers [E11, E22, gamma12]", lambda v: are_reals(v, 3), as_reals)
WAYPOINTS = Kind(
    "a list of strains [E11, E22, gamma12]",
    lambda v: isinstance(v, list) and v != [] and all(are_reals(strain, 3) for strain in v),
    lambda v: tuple(map(as_reals, v)),
)


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

    type: str = key(choice("stiffness", "angle", "path"))
    plane: str = key(choice("strain", "stress"))


@dataclass(frozen=True, kw_only=True)
class Arc:
    """Debonded part of the interface of a fibre, of `angle` degrees in all around the direction `centre`.

    Directions are measured at the fibre's centre from x1 towards x2. `fibre` is "all" or numbers from 1, in the
    order of the arrangement. For type = "angle" the opening is None: [angle] values takes its place.
    """

    fibre: str | tuple[int, ...] = key(FIBRES)
    centre: float = key(real(least=-360.0, most=360.0), default=0.0)
    angle: float | None = key(real(least=0.0, most=360.0), only=("stiffness", "path"))


@dataclass(frozen=True, kw_only=True)
class InterfaceSection:
    """Bonding of fibres and matrix: what is debonded from the start, and the tractions that debond more.

    With `contact` debonded faces do not overlap. A strength of None is unlimited. `criterion`: a node breaks
    when the larger ("max") or the root of the sum of squares ("quadratic") of traction / strength reaches 1.
    """

    contact: bool = key(boolean, default=True)
    debonded: tuple[Arc, ...] = key(ARCS, default=())
    normal_strength: float | None = key(STRENGTH, default=None, only=("path",))
    tangential_strength: float | None = key(STRENGTH, default=None, only=("path",))
    criterion: str = key(choice("max", "quadratic"), default="max", only=("path",))


@dataclass(frozen=True, kw_only=True)
class Angle:
    """Openings of the arcs in degrees, one after the other; without a strain, under the three unit strains."""

    values: tuple[float, ...] = key(OPENINGS)
    strain: Strain | None = key(STRAIN, default=None)


@dataclass(frozen=True, kw_only=True)
class LoadPath:
    """Macroscopic strains [E11, E22, gamma12] that are gone through, straight from 0 to each waypoint.

    `strain` is a single waypoint. method = "events" finds each load factor at which a node breaks;
    "increments" goes through the whole path in so many load steps and in each releases all nodes over their
    strength, or the worst one, until none is over.
    """

    strain: Strain | None = key(STRAIN, default=None)
    waypoints: tuple[Strain, ...] | None = key(WAYPOINTS, default=None)
    method: str = key(choice("events", "increments"), default="events")
    increments: int | None = key(integer(least=1, most=1_000_000), only=("increments",))
    release: str = key(choice("all", "worst"), default="all", only=("increments",))
    max_events: int = key(integer(least=1), default=100_000, only=("events",))

    @property
    def targets(self) -> tuple[Strain, ...]:
        """The waypoints after the unstrained start."""
        if self.waypoints is not None:
            return self.waypoints
        return () if self.strain is None else (self.strain,)


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Into how many subdomains the bodies are cut, or the most unknowns of one; neither: by the ranks."""

    subdomains: int | None = key(integer(least=1, most=1_000_000), default=None)
    max_dofs: int | None = key(integer(least=100), default=None)


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is written. The units are labels only; a deformation scale of None is chosen automatically.

    The stress component drawn is by default ("auto") that of the unit strain.
    """

    fields: bool = key(boolean, default=True)
    pictures: bool = key(boolean, default=True)
    stress: str = key(choice("auto", "S11", "S22", "S12"), default="auto")
    deformation_scale: float | None = key(real(least=0.0), default=None)
    length_unit: str = key(text, default="")
    stress_unit: str = key(text, default="")


SECTIONS: dict[str, type[Any]] = {
    "cell": Cell,
    "analysis": Analysis,
    "interface": InterfaceSection,
    "angle": Angle,
    "path": LoadPath,
    "decomposition": Decomposition,
    "output": Output,
}
