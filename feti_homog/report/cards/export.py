"""`feti-homog export`: the material card of a folder of results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from feti_homog.errors import CaseError
from feti_homog.report.cards import abaqus, ansys, csv_table, moose
from feti_homog.report.cards.effective_material import (
    EffectiveMaterial,
    in_axes_of_the_cell,
    nearest_transversely_isotropic,
)
from feti_homog.results import result_json

FORMATS: dict[str, Callable[[EffectiveMaterial], str]] = {
    "abaqus": abaqus.text,
    "calculix": abaqus.calculix_text,
    "ansys": ansys.text,
    "moose": moose.text,
    "csv": csv_table.text,
}
SYMMETRIES: dict[str, Callable[[Mapping[str, Any]], EffectiveMaterial]] = {
    "orthotropic": in_axes_of_the_cell,
    "transversely isotropic": nearest_transversely_isotropic,
}


def card(directory: Path, form: str, symmetry: str) -> str:
    """Return the card, in one of `FORMATS`, of the material of one of `SYMMETRIES` of the result in a folder.

    Raises:
        CaseError: there is no such format or result, it is damaged, or it has no material that the format can carry;
            one line.
    """
    if form not in FORMATS:
        raise CaseError(f"--format {form}".rstrip() + f": expected one of {', '.join(FORMATS)}")
    document = result_json.read(directory)
    path = directory / result_json.NAME
    try:
        return FORMATS[form](SYMMETRIES[symmetry](document))
    except CaseError as error:
        raise CaseError(*(f"cannot export {path}: {fault}" for fault in error.faults)) from error
    except (AttributeError, KeyError, TypeError, ValueError) as error:
        place = f"{type(error).__name__}: {error}"
        raise CaseError(f"{path}: it is damaged, or no result of this program ({place})") from error
