"""Quantities that are integrated along curved interfaces: the rates at which they converge, by shape and order.

The rows of the table in tests/README.md are the expected ones.
"""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import cKDTree
from support.users_meshes import polar_cell, waved

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

README = Path(__file__).parents[1] / "README.md"
SPRINGS = {"normal_stiffness": 10.0, "tangential_stiffness": 4.0}
STRENGTHS = {"normal_strength": 1.0, "tangential_strength": 1.5}
MATERIALS = {
    "matrix": {"young": 1.0, "poisson": 0.3, "expansion": 3.0},
    "fibre": {"young": 10.0, "poisson": 0.2, "expansion": 1.0},
    "coating": {"young": 4.0, "poisson": 0.25, "expansion": 2.0},
}
ROWS = {
    "circle": {"radius": 0.3},
    "ellipse": {"a": 0.36, "b": 0.18, "angle": 20.0},
    "rounded polygon": {"radius": 0.36, "sides": 4, "corner": 0.5, "angle": 20.0},
    "coated ellipse": {"a": 0.3, "b": 0.15, "angle": 20.0, "coating": 0.3},
}
SHAPES = [*ROWS, "user's mesh"]
# Radius and wave of the user's mesh.
USERS = 0.28, 0.06
QUANTITIES = ("length", "stiffness", "expansion", "sensitivity", "cohesive energy", "traction")
# Errors that are rounding: such sums over nodes have no rate.
ROUNDED = 1e-11
# Nodes of all three meshes are so near to each other.
SAME_PLACE = 1e-6


def document(cell, kind, order, refine, **sections):
    materials = dict(MATERIALS)
    bond = SPRINGS | (STRENGTHS if kind == "envelope" else {"axial_stiffness": 5.0})
    between = [["fibre", "coating"], ["coating", "matrix"]]
    interface = [bond | {"between": pair} for pair in between]
    if "coating" not in cell.get("fibre_list", [{}])[0]:
        interface = bond
        del materials["coating"]
    return Case.parse({
        "cell": cell | {"order": order, "refine": refine},
        "material": materials,
        "interface": interface,
        "analysis": {"type": kind, "plane": "strain" if kind == "envelope" else "generalized"},
        "output": {"sensitivities": kind == "stiffness", "mesh_error": False, "pictures": False},
        "petsc": {"feti_ksp_rtol": 1e-11},
    } | sections)  # fmt: skip


def table(row):
    row = {"x": 0.5, "y": 0.5} | row
    return {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": [row], "mesh_size": 0.3}


def smooth(points):
    """(3, k) smooth functions of points (k, 2) on the torus."""
    x, y = 2 * np.pi * points.T
    return np.stack([np.ones_like(x), np.exp(np.sin(x)) * np.cos(y), np.sin(x + 2 * y + 1.0)])


def outlines(shape, centre):
    """(n, 2) points and lengths (n,) of short pieces of the interfaces, in closed form."""
    row = ROWS.get(shape, {})
    angle = np.radians(row.get("angle", 0.0))
    # From between two corners of a polygon.
    t = 2 * np.pi * (np.arange(40_000) + 0.5) / 40_000 + angle - np.pi / 4
    unit = np.stack([np.cos(t), np.sin(t)], axis=1)
    if shape == "user's mesh":
        points = waved(0.5 + USERS[0] * unit, USERS[1])
        return points, np.hypot(*(np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)).T) / 2
    if shape == "rounded polygon":
        # A disc along a square of that circumradius; the parts of its circle are the corners.
        radius, core = row["corner"] * row["radius"] * np.sqrt(0.5), (1 - row["corner"]) * row["radius"]
        corners = angle + np.pi / 2 * np.arange(4)
        corners = core * np.stack([np.cos(corners), np.sin(corners)], axis=1)
        nearest = (unit @ corners.T).argmax(axis=1)
        share = (np.arange(10_000)[:, None] + 0.5) / 10_000
        onward = np.roll(corners, -1, axis=0)
        out = radius * (corners + onward) / np.linalg.norm(corners + onward, axis=1)[:, None]
        sides = [a + out_ + share * (b - a) for a, b, out_ in zip(corners, onward, out, strict=True)]
        points = np.concatenate([corners[nearest] + radius * unit, *sides])
        steps = np.repeat([2 * np.pi * radius, 4 * np.sqrt(2) * core], len(t)) / len(t)
        return centre + points, steps
    axes = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    lengths = np.array([row.get("a", row.get("radius")), row.get("b", row.get("radius"))])
    grown = [lengths + d for d in {0.0, row.get("coating", 0.0) * np.sqrt(lengths.prod())}]
    points = [centre + (unit * each) @ axes for each in grown]
    steps = [np.hypot(a * unit[:, 1], b * unit[:, 0]) * 2 * np.pi / len(t) for a, b in grown]
    return np.concatenate(points), np.concatenate(steps)


