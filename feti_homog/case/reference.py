"""Generate the case file reference, `feti-homog keys`, from the definitions of the keys."""

import difflib
import inspect
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from feti_homog.case import sections
from feti_homog.errors import CaseError
from feti_homog.materials import material_forms
from feti_homog.schema import keys, types, wording

_OF_A_CASE = dict.fromkeys(("name", "cell", "material", *sections.SECTIONS, "petsc"))  # each once
ORDER = (*_OF_A_CASE, sections.UNCERTAINTY, sections.SWEEP, sections.UNKNOWN, sections.MEASURED)
"""Sections in the order of the reference."""

WIDTH = 100  # characters of a printed line
INDENTED = textwrap.TextWrapper(WIDTH, initial_indent=6 * " ", subsequent_indent=6 * " ", break_on_hyphens=False)

MATERIAL_MEANING = (
    "One section for each phase: [material.matrix], [material.fibre] and, for other phases of meshes and tables, such "
    "as [material.glass]; fibre:2 without a section has the constants of fibre. A section has one of five forms."
)


@dataclass(frozen=True)
class KeyRow:
    """A row of the reference: one key of the case file, in words.

    Attributes:
        key: key name.
        accepts: requirement on the value.
        unit: unit of the value, may be empty.
        default: default as in TOML or in words, or "required"; may be empty.
        applies: geometry, analysis type or method to which the key belongs; empty: all.
        meaning: one or two sentences.
    """

    key: str
    accepts: str
    unit: str
    default: str
    applies: str
    meaning: str


@dataclass(frozen=True)
class TableReference:
    """A table of the case file, with its purpose and keys.

    Attributes:
        section: name of the section: "cell", "material", ...; "name" for the key before the first section.
        place: position in the file: "[cell]", "[material.PHASE], isotropic", ...
        meaning, rows: purpose of the table, and its keys.
    """

    section: str
    place: str
    meaning: str
    rows: tuple[KeyRow, ...]


PETSC_MEANING = (
    "options of the solver without their dash. The command line takes precedence; PETSc's own options, such as "
    "-log_view, belong there alone."
)
UNCERTAINTY_MEANING = (
    "scatter of numbers, which `feti-homog uncertainty` propagates to constants, onsets and peaks, to first order. "
    "`feti-homog run` refuses this section."
)
RANGE_MEANING = "Values of a key that lie between two ends."
NAME = KeyRow("name", types.text.expected, "", "the file's name", "", "Name of the case.")
PETSC_OPTION = KeyRow(
    "feti_OPTION", sections.OPTION_EXPECTED, "", "", "",
    "An option of the solver, such as feti_ksp_rtol = 1e-10; `feti-homog options` lists them.",
)  # fmt: skip
DEVIATION = KeyRow(
    "SECTION.KEY", "a number above 0", "the key's unit", "", "",
    "Standard deviation of a number, whose own value is the mean. Instead, the number itself may be {mean, std} or "
    "{mean, cv}, with cv = std / |mean|.",
)  # fmt: skip
PAIR_WORDS = "a list of [KEY, KEY, VALUE], values from -1 to 1"
PAIRS = KeyRow(sections.CORRELATION, PAIR_WORDS, "", "", "", "Correlation of pairs of these numbers.")
AXIS = KeyRow("SECTION.KEY", sections.AXIS_EXPECTED, "", "", "", sections.AXIS_MEANING)


