"""Numbers and words of mesh files, taken one after the other, from text or binary content.

Content is data: nothing is executed, and nothing allocated that the length of the file does not bound.
"""

from __future__ import annotations

import codecs
import re
import warnings
from collections import deque
from itertools import islice
from typing import Any, NoReturn

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import breadth_first_order

from feti_homog.errors import MeshError
from feti_homog.schema.wording import toml_value
from feti_homog.typing import Float, Int

Numbers = np.ndarray[Any, Any]

WORD = re.compile(rb"\S+")
# The first word that is no number, where whole or real numbers are read.
WRONG_WORD = {
    "i8": re.compile(rb"(?<!\S)(?![-+]?\d+(?!\S))\S+"),
    "f8": re.compile(rb"(?i)(?<!\S)(?![-+]?((\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|nan|inf)(?!\S))\S+"),
}
# Whole numbers in binary .msh files: C's int and size_t.
INT, SIZE = "i4", "u8"
# Whole numbers from here on are not exact as floating-point numbers.
LARGEST = 2**53


class NotANumber(ValueError):
    """A word where a number is expected; `place` is where it begins in the text."""

    def __init__(self, text: bytes, kind: str) -> None:
        wrong = WRONG_WORD[kind].search(text)
        self.place = 0 if wrong is None else wrong.start()
        word = "" if wrong is None else f"{toml_value(wrong[0].decode(errors='replace'))}: "
        super().__init__(f"{word}expected a {'whole number' if kind == 'i8' else 'number'}")


def numbers(text: bytes, kind: str) -> Numbers:
    """Convert text into numbers, whole (`i8`) or real (`f8`).

    Raises:
        NotANumber: another word is in it.
    """
    if not text.strip():
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, kind, sep=" ")
        except (DeprecationWarning, ValueError):  # the one becomes the other in a later version of NumPy
            raise NotANumber(text, kind) from None


class Scanner:
    """Take lines, words and arrays of a file; binary arrays have the most significant byte first."""

    def __init__(self, content: bytes) -> None:
        self.content, self.place, self.is_binary = content.removeprefix(codecs.BOM_UTF8), 0, False

    def line(self) -> list[str]:
        """Take the words in the next line that has any; none at the file's end."""
        words, start = list[str](), self.place
        while not words and start < len(self.content):
            stop = self.content.find(b"\n", start)
            self.place = len(self.content) if stop < 0 else stop + 1
            words = self.content[start : self.place].decode(errors="replace").split()
            start = self.place
        return words

    def word(self) -> str:
        """Take the next word; empty at the end of the file."""
        match = WORD.search(self.content, self.place)
        self.place = len(self.content) if match is None else match.end()
        return "" if match is None else match[0].decode(errors="replace")

    def follows(self, word: str) -> bool:
        """Return whether the next word is `word`."""
        match = WORD.search(self.content, self.place)
        return match is not None and match[0].upper() == word.encode()

    def count(self, word: str) -> int:
        """Return the number of values that a word announces."""
        if not re.fullmatch("[0-9]{1,15}", word):
            self.refuse(f"{toml_value(word)}: expected a number of values")
        return int(word)

    def take(self, count: int, kind: str) -> Numbers:
        """Take (count,) numbers of NumPy's type `kind`."""
        kind = kind if self.is_binary else "f8" if kind[0] == "f" else "i8"
        size = int(kind[1]) if self.is_binary else 1
        if count * size > len(self.content) - self.place:
            self.refuse(f"{count} values should follow, and {len(self.content) - self.place} bytes do")
        start = self.place
        if self.is_binary:
            self.place += count * size
            return np.frombuffer(self.content, f">{kind}", count, start).astype(kind)
        last = deque(islice(WORD.finditer(self.content, start), count), maxlen=1)
        self.place = last[0].end() if last else start
        try:
            values = numbers(self.content[start : self.place], kind)
        except NotANumber as error:
            self.place = start + error.place
            self.refuse(str(error))
        if len(values) < count:
            self.refuse(f"{count} values should follow, and {len(values)} do")
        return values

    def refuse(self, fault: str) -> NoReturn:
        """Raise MeshError with the line that has been reached."""
        line = self.content[: self.place].rstrip().count(b"\n") + 1
        raise MeshError(fault if self.is_binary else f"line {line}: {fault}")


