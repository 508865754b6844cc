"""List the fibres of a case or result as a table, which [cell] geometry = "table" reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from feti_homog.analysis import stored_result
from feti_homog.case import cases, cell_section
from feti_homog.errors import CaseError
from feti_homog.mesh import Torus, arrange, mesh_fibres
from feti_homog.mesh.fill import gmsh_mesher, pixel_mesher
from feti_homog.microstructure import periodic_table, phase_names
from feti_homog.microstructure.shapes import Ellipses, shapes
from feti_homog.typing import Float


def table(source: Path) -> str:
    """Return the fibre table of a case file or result folder as text.  On one rank.

    The table has a row for each fibre and void, with the fibre number.  Ellipses have the columns `a`, `b` and `angle`,
    coatings `coating`, hollow fibres `inner_radius`, polygons `sides` and `corner`.  Exact numbers reproduce the cell.
    Other shapes in a mesh have no radius, and no centre if they wind around the cell.

    Raises:
        CaseError, MeshError: the source is faulty, or does not list its voids.
    """
    fibres = read(source)
    if fibres.lacks_voids:
        raise CaseError(f"{source}: a table lacks voids of images and meshes; result.json lists the fibres by number")
    ellipses = fibres.ellipses
    with np.errstate(invalid="ignore"):  # frames are NaN for other shapes
        is_round = ellipses.are_round
    a, b = np.where(np.isnan(fibres.coatings), np.nan, ellipses.semi_axes.T)  # without a thickness of the coating
    x, y = ellipses.centres.T
    columns = {"x": _words(x), "y": _words(y), "radius": _words(np.where(is_round, a, np.nan))}
    columns["phase"] = list(fibres.phases)
    if not (is_round | np.isnan(a)).all():
        for name, values in (("a", a), ("b", b), ("angle", ellipses.angles)):
            columns[name] = _words(np.where(is_round, np.nan, values))
    if fibres.coatings.any():
        columns["coating"] = _words(fibres.coatings / fibres.radii)
    for name, values in fibres.others.items():
        before = columns.get(name, [""] * len(is_round))
        columns[name] = [new or old for old, new in zip(before, _words(values), strict=True)]
    if fibres.cores.any():
        columns["inner_radius"] = _words(fibres.cores)
    columns["number"] = ["" if name == phase_names.VOID else str(k) for k, name in enumerate(fibres.phases, 1)]
    rows = map(",".join, zip(*columns.values(), strict=True))
    # Every fibre reaches into the cell.
    has_axes = ~np.isnan(a)
    centres, reach = ellipses.centres[has_axes], ellipses.longest[has_axes, None]
    least_corner = (centres - reach).max(axis=0, initial=-np.inf) - fibres.size
    largest_corner = (centres + reach).min(axis=0, initial=np.inf)
    left, bottom = np.clip(fibres.origin, least_corner, largest_corner).tolist()
    width, height = fibres.size.tolist()
    size = f"# width = {width!r}, height = {height!r}, left = {left!r}, bottom = {bottom!r}"
    return "\n".join([size, ",".join(columns), *rows])


def _words(values: Float) -> list[str]:
    """Convert numbers (N,) to exact decimal strings; NaN to an empty string."""
    return ["" if np.isnan(value) else repr(value) for value in values.tolist()]


@dataclass(frozen=True)
class ListedFibres:
    """The N fibres of a periodic cell, in the order of their numbers.

    Attributes:
        size: (2,) width and height.
        ellipses: N circles and ellipses; their centres are as in the table, or within the cell without a table.
        phases: N phase names; in cells that the program meshes, voids follow the fibres.
        coatings: (N,) thickness of the coatings: 0 without a coating, NaN if unknown.
        cores: (N,) radii of the voids within hollow fibres, else 0.
        origin: (2,) lower left corner.
        lacks_voids: whether the cell has voids that the list omits.
        others: table columns (N,) for fibres that are neither discs nor ellipses, NaN for discs and ellipses;
            `ellipses` has discs of equal area for these other fibres, or NaN frames if they are in a mesh.
    """

    size: Float
    ellipses: Ellipses
    phases: tuple[str, ...]
    coatings: Float
    cores: Float
    origin: Sequence[float]
    lacks_voids: bool
    others: Mapping[str, Float] = field(default_factory=dict)

    @property
    def radii(self) -> Float:
        """The radii (N,) of circles, of equal-area discs for ellipses, and NaN without semi-axes."""
        return np.asarray(np.sqrt(self.ellipses.semi_axes.prod(axis=1)))


def read(source: Path) -> ListedFibres:
    """Read the fibres of a case file or result folder.  On one rank.  Raises CaseError or MeshError if faulty."""
    return _of_result(source) if source.is_dir() else _of_cell(cases.load(source).cell)


def _of_result(directory: Path) -> ListedFibres:
    """Read the fibres from result.json, or from the case in it if result.json lacks voids or outlines."""
    document = stored_result.read(directory)
    fibres, cell = document["fibres"], document["cell"]
    is_complete = all("radius" in fibre or "semi_axes" in fibre for fibre in fibres) and not cell.get("porosity")
    if document["case"]["cell"]["geometry"] != "mesh" and not is_complete:
        return _of_cell(cases.parse(document["case"], directory).cell)
    unknown = (np.nan, np.nan)
    centres = np.array([fibre.get("centre") or unknown for fibre in fibres], float).reshape(-1, 2)
    radii = [fibre.get("radius") for fibre in fibres]
    axes = [(r, r) if r else fibre.get("semi_axes") or unknown for r, fibre in zip(radii, fibres, strict=True)]
    a, b = np.array(axes, float).reshape(-1, 2).T
    angles = np.array([fibre.get("angle") or 0.0 for fibre in fibres])
    ellipses = Ellipses.of(centres, a, b, angles)
    phases = tuple(fibre["phase"] for fibre in fibres)
    coatings = np.array([fibre.get("coating") or 0.0 for fibre in fibres])
    cores, has_voids = np.zeros(len(fibres)), bool(cell.get("porosity"))
    size, origin = np.array([cell["width"], cell["height"]]), cell.get("origin", (0.0, 0.0))
    return ListedFibres(size, ellipses, phases, coatings, cores, origin, has_voids)


def _of_cell(cell: cell_section.Cell) -> ListedFibres:
    if cell.has_own_mesh:
        mesh = pixel_mesher.read_cell(cell)
        torus = Torus.of(mesh)
        numbers, is_fibre = mesh_fibres.fibre_numbers(torus)
        ellipses = Ellipses(
            mesh_fibres.fibre_circles(torus)[:, :2] % mesh.period + mesh.origin, mesh_fibres.fibre_frames(torus)
        )
        coatings = mesh_fibres.coating_thickness(numbers, is_fibre, ellipses.semi_axes)
        phases = tuple(mesh.phases[phase] for phase in torus.constituent_phase[is_fibre])
        cores, has_voids = np.zeros(len(phases)), bool(torus.voids)
        return ListedFibres(mesh.period, ellipses[is_fibre], phases, coatings, cores, mesh.origin, has_voids)
    arrangement = arrange.arrange(cell)
    scale = gmsh_mesher.arrangement_scale(cell, arrangement)
    size = scale * arrangement.size
    conics = shapes.elliptic(arrangement.outlines).grown(arrangement.walls)
    centres = scale * conics.centres % size + arrangement.origin
    columns: Mapping[str, Float] = {}
    if cell.table is not None:
        centres = periodic_table.listed_centres(cell.table, cell.window, centres, arrangement.row)
        rows = {name: values[arrangement.row] for name, values in cell.table.columns.items()}
        columns = shapes.columns_without_tips(rows)
    ellipses = Ellipses(centres, scale * conics.frames)
    coatings = scale * (arrangement.coating - arrangement.walls)
    cores = scale * np.where(arrangement.walls > 0, arrangement.radii, 0.0)
    return ListedFibres(size, ellipses, arrangement.phase, coatings, cores, arrangement.origin, False, columns)
