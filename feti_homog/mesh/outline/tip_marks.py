"""Marks: places on curves of an arrangement that become nodes of its mesh, as tips of debonded arcs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from feti_homog.fibres.arrangement import Arrangement
from feti_homog.typing import Float, Int


def marked(arrangement: Arrangement, marks: Mapping[int, Sequence[float]]) -> tuple[Int, Float]:
    """Curve and angle in radians (t,) of the marks on curves that are there: k is the outer curve of fibre k, ~k that
    within its coating."""
    there = {*range(len(arrangement.radii)), *(~np.flatnonzero(arrangement.coated)).tolist()}
    known = {curve: own for curve, own in marks.items() if curve in there}
    curve = np.repeat(list(known), [len(own) for own in known.values()]).astype(int)
    return curve, np.radians([mark for own in known.values() for mark in own])
