"""Sections of a .msh file of gmsh, and the numbers in them, as text or binary.

All of it is data: nothing is executed, and nothing allocated that the length of the file does not bound.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from feti_homog.errors import MeshError
from feti_homog.mesh.readers.scanner import NotANumber, Numbers, numbers
from feti_homog.typing import Float, Int

# Whole numbers in binary files: C's int and size_t.
INT, SIZE = "i4", "u8"
# Whole numbers from here on are not exact as floating-point numbers.
LARGEST = 2**53


class Section:
    """Take the numbers of a section `$name` of a text file one after the other.

    They begin at `start` in the file's content, and are read as whole (`i8`) or as real ones (`f8`), all of them.
    """

    order = ""
    """Byte order of a binary file, `<` or `>`."""

    def __init__(self, name: str, content: bytes, start: int, kind: str = "f8") -> None:
        self.name, self.content, self.start, self.stop = name, content, start, end_of(name, content, start)
        self.values, self.place = self._numbers(content[start : self.stop], kind), 0

    def _numbers(self, text: bytes, kind: str) -> Numbers:
        try:
            return numbers(text, kind)
        except NotANumber as error:
            line = self.content.count(b"\n", 0, self.start + error.place) + 1
            self.refuse(f"line {line}, {error}")

    def refuse(self, fault: str) -> NoReturn:
        """Raise MeshError."""
        raise MeshError(f"${self.name}: {fault}")

    def whole(self, count: int, kind: str = INT) -> Int:
        """Take (count,) whole numbers, of this type in a binary file."""
        return self.records(count, 0, kind)[0]

    def count(self) -> int:
        """Take one whole number, a count of what follows."""
        return int(self.whole(1, SIZE)[0])

    def reals(self, count: int) -> Float:
        """Take (count,) real numbers."""
        self._bound(count, len(self.values) - self.place)
        self.place += count
        return np.asarray(self.values[self.place - count : self.place])

    def records(self, count: int, reals: int, kind: str = INT) -> tuple[Int, Float]:
        """Take (count,) whole numbers and, after each, so many real ones (count, reals)."""
        rows = self.reals(count * (1 + reals)).reshape(count, 1 + reals)
        return self.checked(rows[:, 0]), rows[:, 1:]

    def line(self) -> int:
        """Take one whole number, which is a line of text in binary files too."""
        return self.count()

    def rest(self) -> Numbers:
        """Return all numbers that are left, as C's int in a binary file, where they go on to the end of the file."""
        return self.values[self.place :]

    def skip(self, numbers: int) -> None:
        """Leave out so many of the numbers of `rest`."""
        self.reals(numbers)

    def end(self) -> int:
        """Return the place in the file after the numbers, all of which must have been taken."""
        if self.place < len(self.values):
            self.refuse(f"{len(self.values) - self.place} numbers are left after those that its counts announce")
        return self.stop

    def checked(self, values: Numbers) -> Int:
        """Return the numbers as whole ones."""
        if len(values) == 0 or (np.abs(values.max()) < LARGEST and np.abs(values.min()) < LARGEST):
            whole = values.astype(np.int64)
            if np.array_equal(whole, values):
                return whole
        bad = next(value for value in values.tolist() if not (abs(value) < LARGEST and value == int(value)))
        self.refuse(f"{bad:g}: expected a whole number of at most 15 digits")

    def _bound(self, count: int, left: int) -> None:
        if not 0 <= count <= left:
            self.refuse(f"{count} numbers should follow, and {left} do: the file is damaged or broken off")


class BinarySection(Section):
    """The numbers of a section of a binary file."""

    def __init__(self, name: str, content: bytes, start: int, order: str) -> None:
        self.name, self.content, self.order, self.place = name, content, order, start

    def reals(self, count: int) -> Float:
        return np.asarray(self._take(count, np.dtype(f"{self.order}f8")), float)

    def records(self, count: int, reals: int, kind: str = INT) -> tuple[Int, Float]:
        pair = np.dtype([("whole", f"{self.order}{kind}"), ("reals", f"{self.order}f8", (reals,))])
        taken = self._take(count, pair)
        return self.checked(taken["whole"]), taken["reals"].astype(float)

    def _take(self, count: int, kind: np.dtype[Any]) -> Numbers:
        self._bound(count, (len(self.content) - self.place) // kind.itemsize)
        self.place += count * kind.itemsize
        return np.frombuffer(self.content[self.place - count * kind.itemsize : self.place] or b"", kind)

    def line(self) -> int:
        stop = self.content.find(b"\n", self.place, self.place + 30)
        text = self.content[self.place : stop].strip()
        if not re.fullmatch(rb"\d{1,15}", text):
            self.refuse("there is no line with a count at its beginning")
        self.place = stop + 1
        return int(text)

    def rest(self) -> Numbers:
        left = (len(self.content) - self.place) // 4
        return np.frombuffer(self.content, f"{self.order}i4", left, self.place).astype(np.int64)

    def skip(self, numbers: int) -> None:
        self.place += 4 * numbers

    def end(self) -> int:
        found = re.compile(rb"\s*\$End" + self.name.encode()).match(self.content, self.place)
        if found is None:
            self.refuse(f"there is no $End{self.name} after the numbers that its counts announce")
        return self.place


def end_of(name: str, content: bytes, start: int) -> int:
    """Place of the line `$Endname` from `start` on."""
    stop = content.find(f"\n$End{name}".encode(), start - 1)
    if stop < 0:
        raise MeshError(f"${name}: there is no $End{name}: the file is damaged or broken off")
    return stop


def chain(following: Int) -> Int:
    """Return indices that are met from 0 on, in order.

    following[i] comes after i; the last one's is out of range.
    """
    size = len(following)
    onward = np.clip(following, 0, size)
    graph = csr_array((np.ones(size), onward, np.append(np.arange(size + 1), size)), shape=(size + 1, size + 1))
    met = breadth_first_order(graph, 0, return_predecessors=False)
    return np.asarray(met[met < size], np.int64)
