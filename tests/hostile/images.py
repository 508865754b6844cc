"""Label images and micrographs: declared sizes, code, many arrays, numbers that no label has."""

import os
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image
from support.base_case import MESH_CELL, changed
from support.label_images import circles_in_pixels

from hostile.attempts import Attempt, Content

LABELS = circles_in_pixels(12)


class Program:
    """An object whose pickle makes a folder when it is read."""

    def __reduce__(self) -> tuple[Callable[[str], None], tuple[str]]:
        return os.mkdir, ("made",)


def png(width: int, height: int, colour: int, *chunks: tuple[bytes, bytes]) -> bytes:
    """Return a grey (0) or palette (3) image without pixels, with further chunks."""
    head = struct.pack(">IIBBBBB", width, height, 8, colour, 0, 0, 0)
    parts = (b"IHDR", head), *chunks, (b"IDAT", zlib.compress(bytes(13 * 12))), (b"IEND", b"")
    sealed = (struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d)) for t, d in parts)
    return b"\x89PNG\r\n\x1a\n" + b"".join(sealed)


def npy(array: Any) -> bytes:
    stream = BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def headed(header: str) -> bytes:
    """Return a .npy file of a header alone."""
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()


def shaped(shape: str, kind: str = "'|u1'") -> bytes:
    return headed(f"{{'descr': {kind}, 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n")


def npz(count: int, content: bytes) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for number in range(count):
            archive.writestr(f"../a{number}.npy", content)
    return stream.getvalue()


def tiff(frames: int = 1, **tags: int) -> bytes:
    """Return an image, whose directory leads to itself with `circle`, with another `width`."""
    stream, image = BytesIO(), Image.fromarray(LABELS)
    image.save(stream, "TIFF", save_all=True, append_images=[image] * (frames - 1))
    content = bytearray(stream.getvalue())
    start = struct.unpack_from("<I", content, 4)[0]
    count = struct.unpack_from("<H", content, start)[0]
    for place in range(start + 2, start + 2 + 12 * count, 12):
        if struct.unpack_from("<H", content, place)[0] == 256 and "width" in tags:
            struct.pack_into("<I", content, place + 8, tags["width"])
    if "circle" in tags:
        struct.pack_into("<I", content, start + 2 + 12 * count, start)
    return bytes(content)


IMAGES: dict[str, tuple[Content, str]] = {
    "declared size.png": (png(2**31 - 1, 2**31 - 1, 0), "2147483647 x 2147483647 pixels"),
    "long text.png": (png(12, 12, 0, (b"zTXt", b"a\0\0" + zlib.compress(bytes(50 << 20)))), "cannot be read"),
    "no palette.png": (png(12, 12, 3), "no pixel has it"),
    "a script.png": ("%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 12 12\nshowpage\n", "is no image, or damaged"),
    "objects.npy": (npy(np.array([Program()], object)), "Object arrays cannot be loaded"),
    "code.npy": (headed("__import__('os').mkdir('made')".ljust(117) + "\n"), "cannot be read"),
    "declared size.npy": (shaped("(1000000, 1000000)"), "cannot be read"),
    "negative sizes.npy": (shaped("(-3, -4)"), "cannot be read"),
    "parentheses.npy": (headed("(" * 60_000), "cannot be read"),
    "large fields.npy": (shaped("(9, 9)", "[('a', '|u1', (1000000, 1000000))]"), "cannot be read"),
    "complex numbers.npy": (npy(LABELS * 1j), "expected one whole number a pixel"),
    "structures.npy": (npy(LABELS.astype([("a", "u1"), ("b", "u1")])), "expected one whole number a pixel"),
    "endless numbers.npy": (npy(np.where(LABELS, np.inf, 0.0)), "expected one whole number a pixel"),
    "large numbers.npy": (npy(np.where(LABELS, 1e300, 0.0)), "expected one whole number a pixel"),
    "the least number.npy": (npy(np.where(LABELS, -(2**63), 0)), "no phase for -9223372036854775808"),
    "many labels.npy": (npy(np.arange(40_000).reshape(200, 200)), "no phase for 2, 3, 4, ...;"),
    "nothing.npz": (npz(0, b""), "0 arrays; expected one"),
    "text.npz": (npz(1, b"a"), "expected one whole number a pixel"),
    "20000 arrays.npz": (npz(20_000, npy(np.zeros((2, 2), "u1"))), "20000 arrays; expected one"),
    "declared size.tif": (tiff(width=2**31), "2147483648 x 12 pixels"),
    "many frames.tif": (tiff(300), "300 images; expected one"),
    "a circle.tif": (tiff(circle=1), ""),
    "a pipe.png": (os.mkfifo, "it is a pipe"),
    "endless.npy": (lambda path: path.symlink_to("/dev/zero"), "it is a device, not a file"),
    "sparse.npz": (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 20 << 30), "cannot be read"),
    "a folder.tif": (os.mkdir, "Is a directory"),
    "a link in a circle.png": (lambda path: path.symlink_to(path), "Too many levels of symbolic links"),
}
MICROGRAPHS: dict[str, tuple[Content, str]] = {
    "one grey value.npy": (npy(np.full((500, 500), 7.0)), "expected fibres brighter or darker"),
    "not numbers.npy": (npy(np.full((50, 50), np.nan)), "grey values below 1e100"),
    "large numbers.npy": (npy(1e300 * (np.arange(6400.0).reshape(80, 80) % 7)), "grey values below 1e100"),
    "unequal sides.npy": (npy(np.arange(200_000).reshape(2, 100_000) % 200), ""),
}
BOTH = ("a pipe.png", "endless.npy", "sparse.npz", "a link in a circle.png", "20000 arrays.npz", "objects.npy")


def attempts() -> Iterator[Attempt]:
    cell = 'geometry = "pixels"\nfile = "{}"\npixel = 1.0\nlabels = {{0 = "matrix", 1 = "fibre"}}'
    for name, (content, expected) in IMAGES.items():
        case = changed((MESH_CELL[0], cell.format(name)))
        words = name if callable(content) else expected  # a case names what is no file
        files, codes = {"c.toml": case, name: content}, (2,) if expected else (0,)
        yield Attempt("images", name, ("check", "@/c.toml"), words, files, codes)
    for name, (content, expected) in (MICROGRAPHS | {name: IMAGES[name] for name in BOTH}).items():
        words = ("fibres", "--image", f"@/{name}")
        yield Attempt("micrographs", name, words, expected, {name: content}, (2,) if expected else (0, 2))
