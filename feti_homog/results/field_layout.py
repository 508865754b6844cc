"""Define the layout of result.h5: the parts that ranks write, their paths in the file, and views for viewers.

Lengths have the unit of the cell, stresses the unit of the moduli.  The file has n nodes, m elements, k interface nodes
and f fibres, distributed over the ranks.  Nodes are torn: each body in each subdomain has its own nodes.  Views show
tables as vectors with three components, tensors or single columns.  They are virtual and take almost no space: HDF5
fills them from other datasets when a viewer reads them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from feti_homog.materials import voigt
from feti_homog.system.runtime import described, records
from feti_homog.typing import AnyInt, Float, Float32

PROGRAM = "feti_homog"
GROUP_OF_STATES = "state/K"


@dataclass(frozen=True)
class Header:
    """The attributes of result.h5: case, program version, cell, mesh and units."""

    title: str = described("name of the case")
    version: str = described("version of the program")
    width: float = described("width of the cell", records.LENGTH)
    height: float = described("height of the cell", records.LENGTH)
    order: int = described("order of the elements: 1, or 2 with curved sides at interfaces")
    refine: int = described("how often every triangle of the coarse mesh was cut in four")
    phases: tuple[str, ...] = described("names of the phases", shape="(p,)")
    length_unit: str = described("label of the unit of lengths, may be empty", default="")
    stress_unit: str = described("label of the unit of stresses, may be empty", default="")
    origin: tuple[float, float] = described("lower left corner of the cell", records.LENGTH, "(2,)", default=(0.0, 0.0))
    case: str = described("the case with its defaults as JSON, the same as `case` of result.json", default="{}")


@dataclass(frozen=True)
class MeshPart:
    """This rank's n nodes and m triangles, one subdomain after the other.

    Nodes are torn between subdomains and bodies.  The 4**refine triangles of each coarse triangle are consecutive.
    """

    points: Float = described("positions of the nodes", records.LENGTH, "(n, 2)")
    triangles: AnyInt = described(
        "nodes of the elements, from 0: vertices, then, for order 2, the mid-side nodes 01, 12, 20",
        shape="(m, 3 or 6)", dtype="int64",
    )  # fmt: skip
    body: AnyInt = described("body of each element, from 0, the matrix", shape="(m,)", dtype="int32")
    subdomain: AnyInt = described(
        "subdomain of each element, from 0; if subdomains extend across materials, each part in one body has a number",
        shape="(m,)",
        dtype="int32",
    )
    rank: AnyInt = described("rank that computed each element, from 0", shape="(m,)", dtype="int32")
    phase: AnyInt = described("phase of each element, a place in `phases`", shape="(m,)", dtype="int32")
    fibre_number: AnyInt = described(
        "number of the fibre, from 1, in the fibre and its coating; 0 in the matrix", shape="(m,)", dtype="int32"
    )


@dataclass(frozen=True)
class FibrePart:
    """The f fibres, all on the first rank, numbered as in case files."""

    number: AnyInt = described("number in `fibre = N` of case files, from 1", shape="(f,)", dtype="int32")
    body: AnyInt = described("body in /mesh/body", shape="(f,)", dtype="int32")
    phase: AnyInt = described("phase, a place in `phases`", shape="(f,)", dtype="int32")
    centre: Float = described(
        "centre of the circle, in the cell, or area centroid of a fibre that is not round; NaN if it winds around",
        records.LENGTH,
        "(f, 2)",
    )
    radius: Float = described("radius; NaN for a fibre that is not round", records.LENGTH, "(f,)")
    strength: Float = described("strength of the fibre's bonds / strength in [interface]", shape="(f,)")


@dataclass(frozen=True)
class InterfacePart:
    """The k fibre-matrix interface nodes whose multipliers this rank owns; k may be 0."""

    points: Float = described("positions of the interface nodes", records.LENGTH, "(k, 2)")
    normal: Float = described("unit normals (n1, n2), from fibre to matrix; tangents are (-n2, n1)", shape="(k, 2)")
    length: Float = described("tributary length: interface length that a node represents", records.LENGTH, "(k,)")
    fibre: AnyInt = described("body of the fibre, or of its coating", shape="(k,)", dtype="int32")
    fibre_number: AnyInt = described("number of the fibre, from 1", shape="(k,)", dtype="int32")
    pair: AnyInt = described("index, from 0, of the node's section [[interface]]", shape="(k,)", dtype="int32")
    fibre_node: AnyInt = described("a node of the mesh on the fibre's face, from 0", shape="(k,)", dtype="int64")
    vertex: AnyInt = described("the interface node, from 0, as an element for viewers", shape="(k, 1)", dtype="int64")
    matrix_node: AnyInt = described(
        "a node of the mesh on the matrix's face, from 0, at the place of `fibre_node` or at a periodic image of it",
        shape="(k,)",
        dtype="int64",
    )


@dataclass(frozen=True, repr=False)
class StatePart:
    """A stored state: its macroscopic strains and stresses, its label, and this rank's part of the fields."""

    strain: Float = described(f"macroscopic strain {', '.join(voigt.STRAINS)}", shape="(3,)")
    stress_mean: Float = described(f"mean stress {', '.join(voigt.STRESSES)}", records.STRESS, "(3,)", name="stress")
    load_factor: float = described("position on the path, 0 to 1; 1 for other analyses")
    point: int = described("number, from 0, of the state's point in `path` or `angle` of result.json; else 0")
    label: str = described("label of the state, such as `E11`, `60 deg E11`, `event 12`")
    displacement: Float = described(
        "displacement, including the displacement E x of the macroscopic strain, x from the lower left corner",
        records.LENGTH,
        "(n, 2)",
    )
    stress: Float = described(f"element means, {', '.join(voigt.STRESSES)}", records.STRESS, "(m, 3)")
    stress_33: Float = described(
        "stress 33, out of the plane: 0 in plane stress, NaN where the material's constants do not determine it",
        records.STRESS,
        "(m,)",
    )
    mesh_error: Float32 = described(
        "share of each element in the estimated error of the strain energy / strain energy of the cell; NaN without "
        "`mesh_error` in [output]",
        shape="(m,)",
        dtype="float32",
    )
    traction: Float = described("sigma n, normal (tension positive) and tangential", records.STRESS, "(k, 2)")
    jump: Float = described(
        "gap and slip: displacement of the matrix minus that of the fibre, normal and tangential",
        records.LENGTH,
        "(k, 2)",
    )
    traction_vector: Float = described("`traction` as (x, y, z), z `axial_traction` or 0", records.STRESS, "(k, 3)")
    jump_vector: Float = described("`jump` as (x, y, z), z `axial_jump` or 0", records.LENGTH, "(k, 3)")
    displacement_fibre: Float = described("displacement (x, y, z) of the fibre's face", records.LENGTH, "(k, 3)")
    displacement_matrix: Float = described(
        "displacement (x, y, z) of the matrix's face, at the same place: `displacement_fibre` plus `jump_vector`",
        records.LENGTH,
        "(k, 3)",
    )
    status: AnyInt = described("0 bonded, 1 closed (debonded, in contact), 2 open", shape="(k,)", dtype="int8")
    damage: Float = described("damage of bonds: 0 intact, 1 broken; between only by laws that soften", shape="(k,)")
    sliding: AnyInt = described(
        "sign of the growing slip where faces slide with friction; 0 elsewhere, where closed faces stick",
        shape="(k,)",
        dtype="int8",
    )

    def __repr__(self) -> str:
        sizes = f"{len(self.displacement)} nodes, {len(self.stress)} elements, {len(self.status)} interface nodes"
        return f"{type(self).__name__}({self.label!r}, {sizes})"


