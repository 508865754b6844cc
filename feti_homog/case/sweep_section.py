"""The section [sweep] of a case file: what varies, and how the values are combined."""

from __future__ import annotations

from dataclasses import dataclass

from feti_homog.case.section_values import SEED
from feti_homog.schema.keys import Key, key
from feti_homog.schema.values import choice, integer, real

SWEEP = "sweep"
MAX_CASES = 20_000

AXIS_EXPECTED = "a list of values, or a range {from, to} with step, with count, or with samples in [sweep]"
AXIS_MEANING = (
    "Values of any key of the file, instead of or beside the one in its section. A list of tables for a section is "
    'merged into it: cell = [{geometry = "square"}, {geometry = "random", fibres = 30}]; further keys of that section '
    'are then quoted: "cell.refine" = [0, 1].'
)


RANGE_KEYS = {
    "from": Key(real(), "First value, below the last.", required=True),
    "to": Key(real(), "Last value.", required=True),
    "step": Key(real(above=0.0), "Distance of the values, at most to - from; of linear ranges."),
    "count": Key(
        integer(least=2, most=MAX_CASES),
        "Number of values, both ends included. Without step and count, samples in [sweep] gives the number.",
    ),
    "scale": Key(choice("linear", "log"), '"log": values of even ratios, from a number above 0.', default='"linear"'),
}
"""A range is no dataclass: `from` is a word of Python's."""


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
    seed: int = key(SEED, "Seed of the samples.", default=0)
    realisations: int | None = key(
        integer(least=1, most=MAX_CASES),
        "Arrangements of each point with a random cell; the k-th has the seed [cell] seed + k - 1 at all points.",
        default=None,
    )
