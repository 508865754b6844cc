"""Define the section [cell] of a case file: geometry and mesh of the periodic cell."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from feti_homog.case import section_values as kinds
from feti_homog.microstructure import phase_names
from feti_homog.schema import key, keys, types

FEWEST_MATCHED = 10  # fibres: the distances between fewer fibres have no distribution

if TYPE_CHECKING:
    from feti_homog.microstructure import fibre_pattern, fibre_table


class Lattice(NamedTuple):
    """Equal fibres in a cell of width 1: height, centres, and the fibre fraction at which fibres touch."""

    height: float
    centres: tuple[tuple[float, float], ...]
    touching: float


LATTICES = {
    "square": Lattice(1.0, ((0.5, 0.5),), math.pi / 4),
    "hexagonal": Lattice(math.sqrt(3), ((0.0, 0.0), (0.5, math.sqrt(3) / 2)), math.pi / (2 * math.sqrt(3))),
}
CIRCULAR = (*LATTICES, "random")
TOUCHING = {name: lattice.touching for name, lattice in LATTICES.items()}
TOUCHING["random"] = TOUCHING["hexagonal"]  # the densest packing of circles

GEOMETRY = keys.Selector("cell", "geometry")
ALL_CIRCULAR, RANDOM, TABLE = GEOMETRY.among(*CIRCULAR), GEOMETRY.among("random"), GEOMETRY.among("table")
MESH, PIXELS, OWN_MESH = GEOMETRY.among("mesh"), GEOMETRY.among("pixels"), GEOMETRY.among("mesh", "pixels")
MESHED, SIZED = GEOMETRY.among(*CIRCULAR, "table"), GEOMETRY.among(*CIRCULAR, "table", "pixels")
FROM_A_FILE, REPAIRABLE = GEOMETRY.among("table", "mesh", "pixels"), GEOMETRY.among("table", "mesh")
random_key, meshed_key = partial(key, only=RANDOM), partial(key, only=MESHED)
length_key = partial(key, types.real(least=1e-9, most=1e9), unit="length")


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Geometry of the periodic cell and its mesh. Keys of another geometry keep their defaults.

    Two fields are not keys: `table` has the contents of `file` or `fibre_list` for geometry = "table", with the cell
    size, and `matched` has the fibres of `match`.
    """

    geometry: str = key(
        types.choice(*CIRCULAR, "table", "mesh", "pixels"),
        '"square": one fibre in the middle of a square cell; "hexagonal": fibres in the middle and at the corners of a '
        'cell sqrt(3) times as high as wide; "random": random fibres in a square cell; "table": fibres from a table, '
        'for example of a micrograph; "mesh": a mesh file of gmsh, Abaqus, VTK or Medit; "pixels": a label image.',
    )
    fibre_fraction: float | None = key(
        types.real(above=0.0, below=1.0),
        "Area of the fibres / area of the cell. It must be below the fraction at which fibres touch: pi/4 (square), "
        "pi/sqrt(12) (hexagonal and random; min_gap lowers the limit of random cells).",
        only=ALL_CIRCULAR,
        unless=("match", "mix"),
        default_words="required, or given by match or mix",
    )
    width: float | None = length_key(
        "Width of the cell.", only=MESHED, absent="1, or given by fibre_radius or the table"
    )
    height: float | None = length_key("Height of the cell.", only=TABLE, absent="given by the table")
    fibre_radius: float | None = length_key(
        "Mean radius of the fibres, in place of width.", only=ALL_CIRCULAR, absent="given by width"
    )
    coating: float | None = meshed_key(
        types.real(least=0.01, most=1.0),
        'Thickness of the coating around every fibre / radius of the fibre; the coating has the phase "coating". '
        "fibre_fraction and fibre_radius exclude the coatings, gaps lie between the coatings. The coating of an "
        "ellipse makes both semi-axes longer by coating sqrt(a b).",
        absent="none, or the column coating of a table",
    )
    mesh_size: float = key(
        types.real(least=1e-4, most=0.5),
        "Element size before refine / width of the cell. A mesh has at most 1000000 elements, or 20000000 in cells of "
        "400 or more round fibres and voids; small elements in narrow gaps and thin coatings count.",
        default=0.05,
        only=SIZED,
    )
    interface_size: float | None = meshed_key(
        types.real(least=1e-5, most=0.5),
        "Element size on interfaces, before refine / width of the cell. Away from interfaces, elements grow to "
        "mesh_size by 0.4 times the distance. At most mesh_size.",
        absent="mesh_size",
    )
    tip_size: float | None = meshed_key(
        types.real(least=1e-6, most=0.5),
        "Element size at the tips of debonded arcs, before refine / width of the cell. Away from tips, elements grow "
        "as they do away from interfaces. At most interface_size.",
        absent="chosen so that tips err no more than the rest; in paths and envelopes interface_size",
    )
    refine: int = key(
        types.integer(least=0, most=8),
        "Number of times that every element is split in four; new nodes lie on round and elliptic interfaces.",
        default=0,
    )
    accuracy: float | None = meshed_key(
        types.real(least=1e-7, most=0.1),
        "Largest relative error of the strain energy under any macroscopic strain, and so of the entries of the "
        "effective stiffness. The program then chooses mesh_size, refine and, unless given, order; mesh_size, refine, "
        "interface_size and tip_size must be left out. If the estimated error is larger, a remark names a sufficient "
        "mesh. Paths after bonds break, and polygons with sharp corners, have larger errors.",
        absent="none",
    )
    order: int = key(
        types.integer(least=1, most=2),
        "Order of the triangles. 1: linear triangles, which lock above poisson = 0.49 except in plane stress. 2: "
        "quadratic triangles, curved on round interfaces. Except in plane stress, quadratic triangles of isotropic "
        "phases also have a cubic bubble and a linear pressure, and serve up to poisson = 0.5. With accuracy, the "
        "default is the order that takes fewer nodes.",
        default=1,
        default_words="1, or 2 above poisson = 0.49",
    )
    bodies: str = key(
        types.choice("torus", "plane"),
        '"torus": a fibre that the boundary of the cell cuts is one body; "plane": each part of such a fibre is a '
        "separate body. The stiffness is the same.",
        default="torus",
    )
    fibres: int | None = random_key(
        types.integer(least=1, most=types.MOST_FIBRES),
        "Number of fibres.",
        unless=("match", "radii"),
        default_words="required, or given by match, or by width and radii",
    )
    mix: Mapping[str, float] | None = random_key(
        kinds.FRACTIONS,
        "Fibres of several phases, in place of fibre_fraction: for each phase, area of its fibres / area of the cell. "
        "Each phase needs a section [material.NAME].",
        absent="none",
    )
    radii: Mapping[str, float] | None = random_key(
        kinds.RADII,
        "Mean fibre radius of each phase in mix, in place of fibre_radius. The phases share the number fibres, or as "
        "many as the width allows: each gets the nearest whole number, at least one. The radii of a phase are then "
        "scaled so that its fraction is exact.",
        unit="length",
        absent="equal radii",
    )
    voids: float | bool | None = key(
        kinds.VOIDS,
        "In a random cell: area of the voids / area of the cell; voids lie among the fibres, at least min_gap from "
        "fibres and from each other. In a mesh: true, if holes without elements are voids; else holes are faults.",
        absent="none", only=GEOMETRY.among("random", "mesh"),
    )  # fmt: skip
    void_radius: float | None = random_key(
        types.real(least=0.05, most=20.0),
        "Radius of the voids / mean radius of the fibres. The cell gets the nearest whole number of voids, at least "
        "one; their radius is then scaled so that their fraction is exact.",
        absent="1",
    )
    match: Path | None = key(
        kinds.TABLE_FILE,
        "File, relative to the case file, with a table of the fibres in a micrograph: columns x, y, radius, and a "
        'comment such as "# width = 120, height = 80". The cell gets the ratios of the radii, which fibre_radius '
        "scales, and, as nearly as min_gap allows, the distributions of distances to the two nearest neighbours. "
        "Ellipses count as equal-area discs.",
        absent="none",
        only=RANDOM,
    )
    min_gap: float = random_key(
        types.real(least=0.0, most=1.0), "Smallest gap between fibres / their mean diameter.", default=0.05
    )
    seed: int = random_key(
        kinds.SEED,
        "Seed of the random arrangement; the same seed gives the same cell on any machine and any number of ranks.",
        default=0,
    )
    radius_spread: float = random_key(
        types.real(least=0.0, most=0.5), "Largest deviation of a radius from the mean / mean radius.", default=0.0
    )
    file: Path | None = key(
        kinds.CELL_FILE,
        'Path relative to the case file. With geometry = "mesh": triangles or quadrilaterals, linear or quadratic, '
        'that fill a rectangle, in physical surfaces "matrix", "fibre", "glass", ...; nodes on opposite sides match, '
        "and fibres may have any shape. In Abaqus files (.inp), element sets have these names; in .vtu and .vtk files, "
        'cell data "phase" are 0 in the matrix, 1 in fibre, 2 in fibre:2, ... With "pixels": an image (.png, .tif, '
        '.npy, .npz) with one whole number a pixel, see labels. With "table": one row for each fibre, with columns x, '
        "y, radius and, optionally, phase, coating (thickness / radius) and strength (of its bonds / strength in "
        "[interface]). Ellipses have semi-axes a and b in place of the radius, and the angle from x to a in degrees; "
        "hollow fibres have an inner_radius; rounded polygons have sides, corner, and the angle of the first corner. "
        'Rows of the phase void are voids. Text after # is a comment; "# width = 120, height = 80" gives the size of '
        "the cell.",
        only=FROM_A_FILE,
        absent="required, or fibre_list of a table",
    )
    phases: Mapping[str, tuple[str | int, ...]] | None = key(
        kinds.PHASES,
        "For each phase, its names or numbers in the file, where these differ from the name of the phase: gmsh's "
        "physical surfaces; Abaqus's element sets, or materials of sections; numbers in VTK's cell data; Medit's "
        "references. Capitals do not matter. The entry debonded names lines that are debonded from the start.",
        only=MESH,
        absent="none",
    )
    repair: str = key(
        types.choice("none", "snap", "overlaps"),
        '"snap", for meshes: nodes on sides that nearly match move until they match; the result states how far. '
        '"overlaps", for tables: fibres that touch, or overlap by less than 1 % of a radius, shrink until they '
        "separate; the result names the rows.",
        default="none",
        only=REPAIRABLE,
    )
    snap_tolerance: float = key(
        types.real(least=0.0, most=0.1),
        'Largest move of a node by repair = "snap" / width of the cell.',
        default=1e-3,
        only=MESH,
    )
    boundary: str = key(
        types.choice("periodic", "displacement", "traction"),
        'Conditions on the sides. "displacement": u = E x, for meshes that are not periodic; the result is an upper '
        'bound of the effective stiffness of the material from which the cell was cut. "traction": t = Sigma n, which '
        "gives a lower bound. Neither needs matching nodes; both bounds tend to the effective stiffness as cells grow. "
        'For conductivity they prescribe T = G x and -q n. Only with type = "stiffness" or "conductivity".',
        default="periodic",
        only=OWN_MESH,
    )
    columns: tuple[str, ...] | None = key(
        kinds.NAMES_OF_COLUMNS,
        "Names of the columns of a table, in place of a line of names. Columns other than those of file are ignored.",
        only=TABLE,
        absent="the first line of the table",
    )
    fibre_list: tuple[Mapping[str, Any], ...] | None = key(
        kinds.FIBRE_LIST, "The fibres, as a list in place of file.", only=TABLE, absent="given by file"
    )
    labels: Mapping[str, str] = key(
        kinds.LABELS,
        'The phase, or "void", of each number in an image, such as {0 = "matrix", 255 = "fibre"}.',
        only=PIXELS,
    )
    pixel: float = length_key("Side of a pixel.", default=1.0, only=PIXELS)
    smooth: bool = key(
        types.boolean,
        "With false, each pixel becomes two triangles, whose diagonals alternate. With true, gmsh meshes the regions "
        "within smooth outlines (marching squares of scikit-image) by elements of mesh_size.",
        default=False,
        only=PIXELS,
    )
    window: str = key(
        types.choice("periodic", "cut", "mirrored"),
        'What a table or image shows. "periodic": a periodic cell, whose fibres must not overlap; they shift together '
        'so that the cell sides cut them well, unless a file gives left and bottom. "cut", for tables: a window of a '
        "larger section, whose fibres may overlap across the border; these move apart as little as possible, and "
        'fibres with centres outside are left out. "mirrored", for images: the cell is the image with its three mirror '
        "images, beside it, above it, and diagonally across; tension and shear are then uncoupled.",
        default="periodic",
        only=GEOMETRY.among("table", "pixels"),
    )
    table: fibre_table.FibreTable | None = field(default=None, compare=False)
    matched: fibre_pattern.FibrePattern | None = field(default=None, compare=False)

    @property
    def fractions(self) -> dict[str, float]:
        """Return the fibre fraction of each phase, in name order; empty for cells from a file."""
        if self.mix is not None:
            return dict(sorted(self.mix.items()))
        return {} if self.fibre_fraction is None else {phase_names.FIBRE: self.fibre_fraction}

    @property
    def has_voids(self) -> bool:
        """Return whether the cell has voids or hollow fibres; voids in images do not count."""
        table = self.table
        return bool(self.voids) or (table is not None and bool(table.is_void.any() or table.inner_radius.any()))

    @property
    def has_own_mesh(self) -> bool:
        """Return whether the user provides a mesh, or an image that becomes the mesh."""
        return self.geometry in ("mesh", "pixels")
