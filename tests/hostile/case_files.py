"""Case files and options, those of `support.hostile_inputs` among them, and sizes that a case asks for."""

import os
from collections.abc import Iterator

from support.base_case import BASE, MESH_CELL, changed
from support.hostile_inputs import CASES, MESHES, OPTIONS, PATH, SMALL, write_grid

from hostile.attempts import Attempt, Content

MIX = 'geometry = "random"\nmix = {glass = 0.3, carbon = 0.2}\nradii = {glass = 0.5, carbon = 0.4}\n'
CELLS = {
    "a coating that nearly touches its image": (
        'geometry = "square"\nfibre_fraction = 0.5\ncoating = 0.2533\nmesh_size = 0.1\n',
        "narrow gaps, thin coatings or small fibres need about 4.9e+06 elements",
    ),
    "fibres of 1e5 widths": (MIX + "width = 1e5\n", "makes 7.8e+09 fibres"),
    "voids without number": (
        'geometry = "random"\nfibres = 50000\nfibre_fraction = 0.1\nvoids = 0.1\nvoid_radius = 0.05\nmesh_size = 0.5\n',
        "",
    ),
    "1e5 fibres": (
        'geometry = "random"\nfibres = 100000\nfibre_fraction = 0.3\nmesh_size = 1e-4\n',
        "elements before refine",
    ),
}
LONG_KIND = "long case files"
UNKNOWN = "material.fibre.young = {start = 70.0, lower = 10.0, upper = 200.0}\n"
FILES: dict[str, tuple[Content, str]] = {
    "endless": (lambda path: path.symlink_to("/dev/zero"), "more than 4 MiB"),
    "a link in a circle": (lambda path: path.symlink_to(path), "Too many levels of symbolic links"),
    "sparse": (lambda path: os.truncate(os.open(path, os.O_CREAT | os.O_RDWR), 20 << 30), "more than 4 MiB"),
    "colours": ("[cell]\n\x1b[31m = 1\n", "not TOML"),
    "colours of a key": (changed(("young = 88.0", '"\\u001b[31m" = 88.0')), r"\u001b[31m"),
    "colours of a name": (changed(('"strain"', '"\\u001b[31m"')), r"\u001b[31m"),
    "turned text": (changed(('"strain"', '"\u202e"')), "\\u202e"),
    "1e5 keys": (BASE + "".join(f"x{k} = 1\n" for k in range(100_000)), "keys; expected at most 10000"),
    "a key of 1e6 parts": ("a." * 1_000_000 + "b = 1\n", "nested more than 50 deep"),
    "quoted parts of a key": ("['a' . " + '"" .' * 500_000 + "b]\n", "nested more than 50 deep"),
    "1e4 sections": (BASE + "".join(f"[x{k}]\n" for k in range(9_000)), "more faults"),
    "3e5 angles": (BASE + f"[angle]\nvalues = [{'1, ' * 300_000}]\n", "entries; expected at most 100000"),
    "2000 angles": (BASE + f"[angle]\nvalues = {[k * 0.1 for k in range(2000)]}\n", "at most 1000 of them"),
    "3000 tests": (
        BASE + f"[unknown]\n{UNKNOWN}" + "[[test]]\nmeasured.E1 = {value = 1, std = 1}\n" * 3000,
        "at most 1000",
    ),
    "9000 uncertain numbers": (
        BASE + "[uncertainty]\n" + "".join(f"material.fibre.x{k} = 1.0\n" for k in range(9000)),
        "9000 uncertain numbers; expected at most 1000",
    ),
    "a bad range of 3000 cases": (
        BASE + '[sweep]\n"cell.fibre_fraction" = {from = 1.0, to = 2.0, step = 3.3e-4}\n',
        "more faults",
    ),
    "2e4 interfaces": (BASE + "[[interface]]\nx = 1\n" * 20_000, "20000 sections; expected at most 1000"),
    "2e4 arcs": (BASE + f"[interface]\ndebonded = [{'{fibre = 1}, ' * 20_000}]\n", "at most 10000 of them"),
    "2e4 cases": (BASE + '[sweep]\n"cell.fibre_fraction" = [' + "'a', " * 20_000 + "]\n", "expected at most 10000"),
    "3e4 unknown keys": (
        BASE + "".join(f"[path.x{k}]\n" + "".join(f"y{n}=1\n" for n in range(100)) for k in range(300)),
        "more faults",
    ),
    "2e4 waypoints": (changed(SMALL, PATH, end=f"[path]\nwaypoints = [{'[1, 0, 0], ' * 20_000}]\n"), "at most 10000"),
}

