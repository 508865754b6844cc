"""Tables of a fit: unknown constants of cases, and what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from feti_homog.schema.keys import key
from feti_homog.schema.values import file_name, real

UNKNOWN, MEASURED, TEST, CURVE = "unknown", "measured", "test", "curve"
FIT_SECTIONS = (UNKNOWN, MEASURED, TEST)
STD = real(above=0.0)


@dataclass(frozen=True, kw_only=True)
class Unknown:
    """An unknown SECTION.KEY = {start, lower, upper} of a fit: any key of the file whose value is a number."""

    start: float = key(real(), "First value, not outside of the bounds.")
    lower: float = key(real(), "Lower bound.")
    upper: float = key(real(), "Upper bound, above the lower one.")


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A measured NAME = {value, std}, of several tests as measured.NAME in a section [[test]] for each."""

    value: float = key(
        real(),
        "Measured value. Names of a stiffness are those of `sensitivities` in result.json, such as E1 or G_axial; of a "
        "path those of cases.csv, such as onset_S11 and peak_S11. A section [[test]] has besides the keys in which its "
        "case differs, such as cell.fibre_fraction = 0.5.",
    )
    std: float = key(STD, "Standard deviation of the measurement.")


@dataclass(frozen=True, kw_only=True)
class MeasuredCurve:
    """A measured curve = {file, std} of a fit whose analysis is a path of one leg."""

    file: Path = key(
        file_name("the name of a .csv file", ".csv"),
        "A table with a head: a column of strains, such as E11, that rise with the load, and one of stresses, S11.",
    )
    std: float = key(STD, "Standard deviation of each stress.", unit="stress")
