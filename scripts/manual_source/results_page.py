"""The page on the files of a run and a sweep, made from the records that the file writers use."""

from collections.abc import Iterable

from markdown_text import code, page, table
from record_tables import Item, items, schema_keys, spatial_items

from feti_homog.analysis.result_records import AnglePoint, EnvelopePoint, LoadPoint, PathPoint
from feti_homog.results.result_json import DescribedColumn, columns
from feti_homog.studies.outputs import COLUMNS, STATISTICS_COLUMNS

INTRODUCTION = """\
Any consistent units: stresses have the unit of the moduli in the case file, lengths have the unit of the cell.
Orders and signs: [README](../README.md#units-order-and-signs). Words in capitals stand for names that vary."""

JSON = """\
All numbers are finite. `KEY[]` is a list, whose entries have the keys listed after the dot, as in `path[].strain`.
Keys without a value are absent."""

HDF5 = """\
n nodes, m elements, k interface nodes, f fibres; nodes are torn: each subdomain has its own nodes. K is the number of
a state, from 0. The states of a stiffness are the unit strains, the states of a path are the points whose numbers
`states` in result.json lists. Every dataset has the attributes `meaning` and `unit`: the label that the case gives to
the unit, if any, and 1 for pure numbers.

In ParaView `result.xdmf` opens the cell and `interface.xdmf` the interface, with the `displacement` of the fibre's
face. The filter Python Annotation, applied to the field data, shows a state's label by
`label.astype("u1").tobytes().decode()`, and the load factor by `load_factor`.

Fields that follow from these fields are not stored. `feti-homog fields DIR` writes all states with fluctuations,
strains, von Mises and principal stresses as `cell.vtkhdf` and `interface.vtkhdf` (ParaView from 5.12 on). With
`--format vtu` it writes a `.vtu` for each state (also for meshio); `cell.pvd` and `interface.pvd` list these files
(PyVista). Times are state numbers, because load factors fall where a path snaps back; `load_factor`, `temperature`,
`mean_strain` and `mean_stress` are field data. In Python `feti_homog.read_state(DIR, K)` returns fields as arrays."""

CASES_CSV = """\
The table of a sweep has a row for each case; `collect` writes the results. i and j stand for 1, 2 or 3; in stiffnesses
of generalized plane strain, for 1 to 6."""

STATISTICS_CSV = """\
Each row has the statistics of one output at one point of the sweep, over the finished realisations. Times, memory,
checks and outputs that are zero in all cases have no row."""

SPATIAL = """\
In generalized plane strain, result.h5 has all entries above; this table lists the entries that change or are new.
Fields do not vary along x3, except for the displacement E33 x3."""


def results() -> str:
    """Return the page on result.json, result.h5 and the tables."""
    keys = table(["key", "type", "unit", "meaning"], [(code(k.path), k.type, k.unit, k.meaning) for k in schema_keys()])
    fields = _fields(items())
    spatial = _fields(spatial_items())
    parts = ["# Results", INTRODUCTION, "## result.json", JSON, keys, "## result.h5", HDF5, fields, SPATIAL, spatial]
    parts += ["## angle.csv", _columns(columns(AnglePoint)), "## path.csv", _columns(columns(PathPoint))]
    parts += ["## load.csv", _columns(columns(LoadPoint))]
    parts += ["## envelope.csv", _columns(columns(EnvelopePoint))]
    parts += ["## cases.csv", CASES_CSV, _columns(COLUMNS), "## statistics.csv", STATISTICS_CSV]
    parts += [_columns(STATISTICS_COLUMNS)]
    return page(*parts)


def _fields(described: Iterable[Item]) -> str:
    rows = [(code(i.path), i.kind, i.shape, i.dtype, i.unit, i.meaning) for i in described]
    return table(["place", "name", "shape", "type", "unit", "meaning"], rows)


def _columns(described: Iterable[DescribedColumn], head: str = "column") -> str:
    return table([head, "unit", "meaning"], [(code(c.name), c.unit, c.meaning) for c in described])
