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
from feti_homog.typing import Int

Numbers = np.ndarray[Any, Any]

WORD = re.compile(rb"\S+")
# The first word that is no number, where whole or real numbers are read.
WRONG_WORD = {
    "i8": re.compile(rb"(?<!\S)(?![-+]?\d+(?!\S))\S+"),
    "f8": re.compile(rb"(?i)(?<!\S)(?![-+]?((\d+(\.\d*)?|\.\d+)(e[-+]?\d+)?|nan|inf)(?!\S))\S+"),
}


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


def chain(following: Int) -> Int:
    """Return the indices met from 0 on, in order.

    following[i] comes after i; behind the last it is out of range.
    """
    size = len(following)
    onward = np.clip(following, 0, size)
    graph = csr_array((np.ones(size), onward, np.append(np.arange(size + 1), size)), shape=(size + 1, size + 1))
    met = breadth_first_order(graph, 0, return_predecessors=False)
    return np.asarray(met[met < size], np.int64)
