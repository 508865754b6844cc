"""The case file: TOML to frozen dataclasses, with every fault reported at once."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from feti_homog.config.interface_sections import read_bonding
from feti_homog.config.materials import KINDS, Isotropic, Material, plane_stiffness
from feti_homog.config.schema import accepted, is_real, keys_of, named, read, shown, suggestion, text, written
from feti_homog.config.sections import (
    CIRCULAR,
    SECTIONS,
    TOUCHING,
    Analysis,
    Angle,
    Arc,
    Cell,
    Decomposition,
    InterfaceSection,
    LoadPath,
    Output,
)
from feti_homog.errors import CaseError

Scalar = str | int | float | bool

PHASE = re.compile(r"matrix|fibre(:\w+)?")
PETSC_WIDE = (
    "log_view", "log_view_memory", "log_trace", "options_left", "options_view", "malloc_debug", "malloc_view",
    "malloc_dump", "memory_view", "on_error_abort", "fp_trap", "info",
)  # fmt: skip
LOCKING_POISSON = 0.49

REQUIRED = ("cell", "material", "analysis")
SWEEP = "sweep"
TOP_LEVEL = (*SECTIONS, "material", "petsc", "name")
HOMES: list[tuple[str, type[Any]]] = [
    *((f"[{section}]", cls) for section, cls in SECTIONS.items()),
    *(("[material.PHASE]", cls) for cls in KINDS.values()),
    ("an arc of [interface] debonded", Arc),
]
OWNERS = {
    name: " or ".join(home for home, cls in HOMES if name in keys_of(cls)) for _, cls in HOMES for name in keys_of(cls)
}


@dataclass(frozen=True, kw_only=True)
class Case:
    """A checked case; `materials` by phase, in the file's order; `petsc` options without dash.

    Without `interface` the bonding is perfect; `angle` and `path` are there if the analysis is of that type.
    """

    name: str
    cell: Cell
    materials: dict[str, Material]
    analysis: Analysis
    interface: InterfaceSection | None
    angle: Angle | None
    path: LoadPath | None
    decomposition: Decomposition
    output: Output
    petsc: dict[str, Scalar]

    @classmethod
    def load(cls, path: str | Path) -> Case:
        """The case in a file; see `load`."""
        return load(path)

    @classmethod
    def parse(cls, document: Mapping[str, Any], folder: str | Path = ".") -> Case:
        """The case of a document of TOML's values; see `parse`."""
        return parse(document, Path(folder))

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """What is debonded from the start; none if the bonding is perfect."""
        return () if self.interface is None else self.interface.debonded

    def material_of(self, phase: str) -> Material:
        """The material of a phase; "fibre:2" without its own has that of "fibre". Raises KeyError."""
        return self.materials[_provider(phase, self.materials)]

    def warnings(self) -> tuple[str, ...]:
        """What is allowed but probably not wanted, one line each."""
        locking = self.analysis.plane == "strain" and self.cell.order == 1
        return tuple(
            f"[material.{named(phase)}] poisson = {material.poisson}: linear triangles lock "
            f"above {LOCKING_POISSON} in plane strain; use order = 2 in [cell]"
            for phase, material in self.materials.items()
            if locking and isinstance(material, Isotropic) and material.poisson > LOCKING_POISSON
        )

    def resolved(self) -> dict[str, Any]:
        """The case with its defaults as a plain document, of which `parse` makes the same case again."""
        document: dict[str, Any] = {"name": self.name}
        document["cell"] = written(self.cell, self.cell.geometry)
        document["material"] = {phase: written(material) for phase, material in self.materials.items()}
        document["analysis"] = written(self.analysis)
        if self.interface is not None:
            document["interface"] = written(self.interface, self.analysis.type)
        if self.angle is not None:
            document["angle"] = written(self.angle)
        if self.path is not None:
            document["path"] = written(self.path, self.path.method)
        document |= {"decomposition": written(self.decomposition), "output": written(self.output)}
        return document | {"petsc": dict(self.petsc)}

    def digest(self) -> str:
        """Short name of what the case computes: the same whatever its name, output, PETSc options and max_events."""
        document = {k: v for k, v in self.resolved().items() if k not in ("name", "output", "petsc")}
        document.get("path", {}).pop("max_events", None)
        document["cell"].pop("file", None)
        content = b"" if self.cell.file is None else self.cell.file.read_bytes()
        return hashlib.sha256(json.dumps(document, sort_keys=True).encode() + content).hexdigest()[:16]


