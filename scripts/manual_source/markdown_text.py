"""Pieces of Markdown: pages, tables, and text in which nothing is markup but `code`."""

import re
from collections.abc import Iterable, Sequence


def page(*parts: str) -> str:
    """Return the parts with empty lines between them."""
    return "\n\n".join(parts)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown; columns that are empty in all rows are left out."""
    rows = list(rows)
    used = [i for i in range(len(head)) if any(row[i] for row in rows)]
    lines = [[head[i] for i in used], ["---"] * len(used), *([plain(row[i]) for i in used] for row in rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def plain(text: str) -> str:
    """Return the text with Markdown's markup characters escaped, except in `code`."""
    pieces = text.split("`")
    pieces[::2] = [re.sub(r"[\\*_\[\]<>$#~|]", r"\\\g<0>", piece) for piece in pieces[::2]]
    pieces[1::2] = [piece.replace("|", r"\|") for piece in pieces[1::2]]
    return "`".join(pieces)


def code(word: str) -> str:
    """Return the word as code, if it is not empty."""
    return word and f"`{word}`"


def capitalised(words: str) -> str:
    """Return the text with a capital first letter; other letters stay as they are."""
    return words[:1].upper() + words[1:]
