"""Edits that make one thing of a result false, and the laws that a result breaks."""

from __future__ import annotations

import numpy as np

from feti_homog.verification.certificate import verify

SMALL = 1e-6
MATRIX = ("material", "matrix")


def broken(folder):
    """The laws that a result breaks."""
    return {finding.law.name for finding in verify(folder).findings if not finding.holds}


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
