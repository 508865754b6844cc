"""Read images: grey values, or labels that stand for phases, such as in segmented micrographs."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from warnings import simplefilter

import numpy as np

from feti_homog.errors import MOST_FAULTS, CaseError, FetiHomogError
from feti_homog.microstructure import phase_names
from feti_homog.schema import types, wording
from feti_homog.system.runtime import input_files
from feti_homog.typing import Array, Int32

# Modes of Pillow with several numbers per pixel, and how many of these are colours.
COLOURS = {"LA": 1, "RGB": 3, "RGBA": 3}
# Modes of Pillow with one whole number per pixel: bits, palettes, 8, 16 and 32 bits.
WHOLE_NUMBERS = {"1", "P", "L", "I", "I;16", "I;16B", "I;16L", "I;16N"}


def read_labels(path: Path, labels: Mapping[str, str], is_mirrored: bool) -> tuple[Int32, tuple[str, ...]]:
    """Read an image, and replace its labels by phase numbers.

    Returns the phase numbers (rows, columns), the lowest row first, and the phase names, the matrix first, others in
    alphabetical order, voids last. `is_mirrored` puts the mirror images beside and above the image.

    Raises:
        CaseError: the file is too large or not an image of whole numbers, or its numbers are not the keys of `labels`.
    """
    image = read_image(path)
    numbers, counts = np.unique(image, return_counts=True)
    names = list(map(str, numbers.tolist()))
    shares = [f"{name}: {share:.3g} %" for name, share in zip(names, 100 * counts / image.size, strict=True)]
    listed = f"{path.name} has {', '.join(shares[:MOST_FAULTS])}{', ...' if len(names) > MOST_FAULTS else ''}"
    faults = []
    if unnamed := [name for name in names if name not in labels]:
        few = ", ".join(unnamed[:3]) + (", ..." if len(unnamed) > 3 else "")
        way = ""
        if len(unnamed) > 16:
            way = "; turn grey values into labels by a threshold, or into a table by fibres --image"
        faults.append(f"[cell] labels: no phase for {few}; {listed}{way}")
    for name in sorted(labels.keys() - set(names)):
        faults.append(f"[cell] labels {name} = {wording.toml_value(labels[name])}: no pixel has it; {listed}")
    if faults:
        raise CaseError(*faults)
    rank = {phase_names.MATRIX: 0, phase_names.VOID: 2}
    phases = tuple(sorted(set(labels.values()), key=lambda name: (rank.get(name, 1), name)))
    phase = np.array([phases.index(labels[name]) for name in names], np.int32)[np.searchsorted(numbers, image)]
    phase = phase[::-1]  # the first row of an image is the upper one
    if is_mirrored:
        phase = np.block([[phase, phase[:, ::-1]], [phase[::-1], phase[::-1, ::-1]]])
        _check_size(path, *phase.shape)
    return phase, phases


def read_image(path: Path, is_grey: bool = False) -> Array:
    """Return the pixels (rows, columns) of an image file, the upper row first; with `is_grey`, as grey values.

    A separate process with limited memory decodes the file.

    Raises:
        CaseError: the file is damaged, too large, not a single image, or, unless `is_grey`, not of whole numbers.
    """
    image = input_files.in_own_process(path, partial(_decoded, is_grey=is_grey), 128 * types.MOST_PIXELS)
    if not is_grey and image.dtype.kind == "f" and np.all((image == np.rint(image)) & (np.abs(image) < 1 << 31)):
        image = image.astype(np.int64)
    if image.ndim != 2 or image.dtype.kind not in ("iubf" if is_grey else "iub"):
        shape = "x".join(map(str, image.shape))
        way = "; cut one layer out of a stack" if image.ndim > 2 else ""
        expected = f"expected one whole number a pixel, in rows{way}"
        raise CaseError(f"{path.name}: {shape} values of type {image.dtype}; {expected}")
    _check_size(path, *image.shape)
    return image.astype(np.uint8) if image.dtype.kind == "b" else image


def _check_size(path: Path, rows: int, columns: int) -> None:
    if min(rows, columns) < 2 or rows * columns > types.MOST_PIXELS:
        expected = f"expected two rows and columns or more, and at most {types.MOST_PIXELS} pixels"
        raise CaseError(f"{path.name}: {columns} x {rows} pixels; {expected}")


def _decoded(path: Path, is_grey: bool) -> Array:
    """Decode an image file, with `is_grey` to grey values, or load the array of a NumPy file.  Raises CaseError."""
    try:
        with input_files.opened(path) as stream:
            if path.suffix.lower() in (".npy", ".npz"):
                stored = np.load(stream, allow_pickle=False)
                entries = [...] if isinstance(stored, np.ndarray) else stored.files
                if len(entries) != 1:
                    raise CaseError(f"{path.name}: {len(entries)} arrays; expected one")
                return np.asarray(stored[entries[0]])
            from PIL import Image, UnidentifiedImageError  # comes with Matplotlib

            simplefilter("ignore")
            Image.MAX_IMAGE_PIXELS = None  # this program has its own limit
            try:
                picture = Image.open(stream, formats=("PNG", "TIFF", "JPEG", "BMP", "PPM"))  # others may run programs
            except UnidentifiedImageError:
                raise CaseError(f"{path.name}: is no image, or damaged") from None
            _check_size(path, picture.height, picture.width)
            if (frames := getattr(picture, "n_frames", 1)) > 1:
                raise CaseError(f"{path.name}: {frames} images; expected one; cut one layer out of a stack")
            if is_grey:
                return np.array(picture if picture.mode in WHOLE_NUMBERS - {"P"} | {"F"} else picture.convert("L"))
            pixels = np.array(picture)
            if picture.mode in COLOURS:
                opaque = pixels[..., -1] == 255 if picture.mode.endswith("A") else True
                if (pixels[..., :1] == pixels[..., : COLOURS[picture.mode]]).all() and np.all(opaque):
                    return pixels[..., 0]  # grey values, stored as colours
                expected = "expected one whole number a pixel: save it with a palette or as grey values"
                raise CaseError(f"{path.name}: pixels of mode {picture.mode} with colours or transparency; {expected}")
            return pixels
    except FetiHomogError:
        raise
    except Exception as error:  # Pillow raises many classes
        raise CaseError(f"{path.name}: cannot be read: {getattr(error, 'strerror', None) or error}") from None
