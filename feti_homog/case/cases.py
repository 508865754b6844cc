"""Read a case file into frozen dataclasses, check its contents, and report all faults at once."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from feti_homog.case import bond_laws, cell_sizes, sections
from feti_homog.case.cell_section import GEOMETRY, Cell
from feti_homog.case.interface_section import Arc, InterfaceSection, interface_tables, labelled
from feti_homog.case.load_sections import AnalysisSection, Angle, Envelope, LoadPath, SingleLoad, completed
from feti_homog.case.material_sections import provider, read_materials, unlike_units
from feti_homog.case.relations import axes_lines, read_interfaces, relation_faults, stress_free, unlike_strengths
from feti_homog.case.rules import RULES, Rule
from feti_homog.case.section_values import ANALYSIS_TYPE, CRITERION, METHOD, PLANE
from feti_homog.case.toml_files import is_key, leaves, read_document, short_digest, to_document, with_values
from feti_homog.errors import CaseError
from feti_homog.materials import laws, material_forms, voigt
from feti_homog.schema import TableReader, keys, types, wording
from feti_homog.system.runtime import input_files

FIELDS = {"load": "single_load"}  # the field of [load]: Case.load is a method
STUDIES = {
    sections.SWEEP: "this file describes many cases; `feti-homog sweep` runs them",
    sections.UNCERTAINTY: "a run takes no scatter; `feti-homog uncertainty` propagates it to results",
}
"""Sections of files with many cases, and the command for each."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """A checked case.

    Attributes:
        materials: materials by phase, in file order.
        interfaces: empty for perfect bonding; each of several interfaces has its pair of phases.
        angle, path, single_load, envelope: the analysis section, None for other types; single_load is [load].
        petsc: PETSc options without dash.
        source: document and folder of `parse`, without defaults.
    """

    name: str
    cell: Cell
    materials: dict[str, material_forms.Material]
    analysis: sections.Analysis
    interfaces: tuple[InterfaceSection, ...]
    angle: Angle | None
    path: LoadPath | None
    single_load: SingleLoad | None
    envelope: Envelope | None
    decomposition: sections.Decomposition
    output: sections.Output
    petsc: dict[str, sections.Scalar]
    source: tuple[dict[str, Any], Path] = field(compare=False, repr=False)

    @classmethod
    def load(cls, path: str | Path) -> Case:
        """Load a case from a file, whose stem is the default case name.  Raises CaseError with all faults."""
        return cls.parse(read_document(path), Path(path).parent)

    @classmethod
    def parse(cls, values: Mapping[str, Any], folder: str | Path = ".") -> Case:
        """Build a case from nested dictionaries, with file names relative to `folder`.

        Values may be NumPy scalars, arrays, tuples and paths, besides TOML types.

        Raises:
            CaseError: the case is faulty; one line per fault.
            TypeError: `values` is not a mapping.
        """
        document, folder = to_document(values), Path(folder)
        contents, faults = _read_sections(document, folder)
        if not faults:
            of_materials = contents["materials"], contents["analysis"].plane
            faults += laws.contrast_lines(*of_materials)[0]
            faults += cell_sizes.derivative_faults(*of_materials) if contents["output"].sensitivities else ()
        if not faults:
            cell, materials = contents["cell"], contents["materials"]
            plane, free_faces = contents["analysis"].plane, bool(contents["interfaces"]) or cell.has_voids
            contents["cell"] = cell_sizes.sized(cell, document["cell"], materials, plane, free_faces, faults)
        if faults:
            raise CaseError(*faults)
        return cls(name=document.get("name", "case"), source=(document, folder), **contents)

    def replace(self, changes: Mapping[str, Any]) -> Case:
        """Return the checked case with other values by dotted key, such as `{"material.fibre.young": 80.0}`.

        All other keys stay as in the file or document.  A number, from 1, selects one of several sections or an entry
        of a list, as in `interface.2.friction` and `material.fibre.expansion.3`; `material.fibre.stiffness.C12` sets
        both symmetric entries; None removes a key.  Raises like `parse`.
        """
        (document, folder), faults = self.source, list[str]()
        changed = with_values(document, dict(leaves(to_document(changes), lambda path, _: is_key(path))), faults)
        if faults:
            raise CaseError(*faults)
        return parse(changed, folder)

    @property
    def arcs(self) -> tuple[Arc, ...]:
        """Return the initially debonded arcs of all interfaces."""
        return tuple(arc for interface in self.interfaces for arc in interface.debonded)

    @property
    def interface(self) -> InterfaceSection | None:
        """Return the first interface, None for perfect bonding; all interfaces share contact, criterion and growth."""
        return self.interfaces[0] if self.interfaces else None

    @property
    def has_friction(self) -> bool:
        """Return whether debonded faces of any interface have friction."""
        return any(interface.friction for interface in self.interfaces)

    @property
    def targets(self) -> tuple[Mapping[str, float], ...]:
        """Return the loads of [path] or [load] with all components; () for other sections.

        A load maps names to values: the strain or stress of each component in Voigt order and, in generalized plane
        strain, the temperature.  The unloaded start of a path is left out.
        """
        return completed(tuple(self.section.placed.values()), self.analysis.plane)

    @property
    def section(self) -> AnalysisSection:
        """Return the section of the analysis; `AnalysisSection()` for types without a section."""
        return self.angle or self.path or self.single_load or self.envelope or AnalysisSection()

    def material_of(self, phase: str) -> material_forms.Material:
        """Return the material of a phase; without a section, "fibre:2" has the material "fibre".  Raises KeyError."""
        return self.materials[provider(phase, self.materials)]

    @property
    def fewer_events(self) -> str:
        """Return advice on fewer events, to end a message; empty unless a path of events has a softening law."""
        has_events = self.path is not None and self.path.method == "events"
        if self.interface is None or not has_events or not bond_laws.LAWS[self.interface.criterion].softens:
            return ""
        by = "fewer teeth" if self.interface.teeth else "a larger softening_tolerance"
        return f"; {by} in [interface] would give fewer events"

    def warnings(self) -> tuple[str, ...]:
        """List valid but probably unintended settings, one per line."""
        of_elements = cell_sizes.warnings(self.materials, self.analysis.plane)
        _, contrast = laws.contrast_lines(self.materials, self.analysis.plane)
        strengths = unlike_strengths(self.materials, self.interfaces, self.analysis.plane)
        idle = [label for label, each in labelled(self.interfaces) if each.friction_on_damage and each.friction == 0.0]
        frictionless = (f"[{label}] friction_on_damage = true: without effect, for friction = 0" for label in idle)
        return (*of_elements, *contrast, *strengths, *frictionless)

    def remarks(self) -> tuple[str, ...]:
        """List remarks on assumed and on doubtful settings, one per line."""
        kind, section, plane = self.analysis.type, self.section, self.analysis.plane
        of_elements = cell_sizes.remarks(self.materials, plane)
        of_table = () if self.cell.table is None else (*self.cell.table.remarks, *cell_sizes.default_size(self.cell))
        of_load = (*stress_free(kind, section.placed, plane), *axes_lines(kind, section, self.materials, plane))
        return (*of_elements, *unlike_units(self.materials), *of_table, *of_load)

    def resolved(self) -> dict[str, Any]:
        """Return the case with its defaults as a document; `parse` turns it into an equal case."""
        selected: keys.Selected = {
            GEOMETRY: self.cell.geometry,
            ANALYSIS_TYPE: self.analysis.type,
            PLANE: self.analysis.plane,
            METHOD: None if self.path is None else self.path.method,
            CRITERION: None if self.interface is None else self.interface.criterion,
        }
        chosen: dict[str, Any] = {} if self.cell.accuracy is None else dict.fromkeys(cell_sizes.CHOSEN)
        document: dict[str, Any] = {"name": self.name, "cell": keys.to_table(replace(self.cell, **chosen), selected)}
        document["material"] = {phase: keys.to_table(material, selected) for phase, material in self.materials.items()}
        for section in sections.SECTIONS:
            if section != "cell" and (contents := getattr(self, FIELDS.get(section, section))) is not None:
                document[section] = keys.to_table(contents, selected)
        if len(self.interfaces) > 1:
            document["interface"] = [keys.to_table(interface, selected) for interface in self.interfaces]
        return document | {"petsc": dict(self.petsc)}

    def digest(self, with_output: bool = True) -> str:
        """Return a digest of all settings that change results.  Raises OSError if a file of [cell] is unreadable.

        Name, PETSc options, max_events and, without `with_output`, [output] do not count.  Files count by content.
        """
        document = {k: v for k, v in self.resolved().items() if k not in ("name", "output", "petsc")}
        if with_output:
            computed = [name for name, entry in keys.keys_of(sections.Output).items() if not entry.presentation]
            document["output"] = {name: getattr(self.output, name) for name in computed}
        document.get("path", {}).pop("max_events", None)
        document["cell"] = {k: v for k, v in document["cell"].items() if k not in ("file", "match")}
        content = b"".join(input_files.read(path) for path in (self.cell.file, self.cell.match) if path is not None)
        return short_digest(json.dumps(document, sort_keys=True).encode() + content.replace(b"\r\n", b"\n"))


load = Case.load
parse = Case.parse


def check_stored(values: Mapping[str, Any]) -> None:
    """Check the case stored in a result, without input files.  Raises CaseError with all faults."""
    if faults := _read_sections(to_document(values), None)[1]:
        raise CaseError(*faults)


def _read_sections(document: dict[str, Any], folder: Path | None) -> tuple[dict[str, Any], list[str]]:
    """Read all sections of a document; return the fields of `Case`, and all faults.

    A faulty section is None; [material] keeps valid phases, [petsc] all options.  Without a folder the cell is None.
    """
    analysis = document.get("analysis")
    if isinstance(analysis, dict) and analysis.get("type") == "conductivity":
        document = document | {"analysis": {"plane": voigt.CONDUCTION.name} | analysis}
    first = next(iter(interface_tables(document)), None)
    if isinstance(first, dict) and "law" in first:
        first = first | {"criterion": first["law"]}
    tables, selected = document | {"interface": first}, dict[keys.Selector, str | None]()
    for selector in (GEOMETRY, ANALYSIS_TYPE, PLANE, METHOD, CRITERION):
        section, table = sections.SECTIONS[selector.section], tables.get(selector.section)
        default = getattr(section, selector.key, None)
        value = table.get(selector.key, default) if isinstance(table, Mapping) else default
        selected[selector] = value if keys.keys_of(section)[selector.key].type.accepts(value) else None
    if (conducts := selected[ANALYSIS_TYPE] == "conductivity") or selected[PLANE] == voigt.CONDUCTION.name:
        selected[PLANE] = voigt.CONDUCTION.name if conducts else None
    faults = [f"[{section}]: missing section" for section in sections.REQUIRED if section not in document]
    for name, value in document.items():
        if name in STUDIES:
            words = f"{name} = {wording.toml_value(value)}: expected a section [{name}]"
            faults.append(f"[{name}]: {STUDIES[name]}" if isinstance(value, dict) else words)
        elif name not in sections.TOP_LEVEL:
            is_section = isinstance(value, dict)
            key = f"[{wording.toml_key(name)}]" if is_section else wording.toml_key(name)
            fit = "it belongs to the file of a fit; `feti-homog fit` runs it" if name in sections.FIT_SECTIONS else ""
            hint = fit or wording.suggestion(name, sections.TOP_LEVEL, sections.KEY_OWNERS)
            faults.append(f"{key}: unknown {'section' if is_section else 'key'}; {hint}")
    title = document.get("name", "case")
    if complaint := types.text.complaint(title):
        faults.append(f"name = {wording.toml_value(title)}: {complaint}")
    reader = TableReader(selected, sections.KEY_OWNERS, faults)
    rules = _applicable(frozenset(document.keys() & sections.SECTIONS.keys()), tuple(selected.items()))
    of_rules = [[*rule.faults(document, selected)] for rule in rules]
    foreign = {rule.path[0] for rule, lines in zip(rules, of_rules, strict=True) if lines and rule.holds is None}
    cell = _read_section(document, "cell", reader)
    if "cell" in foreign or cell is None or not folder:
        cell = None
    elif cell.file is None and cell.fibre_list is None and cell.match is None:
        faults += cell_sizes.size_faults(cell)
    else:
        from feti_homog.case import cell_files  # few cells have files

        cell = cell_files.checked_cell(cell, folder, faults)
    contents = {
        "cell": cell,
        "materials": read_materials(document, selected[PLANE], reader),
        "analysis": _read_section(document, "analysis", reader),
        "decomposition": _read_section(document, "decomposition", reader),
        "interfaces": read_interfaces(document, reader),
        **{FIELDS.get(name, name): _read_section(document, name, reader) for name in sections.SECTIONS_OF_AN_ANALYSIS},
        "output": _read_section(document, "output", reader),
        "petsc": sections.read_petsc(document.get("petsc", {}), faults),
    }
    faults += [fault for rule in of_rules for fault in rule]
    # Sections that do not belong to the analysis have no further checks.
    faults += relation_faults(contents | {FIELDS.get(name, name): None for name in foreign}, document, selected[PLANE])
    return contents, faults


@lru_cache
def _applicable(names: frozenset[str], selected: tuple[tuple[keys.Selector, str | None], ...]) -> list[Rule]:
    """Return the rules on the document or the sections `names` whose conditions all hold for the `selected` values."""
    rules = (rule for rule in RULES if not rule.path or rule.path[0] in names)
    return [rule for rule in rules if all(condition.holds(dict(selected)) for condition in rule.when)]


def _read_section(document: Mapping[str, Any], section: str, reader: TableReader) -> Any:
    """Read a section into a dataclass; None if faulty or absent.  Absent [decomposition] and [output] have defaults."""
    if section not in document and section in (*sections.REQUIRED, *sections.SECTIONS_OF_AN_ANALYSIS):
        return None
    return reader.read(sections.SECTIONS[section], document.get(section, {}), section)


def check_phases(case: Case, phases: Iterable[str]) -> None:
    """Check that mesh phases and materials match. Raises CaseError with all faults."""
    sources = {phase: provider(phase, case.materials) for phase in phases}
    without = [phase for phase, source in sources.items() if source not in case.materials]
    faults = [f"[material.{wording.toml_key(phase)}]: missing section; the mesh has this phase" for phase in without]
    unused = [phase for phase in case.materials if phase not in sources.values()]
    has, missing = (", ".join(map(wording.toml_key, some)) for some in (sources, without))
    if len(unused) == len(without) == 1 and not case.cell.phases and "matrix" not in without:
        has += f". If they are the same, add to [cell]: phases = {{{unused[0]} = {wording.toml_value(without[0])}}}"
    elif without:
        has += f". If it is {missing.replace(', ', ' or ')}, rename the section"
    faults += [f"[material.{wording.toml_key(phase)}]: the mesh has no such phase; it has {has}" for phase in unused]
    if faults:
        raise CaseError(*faults)
