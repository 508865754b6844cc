"""Describe the fields of records, which are dataclasses, by meaning, unit and names in files.

Writers of files and the reference tables of the manual take names and types from the descriptions.  Fields without a
description are not written.
"""

import dataclasses
import types
import typing
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")

DESCRIPTION = "description"
STRESS, LENGTH, SECONDS, BYTES, DEGREES = "unit of the moduli", "unit of the cell", "s", "bytes", "degrees"
KINDS = {float: int | float, int: int, str: str, bool: bool, Mapping: Mapping}


@dataclass(frozen=True)
class Description:
    """The description of a field.

    Attributes:
        meaning: meaning in words.
        unit: unit, empty for pure numbers, counts and strings.
        shape: shape of an array, such as "(3, 3)" or "(n, 2)"; empty for other values.
        components: names of the columns that an array fills in a table.
        spatial_components: `components` in generalized plane strain, if they differ.
        entries: keys of a mapping and their meanings; a single key in capitals stands for any key.
        dtype: type of an array in an HDF5 file.
        name: name in an HDF5 file, if it is not the name of the field.
    """

    meaning: str
    unit: str = ""
    shape: str = ""
    components: tuple[str, ...] = ()
    entries: Mapping[str, str] = dataclasses.field(default_factory=dict)
    dtype: str = "float64"
    name: str = ""
    spatial_components: tuple[str, ...] = ()


def described(
    meaning: str,
    unit: str = "",
    shape: str = "",
    components: tuple[str, ...] = (),
    *,
    default: Any = dataclasses.MISSING,
    **attributes: Any,
) -> Any:
    """Return a dataclass field with a `Description` of these arguments."""
    description = Description(meaning, unit, shape, components, **attributes)
    return dataclasses.field(default=default, metadata={DESCRIPTION: description})


def descriptions(record: type | Any) -> dict[str, Description]:
    """Return the descriptions of the fields of a record, or of its class, by name."""
    return {f.name: f.metadata[DESCRIPTION] for f in dataclasses.fields(record) if DESCRIPTION in f.metadata}


def plain(value: Any) -> Any:
    """Convert a value to plain mappings and lists: a record becomes a mapping of its described fields.

    Fields with default None are left out if they are None.
    """
    if dataclasses.is_dataclass(value):
        defaults = {f.name: f.default for f in dataclasses.fields(value)}
        items = {name: getattr(value, name) for name in descriptions(value)}
        return {name: plain(item) for name, item in items.items() if item is not None or defaults[name] is not None}
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def restored(kind: type[T], document: Mapping[str, Any]) -> T:
    """Construct a record of class `kind` from the output of `plain`; unknown keys are ignored.

    Raises:
        KeyError: a key without a default is missing.
        TypeError, ValueError: a value has another type than its field, or an array has other axes or entries.
    """
    _require(document, Mapping)
    hints, values = typing.get_type_hints(kind), {}
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        has_default = field.name not in document and field.default is not dataclasses.MISSING
        if DESCRIPTION not in field.metadata or has_default:
            continue
        value = values[field.name] = _restored_value(hints[field.name], document[field.name])
        shape = field.metadata[DESCRIPTION].shape
        axes = [words.rstrip("(),").count(",") + 1 for words in shape.split(" or ")]
        if getattr(value, "ndim", axes[0]) not in axes:
            raise TypeError(f"{field.name}: expected an array {shape}")
    return kind(**values)


def _restored_value(hint: Any, value: Any) -> Any:
    """Convert a value of a document to the type `hint`, or keep None if `hint` allows it.  Raises like `restored`."""
    if value is None and without_none(hint) != hint:
        return None
    hint = without_none(hint)
    if dataclasses.is_dataclass(hint):
        return restored(typing.cast(type, hint), value)
    origin = typing.get_origin(hint) or hint
    if origin.__module__ == "numpy":
        import numpy as np  # NumPy reads the environment when it is imported

        return np.asarray(value, dtype=float)
    if origin is tuple:
        _require(value, list | tuple)
        return tuple(_restored_value(typing.get_args(hint)[0], item) for item in value)
    if origin in KINDS:
        _require(value, KINDS[origin])
    if origin is Mapping and typing.get_args(hint)[1] in KINDS:
        return {name: _restored_value(typing.get_args(hint)[1], item) for name, item in value.items()}
    return value


def _require(value: Any, kind: Any) -> None:
    """Raise TypeError for a value that is not of type `kind`; a truth value is not a number."""
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"{value!r:.40} has another type than expected")


def without_none(hint: Any) -> Any:
    """Return X for the type `X | None`, and any other type as it is."""
    if typing.get_origin(hint) not in (types.UnionType, typing.Union):
        return hint
    (kind,) = (part for part in typing.get_args(hint) if part is not type(None))
    return kind
