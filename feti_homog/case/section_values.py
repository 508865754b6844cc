"""Define the value types of case sections, and the selectors that decide which keys belong to a case."""

import math
import re
from dataclasses import replace
from itertools import pairwise
from typing import Any

from feti_homog.case.bond_laws import laws_with
from feti_homog.microstructure import phase_names
from feti_homog.schema import keys, types

STRAIN_COMPONENTS = "[E11, E22, gamma12]"
SEED = types.integer(least=0, most=10**15)

MESH_SUFFIXES = (".msh", ".inp", ".vtu", ".vtk", ".mesh")
MESH_FILE = ".msh, .inp, .vtu, .vtk or .mesh file (else: gmsh a.med -save -o a.msh, meshio convert a.xdmf a.vtu)"
IMAGE_SUFFIXES = (".png", ".tif", ".tiff", ".npy", ".npz")
IMAGE_FILE = ".png, .tif, .npy or .npz file"


def _by_phase(words: str, example: str, number: types.ValueType) -> types.ValueType:
    """Return the type of nonempty tables {fibre phase: number}; messages call numbers `words` and quote `example`."""

    def accepts(value: Any) -> bool:
        is_table = isinstance(value, dict) and value != {}
        names_phases = is_table and all(map(phase_names.FIBRE_PHASE.fullmatch, value))
        return names_phases and all(map(number.accepts, value.values()))

    return types.ValueType(
        f"a table by phase of {words}, such as {example}, without matrix, coating and void",
        accepts,
        lambda value: {phase: float(entry) for phase, entry in value.items()},
    )


TABLE_SUFFIXES = (".csv", ".tsv", ".txt", ".dat")
TABLE_FILE = types.file_name("the name of a .csv file", *TABLE_SUFFIXES)
NAMES_OF_COLUMNS = types.list_of(types.text, 'a list of names such as ["x", "y", "radius"]', least=3)
CELL_FILE = types.file_name(
    f"the name of a {MESH_FILE}, of a {IMAGE_FILE} of pixels, or of a table: .csv, .tsv, .txt, .dat (not .xlsx)",
    *(*MESH_SUFFIXES, *IMAGE_SUFFIXES, *TABLE_SUFFIXES),
)
FIBRE_LIST = types.ValueType(
    "a list of fibres such as {x = 0.5, y = 0.5, radius = 0.3}",
    lambda value: isinstance(value, list) and value != [] and all(isinstance(fibre, dict) for fibre in value),
    tuple,
)
FRACTIONS = _by_phase("numbers above 0 and below 1", "{glass = 0.3, carbon = 0.25}", types.real(above=0.0, below=1.0))
_SELECTOR = types.either("", types.text, types.integer(least=0, most=10**9))
_SELECTORS = types.either("", _SELECTOR, types.list_of(_SELECTOR, "", least=1))
PHASES = types.ValueType(
    "a table by phase of names or numbers in the file, or lists of them, such as "
    '{matrix = "Epoxy", fibre = [2, "Glass"]}',
    lambda v: (
        isinstance(v, dict) and v != {} and all(phase_names.PHASE.fullmatch(k) and _SELECTORS.accepts(v[k]) for k in v)
    ),
    lambda v: {phase: tuple(names if isinstance(names, list) else [names]) for phase, names in v.items()},
)
LABELS = types.ValueType(
    'a table of phases, one of them matrix, by number from 0 to 65535, such as {0 = "matrix", 255 = "fibre"}',
    lambda v: (
        isinstance(v, dict)
        and all(re.fullmatch("0|[1-9][0-9]{0,4}", k) and int(k) <= 65535 for k in v)
        and all(name == phase_names.VOID or phase_names.PHASE.fullmatch(str(name)) for name in v.values())
        and phase_names.MATRIX in v.values()
    ),
    dict,
)
VOIDS_OF_A_RANDOM_CELL = types.real(least=0.0, most=0.5)
VOIDS = types.either(f"true for a mesh, or {VOIDS_OF_A_RANDOM_CELL.expected}", VOIDS_OF_A_RANDOM_CELL, types.boolean)
RADII = _by_phase("numbers from 1e-9 to 1e9", "{glass = 6.0, carbon = 3.5}", types.real(least=1e-9, most=1e9))
FIBRE = types.integer(least=1)
FIBRES = replace(
    types.either(
        'the number of a fibre, a list of numbers, or "all"; with "all", `feti-homog fibres CASE.toml` prints numbers',
        *(types.choice("all"), FIBRE, types.list_of(FIBRE, "", least=1)),
    ),
    store=lambda value: value if value == "all" else tuple(value if isinstance(value, list) else [value]),
)
KEPT = types.integer(least=2, most=10**9)
STATES = types.either(f'"all", "peaks" or {KEPT.expected}', types.choice("all", "peaks"), KEPT)
PAIR = types.list_of(types.text, 'the names of two phases, such as ["coating", "matrix"]', count=2, unique=True)
_UNLIMITED = replace(types.POSITIVE_OR_INF, store=lambda value: None if math.isinf(float(value)) else float(value))
STRENGTH = replace(_UNLIMITED, expected="a traction above 0, or inf")
STIFFNESS = replace(_UNLIMITED, expected="a stiffness above 0, or inf")
CONDUCTANCE = replace(_UNLIMITED, expected="a conductance above 0, or inf")
TOUGHNESS = replace(types.real(above=0.0), expected="an energy per area above 0")
NUMBERS_ABOVE = types.list_of(types.real(least=0.0), "a list of two numbers or more, none below 0", least=2, most=1000)
_ANGLES = types.list_of(
    types.real(least=0.0, most=360.0), "a rising list of numbers from 0 to 360", least=1, most=1000, unique=True
)
OPENINGS = replace(_ANGLES, accepts=lambda v: _ANGLES.accepts(v) and all(a < b for a, b in pairwise(v)))
STRAIN = types.list_of(types.real(), f"a list of three numbers {STRAIN_COMPONENTS}", count=3)

ANALYSIS_TYPE = keys.Selector("analysis", "type")
PLANE = keys.Selector("analysis", "plane")
METHOD = keys.Selector("path", "method")
CRITERION = keys.Selector("interface", "criterion", word="law")

MECHANICAL = ANALYSIS_TYPE.among("stiffness", "angle", "path", "load", "envelope")
CONDUCTIVITY = ANALYSIS_TYPE.among("conductivity")
ANGLE_ANALYSIS, PATH_ANALYSIS = ANALYSIS_TYPE.among("angle"), ANALYSIS_TYPE.among("path")
ENVELOPE_ANALYSIS, BREAKING = ANALYSIS_TYPE.among("envelope"), ANALYSIS_TYPE.among("path", "envelope")
BY_ENERGY, BY_TABLE = CRITERION.among(*laws_with("toughness")), CRITERION.among(*laws_with("openings"))
BY_STRENGTH = CRITERION.among(*laws_with("normal_strength"))
BY_AXIAL_STRENGTH = CRITERION.among(*laws_with("axial_strength"))
SOFTENING = CRITERION.among(*laws_with("mixing_exponent"))

IN_THE_PLANE, GENERALIZED = PLANE.among("strain", "stress"), PLANE.among("generalized")
BY_EVENTS, BY_INCREMENTS = METHOD.among("events"), METHOD.among("increments")
