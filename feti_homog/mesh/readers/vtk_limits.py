"""Bounds on what a file of VTK lets meshio allocate and do."""

from __future__ import annotations

import io
import re
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr
from functools import partial
from types import ModuleType, SimpleNamespace
from typing import Any
from xml.etree import ElementTree

from feti_homog.errors import MeshError
from feti_homog.schema.wording import toml_value

# Bytes that compressed data may have: so many in any file, or so many for each of the file's.
MOST_BYTES, MOST_RATIO = 2**26, 50
# Modules by which meshio decompresses, and what makes a decompressor that stops where it should.
DECOMPRESSORS = {"zlib": "decompressobj", "lzma": "LZMADecompressor"}
# Sizes that sections of a legacy file declare, and arrays of its fields: components, tuples and a type.
DECLARED = re.compile(
    rb"(?im)^(POINTS|CELLS|CELL_TYPES|POINT_DATA|CELL_DATA|LOOKUP_TABLE|COLOR_SCALARS)\b([^\n]{0,200})"
)
ARRAY = re.compile(rb"(?im)^\S{1,200} (\d+) (\d+) [a-z][a-z_0-9]{0,20}\s*$")
DATASET = re.compile(rb"(?im)^DATASET\s+(\S{1,60})")
COUNTED = re.compile(rb"([A-Z][A-Za-z0-9]{0,40})\s+([0-9]{1,40})")
RAW = re.compile(rb"(<AppendedData[^>]*>).*(</AppendedData>)", re.DOTALL)


def check(content: bytes, suffix: str) -> None:
    """Raise MeshError where a file of this kind is damaged, or declares what meshio should not read."""
    {".vtu": _check_xml, ".vtk": _check_legacy, ".mesh": _check_medit}[suffix](content)


def _check_medit(content: bytes) -> None:
    for name, count in COUNTED.findall(content):
        if int(count) > len(content):
            raise MeshError(f"it declares {int(count)} {name.decode()}: there are {len(content)} bytes in all")


def _check_xml(content: bytes) -> None:
    if re.search(rb"<AppendedData[^>]*[\"']raw[\"']", content):
        content = RAW.sub(rb"\1\2", content)
    try:
        root = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise MeshError(f"not XML: {error}") from None
    header = root.get("header_type", "UInt32")
    if header not in ("UInt32", "UInt64"):
        raise MeshError(f"header_type is {toml_value(header)}: expected UInt32 or UInt64")
    if any(array.get("Name") in ("faces", "faceoffsets") for array in root.iter("DataArray")):
        raise MeshError("elements are polyhedra: only triangles of three or six nodes can be used")


def _check_legacy(content: bytes) -> None:
    for kind in DATASET.findall(content):
        if kind.upper() != b"UNSTRUCTURED_GRID":
            raise MeshError(f"DATASET {kind.decode(errors='replace')}: expected UNSTRUCTURED_GRID")
    sizes = [
        (name, int(word))
        for name, words in DECLARED.findall(content)
        for word in re.findall(rb"(?<!\S)\d{1,40}(?!\S)", words)
    ]
    sizes += [(b"an array", int(components[:40]) * int(tuples[:40])) for components, tuples in ARRAY.findall(content)]
    for name, size in sizes:
        if size > len(content):
            words = f"{name.decode()} of {size} values"
            raise MeshError(f"it declares {words}: there are {len(content)} bytes in all")


@contextmanager
def bounded(reader: ModuleType, length: int) -> Iterator[None]:
    """Let meshio decompress no more data than a file of this length should have, and print nothing."""
    left = max(MOST_BYTES, MOST_RATIO * length)

    def decompress(make: Callable[[], Any], content: bytes) -> bytes:
        nonlocal left
        decompressor = make()
        data: bytes = decompressor.decompress(content, left + 1)
        left -= len(data)
        if left < 0:
            raise MeshError("its compressed data are too large for a file of its length")
        if not decompressor.eof:
            raise MeshError("its compressed data are broken off")
        return data

    inner = sys.modules.get(f"{reader.__name__}._vtu")
    kept = {name: module for name in DECOMPRESSORS if (module := getattr(inner, name, None))}
    for name, module in kept.items():
        own = partial(decompress, getattr(module, DECOMPRESSORS[name]))
        setattr(inner, name, SimpleNamespace(decompress=own))
    try:
        with redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.filterwarnings("error", "string or file could not be read")  # what is no number
            yield
    finally:
        for name, module in kept.items():
            setattr(inner, name, module)
