"""Tables of fibres."""

import os
from collections.abc import Iterator

from support.base_case import MESH_CELL, changed

from hostile.attempts import Attempt, Content

HEAD = "# width = 1, height = 1\nx,y,radius\n"
CASE = changed((MESH_CELL[0], 'geometry = "table"\nfile = "t.csv"\nmesh_size = 0.1'))
MATCHED = changed((MESH_CELL[0], 'geometry = "random"\nmatch = "t.csv"\nmesh_size = 0.1'))
MANY = 30_000
TABLES: dict[str, tuple[Content, str]] = {
    "a pipe": (os.mkfifo, "it is a pipe"),
    "a folder": (os.mkdir, "Is a directory"),
    "endless": (lambda path: path.symlink_to("/dev/zero"), "it is a device, not a file"),
    "a link in a circle": (lambda path: path.symlink_to(path), "Too many levels of symbolic links"),
    "sparse": (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 20 << 30), "more than 64 MiB"),
    "empty": ("", "no rows"),
    "zeros": (b"\0" * 10000, "null characters"),
    "an image": (b"\x89PNG\r\n\x1a\n\xff" * 100, "expected text in UTF-8"),
    "names alone": (HEAD, "no fibres"),
    "one line of a megabyte": (HEAD + "1," * 500_000, "it has 500001"),
    "a name of a megabyte": ("x" * 1_000_000, "expected names of columns"),
    "a name with many blanks": ("x,y,radius,a" + " " * 60_000 + "b\n0.5,0.5,-0.1,1\n", "expected a number above 0"),
    "sizes without a number": ("# " + "width:" * 20_000 + "=\nx,y,radius\n0.5,0.5,0.1\n", "width"),
    "colours": (HEAD + "\x1b[31m,1,1\n", "x = "),
    "colours of a size": ("# width = 1\x1b[31m\nx,y,radius\n0.5,0.5,0.1\n", "width = 1"),
    "two numbers of a size": ("# width = 10 20\nx,y,radius\n0.5,0.5,0.1\n", "width"),
    "an endless size": ("# width = 1e999, height = 1\nx,y,radius\n0.5,0.5,0.1\n", "expected a number above 0"),
    "underscores": (HEAD + "0.2_5,0.5,0.1\n", "x = "),
    "not a number": (HEAD + "nan,0.5,0.1\n", "x = "),
    "too large a number": (HEAD + "1e400,0.5,0.1\n", "x = "),
    "nearly too large": (HEAD + "0.5,0.5,0.1\n1e99,0.5,0.1\n", "lies outside the cell"),
    "a negative radius": (HEAD + "0.5,0.5,-0.1\n", "expected a number above 0"),
    "a tiny radius": (HEAD + "0.5,0.5,1e-90\n", "expected"),
    "a large radius": (HEAD + "0.5,0.5,0.6\n", "expected"),
    "an open quotation": (HEAD + '"0.5,0.5,0.1\n', "a quotation mark is not closed"),
    "formulas": (HEAD + "=cmd|'/c calc',0.5,0.1\n", "x = "),
    "columns of the same name": ("x,y,radius,x\n0.5,0.5,0.1,0.5\n", "the name is there twice"),
    "many faults": (HEAD + "a,b,-1\n" * 10_000, "29980 more faults"),
    "1e6 rows": (HEAD + "a,b,-1\n" * 1_000_000, "1000001 lines; expected at most 200000"),
    "3e4 rows outside": (HEAD + "0,0,0.1\n" + "2,0,0.1\n" * MANY, "and 29980 more faults"),
    "rows that are alike": (HEAD + "0.5,0.5,0.01\n" * MANY, "pairs of fibres are nearer"),
    "a large one among many": (
        HEAD + "".join(f"{k % 200 / 200},{k // 200 / 200},0.0001\n" for k in range(MANY)) + "0.50001,0.90001,0.2\n",
        "pairs of fibres are nearer",
    ),
    "phases of control characters": ("x,y,radius,phase\n0.5,0.5,0.1,fi\x07bre\n", "phase"),
    "phases without a number": ("# width=1, height=1\nx,y,radius,phase\n0.5,0.5,0.1,fibre:\n", "phase"),
    "phases of many digits": (
        "# width=1, height=1\nx,y,radius,phase\n0.5,0.5,0.1,fibre:99999999999999999999\n",
        "phase",
    ),
    "negative coatings": ("# width=1, height=1\nx,y,radius,coating\n0.5,0.5,0.1,-1e-9\n", "coating = -1e-09"),
}
OF_A_WINDOW = (
    "a pipe",
    "endless",
    "sparse",
    "colours",
    "many faults",
    "a name of a megabyte",
    "an image",
    "not a number",
)


def attempts() -> Iterator[Attempt]:
    for name, (content, expected) in TABLES.items():
        words = "t.csv" if callable(content) and name != "sparse" else expected  # no file is not looked into
        yield Attempt("tables", name, ("check", "@/c.toml"), words, {"c.toml": CASE, "t.csv": content})
    for name in OF_A_WINDOW:
        content, expected = TABLES[name]
        expected = "a pipe or device" if name in ("a pipe", "endless") else expected
        yield Attempt("windows", name, ("check", "@/c.toml"), expected, {"c.toml": MATCHED, "t.csv": content})
