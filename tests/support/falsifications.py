"""Edits that make one thing of a result false, and the laws that a result breaks."""

import shutil

import numpy as np

from feti_homog.results import result_json
from feti_homog.verify import certificate
from feti_homog.verify.findings import NO_REASON, THINNED

SMALL = 1e-6
MATRIX = ("material", "matrix")


def broken(folder):
    """Return the laws that a result breaks; `verify` runs in this process, since hundreds of starts take minutes."""
    return {finding.name for finding in certificate._verified(folder).findings if not finding.holds}


def check_what_is_left(kind, certificate):
    """Nothing that a reader relies on is left unchecked, and nothing without a reason."""
    assert NO_REASON not in certificate.unchecked
    assert (THINNED in certificate.unchecked) == (kind in ("peaks", "thinned", "cooled, thinned"))
    left = {name for names in certificate.unchecked.values() for name in names}
    relied = {
        "effective_stiffness",
        "effective_conductivity",
        "moduli",
        "bounds",
        "constants",
        "status",
        "check_tolerance",
        "compliance",
    }
    relied |= {f"path[].{name}" for name in ("stored", "work", "dissipated", "load_factor", "strain", "broke")}
    relied |= {"envelope[].factor", "load.stress", "angle[].stiffness", "tips", "solver.rtol"}
    assert not relied & left and {"version", "memory", "timings", "digest"} <= left


def resealed(folder, copy, content):
    """Return a copy of a result with another document, under the checksum that belongs to it."""
    shutil.copytree(folder, copy, ignore=shutil.ignore_patterns("*.csv"))
    (copy / "result.json").write_text(result_json.dumps(content))
    return copy


def scale(name, factor=1 + SMALL, state=0):
    """Multiply the largest number of a table of a state."""

    def edit(_, file):
        table = file[f"state/{state}/{name}"]
        values = table[()]
        values.ravel()[np.abs(values).argmax()] *= factor
        table[()] = values

    return edit


def shift(name, by=SMALL, row=0, group="state/0", state=None):
    """Add to the first number of a row of a table."""
    group = group if state is None else f"state/{state}"

    def edit(_, file):
        table = file[f"{group}/{name}"]
        values = table[()]
        values.reshape(len(values), -1)[row, 0] += by
        table[()] = values

    return edit


def swap_rows(*names):
    """Exchange two interface nodes, or some of what is known of them."""

    def edit(_, file):
        for name in names:
            table = file[name]
            values = table[()]
            values[[0, -1]] = values[[-1, 0]]
            table[()] = values

    return edit


def document(*places, factor=1 + SMALL, to=None):
    """Change a number of result.json."""

    def edit(content, _):
        for key in places[:-1]:
            content = content[key]
        content[places[-1]] = content[places[-1]] * factor if to is None else to

    return edit


def both(*edits):
    def edit(content, file):
        for each in edits:
            each(content, file)

    return edit


def attribute(name, factor=1 + SMALL, state=0):
    def edit(_, file):
        attributes = file[f"state/{state}"].attrs
        attributes[name] = attributes[name] * factor

    return edit


def entry(name, row, to, state=0):
    """Set a number of an attribute of a state."""

    def edit(_, file):
        attributes = file[f"state/{state}"].attrs
        values = attributes[name]
        values[row] = to
        attributes[name] = values

    return edit


def raised(point, by, *names):
    """Raise numbers of a point and of all points after it."""

    def edit(content, _):
        for each in content["path"][point:]:
            for name in names:
                each[name] += by

    return edit


def free_axial_traction(state):
    """Return an open face of a state is pulled along the fibre."""

    def edit(_, file):
        group = file[f"state/{state}"]
        node = int(np.flatnonzero(group["status"][()] == 2)[0])
        group["axial_traction"][node] = 1e-3 * np.abs(group["axial_traction"][()]).max()

    return edit
