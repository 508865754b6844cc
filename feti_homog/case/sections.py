"""Define the sections of a case file, with [sweep] and the fit tables: keys, values and meanings.

[petsc] has the PETSc options of the solver without their dash.  PETSc reads its own options, such as -log_view, when it
starts, so they belong on the command line.
"""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.case.cell_section import Cell
from feti_homog.case.interface_section import Arc, InterfaceSection, Scatter
from feti_homog.case.load_sections import Angle, Envelope, LoadPath, MixedLoad, SingleLoad
from feti_homog.case.section_values import ANALYSIS_TYPE, MECHANICAL, PATH_ANALYSIS, SEED, STATES
from feti_homog.materials import material_forms
from feti_homog.schema import key, keys, types, wording

Scalar = str | int | float | bool

OPTION_EXPECTED = "a string, a number, true or false"
SWEEP = "sweep"
UNCERTAINTY, CORRELATION = "uncertainty", "correlation"
DIFFERENTIABLE = ("stiffness", "load", "conductivity")
"""Analysis types with sensitivities."""
UNKNOWN, MEASURED, TEST, CURVE = "unknown", "measured", "test", "curve"
FIT_SECTIONS = (UNKNOWN, MEASURED, TEST)
STD = types.real(above=0.0)

AXIS_EXPECTED = "a list of values, or a range {from, to} with step, with count, or with samples in [sweep]"
AXIS_MEANING = (
    "Values of any key of the file, which replace its value in the section. A section may get a list of tables, each "
    'of which is merged into it: cell = [{geometry = "square"}, {geometry = "random", fibres = 30}]; further keys of '
    'that section are then quoted: "cell.refine" = [0, 1].'
)

RANGE_KEYS = {
    "from": keys.Key(types.real(), "First value, below the last.", required=True),
    "to": keys.Key(types.real(), "Last value.", required=True),
    "step": keys.Key(types.real(above=0.0), "Distance between values, at most to - from; for linear ranges."),
    "count": keys.Key(
        types.integer(least=2, most=types.MOST_ROWS),
        "Number of values, both ends included. Without step and count, samples in [sweep] gives the number.",
    ),
    "scale": keys.Key(
        types.choice("linear", "log"), '"log": values with a constant ratio, above 0.', default='"linear"'
    ),
}
"""Keys of a range; not a dataclass, because `from` is a keyword of Python."""


@dataclass(frozen=True, kw_only=True)
class SweepSection:
    """Many cases in one file: keys that vary, their values, and the way to combine the values."""

    mode: str = key(
        types.choice("grid", "zip"),
        '"grid": all combinations, where the last key in the file varies fastest; "zip": the first values of all keys '
        "together, then the second values, and so on.",
        default="grid",
    )
    samples: int | None = key(
        types.integer(least=1, most=types.MOST_ROWS),
        "Number of points in the box of the ranges that have neither step nor count.",
        default=None,
    )
    sampling: str = key(
        types.choice("latin", "random"), '"latin": a Latin hypercube; "random": independent points.', default="latin"
    )
    seed: int = key(SEED, "Seed of the samples.", default=0)
    realisations: int | None = key(
        types.integer(least=1, most=types.MOST_ROWS),
        "Random cells, or strengths that scatter, at each point, with seeds of [cell] and of scatter that count up; or "
        "give lists of cell.seed.",
        default=None,
    )


@dataclass(frozen=True, kw_only=True)
class Analysis:
    """Type of the analysis and its plane state."""

    type: str = key(
        types.choice("stiffness", "angle", "path", "load", "envelope", "conductivity"),
        '"stiffness": the effective stiffness; "angle": the response as a function of the debonding angle, see '
        '[angle]; "path": debonding along a load path, see [path]; "load": the response to one load, under which '
        'nothing breaks, see [load]; "envelope": the loads at which debonding begins, see [envelope]; "conductivity": '
        "the effective conductivity for heat, electricity or diffusion, or the dielectric constant.",
    )
    plane: str = key(
        types.choice("strain", "stress", "generalized", "conduction"),
        'Plane state: "strain" for long fibres along x3, "stress" for a thin sheet; "generalized" is '
        'generalized plane strain: long fibres under all six strains, also along x3. "conduction" belongs to type = '
        '"conductivity", where the key may be left out.',
    )


