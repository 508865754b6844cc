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


@dataclass(frozen=True, kw_only=True)
class Cell:
    """Geometry of the periodic cell and its mesh. Keys of another geometry keep their defaults.

    Two fields are not keys: `table` has the contents of `file` or `fibre_list` for geometry = "table", with the cell
    size, and `matched` has the fibres of `match`.
    """

    geometry: str = key(
        types.choice(*CIRCULAR, "table", "mesh", "pixels"),
        '"square": a fibre in the middle of a square cell; "hexagonal": a cell sqrt(3) times as high as wide with '
        'fibres in the middle and at the corners; "random": fibres in a square cell; "table": fibres of a table, as of '
        'a micrograph; "mesh": a file of gmsh, Abaqus or VTK; "pixels": an image of labels.',
    )
    fibre_fraction: float | None = key(
        types.real(above=0.0, below=1.0),
        "Area of the fibres / area of the cell, below that at which they touch: pi/4 (square), pi/sqrt(12) "
        "(hexagonal; random, where min_gap lowers it).",
        only=ALL_CIRCULAR,
        unless=("match", "mix"),
        default_words="required, or given by match or mix",
    )
    width: float | None = meshed_key(
        types.real(least=1e-9, most=1e9),
        "Width of the cell.",
        unit="length",
        absent="1, or given by fibre_radius or the table",
    )
    height: float | None = key(
        types.real(least=1e-9, most=1e9), "Height of the cell.", unit="length", only=TABLE, absent="given by the table"
    )
    fibre_radius: float | None = key(
        types.real(least=1e-9, most=1e9),
        "Mean radius of the fibres, in place of width.",
        unit="length",
        only=ALL_CIRCULAR,
        absent="given by width",
    )
    coating: float | None = meshed_key(
        types.real(least=0.01, most=1.0),
        'Thickness of the coatings of all fibres / radius of the fibre, which is within; of the phase "coating". '
        "fibre_fraction and fibre_radius are those without them, gaps those with them. Coatings of ellipses make both "
        "semi-axes longer by coating sqrt(a b).",
        absent="none, or the column coating of a table",
    )
    mesh_size: float = key(
        types.real(least=1e-4, most=0.5),
        "Size of the elements, before refine, / width of the cell. At most 1000000 are made, 20000000 in cells of 400 "
        "or more round fibres and voids, counting the small ones in narrow gaps and thin coatings.",
        default=0.05,
        only=SIZED,
    )
    interface_size: float | None = meshed_key(
        types.real(least=1e-5, most=0.5),
        "Size of the elements on interfaces, before refine, / width of the cell; from there they grow to mesh_size, by "
        "0.4 of the distance. At most mesh_size.",
        absent="mesh_size",
    )
    tip_size: float | None = meshed_key(
        types.real(least=1e-6, most=0.5),
        "Size of the elements at the tips of debonded arcs, before refine, / width of the cell; from there they grow "
        "like those on interfaces. At most interface_size.",
        absent="such that tips err no more than the rest; of paths and envelopes interface_size",
    )
    refine: int = key(
        types.integer(least=0, most=8),
        "How many times every element is split in four, on the ranks; new nodes follow round and elliptic interfaces.",
        default=0,
    )
    accuracy: float | None = meshed_key(
        types.real(least=1e-7, most=0.1),
        "Largest relative error of the strain energy under any macroscopic strain, and so of the entries of the "
        "effective stiffness: mesh_size and refine are chosen, which it excludes with interface_size and tip_size, and "
        "order, unless it is given. If the estimated error is more, a remark names the mesh that would do. It is not "
        "that of paths after bonds break, nor of polygons with sharp corners.",
        absent="none",
    )
    order: int = key(
        types.integer(least=1, most=2),
        "Order of the triangles. 1: linear; they lock above poisson = 0.49, but in plane stress. 2: quadratic, curved "
        "on round interfaces; those of phases with isotropic constants, but in plane stress, have a cubic bubble and a "
        "linear pressure of their own and serve up to poisson = 0.5. With accuracy that of the two which takes fewer "
        "nodes, unless it is given.",
        default=1,
        default_words="1, or 2 above poisson = 0.49",
    )
    bodies: str = key(
        types.choice("torus", "plane"),
        '"torus": a fibre that the boundary of the cell cuts is one body; "plane": its parts are bodies of their own. '
        "The stiffness is the same.",
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
        "Fibres of several phases, in place of fibre_fraction: the area of those of each / area of the cell. Each "
        "needs its [material.NAME].",
        absent="none",
    )
    radii: Mapping[str, float] | None = random_key(
        kinds.RADII,
        "Mean radius of the fibres of each phase of mix, in place of fibre_radius. Of fibres, or of as many as a cell "
        "of this width takes, each phase gets the nearest whole number, at least one; its radii are then scaled such "
        "that its fraction is exact.",
        unit="length",
        absent="equal ones",
    )
    voids: float | bool | None = key(
        kinds.VOIDS,
        "Of a random cell voids among the fibres, min_gap from them and from each other: their area / area of the "
        "cell. Of a mesh, true: where it has no elements there are voids; without it such holes are faults.",
        absent="none", only=GEOMETRY.among("random", "mesh"),
    )  # fmt: skip
    void_radius: float | None = random_key(
        types.real(least=0.05, most=20.0),
        "Radius of the voids / mean radius of the fibres. There is the nearest whole number of voids, at least one; "
        "their radius is then scaled such that their fraction is exact.",
        absent="1",
    )
    match: Path | None = key(
        kinds.TABLE_FILE,
        "A table of the fibres in a window of a micrograph, relative to the case file: columns x, y, radius, and a "
        'comment such as "# width = 120, height = 80". The cell gets its radii and, as near as can be, its '
        "distributions of the distances of nearest and second neighbours, but none below min_gap. Ellipses count as "
        "discs of the same area.",
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
        types.real(least=0.0, most=0.5), "Largest difference of a radius from the mean / mean radius.", default=0.0
    )
    file: Path | None = key(
        kinds.CELL_FILE,
        'Relative to the case file. Of geometry = "mesh" the mesh: triangles of three or six nodes that fill a '
        'rectangle, in physical surfaces "matrix", "fibre", "glass", ...; the nodes on opposite sides match. Fibres '
        "may have any shape. Of Abaqus' files (.inp) element sets have these names; of .vtu and .vtk files cell data "
        '"phase" are 0 in the matrix, 1 in fibre, 2 in fibre:2, ... Of "pixels" the image (.png, .tif, .npy, .npz), a '
        'whole number each, see labels. Of "table" the fibres, a row for each: columns x, '
        "y, radius and, if there are any, phase, coating (thickness / radius) and strength "
        "(of its bonds / that of [interface]); of ellipses a and b, the semi-axes, in place of the radius, and angle "
        "from x to a in degrees; of hollow fibres inner_radius; of rounded polygons sides and corner, with the angle "
        "of the first corner. Rows of the phase void are voids. What "
        'follows # is a comment, of which "# width = 120, height = 80" gives the size of the cell.',
        only=FROM_A_FILE,
        absent="required, or fibre_list of a table",
    )
    phases: Mapping[str, tuple[str | int, ...]] | None = key(
        kinds.PHASES,
        "Names and numbers in the file, by the phase that they are of, where they are not the phases' names: physical "
        "surfaces of gmsh; element sets and materials of sections of Abaqus; numbers of VTK's cell data and Medit's "
        "references. Capitals do not matter. debonded has those of lines that are debonded from the start.",
        only=MESH,
        absent="none",
    )
    repair: str = key(
        types.choice("none", "snap", "overlaps"),
        '"snap", of a mesh: nodes on sides that nearly match are moved to match; the result has how far. "overlaps", '
        "of a table: fibres that touch, or overlap by less than 1 % of a radius, are made smaller until they do not; "
        "the result names the rows.",
        default="none",
        only=REPAIRABLE,
    )
    snap_tolerance: float = key(
        types.real(least=0.0, most=0.1),
        'How far nodes may be moved by repair = "snap" / width of the cell.',
        default=1e-3,
        only=MESH,
    )
    boundary: str = key(
        types.choice("periodic", "displacement", "traction"),
        'Conditions on the sides. "displacement": u = E x, for meshes that are not periodic; the stiffness is then an '
        'upper bound of the effective one of the material that the cell is a piece of. "traction": t = Sigma n, its '
        "lower bound. Neither needs matching nodes, and both tend to the effective stiffness as cells grow; of "
        'conductivity they prescribe T = G x and -q n. They belong to type = "stiffness" and "conductivity".',
        default="periodic",
        only=OWN_MESH,
    )
    columns: tuple[str, ...] | None = key(
        kinds.NAMES_OF_COLUMNS,
        "Names of the columns of a table, in place of a line of names; others than those of file are not read.",
        only=TABLE,
        absent="the first line of the table",
    )
    fibre_list: tuple[Mapping[str, Any], ...] | None = key(
        kinds.FIBRE_LIST, "The fibres, in place of file.", only=TABLE, absent="given by file"
    )
    labels: Mapping[str, str] = key(
        kinds.LABELS,
        'The phase of each number in an image, such as {0 = "matrix", 255 = "fibre"}, or "void".',
        only=PIXELS,
    )
    pixel: float = key(types.real(least=1e-9, most=1e9), "Edge of a pixel.", unit="length", default=1.0, only=PIXELS)
    smooth: bool = key(
        types.boolean,
        "Of an image: with false each pixel is two triangles, by turns along one diagonal and the other; with true "
        "gmsh meshes the regions within smooth outlines (marching squares of scikit-image), by mesh_size.",
        default=False,
        only=PIXELS,
    )
    window: str = key(
        types.choice("periodic", "cut", "mirrored"),
        'What a table or image is. "periodic": a cell, whose fibres must not overlap; all are shifted so that its '
        'sides cut them well, unless a file gives left and bottom. "cut", of a table: a piece of something larger, '
        "whose fibres may overlap across the border: they are moved apart as little as can be. Those with centres "
        'outside are left out. "mirrored", of an image: beside and above it lie its mirror images, four in a cell.',
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
        """Return whether the cell has voids, as far as the case tells without a user's mesh."""
        table = self.table
        return bool(self.voids) or (table is not None and bool(table.is_void.any() or table.inner_radius.any()))

    @property
    def has_own_mesh(self) -> bool:
        """Return whether the user provides the mesh, or an image of it."""
        return self.geometry in ("mesh", "pixels")