SPRINGS = (
    "[path]\nstrain = [0.1, 0, 0]\nmax_events = 4\n[output]\npictures = false\n[interface]\nnormal_stiffness = {}\n"
)
SPRINGS += "tangential_stiffness = {}\nlaw = "
ENERGIES = "normal_toughness = 1e-3\ntangential_toughness = 1e-3\n"
STRENGTHS = "normal_strength = 0.05\ntangential_strength = 0.05\n"
LAWS = {
    "energy of soft springs": ('"energy"\ntoughness = 1e-3\n', ("1e3", "1e-99"), "error: ", (3,)),
    "soft springs": (f'"max"\n{STRENGTHS}', ("1e99", "1e-99"), "leaves a matrix singular", (3,)),
    "damage of stiff springs": (f'"bilinear"\n{STRENGTHS}{ENERGIES}', ("1e99", "1e99"), "at most 1.25e+12", (2,)),
    "a jump of the toughness": (
        f'"bilinear"\n{STRENGTHS}{ENERGIES}mixing_exponent = 1e99\n',
        ("1e3", "1e3"),
        "mixing_exponent = 1e+99: expected a number at least 0.5 and at most 100",
        (2,),
    ),
    "endless friction": (f'"max"\n{STRENGTHS}friction = 1e99\n', ("1e3", "1e3"), "", (0, 3)),
}
"""Laws at the edges of their ranges."""


def attempts() -> Iterator[Attempt]:
    for name, (words, expected) in OPTIONS.items():
        yield Attempt("options", name, ("check", "@/c.toml", *words.split()), expected, {"c.toml": changed(SMALL)})
    grids = {f"{name}.msh": grid_of(*sizes) for name, sizes in MESHES.items()}
    for name, (content, expected) in CASES.items():
        file: Content = content.encode("utf-16") if name == "UTF-16" else os.mkdir if name == "a folder" else content
        yield Attempt("case files", name, ("check", "@/c.toml"), expected, {"c.toml": file, **grids})
    for name, (cell, expected) in CELLS.items():
        case = changed((MESH_CELL[0], cell))
        for phase in ("coating", "glass", "carbon"):
            if phase in cell:
                case += f"[material.{phase}]\nyoung = 1.0\npoisson = 0.3\n"
        yield Attempt("cells", name, ("check", "@/c.toml"), expected, {"c.toml": case})
    for name, (content, expected) in FILES.items():
        kind = LONG_KIND if isinstance(content, str) and len(content) > 50_000 else "case files"
        yield Attempt(kind, name, ("check", "@/c.toml"), expected, {"c.toml": content})
    for name, (law, stiffnesses, expected, codes) in LAWS.items():
        case = changed(("0.05", "0.3"), PATH, end=SPRINGS.format(*stiffnesses) + law)
        yield Attempt("laws", name, ("run", "@/c.toml", "--out", "@/out", "--quiet"), expected, {"c.toml": case}, codes)
    yield Attempt("case files", "of no name", ("check", "@/a\0b.toml"), "null character")
    yield Attempt("case files", "none", ("check", "@/\x1b[31m.toml"), r"\x1b[31m")
    yield Attempt("options", "of control characters", ("check", "@/c.toml", "--\x1b[31m"), r"\x1b[31m")


def grid_of(count: int, size: float) -> Content:
    return lambda path: write_grid(path, count, size)
