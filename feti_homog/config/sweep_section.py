"""The section [sweep] of a case file: what varies, and how the values are combined."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.config.schema import key
from feti_homog.config.values import choice, integer

SWEEP = "sweep"
MAX_CASES = 100_000

AXIS_EXPECTED = "a list of values, or a range {from, to} with step, with count, or with samples in [sweep]"
RANGE_KEYS = {
    "from": "First value; a number below to.",
    "to": "Last value.",
    "step": "Distance of the values; linear ranges only.",
    "count": f"Number of values with both ends, 2 to {MAX_CASES}; without it and step, the key is sampled.",
    "scale": '"linear" (the default), or "log": even ratios, from a number above 0.',
}


@dataclass(frozen=True, kw_only=True)
class SweepSection:
    """Many cases in one file: keys that vary, each with its values, and how these are combined."""

    mode: str = key(
        choice("grid", "zip"),
        '"grid": all combinations, the last key in the file fastest; "zip": first values with first, second with '
        "second.",
        default="grid",
    )
    samples: int | None = key(
        integer(least=1, most=MAX_CASES),
        "Number of points in the box of the ranges that have neither step nor count.",
        default=None,
    )
    sampling: str = key(
        choice("latin", "random"), '"latin": a Latin hypercube; "random": independent points.', default="latin"
    )
    seed: int = key(integer(least=0), "Of the samples.", default=0)
    realisations: int | None = key(
        integer(least=1, most=MAX_CASES),
        "Arrangements of each point with a random cell; the k-th has the seed [cell] seed + k - 1 at all points.",
        default=None,
    )
