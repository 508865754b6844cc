"""A Sphinx extension that shows the project's docstrings: plain text with `names` in single backticks.

Markup of reStructuredText (|x|, *, lam_, K^-1) is text here; `names` of the package become links, other words in
backticks become code. Attributes that the docstring of their class describes stand there with their type.
"""

import re
from typing import Any

from jinja2 import Environment
from sphinx.application import Sphinx

NAME = re.compile(r"[A-Za-z_][\w.]*")
SECTION = re.compile(r"(Args|Attributes|Raises|Returns|Yields):")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("autodoc-process-docstring", _to_markup, priority=400)  # before napoleon, at 500
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def add_filters(environment: Environment) -> None:
    """Add the filters that the templates apply to a class."""
    environment.filters |= {"described": described, "names_described": names_described}


def _to_markup(app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]) -> None:
    lines[:] = markup("\n".join(lines)).split("\n")


def markup(docstring: str) -> str:
    """Return the docstring in reStructuredText; indented blocks, such as formulas, stay as they are."""
    blocks, in_section = [], False
    for block in re.split(r"\n[ ]*\n", docstring):
        if block.startswith(" ") and not in_section:
            blocks.append(f"::\n\n{block}")
        else:
            in_section = any(map(SECTION.fullmatch, block.splitlines()))
            blocks.append(_paragraph(block))
    return "\n\n".join(blocks)


def _paragraph(block: str) -> str:
    pieces = re.split(r"``?([^`]+)``?", block)
    text = [_plain(piece) for piece in pieces[::2]]
    code = [f"`{piece}`" if NAME.fullmatch(piece) else f"``{piece}``" for piece in pieces[1::2]]
    return "".join(part for pair in zip(text, [*code, ""], strict=True) for part in pair)


def _plain(text: str) -> str:
    return re.sub(r"[*|\\]|_(?!\w)", r"\\\g<0>", text)


def names_described(cls: Any) -> list[str]:
    """Return the attributes that the docstring of a class, as napoleon leaves it, describes."""
    described = re.findall(r"^:ivar ([\w, ]+):", cls.docstring, flags=re.MULTILINE)
    return [name for names in described for name in names.split(", ")]


def described(cls: Any) -> str:
    """Return the docstring of a class with the types of the attributes that it describes."""
    types = {child.name: child.annotation for child in cls.children if child.type == "attribute" and child.annotation}
    lines = [f":vartype {name}: {_plain(types[name])}" for name in names_described(cls) if name in types]
    return "\n".join([cls.docstring.rstrip(), *lines, ""])