class Section:
    """Take the numbers in section `$name` of a .msh file, which begin at `start`.

    Text is read at once, as whole (`i8`) or real numbers (`f8`). A binary file has the byte order `<` or `>`; its
    numbers are read as they are taken.
    """

    def __init__(self, name: str, content: bytes, start: int, order: str, kind: str) -> None:
        self.name, self.content, self.order, self.place = name, content, order, start
        if order:
            return
        self.stop, self.place = end_of(name, content, start), 0
        try:
            self.values = numbers(content[start : self.stop], kind)
        except NotANumber as error:
            line = content.count(b"\n", 0, start + error.place) + 1
            self.refuse(f"line {line}, {error}")

    def refuse(self, fault: str) -> NoReturn:
        """Raise MeshError with the name of the section."""
        raise MeshError(f"${self.name}: {fault}")

    def take(self, count: int, kind: np.dtype[Any]) -> Numbers:
        """Take (count,) numbers, of a NumPy type in a binary file."""
        size = kind.itemsize if self.order else 1
        remaining = (len(self.content if self.order else self.values) - self.place) // size
        if not 0 <= count <= remaining:
            self.refuse(f"{count} numbers should follow, and {remaining} do: the file is damaged or broken off")
        start, self.place = self.place, self.place + count * size
        return np.frombuffer(self.content[start : self.place], kind) if self.order else self.values[start : self.place]

    def reals(self, count: int) -> Float:
        """Take (count,) real numbers."""
        return np.asarray(self.take(count, np.dtype(f"{self.order}f8")), float)

    def records(self, count: int, reals: int, kind: str = INT) -> tuple[Int, Float]:
        """Take (count,) whole numbers and, after each, real ones (count, reals)."""
        pair = np.dtype([("whole", f"{self.order}{kind}"), ("reals", f"{self.order}f8", (reals,))])
        if self.order:
            taken = self.take(count, pair)
            return self.checked(taken["whole"]), taken["reals"].astype(float)
        rows = self.take(count * (1 + reals), pair).reshape(count, 1 + reals)
        return self.checked(rows[:, 0]), rows[:, 1:]

    def whole(self, count: int, kind: str = INT) -> Int:
        """Take (count,) whole numbers, of type `kind` in a binary file."""
        return self.records(count, 0, kind)[0]

    def count(self) -> int:
        """Take one whole number, a count of entries."""
        return int(self.whole(1, SIZE)[0])

    def line(self) -> int:
        """Take one whole number, a line of text in binary files too."""
        if not self.order:
            return self.count()
        stop = self.content.find(b"\n", self.place, self.place + 30)
        text = self.content[self.place : stop].strip()
        if not re.fullmatch(rb"\d{1,15}", text):
            self.refuse("there is no line with a count at its beginning")
        self.place = stop + 1
        return int(text)

    def rest(self) -> Numbers:
        """Return all numbers that follow, as C's int in a binary file, where they go on to its end."""
        if not self.order:
            return self.values[self.place :]
        count = (len(self.content) - self.place) // 4
        return np.frombuffer(self.content, f"{self.order}i4", count, self.place).astype(np.int64)

    def skip(self, count: int) -> None:
        """Leave out the first numbers of `rest`."""
        self.place += count * (4 if self.order else 1)

    def end(self) -> int:
        """Return the place in the file after the numbers, all of which must have been taken."""
        if self.order:
            if re.compile(rb"\s*\$End" + self.name.encode()).match(self.content, self.place) is None:
                self.refuse(f"there is no $End{self.name} after the numbers that its counts announce")
            return self.place
        if self.place < len(self.values):
            self.refuse(f"{len(self.values) - self.place} numbers are left after those that its counts announce")
        return self.stop

    def checked(self, values: Numbers) -> Int:
        """Convert numbers into whole ones."""
        if len(values) == 0 or (np.abs(values.max()) < LARGEST and np.abs(values.min()) < LARGEST):
            integers = values.astype(np.int64)
            if np.array_equal(integers, values):
                return integers
        bad = next(value for value in values.tolist() if not (abs(value) < LARGEST and value == int(value)))
        self.refuse(f"{bad:g}: expected a whole number of at most 15 digits")


def end_of(name: str, content: bytes, start: int) -> int:
    """Return the place of the line `$Endname` from `start` on."""
    stop = content.find(f"\n$End{name}".encode(), start - 1)
    if stop < 0:
        raise MeshError(f"${name}: there is no $End{name}: the file is damaged or broken off")
    return stop


def chain(following: Int) -> Int:
    """Return the indices met from 0 on, in order.

    following[i] comes after i; behind the last it is out of range.
    """
    size = len(following)
    onward = np.clip(following, 0, size)
    graph = csr_array((np.ones(size), onward, np.append(np.arange(size + 1), size)), shape=(size + 1, size + 1))
    met = breadth_first_order(graph, 0, return_predecessors=False)
    return np.asarray(met[met < size], np.int64)
