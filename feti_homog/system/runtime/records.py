"""Records: dataclasses whose fields carry their meaning, unit and the names under which they are written.

The writers of files take names and types from these descriptions, and so do the reference tables of the manual.
Fields without a description are not written.
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
    """Content of a field.

    Attributes:
        meaning: in words.
        unit: empty for pure numbers, counts and texts.
        shape: of an array, as "(3, 3)" or "(n, 2)".
        components: the names of the columns that an array fills in a table.
        spatial_components: `components` of generalized plane strain, if there are more.
        entries: the keys of a mapping and their meanings; a single key in capitals stands for any.
        dtype: of an array in an HDF5 file.
        name: under which an HDF5 file has it, if not the field's.
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
    """Return a dataclass field with a description; `attributes` are further ones of it."""
    description = Description(meaning, unit, shape, components, **attributes)
    return dataclasses.field(default=default, metadata={DESCRIPTION: description})


def descriptions(record: type | Any) -> dict[str, Description]:
    """Return the described fields of a record, or of its class, by name."""
    return {f.name: f.metadata[DESCRIPTION] for f in dataclasses.fields(record) if DESCRIPTION in f.metadata}


def plain(value: Any) -> Any:
    """Return the value, with a mapping of its described fields for each record.

    A field whose default is None is left out while it is None.
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
    """Return the record of a class from its document by `plain`; other keys are left out.

    Raises:
        KeyError: a key without a default is missing.
        TypeError: a value is of another kind than the record's.
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
            raise TypeError(f"{field.name} is no array {shape}")
    return kind(**values)


def _restored_value(hint: Any, value: Any) -> Any:
    if value is None and without_none(hint) != hint:
        return None
    hint = without_none(hint)
    if dataclasses.is_dataclass(hint):
        return restored(typing.cast(type, hint), value)
    origin = typing.get_origin(hint) or hint
    if origin.__module__ == "numpy":
        import numpy as np  # it reads the environment

        return np.asarray(value, dtype=float)
    if origin is tuple:
        _require(value, list | tuple)
        return tuple(_restored_value(typing.get_args(hint)[0], item) for item in value)
    if origin in KINDS:
        _require(value, KINDS[origin])
    if origin is Mapping and (inner := typing.get_args(hint)[1]) in KINDS:
        return {name: _restored_value(inner, item) for name, item in value.items()}
    return value


def _require(value: Any, kind: Any) -> None:
    """Raise TypeError for a value of another kind; truth is no number."""
    if not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool):
        raise TypeError(f"{value!r:.40} is of another type than expected")


def without_none(hint: Any) -> Any:
    """Return X, the type in `X | None`."""
    if typing.get_origin(hint) not in (types.UnionType, typing.Union):
        return hint
    (kind,) = (part for part in typing.get_args(hint) if part is not type(None))
    return kind