def tables(word: str = "", results: Sequence[str] = ()) -> list[TableReference]:
    """Return tables of the reference in `ORDER`: all of them or, with a `word`, only tables that match it.

    A section name matches all tables of the section. Any other `word` is searched in names and descriptions; case is
    ignored, underscores count as spaces. A table whose own name does not match keeps only its matching keys.

    Raises:
        CaseError: nothing matches, and `results`, the lines on results with the word, is empty.
    """
    ranges, measured = _rows(sections.SWEEP, sections.RANGE_KEYS), f"[{sections.MEASURED}]"
    references = [
        TableReference("name", "before the first section", "the case as a whole.", (NAME,)),
        *map(_table, sections.TABLES),
        _table(sections.SectionTable(sections.UNKNOWN, f"[{sections.UNKNOWN}] SECTION.KEY", sections.Unknown)),
        _table(sections.SectionTable(sections.MEASURED, f"{measured} NAME", sections.Measured)),
        _table(sections.SectionTable(sections.MEASURED, f"{measured} {sections.CURVE}", sections.MeasuredCurve)),
        TableReference("petsc", "[petsc]", PETSC_MEANING, (PETSC_OPTION,)),
        TableReference(sections.UNCERTAINTY, f"[{sections.UNCERTAINTY}]", UNCERTAINTY_MEANING, (DEVIATION, PAIRS)),
        _table(sections.SectionTable(sections.SWEEP, f"[{sections.SWEEP}]", sections.SweepSection), AXIS),
        TableReference(sections.SWEEP, f"a range in [{sections.SWEEP}]", RANGE_MEANING, ranges),
    ]
    references.sort(key=lambda table: ORDER.index(table.section))
    if not word or word in ORDER:
        return [table for table in references if word in ("", table.section)]
    found = []
    for table in references:
        rows = table.rows
        if not _has(word, table.section, table.place):
            rows = tuple(row for row in table.rows if _has(word, *vars(row).values()))
        if rows or _has(word, table.meaning):
            found.append(replace(table, rows=tuple(sorted(rows, key=lambda row: not _has(word, row.key)))))
    if not found and not results:
        names = {*ORDER, *(row.key for table in references for row in table.rows)}
        near = [*wording.SYNONYMS.get(word.lower(), ()), *difflib.get_close_matches(word, sorted(names))]
        words = f"near words: {', '.join(near)}" if near else "`feti-homog keys` lists all keys"
        raise CaseError(f"keys {wording.toml_key(word)}: no key, section or description has it; {words}")
    return found


def _has(word: str, *texts: str) -> bool:
    return any(word.lower().replace("_", " ") in text.lower().replace("_", " ") for text in texts)


def text(word: str = "", results: Sequence[str] = ()) -> str:
    """Return index and reference or, with a `word`, matching tables and `results`, as text.  Raises like `tables`."""
    references = tables(word, results)
    if word:
        described = "\n".join(textwrap.fill(line, WIDTH, subsequent_indent=6 * " ") for line in results)
        return "\n\n".join(filter(None, [as_text(references), described]))
    groups = {name: dict[str, dict[str, None]]() for name in sections.GROUPS}
    group_of = {place: name for name, places in sections.GROUPS.items() for place in places.split()}
    for table in references:
        for row in table.rows:
            group = group_of.get(f"{table.section}.{row.key}", group_of[table.section])
            groups[group].setdefault(table.place.partition(",")[0], {})[row.key] = None
    lines = ["Keys by need. `feti-homog keys WORD` prints the keys and sections that have a word in them."]
    for name, places in groups.items():
        rows = (f"  {place}: {', '.join(names)}" for place, names in places.items())
        lines += [f"\n{name}", *(textwrap.fill(row, WIDTH, subsequent_indent=4 * " ") for row in rows)]
    return "\n".join([*lines, "", as_text(references)])


def _table(table: sections.SectionTable, *rows: KeyRow) -> TableReference:
    first_paragraph = (inspect.getdoc(table.contents) or "").partition("\n\n")[0]
    meaning = " ".join(first_paragraph.split())
    if table.contents is material_forms.Isotropic:  # the first form
        meaning = f"{MATERIAL_MEANING} {meaning}"
    rows = *rows, *_rows(table.section, keys.keys_of(table.contents))
    return TableReference(table.section, table.place, meaning, rows)


def _rows(section: str, keys: Mapping[str, keys.Key]) -> tuple[KeyRow, ...]:
    above = [sections.SECTIONS_OF_AN_ANALYSIS[section]] if section in sections.SECTIONS_OF_AN_ANALYSIS else []
    return tuple(
        KeyRow(
            name,
            entry.type.expected,
            entry.unit,
            "required" if entry.required and not entry.unless else entry.default,
            ", ".join(condition.in_words(section) for condition in (*above, *entry.only)),
            entry.meaning,
        )
        for name, entry in keys.items()
    )


def as_text(references: Sequence[TableReference]) -> str:
    """Format tables as plain text: each key with its values, conditions and meaning."""
    blocks = []
    for table in references:
        lines = [textwrap.fill(f"{table.place}: {table.meaning}", WIDTH)]
        for row in table.rows:
            unit = f" ({row.unit})" if row.unit else ""
            default = f"default {row.default}" if row.default else "optional"
            presence, only = ("required", " if") if row.default == "required" else (default, "; only if")
            when = f"{only} {row.applies}" if row.applies else ""
            words = (f"{row.accepts}{unit}; {presence}{when}", row.meaning)
            lines += [f"\n  {row.key}", *map(INDENTED.fill, words)]
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks)
