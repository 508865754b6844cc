"""A right case file, and the same with some of its words exchanged."""

import re

BASE = """\
[cell]
geometry = "hexagonal"
fibre_fraction = 0.4
mesh_size = 0.05

[material.matrix]
young = 88.0
poisson = 0.299

[material.fibre]
young = 200.0
poisson = 0.222

[analysis]
type = "stiffness"
plane = "strain"
"""

RANDOM = 'geometry = "random"\nfibres = 20\n'
FIBRE = "[material.fibre]\nyoung = 200.0\npoisson = 0.222\n"
ORTHOTROPIC = "E1 = 10.0\nE2 = 5.0\nnu12 = 0.3\nG12 = 2.0\n"
TRANSVERSE = "E_transverse = 14.0\nnu_transverse = 0.25\n"
AXIAL = "E_axial = 235.0\nnu_axial = 0.2\n"
SPATIAL = (
    "stiffness = [[9, 3, 2, 0, 0, 0.5], [3, 8, 2, 0, 0, 0], [2, 2, 7, 0, 0, 0], "
    "[0, 0, 0, 3, 0.5, 0], [0, 0, 0, 0.5, 2, 0], [0.5, 0, 0, 0, 0, 4]]\n"
)
OUT_OF_PLANE = "E3 = 5.0\nnu13 = 0.3\nnu23 = 0.3\n"

MESH_CELL = ('geometry = "hexagonal"\nfibre_fraction = 0.4\nmesh_size = 0.05', 'geometry = "mesh"\nfile = "cell.msh"')

TABLE_CELL = (
    MESH_CELL[0],
    'geometry = "table"\nwidth = 1.0\nheight = 1.0\nfibre_list = [{x = 0.5, y = 0.5, radius = 0.3}]',
)


def changed(*edits: tuple[str, str], end: str = "") -> str:
    """Return the right case with its words exchanged and lines added at its end."""
    document = BASE
    for old, new in edits:
        assert document.count(old) >= 1, old
        document = document.replace(old, new, 1)
    return document + end


def fibre(constants: str, plane: str = "strain") -> str:
    return changed((FIBRE, f"[material.fibre]\n{constants}"), ('"strain"', f'"{plane}"'))


def cell(old: str, new: str) -> str:
    return changed((old, new))


def ended(text: str) -> str:
    return changed(end=text)


def fraction(value: str) -> str:
    return cell("fibre_fraction = 0.4", f"fibre_fraction = {value}")


def with_lines(case: str, *lines: str) -> str:
    """Put lines "[section] key = value" into a case, each in place of the one that its key has."""
    for line in lines:
        section, key, value = re.fullmatch(r"\[(.+?)\] (\w+) = (.*)", line).groups()
        before, head, rest = case.partition(f"[{section}]\n")
        entries, bracket, after = rest.partition("\n[")
        others = [entry for entry in entries.splitlines() if not entry.startswith(f"{key} = ")]
        case = "\n".join([before + (head or f"[{section}]\n") + f"{key} = {value}", *others, ""]) + bracket + after
    return case


def faults(case: str, lines: dict[str, str]) -> dict[str, str]:
    """Return the case with each line, below the fault that names the line and ends with these words."""
    return {f"{line}: {words}": with_lines(case, line) for line, words in lines.items()}