def measured(shape, order, refine, folder):
    """Return quantities of one mesh, each (n,), and the nodes on interfaces (k, 2) with their tractions (k, 2)."""
    cell = table(ROWS[shape]) if shape in ROWS else {"geometry": "mesh", "file": str(folder / f"{refine}.msh")}
    case = document(cell, "stiffness", order, refine if shape in ROWS else 0)
    found = run(case, MPI.COMM_SELF, fields=True)
    nodes, state = found.fields.interface, found.fields.states[0]
    exact, steps = outlines(shape, found.fibres[0].centre)
    openings = 10 * np.stack([np.hypot(*each.jump.T) for each in found.fields.states])
    by_springs = [name.endswith("normal_stiffness") for name in found.sensitivities.parameters]
    quantities = {
        "length": smooth(nodes.points) @ nodes.length - smooth(exact) @ steps,
        "stiffness": found.effective_stiffness.ravel(),
        "expansion": found.thermal_expansion,
        "sensitivity": found.sensitivities.derivatives[:, by_springs].ravel(),
        # Of an exponential law whose strength is that at an opening of 0.1.
        "cohesive energy": (1 - (1 + openings) * np.exp(-openings)) @ nodes.length,
    }
    return quantities, nodes.points, state.traction


def refinements(order):
    """1 to 3 of linear elements, 0 to 2 of quadratic ones."""
    return range(2 - order, 5 - order)


def rates(shape, order, folder):
    """Rates at which the quantities converge over three refinements; None of errors that are rounding."""
    if shape == "user's mesh":
        for k in refinements(order):
            polar_cell((0.5, 0.5), USERS[0], folder / f"{k}.msh", order=order, size=0.2, halvings=k, wave=USERS[1])
    meshes = [measured(shape, order, refine, folder) for refine in refinements(order)]
    perimeters = [quantities["length"][0] for quantities, *_ in meshes]
    assert shape == "user's mesh" or np.abs(perimeters).max() < 1e-6
    first = meshes[0][1]
    nearest = [cKDTree(points % 1.0, boxsize=1.0).query(first % 1.0) for _, points, _ in meshes]
    same = np.max([away for away, _ in nearest], axis=0) < SAME_PLACE
    tractions = [own[2][near[same]].ravel() for own, (_, near) in zip(meshes, nearest, strict=True)]
    found = {}
    for name in QUANTITIES:
        values = tractions if name == "traction" else [quantities[name] for quantities, *_ in meshes]
        errors = values if name == "length" else [b - a for a, b in pairwise(values)]
        coarse, fine = (np.linalg.norm(error) for error in errors[-2:])
        found[name] = None if fine < ROUNDED else float(np.log2(coarse / fine))
    return found


def rate_of_onset(shape, order):
    """Return the rate of the strain E11 at which the first bond breaks, where its axes are those of the cell."""
    envelope, row = {"plane": ["E11", "E22"], "directions": 4}, ROWS[shape] | {"angle": 0.0}
    cases = [document(table(row), "envelope", order, k, envelope=envelope) for k in refinements(order)]
    coarse, fine = np.abs(np.diff([run(case, MPI.COMM_SELF).envelope[0].factor for case in cases]))
    return float(np.log2(coarse / fine))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", SHAPES)
def test_rates_are_those_of_the_table(shape, order, tmp_path):
    expected = of_table(shape, order)
    found = rates(shape, order, tmp_path)
    if "load of onset" in expected:
        found["load of onset"] = rate_of_onset(shape, order)
    print(shape, order, {name: rate and round(rate, 2) for name, rate in found.items()})
    assert found.keys() == expected.keys()
    for name, rate in found.items():
        assert rate == pytest.approx(expected[name], abs=0.25), name


def of_table(shape, order):
    """Return the rates of a shape in tests/README.md by quantity; None where errors are rounding."""
    text = README.read_text().split("## Rates along interfaces")[1].split("\n## ")[0]
    lines = [[cell.strip() for cell in line.strip("|\n").split("|")] for line in text.splitlines() if line[:1] == "|"]
    column = lines[0].index(shape)
    own = {line[0]: line[column] for line in lines[2:] if line[1] == str(order) and line[column]}
    return {name: None if rate == "exact" else float(rate) for name, rate in own.items()}
