"""result.json: the document of a run, written whole or not at all."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from feti_homog.errors import FetiHomogError
from feti_homog.output.files import atomic

NAME = "result.json"


def write(directory: Path, document: Mapping[str, Any]) -> Path:
    """Writes `directory`/result.json, whose folder is made if needed; returns its path.

    NumPy arrays and scalars become lists and numbers, tuples lists, paths text. The file is replaced in one
    step: a reader finds the old document or the new one. Call on one rank.

    Raises:
        FetiHomogError: a number is not finite (one line for each, with its place in the document), or the
            file cannot be written.
        TypeError: a value has no form in JSON.
    """
    faults: list[str] = []
    plain = _plain(document, "", faults)
    if faults:
        raise FetiHomogError(*faults)

    def write_text(part: Path) -> None:
        part.parent.mkdir(parents=True, exist_ok=True)
        with part.open("w", encoding="utf-8") as stream:
            json.dump(plain, stream, indent=1, ensure_ascii=False, allow_nan=False)
            stream.write("\n")

    return atomic.replace(Path(directory) / NAME, write_text)


def read(directory: Path) -> dict[str, Any]:
    """The document of `directory`/result.json. Raises FetiHomogError if it is missing or not JSON."""
    path = Path(directory) / NAME
    try:
        document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise FetiHomogError(f"cannot read {path}: {error.strerror or error}") from error
    except ValueError as error:
        raise FetiHomogError(f"cannot read {path}: {error}") from error
    return document


def _plain(value: Any, place: str, faults: list[str]) -> Any:
    """The value in JSON's own types; appends to `faults` the place of each number that is not finite."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {key: _plain(item, f"{place}.{key}" if place else key, faults) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, f"{place}[{i}]", faults) for i, item in enumerate(value)]
    if isinstance(value, float) and not math.isfinite(value):
        faults.append(f"{NAME}: {place} is {value}, not a finite number")
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    raise TypeError(f"{NAME}: {place} is a {type(value).__name__}, which JSON cannot hold")
