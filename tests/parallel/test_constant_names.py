"""One name for each constant of a cell in space, wherever it is read or printed, and the axes of names of a ply."""

import csv
import io
import re
from itertools import pairwise

import numpy as np
import pytest

from feti_homog import Case, run
from feti_homog.materials.engineering_constants import ABOUT_FIBRES, OF_THE_CELL, constants
from feti_homog.report.cards.effective_material import in_axes_of_the_cell
from feti_homog.report.cards.export import csv_table
from feti_homog.report.text import constant_tables
from feti_homog.report.text.summary import summary
from feti_homog.studies.outputs import outputs
from feti_homog.studies.predictions import responses
from feti_homog.system.runtime.records import plain

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]
# Every constant has a value of its own: no axis of symmetry, couplings of shears.
DISTINCT = {
    "name": "distinct",
    "cell": {"geometry": "random", "fibres": 2, "fibre_fraction": 0.3, "mesh_size": 0.3, "seed": 1},
    "material": {
        "matrix": {"young": 3.0, "poisson": 0.35, "expansion": 5e-5},
        "fibre": {"young": 70.0, "poisson": 0.2, "expansion": 5e-6},
    },
    "analysis": {"type": "stiffness", "plane": "generalized"},
    "output": {"sensitivities": True, "fields": False},
}
CONSTANT = re.compile(r"(E|G|K|nu|expansion)(\d+|_\w+)")


@pytest.fixture(scope="module")
def result():
    from mpi4py import MPI

    case = Case.parse(DISTINCT)
    return case, run(case, MPI.COMM_WORLD)


def test_every_constant_has_one_name(result):
    """No two names, of tables, sweeps, fits and sensitivities, have one value; no name has two."""
    _, found = result
    document = plain(found.document)
    own = dict(zip(found.sensitivities.constants, map(float, found.sensitivities.constant_values), strict=True))
    assert {*responses(found.document)} == {*constants(np.eye(6), np.zeros(6))} == {*own}
    sources = {"sensitivities": own, "sweep": outputs(document)}
    sources["axes of the cell"] = dict(row[:2] for row in constant_tables.cell_constants(document)[0].rows)
    about = constant_tables.cell_constants(document)[1]
    sources["about the fibres"] = dict(
        zip((column.name for column in about.columns[1:]), map(float, about.rows[0][1:]), strict=True)
    )
    values: dict[str, float] = {}
    for source, named in sources.items():
        for name, value in named.items():
            if CONSTANT.fullmatch(name) and not name.endswith("_mesh_error"):
                assert float(value) == pytest.approx(values.setdefault(name, float(value)), rel=1e-2), (source, name)
    assert {*ABOUT_FIBRES} <= values.keys() and {"E1", "nu23", "expansion_x1", "expansion_gamma12"} <= values.keys()
    exact = {name: value for name, value in (own | outputs(document)).items() if name in values and value}
    ordered = pairwise(sorted(exact.items(), key=lambda each: each[1]))
    assert [(one, other) for (one, x), (other, y) in ordered if np.isclose(x, y, rtol=1e-9, atol=0.0)] == []
    assert {column.name for table in constant_tables.sensitivities(document) for column in table.columns[1:]} <= {*own}


def test_cards_have_the_names_of_material_axes(result):
    document = plain(result[1].document)
    cell = outputs(document) | {"nu31": np.nan, "nu32": np.nan}
    card = csv_table(in_axes_of_the_cell(document))
    rows = {row["name"]: float(row["value"]) for row in csv.DictReader(io.StringIO(card))}
    for name, of_the_cell in OF_THE_CELL.items():
        assert np.isnan(cell[of_the_cell]) or rows[name] == pytest.approx(cell[of_the_cell], rel=1e-8)
    for name in ("expansion_axial", "expansion_x1", "expansion_x2"):
        assert rows[name] == pytest.approx(cell[name], rel=1e-8)
    table = constant_tables.table(document)
    assert table.title.startswith("Material axes: 1 along the fibres (x3 of the cell)")
    assert {row[0] for row in table.rows} == {*OF_THE_CELL}
    printed = summary(document)
    assert not re.search(r"alpha\d|exp\.|transv\.|expansion\.\d|\w axial\b", printed)
    assert "Engineering constants, axes of the cell, x3 along the fibres" in printed