def load(path: str | Path) -> Case:
    """The case in a file, named after the file unless it says otherwise. Raises CaseError with all faults."""
    return parse(read_document(path), Path(path).parent)


def read_document(path: str | Path) -> dict[str, Any]:
    """The TOML document in a file, named after the file. Raises CaseError if it is none."""
    path = Path(path)
    try:
        content = path.read_bytes().decode("utf-8-sig")
        document = tomllib.loads(content)
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        raise CaseError(f"{path}: not UTF-8 text (line {line})") from None
    except (ValueError, RecursionError) as error:  # of too long a number and too deep an array too
        place = f"line {content.count(chr(10)) + 1}, the end"
        raise CaseError(f"{path}: not TOML: {str(error).replace('end of document', place)}") from None
    except OSError as error:
        raise CaseError(f"{path}: cannot be read: {error.strerror}") from None
    return {"name": path.stem} | document


def parse(document: Mapping[str, Any], folder: Path) -> Case:
    """The case of a TOML document; its files are relative to `folder`. Raises CaseError with all faults."""
    faults = _top_level_faults(document)
    geometry = accepted(Cell, document.get("cell"), "geometry")
    plane = accepted(Analysis, document.get("analysis"), "plane")
    analysis = accepted(Analysis, document.get("analysis"), "type")
    cell = _read_section(document, "cell", faults, "geometry", geometry)
    decomposition = _read_section(document, "decomposition", faults)
    if decomposition and decomposition.subdomains and decomposition.max_dofs:
        faults.append("[decomposition] subdomains, max_dofs: exclude each other; give one")
    parts = {
        "cell": cell and _checked_cell(cell, folder, faults),
        "materials": _read_materials(document.get("material"), geometry, plane, faults),
        "analysis": _read_section(document, "analysis", faults),
        **read_bonding(document, geometry, analysis, faults, OWNERS),
        "decomposition": decomposition,
        "output": _read_section(document, "output", faults),
        "petsc": _read_petsc(document.get("petsc", {}), faults),
    }
    if faults:
        raise CaseError(*faults)
    return Case(name=document.get("name", "case"), **parts)


def _top_level_faults(document: Mapping[str, Any]) -> list[str]:
    """Faults of the names of sections and of the keys before the first section."""
    faults = [f"[{section}]: missing section" for section in REQUIRED if section not in document]
    for name, value in document.items():
        hint = suggestion(name, TOP_LEVEL, OWNERS)
        if name == SWEEP:
            faults.append("[sweep]: this file describes many cases; `feti-homog sweep` runs them")
        elif name not in TOP_LEVEL and isinstance(value, dict):
            faults.append(f"[{named(name)}]: unknown section; {hint}")
        elif name not in TOP_LEVEL:
            faults.append(f"{named(name)}: unknown key; {hint}")
    name = document.get("name", "case")
    if not text.accepts(name):
        faults.append(f"name = {shown(name)}: expected {text.expected}")
    return faults


def _read_section(
    document: Mapping[str, Any], section: str, faults: list[str], variant: str = "", chosen: str | None = None
) -> Any:
    """The dataclass of a section, or None if that is faulty or was already found to be missing."""
    if section in REQUIRED and section not in document:
        return None
    return read(SECTIONS[section], document.get(section, {}), section, faults, variant, chosen, OWNERS)


def _checked_cell(cell: Cell, folder: Path, faults: list[str]) -> Cell:
    """The cell with its file's path completed; faults between its keys are added to `faults`."""
    if cell.fibre_fraction is not None:
        crowding = (1.0 + cell.min_gap) ** 2 if cell.geometry == "random" else 1.0
        limit = TOUCHING[cell.geometry] / crowding
        if cell.fibre_fraction >= limit:
            reason = "no circles min_gap apart are denser" if crowding > 1 else "there the fibres touch"
            faults.append(
                f"[cell] fibre_fraction = {cell.fibre_fraction}: expected less than {limit:.4g} for "
                f"geometry = {shown(cell.geometry)}: {reason}"
            )
    if cell.file is None:
        return cell
    file = (folder / cell.file).resolve()
    if not os.path.isfile(file):  # false, not an error, for a name too long
        faults.append(f"[cell] file = {shown(str(cell.file))}: no such file (expected at {file})")
    return dataclasses.replace(cell, file=file)