def tables(part: Any) -> dict[str, records.Description]:
    """Return descriptions, by name, of the fields of `part` that have rows; they become datasets."""
    return {name: d for name, d in records.descriptions(part).items() if rows_of(d)}


def attributes(part: Any) -> dict[str, Any]:
    """Return the values, by attribute name, of the fields of `part` that have no rows; they become attributes."""
    return {d.name or name: getattr(part, name) for name, d in records.descriptions(part).items() if not rows_of(d)}


def rows_of(description: records.Description) -> str:
    """Return the letter for the row count of a dataset (n, m, k or f, see the module); "" for attributes."""
    first = description.shape[1:2]
    return first if first in ("n", "m", "k", "f") else ""


@dataclass(frozen=True, kw_only=True, repr=False)
class SpatialStatePart(StatePart):
    """One state in generalized plane strain or conduction, and this rank's part of its fields.

    Fields are constant along x3, except for the displacement E33 x3.  In conduction the displacement along x3 is the
    temperature, and stresses 33, 23 and 13 are minus the flux.
    """

    strain: Float = described(f"macroscopic strain {', '.join(voigt.SPATIAL_STRAINS)}", shape="(6,)")
    stress_mean: Float = described(
        f"macroscopic stress {', '.join(voigt.SPATIAL_STRESSES)}", records.STRESS, "(6,)", name="stress"
    )
    temperature: float = described("change of temperature", "temperature")
    stress_33: Float = described("stress 33, along the fibres", records.STRESS, "(m,)")
    axial_displacement: Float = described(
        "displacement along x3 at x3 = 0, including that of the macroscopic strain", records.LENGTH, "(n,)"
    )
    axial_stress: Float = described(f"element means, {', '.join(voigt.AXIAL_STRESSES)}", records.STRESS, "(m, 2)")
    axial_traction: Float = described("sigma n along x3", records.STRESS, "(k,)")
    axial_jump: Float = described("slip along x3: matrix displacement minus fibre displacement", records.LENGTH, "(k,)")


