"""Files of a fit: fit.json, measured.csv and fit.png, and its text."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.errors import CaseError
from feti_homog.report.text.table import Column, Table
from feti_homog.results import atomic, seals
from feti_homog.studies.fit.description import Fit
from feti_homog.studies.fit.estimation import CONFIDENCE, Estimates, names_of
from feti_homog.system.runtime import input_files
from feti_homog.version import __version__

NAME, TABLE, PICTURE = "fit.json", "measured.csv", "fit.png"
OWN = re.compile(r"fit\.(json|png)|measured\.csv|(evaluation|differences)-\d{4,}")
FIRST, LEAST_SHARE, MOST_DEVIATIONS = Column("", -38), 0.01, 3.0
HEAD = ("test", "name", "strain", "value", "std", "computed", "residual")


def begin(path: Path, digest: str, own: re.Pattern[str] = OWN, kind: str = "fit") -> None:
    """Make the folder of a fit with its file `path`, or find that it is that.  On one rank.

    Args:
        own: names of what a fit writes there.
        kind: word for it.

    Raises:
        CaseError: the folder is that of another fit, or has files of others under names of a fit.
        FetiHomogError: it cannot be written.
    """
    directory = path.parent
    if path.exists():
        try:
            known = seals.loads(input_files.read(path).decode("utf-8"))
        except (OSError, ValueError) as error:
            raise CaseError(f"{path} is no readable {kind}: {error}; move it away") from error
        if known.get("digest") != digest:
            raise CaseError(f"--out {directory} holds another {kind}; choose another folder")
        return
    with atomic.write_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        foreign = [each.name for each in sorted(directory.iterdir()) if own.fullmatch(each.name)]
    if foreign:
        raise CaseError(
            f"--out {directory}: no {kind} of this program wrote {foreign[0]}, and this one would replace it; "
            "move it away or choose another folder"
        )
    atomic.replace_text(path, seals.dumps({"version": __version__, "digest": digest, "status": "running"}))


def write(directory: Path, digest: str, fit: Fit, estimates: Estimates) -> dict[str, Any]:
    """Write all files of a finished fit, and return the content of fit.json.  On one rank."""
    from feti_homog.studies.fit import picture  # only a rank that draws loads Matplotlib

    document = {"version": __version__, "digest": digest} | content(fit, estimates)
    atomic.remove_unfinished(directory, OWN)
    atomic.replace_text(directory / TABLE, _table(document))
    picture.write(directory / PICTURE, document)
    atomic.replace_text(directory / NAME, seals.dumps(document))
    return document


def content(fit: Fit, estimates: Estimates) -> dict[str, Any]:
    """Return what is written about a finished fit, without numbers that are not finite."""
    found, names = estimates, [*fit.unknowns]
    faults = [] if found.converged else [f"no minimum after {found.evaluations} evaluations"]
    faults += names_of(found.undetermined, names)
    faults += _hardly_determined(fit, found)
    unknowns = {
        name: {
            "estimate": float(found.x[k]),
            "std": _finite(found.std[k]),
            "interval": [_finite(found.x[k] + sign * found.half_width[k]) for sign in (-1, 1)],
            "at_bound": {-1: "lower", 0: None, 1: "upper"}[int(found.at_bound[k])],
            "start": unknown.start, "lower": unknown.lower, "upper": unknown.upper,
            "shares": [float(share) for share in found.shares[k]],
        }
        for k, (name, unknown) in enumerate(fit.unknowns.items())
    }  # fmt: skip
    data = [
        {"test": each.test + 1, "name": each.name, "strain": each.strain, "strain_name": each.strain_name or None,
         "value": each.value, "std": each.std, "computed": float(f), "residual": float(r)}
        for each, f, r in zip(fit.data, found.computed, found.residuals, strict=True)
    ]  # fmt: skip
    return {
        "name": fit.name,
        "status": "not converged" if faults else "done",
        "faults": faults,
        "confidence": CONFIDENCE,
        "evaluations": found.evaluations,
        "unknowns": unknowns,
        "correlation": [[_finite(value) for value in row] for row in found.correlation],
        "singular_values": found.singular_values.tolist(),
        "directions": found.directions.tolist(),
        "sum_of_squares": _finite(float(found.residuals @ found.residuals)),
        "chance": found.chance,
        "measured": data,
    }


def _hardly_determined(fit: Fit, found: Estimates) -> list[str]:
    """Return a line for each unknown whose standard deviation is more than the width of its bounds."""
    return [
        f"[unknown] {name}: the measured values hardly determine it: its standard deviation {std:.3g} is more than the "
        f"width {unknown.upper - unknown.lower:.3g} of its bounds"
        for (name, unknown), std in zip(fit.unknowns.items(), found.std, strict=True)
        if np.isfinite(std) and std > unknown.upper - unknown.lower
    ]


def text(document: Mapping[str, Any]) -> str:
    """Return the tables of a fit for a terminal."""
    data = _labels(document)
    interval = f"{document['confidence']:.0%} interval"
    heads = [FIRST, Column("estimate"), Column("std"), Column(interval, 14), Column("", 12)]
    rows = [_unknown_row(name, own, data) for name, own in document["unknowns"].items()]
    tables = [Table("Unknowns", [*heads, Column("  determined by", -40)], rows, title_in_head=True)]
    rows = [[name, *map(_dash, row)] for name, row in zip(document["unknowns"], document["correlation"], strict=True)]
    columns = [FIRST, *(Column(str(k + 1), 8, ".3f") for k in range(len(rows)))]
    tables += [Table("Correlation", columns, rows, title_in_head=True)] if len(rows) > 1 else []
    columns = [FIRST, *(Column(name) for name in HEAD[3:6]), Column("in std", 10, ".2f")]
    rows = [[words, *(each[n] for n in HEAD[3:])] for words, each in zip(data, document["measured"], strict=True)]
    tables.append(Table("Measured", columns, rows, title_in_head=True))
    chance = "" if document["chance"] is None else f", as large or larger with a chance of {document['chance']:.2g}"
    squares = document["sum_of_squares"]
    total = "beyond all numbers" if squares is None else f"{squares:.4g}"
    last = f"Sum of squares {total}{chance}; {document['evaluations']} evaluations"
    return "\n\n".join(["", *("\n".join(table.lines) for table in tables), last, *_limits(document, data)])


def _limits(document: Mapping[str, Any], data: Sequence[str]) -> list[str]:
    """Return a remark where unknowns end at their bounds, and a measured value is off by more than MOST_DEVIATIONS."""
    bound = [f"{name} at its {own['at_bound']}" for name, own in document["unknowns"].items() if own["at_bound"]]
    residuals = [each["residual"] for each in document["measured"]]
    worst = int(np.argmax(np.abs(residuals)))
    if not bound or abs(residuals[worst]) <= MOST_DEVIATIONS:
        return []
    off = f"{data[worst]} is {abs(residuals[worst]):.3g} standard deviations off"
    return [f"Remark: the fit ends with {', '.join(bound)} bound, and {off}"]


def _labels(document: Mapping[str, Any]) -> list[str]:
    """Return the names of the measured values, with their tests if there are several."""
    data = [_words(each) for each in document["measured"]]
    single = len({each["test"] for each in document["measured"]}) == 1
    return [words.removeprefix("test 1 ") for words in data] if single else data


def _unknown_row(name: str, own: Mapping[str, Any], data: Sequence[str]) -> list[Any]:
    """Return the row of an unknown, with the three data that determine it most."""
    order = np.argsort(-np.array(own["shares"]), kind="stable")[:3]
    shares = ", ".join(f"{data[k]} {own['shares'][k]:.0%}" for k in order if own["shares"][k] >= LEAST_SHARE)
    bound = "" if own["at_bound"] is None else f"at its {own['at_bound']} bound; "
    return [name, own["estimate"], _dash(own["std"]), *map(_dash, own["interval"]), f"  {bound}{shares}"]


def _dash(value: float | None) -> float | str:
    return "-" if value is None else value


def _words(datum: Mapping[str, Any]) -> str:
    """Return the name of a measured value, with its test and place."""
    place = "" if datum["strain"] is None else f"({datum['strain_name']} = {datum['strain']:g})"
    return f"test {datum['test']} {datum['name']}{place}"


def _table(document: Mapping[str, Any]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, HEAD, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(document["measured"])
    return stream.getvalue()


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