def _read_materials(table: object, geometry: str | None, plane: str | None, faults: list[str]) -> dict[str, Material]:
    """The materials by phase; what depends on a geometry or plane state that is faulty is not checked."""
    if table is None:
        return {}
    if not isinstance(table, dict):
        faults.append(f"material = {shown(table)}: expected sections [material.matrix], [material.fibre]")
        return {}
    materials = {}
    for phase, constants in table.items():
        section = f"material.{named(phase)}"
        if not PHASE.fullmatch(phase):
            hint = suggestion(phase, ("matrix", "fibre", "fibre:2"), OWNERS)
            faults.append(f"[{section}]: unknown phase; {hint}")
        elif ":" in phase and geometry in CIRCULAR:
            faults.append(f'[{section}]: belongs to geometry = "mesh", not {shown(geometry)}')
        else:
            materials[phase] = _read_material(constants, section, plane, faults)
    needed = ("matrix", "fibre") if geometry in CIRCULAR else ("matrix",)
    faults += [f"[material.{phase}]: missing section" for phase in needed if phase not in table]
    return materials


def _read_material(table: object, section: str, plane: str | None, faults: list[str]) -> Any:
    """The material of a section, of the kind that its keys tell; None if it is faulty."""
    given = table if isinstance(table, dict) else {}
    kinds = {kind: [name for name in keys_of(cls) if name in given] for kind, cls in KINDS.items()}
    used = [kind for kind, names in kinds.items() if names] or ["isotropic"]
    if len(used) > 1:
        groups = " and ".join(f"{', '.join(kinds[kind])} ({kind})" for kind in used)
        faults.append(f"[{section}] {groups}: exclude each other; a material is of one kind")
        return None
    material = read(KINDS[used[0]], table, section, faults, owners=OWNERS)
    if material is not None and plane is not None:
        try:
            plane_stiffness(material, plane)
        except ValueError as error:
            faults.append(f"[{section}] {error}")
    return material


def _read_petsc(table: object, faults: list[str]) -> dict[str, Scalar]:
    """PETSc's options by name; whether PETSc knows one of prefix feti_ only the run can tell."""
    if not isinstance(table, dict):
        faults.append(f"petsc = {shown(table)}: expected a section [petsc]")
        return {}
    for name, value in table.items():
        line = f"[petsc] {named(name)} = {shown(value)}: "
        if name.startswith("-"):
            faults.append(f"{line}expected the option's name without its dash")
        elif not re.fullmatch(r"feti_\w+", name) and name not in PETSC_WIDE:
            faults.append(f"{line}expected the prefix feti_, or one of {', '.join(PETSC_WIDE)}")
        elif not (isinstance(value, bool) or is_real(value) or text.accepts(value)):
            faults.append(f"{line}expected a text, a number, true or false")
    return dict(table)


def _provider(phase: str, materials: Mapping[str, Material]) -> str:
    """The phase whose material a phase has: its own, or that of "fibre" for "fibre:2"."""
    return phase if phase in materials else phase.partition(":")[0]


def check_phases(case: Case, phases: Iterable[str]) -> None:
    """Raises CaseError if a phase of the mesh has no material, or a material no phase."""
    phases = list(phases)
    providers = [_provider(phase, case.materials) for phase in phases]
    lacking = [phase for phase in phases if _provider(phase, case.materials) not in case.materials]
    unused = [phase for phase in case.materials if phase not in providers]
    faults = [f"[material.{named(phase)}]: missing section; the mesh has this phase" for phase in lacking] + [
        f"[material.{named(phase)}]: the mesh has no such phase; it has {', '.join(map(named, phases))}"
        for phase in unused
    ]
    if faults:
        raise CaseError(*faults)