@dataclass(frozen=True, kw_only=True)
class Decomposition:
    """Decomposition of the cell into subdomains. Give one of the first two keys, or neither."""

    subdomains: int | None = key(
        types.integer(least=1, most=1_000_000),
        "Number of subdomains, at least one per body; by default, large bodies are cut to the fastest size.",
        absent="automatic",
    )
    max_dofs: int | None = key(
        types.integer(least=100, most=10**9),
        "Bodies are cut so that no subdomain has many more unknowns than this.",
        absent="automatic",
    )
    cut: str = key(
        types.choice("auto", "bodies"),
        '"bodies": each body is cut separately. "auto": the faster way: the cell is cut across its materials if no '
        "faces can separate, unknowns are at most 400 000 (more if bodies are small), stiffnesses differ by at most "
        "1e3, and the case gives no other key here and no solver option except tolerances and options that only "
        "print; else as with bodies.",
        default="auto",
    )


@dataclass(frozen=True, kw_only=True)
class Output:
    """Files and pictures of a run."""

    fields: bool = key(types.boolean, "Write result.h5 and result.xdmf.", default=True)
    states: int | str = key(
        STATES,
        "The points of a path whose fields are written. A number: at most so many points: both ends, up to half "
        'around the deepest stress drops, the rest evenly between. "peaks": both ends and the points around all drops '
        'of more than 1 % of the largest stress. "all": every point. The curve always has every point.',
        default=20,
        only=PATH_ANALYSIS,
    )
    mesh_error: bool = key(
        types.boolean,
        "Estimate the mesh error of every constant. With refine >= 1, the estimate takes about 5 % of the time of a "
        "run that writes fields, up to 17 % in large cells without fields or with elements of order 2, 14 % in sweeps "
        "of small cells, 20 % in bonded cells with linear elements. With refine = 0, with polygons, and beside "
        "debonded arcs with elements of order 2 or a tip_size, it takes up to 60 % of a run without fields.",
        default=True,
    )
    sensitivities: bool = key(
        types.boolean,
        "Compute and draw the derivatives of all constants of the cell by all constants of its phases and elastic "
        "interfaces, and by the fraction of a bonded square or hexagonal pattern; only with [analysis] type = "
        '"stiffness", "load" or "conductivity". Bonded cells need no further solve. With contact, derivatives hold at '
        "fixed status, and every load takes as many more solves as there are unit loads. Friction allows none.",
        default=False,
    )
    pictures: bool = key(types.boolean, "Draw PNG files; without fields, only curves.", default=True, presentation=True)
    report: bool = key(types.boolean, "Write report.html: tables, checks, pictures.", default=False, presentation=True)
    stress: str = key(
        types.choice("auto", "S11", "S22", "S12", "S33", "S23", "S13"),
        'Component to draw; "auto": the component of the unit strain. "S33", "S23" and "S13" exist in generalized '
        "plane strain.",
        default="auto",
        only=MECHANICAL,
        presentation=True,
    )
    deformation_scale: float | None = key(
        types.real(least=0.0),
        "Factor of the drawn displacements. By default, displacements and openings are visible and no element turns "
        "over, but the factor is at least 1 under a given strain.",
        absent="automatic",
        only=MECHANICAL,
        presentation=True,
    )
    length_unit: str = key(types.text, "A label, such as mm; nothing is converted.", default="", presentation=True)
    stress_unit: str = key(types.text, "A label, such as GPa; nothing is converted.", default="", presentation=True)


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """An unknown SECTION.KEY = {start, lower, upper} of a fit: any key of the file whose value is a number."""

    start: float = key(
        types.real(),
        "First value, within the bounds. If the search from this value ends with a misfit or a fault, it begins again "
        "at the best of 11 points within the bounds, at the price of one evaluation for each.",
    )
    lower: float = key(types.real(), "Lower bound.")
    upper: float = key(types.real(), "Upper bound, above the lower one.")


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured value NAME = {value, std}; for several tests, measured.NAME in a section [[test]] per test."""

    value: float = key(
        types.real(),
        "Measured value. Names for a stiffness are as in `sensitivities` of result.json, such as E1 or G_axial: E1, "
        "E2, G12 are across the fibres; E_axial, G_axial, expansion_axial are along the fibres. Names for a path are "
        "as in cases.csv, such as onset_S11 and peak_S11. A section [[test]] also has the keys in which its case "
        "differs, such as cell.fibre_fraction = 0.5.",
    )
    std: float = key(STD, "Standard deviation of the measurement.")


@dataclass(frozen=True, kw_only=True)
class MeasuredCurve:
    """A measured curve = {file, std} of a fit whose analysis is a path to one waypoint."""

    file: Path = key(
        types.file_name("the name of a .csv file", ".csv"),
        "A table with column names: a column of strains, such as E11, that rise with the load, and a column of "
        "stresses, such as S11. Separators are as in fibre tables.",
    )
    std: float = key(STD, "Standard deviation of each stress.", unit="stress")


SECTIONS: dict[str, type[Any]] = {
    "cell": Cell,
    "analysis": Analysis,
    "interface": InterfaceSection,
    "angle": Angle,
    "path": LoadPath,
    "load": SingleLoad,
    "envelope": Envelope,
    "decomposition": Decomposition,
    "output": Output,
}

GROUPS = {
    "start here": "name cell.geometry cell.fibre_fraction cell.width cell.fibre_radius material.young material.poisson "
    "analysis",
    "fibres: random, coated, from tables; your own meshes": "cell",
    "meshes": "cell.accuracy cell.mesh_size cell.refine cell.order cell.interface_size cell.tip_size cell.bodies",
    "materials and their strengths": "material",
    "interfaces": "interface",
    "loads": "load path angle envelope",
    "output": "output",
    "many cases, fits, scatter": "sweep unknown measured uncertainty",
    "solver": "decomposition petsc",
}
"""The keys by need: whole sections, or keys that are listed apart from the rest of their section."""

SECTIONS_OF_AN_ANALYSIS = {name: ANALYSIS_TYPE.among(name) for name in ("angle", "path", "load", "envelope")}
"""Sections that one analysis type requires, and no other type has."""

REQUIRED = ("cell", "material", "analysis")
TOP_LEVEL = (*SECTIONS, "material", "petsc", "name")


@dataclass(frozen=True)
class SectionTable:
    """A table of the case file.

    Attributes:
        section: section name.
        place: position in the file as a text, such as "[load] to" or "[material.PHASE], FORM".
        contents: dataclass with the table keys.
    """

    section: str
    place: str
    contents: type[Any]


TABLES = (
    *(SectionTable(section, f"[{section}]", contents) for section, contents in SECTIONS.items()),
    *(
        SectionTable("material", f"[material.PHASE], {form}", contents)
        for form, contents in material_forms.MATERIAL_FORMS.items()
    ),
    SectionTable("material", "[material.PHASE] strength", material_forms.PhaseStrength),
    SectionTable("material", "[material.PHASE] conductivity", material_forms.FibreConductivity),
    SectionTable("interface", "an arc of [interface] debonded", Arc),
    SectionTable("interface", "[interface] scatter", Scatter),
    SectionTable("path", "a load of [path] to or waypoints", MixedLoad),
    SectionTable("load", "[load] to", MixedLoad),
)


KEY_OWNERS = {
    name: " or ".join(
        dict.fromkeys(each.place.partition(",")[0] for each in TABLES if name in keys.keys_of(each.contents))
    )
    for table in TABLES
    for name in keys.keys_of(table.contents)
}
"""The tables that have a key, in words, by key name."""


def read_petsc(table: object, faults: list[str]) -> dict[str, Scalar]:
    """Return all options in [petsc], also faulty ones; {} if it is no table.  Append faults; runs check the values."""
    if not isinstance(table, dict):
        faults.append(f"petsc = {wording.toml_value(table)}: expected a section [petsc]")
        return {}
    for name, value in table.items():
        start = f"[petsc] {wording.toml_key(name)} = {wording.toml_value(value)}: expected"
        if name.startswith("-"):
            faults.append(f"{start} the option's name without its dash")
        elif not re.fullmatch(r"feti_\w+", name):
            faults.append(f"{start} the prefix feti_; PETSc's own options are for the command line")
        elif not (isinstance(value, bool) or types.is_number(value) or types.text.accepts(value)):
            faults.append(f"{start} {OPTION_EXPECTED}")
    return dict(table)
