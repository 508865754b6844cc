"""The reference of what is written has all that small runs write, and nothing else."""

import csv
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import h5py
import pytest
import tomli_w
from manual_source.record_tables import items, schema_keys, spatial_items
from mpi4py import MPI

from feti_homog.analysis.result_records import AnglePoint, EnvelopePoint, PathPoint
from feti_homog.analysis.runner import run
from feti_homog.case.cases import Case
from feti_homog.materials.material_forms import CRITERIA
from feti_homog.results.result_json import columns
from feti_homog.studies import case_runs, collect, sweep_cases
from feti_homog.studies.outputs import COLUMNS, OUTPUT_COLUMNS, STATISTICS_COLUMNS, outputs
from feti_homog.system.runtime.standard_streams import Progress

pytestmark = pytest.mark.slow

TABLE = Path(__file__).parents[2] / "meshes" / "clustered.csv"
BASE = {
    "cell": {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.25},
    "material": {"matrix": {"young": 88.0, "poisson": 0.299}, "fibre": {"young": 200.0, "poisson": 0.222}},
    "output": {"pictures": False},
}
ARC = {"fibre": "all", "centre": 0.0}
HALF_OPEN = {"debonded": [ARC | {"angle": 60.0}]}
STRAIN = [0.1, 0.0, 0.0]
ENERGY = {"normal_stiffness": 900.0, "tangential_stiffness": 300.0, "criterion": "energy", "toughness": 0.005}
COATED = {
    "cell": BASE["cell"] | {"coating": 0.2},
    "material": BASE["material"] | {"coating": {"young": 10.0, "poisson": 0.3}},
}
OUTER, INNER = {"between": ["coating", "matrix"]}, {"between": ["fibre", "coating"]}
IN_SPACE = {
    "plane": "generalized",
    "material": {name: phase | {"expansion": 1e-5} for name, phase in BASE["material"].items()},
}
SOFTENING = {
    "law": "bilinear", "normal_stiffness": 100.0, "tangential_stiffness": 100.0, "normal_strength": 1.0,
    "tangential_strength": 1.0, "normal_toughness": 0.02, "tangential_toughness": 0.02, "teeth": 2,
}  # fmt: skip
ELLIPSE = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": [{"x": 0.5, "y": 0.5, "a": 0.3, "b": 0.2}]}
MATCHED = {"geometry": "random", "match": str(TABLE), "fibres": 10}
VOIDS = {"geometry": "random", "fibre_fraction": 0.3, "fibres": 2, "voids": 0.05}
OPENINGS, PATH, LOAD = {"values": [0, 60]}, {"strain": STRAIN}, {"to": {"E11": 0.01}}
WEAK = {"normal_strength": 1.0}
HASHIN = {name: 1.0 for name in CRITERIA["Hashin"]}
LIMITED = {name: phase | {"strength": HASHIN} for name, phase in BASE["material"].items()}
CASES = {
    "bonded": {"output": BASE["output"] | {"sensitivities": True}},
    "debonded": {"interface": HALF_OPEN},
    "matched": {"cell": MATCHED | {"mesh_size": 0.1}},
    "voids": {"cell": VOIDS | {"mesh_size": 0.1}, "material": LIMITED},
    "ellipse": {"cell": ELLIPSE | {"mesh_size": 0.2}},
    "coated": COATED,
    "stiffness of two interfaces": COATED | {"interface": [OUTER | HALF_OPEN, INNER]},
    "envelope of two interfaces": COATED
    | {"interface": [OUTER | WEAK, INNER | WEAK], "envelope": {"plane": ["S11", "S22"], "directions": 8}},
    "angle of two interfaces": COATED | {"interface": [OUTER | {"debonded": [ARC]}, INNER], "angle": OPENINGS},
    "load on two interfaces": COATED | {"interface": [OUTER | HALF_OPEN, INNER], "load": LOAD},
    "path of two interfaces": COATED | {"interface": [OUTER | HALF_OPEN | ENERGY, INNER | ENERGY], "path": PATH},
    "angle": {"interface": {"debonded": [ARC]}, "angle": OPENINGS},
    "angle of a strain": {"interface": {"debonded": [ARC]}, "angle": OPENINGS | {"strain": STRAIN}},
    "generalized": IN_SPACE,
    "debonded in space": IN_SPACE | {"interface": HALF_OPEN | {"contact": False}},
    "touching in space": IN_SPACE | {"interface": HALF_OPEN},
    "angle in space": IN_SPACE | {"interface": {"debonded": [ARC]}, "angle": OPENINGS},
    "path": {"interface": {"normal_strength": 4.0, "scatter": {"shape": 1000.0}}, "path": PATH},
    "path by energy": {"interface": HALF_OPEN | ENERGY, "path": PATH},
    "path that softens": {"interface": HALF_OPEN | SOFTENING, "path": PATH},
    "path with friction": {"interface": HALF_OPEN | {"friction": 0.3}, "path": PATH},
    "path in space": IN_SPACE
    | {"interface": WEAK, "path": {"waypoints": [{"temperature": -1.0}, {"E22": 0.2, "S13": 0.01}]}},
    "load": {"interface": HALF_OPEN, "load": LOAD},
    "load in space": IN_SPACE | {"load": {"to": {"S22": 0.01, "S13": 0.01, "temperature": -1.0}}},
    "envelope": {
        "interface": WEAK | {"tangential_strength": 1.0},
        "envelope": {"plane": ["S22", "S12"], "directions": 4},
    },
    "envelope in space": {
        "plane": "generalized",
        "interface": {"axial_strength": 1.0},
        "envelope": {"plane": ["S22", "S13"], "directions": 4},
    },
    "conductivity": {
        "analysis": {"type": "conductivity"},
        "material": {"matrix": {"conductivity": 0.2}, "fibre": {"conductivity": 1.0}},
    },
    "envelope by energy": {"interface": ENERGY, "envelope": {"plane": ["E11", "E22"], "directions": 4}},
}
SWEEP = {"sweep": {"cell.mesh_size": [0.25, 0.3]}}