@dataclass(frozen=True)
class View:
    """A virtual dataset /`kind`/GROUP/`name`, filled from datasets of /GROUP.

    Attributes:
        components: column count; 0 for a dataset with one dimension.
        source: dataset that provides type and unit.
        columns: for each nonzero column, the source dataset and source column; None for the whole dataset.
        meaning: description in words.
    """

    kind: str
    name: str
    components: int
    source: str
    columns: Mapping[int, tuple[str, int | None]]
    meaning: str

    def path(self, group: str) -> str:
        """Return the path of the view in the file; `group` is the path of its datasets, such as state/0."""
        return f"{self.kind}/{group}/{self.name}"


def _vector(name: str, third: str = "") -> View:
    columns = {0: (name, 0), 1: (name, 1)} | ({2: (third, None)} if third else {})
    sentence = f"`{name}` with `{third}` as third component" if third else f"`{name}` with a third component 0"
    return View("vector", name, 3, name, columns, sentence)


def _stress_tensor(axial: Sequence[str] = ()) -> View:
    """Return the view of the stress tensor; `axial` names shears along x3, which are 0 if it is empty."""
    entries: dict[str, tuple[str, int | None]] = {"33": ("stress_33", None)}
    entries |= {name[1:]: ("stress", column) for column, name in enumerate(voigt.STRESSES)}
    entries |= {name[1:]: ("axial_stress", column) for column, name in enumerate(axial)}
    places = enumerate(("11", "12", "13", "12", "22", "23", "13", "23", "33"))
    columns = {place: entries[entry] for place, entry in places if entry in entries}
    sentence = "tensor of `stress`, rows of [[11, 12, 13], [12, 22, 23], [13, 23, 33]]"
    return View("tensor", "stress", 9, "stress", columns, sentence)


def _column(name: str, source: str, column: int) -> View:
    return View("column", name, 0, source, {0: (source, column)}, f"column {column} of `{source}`")


COLUMNS = (
    *(_column(name, "stress", column) for column, name in enumerate(voigt.STRESSES)),
    *(_column(f"{table}_{name}", table, k) for table in ("traction", "jump") for k, name in enumerate("nt")),
)
AXIAL = "axial_displacement"  # dataset of states that are not plane

# The views of each group; /state/K stands for every state.
VIEWS: dict[str, tuple[View, ...]] = {
    "interface": (_vector("normal"),),
    GROUP_OF_STATES: (_vector("displacement"), _stress_tensor(), *COLUMNS),
}

# The views of a state in generalized plane strain or conduction.
SPATIAL_VIEWS: tuple[View, ...] = (
    _vector("displacement", AXIAL),
    _stress_tensor(voigt.AXIAL_STRESSES),
    *COLUMNS,
    *(_column(name, "axial_stress", column) for column, name in enumerate(voigt.AXIAL_STRESSES)),
)


def views_of(file: Any, state: int | None = None) -> list[tuple[str, View]]:
    """Return pairs of group and view for the views of one or all states whose tables exist and have rows."""
    groups = {"interface": VIEWS["interface"]}
    for group in (f"state/{number}" for number in sorted(map(int, file.get("state", ()))) if state in (None, number)):
        groups[group] = SPATIAL_VIEWS if AXIAL in file[group] else VIEWS[GROUP_OF_STATES]
    return [
        (group, view)
        for group, views in groups.items()
        for view in views
        if {view.source, *(name for name, _ in view.columns.values())} <= file[group].keys()
        and len(file[group][view.source]) > 0
    ]
