"""The numbers of a result in other units, by the units that `schema_keys` documents."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from feti_homog.analysis.result import schema_keys

# Exponents of the units of stress and length.
UNITS = {
    "": (0, 0), "degrees": (0, 0), "1 / temperature": (0, 0), "s": (0, 0), "bytes": (0, 0),
    "unit of the cell": (0, 1), "unit of the cell squared": (0, 2),
    "unit of the moduli": (1, 0), "1 / unit of the moduli": (-1, 0),
    "unit of the moduli per unit of temperature": (1, 0),
    "unit of the moduli times that of the cell": (1, 1),
}  # fmt: skip
FACTOR = "envelope[].factor"  # a stress or a strain


@cache
def units_of_keys() -> dict[str, tuple[int, int]]:
    """The exponents of each key of result.json.  Raises KeyError for a unit that is new."""
    return {key.path: UNITS[key.unit] for key in schema_keys()}


def in_units(document: Any, stress: float, length: float) -> Any:
    """A result in units in which a stress of 1 is `stress`; its case stays as it is."""
    own = dict(units_of_keys())
    if document["case"].get("envelope", {"plane": ["E11"]})["plane"][0].startswith("S"):
        own[FACTOR] = (1, 0)
    return {name: v if name == "case" else _scaled(v, name, own, stress, length) for name, v in document.items()}


def _scaled(value: Any, path: str, units: Mapping[str, tuple[int, int]], stress: float, length: float) -> Any:
    if isinstance(value, Mapping):
        return {name: _scaled(item, f"{path}.{name}", units, stress, length) for name, item in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return [_scaled(item, f"{path}[]", units, stress, length) for item in value]
    a, b = units.get(path, (0, 0))
    return value if (a, b) == (0, 0) or value is None else (np.asarray(value) * (stress**a * length**b)).tolist()