def document(name: str) -> dict[str, Any]:
    """Return a case of the analysis that has a section of its name, or else of the stiffness."""
    sections = dict(CASES[name])
    kind = next((kind for kind in ("angle", "envelope", "load", "path") if kind in sections), "stiffness")
    return BASE | {"analysis": {"type": kind, "plane": sections.pop("plane", "strain")}} | sections


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Provide a folder of results of each case."""
    root = tmp_path_factory.mktemp("results")
    for name in CASES:
        run(Case.parse(document(name)), root / name, Progress(MPI.COMM_SELF, quiet=True))
    return {name: root / name for name in CASES}


@pytest.fixture(scope="module")
def documents(folders) -> list[dict[str, Any]]:
    return [json.loads((folder / "result.json").read_text()) for folder in folders.values()]


@pytest.fixture(scope="module")
def sweep_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "sweep.toml").write_text(tomli_w.dumps(document("path") | SWEEP))
    case_runs.run_all(sweep_cases.load(folder / "sweep.toml"), folder / "cases", MPI.COMM_SELF, 1, False, True)
    collect.collect(folder / "cases", pictures=False)
    return folder / "cases"


def paths_of(value: Any, above: str = "") -> Iterator[str]:
    """Yield the places of a document as the reference writes them; a case is not gone into."""
    entries = value.items() if isinstance(value, dict) else ()
    for name, item in entries:
        yield f"{above}{name}"
        if isinstance(item, list) and item and isinstance(item[0], dict):
            yield from (path for entry in item for path in paths_of(entry, f"{above}{name}[]."))
        elif (above, name) != ("", "case"):
            yield from paths_of(item, f"{above}{name}.")


def unmatched(names: Iterable[str], patterns: Iterable[str]) -> tuple[set[str], set[str]]:
    """Return the names that are of no pattern and the patterns that are of no name.

    Capitals, i and j stand for anything.
    """
    expressions = {pattern: expression(pattern) for pattern in patterns}
    names = set(names)
    unknown = {name for name in names if not any(e.fullmatch(name) for e in expressions.values())}
    return unknown, {p for p, e in expressions.items() if not any(map(e.fullmatch, names))}


def expression(pattern: str) -> re.Pattern[str]:
    words = re.escape(pattern)
    words = re.sub(r"(?<=[CSk])(ij|ii)", r"[1-6][1-6]", words)
    return re.compile(re.sub(r"(?<![A-Za-z])([A-Z]{2,}|K)(?![a-z])", ".+", words))


def test_keys_of_result_json(documents):
    found = {path for document in documents for path in paths_of(document)}
    unknown, unused = unmatched(found, {key.path for key in schema_keys()})
    # No case here has options of the solver.
    assert (unknown, unused) == (set(), {"case.KEY", "solver.options", "solver.options.OPTION"})


@pytest.mark.parametrize(
    ("name", "described"), [("debonded", set(items())), ("debonded in space", {*items(), *spatial_items()})]
)
def test_datasets_and_attributes_of_result_h5(folders, name, described):
    found = set()

    def note(name: str, item: Any) -> None:
        place = f"/{name}".rstrip("/")
        if isinstance(item, h5py.Dataset):
            found.add((place, "dataset"))
            assert set(item.attrs) == {"meaning", "unit"}, place
        else:
            found.update((place or "/", f"attribute {attribute}") for attribute in item.attrs)

    with h5py.File(folders[name] / "result.h5") as file:
        note("", file)
        file.visititems(note)
    states = {(re.sub(r"^((?:/(?:vector|tensor|column))?/state)/\d+", r"\1/K", place), kind) for place, kind in found}
    assert states == {(item.path, item.kind) for item in described}


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("angle", AnglePoint),
        ("angle in space", AnglePoint),
        ("angle of a strain", AnglePoint),
        ("path", PathPoint),
        ("path by energy", PathPoint),
        ("envelope", EnvelopePoint),
        ("envelope by energy", EnvelopePoint),
        ("envelope in space", EnvelopePoint),
    ],
)
def test_columns_of_the_tables_of_points(folders, name, kind):
    with (folders[name] / f"{name.split()[0]}.csv").open() as stream:
        (header, *_) = csv.reader(stream)
    described = [column.name for column in columns(kind)]
    assert header == [name for name in described if name in header]


def test_columns_of_sweeps(documents, sweep_folder):
    found = {name for document in documents for name in outputs(document)}
    assert unmatched(found, {column.name for column in OUTPUT_COLUMNS}) == (set(), set())
    for name, described in (("cases.csv", COLUMNS), ("statistics.csv", STATISTICS_COLUMNS)):
        with (sweep_folder / name).open() as stream:
            header = next(csv.reader(stream))
        assert not unmatched(header, {column.name for column in described})[0]
