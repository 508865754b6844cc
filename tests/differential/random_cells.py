"""Random cells of every geometry: lattices, random ones, tables of any shapes, users' meshes; voids and coatings."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from support.generated_meshes import generate
from support.void_cells import write_part

from differential.random_phases import Document
from feti_homog.case.cell_section import Cell

GEOMETRIES = {"square": 0.2, "hexagonal": 0.15, "random": 0.25, "table": 0.3, "mesh": 0.1}
MOST_FIBRES = 3
GAP = 0.06  # least distance of fibres / width
TRIES = 400
MESH, VOID = "cell.msh", "void"


@dataclass(frozen=True)
class DrawnCell:
    """[cell], the names of its fibres' phases, whether there are coatings, and how many fibres there are."""

    section: Document
    phases: list[str]
    coated: bool
    fibres: int


def random_cell(rng: np.random.Generator, folder: Path, small: bool) -> DrawnCell:
    """Return a cell of some hundred nodes, fewer if it is to be `small`.

    The file of a user's mesh is written to `folder`.
    """
    names, shares = zip(*GEOMETRIES.items(), strict=True)
    geometry = str(rng.choice(names, p=shares))
    order = int(rng.choice([1, 2], p=[0.7, 0.3]))
    size = order * (rng.uniform(0.28, 0.4) if small else rng.uniform(0.16, 0.24))
    section: Document = {"geometry": geometry, "order": order, "bodies": str(rng.choice(["torus", "plane"]))}
    made = {"square": _square, "hexagonal": _hexagonal, "random": _random, "table": _table, "mesh": _mesh}
    drawn = made[geometry](rng, 2 if small else MOST_FIBRES, folder)
    section |= drawn.section
    if geometry != "mesh":
        section["mesh_size"] = min(size, 0.5)
        if rng.random() < 0.15:
            section["interface_size"] = 0.8 * section["mesh_size"]
    if order == 1 and not small and rng.random() < 0.2:
        section |= {"refine": 1} | ({"mesh_size": min(1.8 * size, 0.5)} if geometry != "mesh" else {})
    return DrawnCell(section, drawn.phases, drawn.coated, drawn.fibres)


def _square(rng: np.random.Generator, most: int, folder: Path) -> DrawnCell:
    return _lattice(rng, 1)


def _hexagonal(rng: np.random.Generator, most: int, folder: Path) -> DrawnCell:
    return _lattice(rng, 2)


def _lattice(rng: np.random.Generator, fibres: int) -> DrawnCell:
    coated = rng.random() < 0.2
    section: Document = {"fibre_fraction": rng.uniform(0.15, 0.3 if coated else 0.5)}
    if coated:
        section["coating"] = rng.uniform(0.15, 0.3)
    return DrawnCell(section | _length(rng), ["fibre"], coated, fibres)


def _length(rng: np.random.Generator) -> Document:
    key = str(rng.choice(["", "width", "fibre_radius"], p=[0.6, 0.2, 0.2]))
    return {key: 10.0 ** rng.uniform(-1, 1)} if key else {}


def _random(rng: np.random.Generator, most: int, folder: Path) -> DrawnCell:
    count = int(rng.integers(1, most + 1))
    section: Document = {"fibres": count, "min_gap": 0.15, "seed": int(rng.integers(1000))}
    section["radius_spread"] = float(rng.choice([0.0, 0.3]))
    coated, phases = False, ["fibre"]
    if count > 1 and rng.random() < 0.3:
        phases = ["glass", "carbon"]
        section["mix"] = {name: rng.uniform(0.08, 0.16) for name in phases}
    else:
        coated = rng.random() < 0.2
        section["fibre_fraction"] = rng.uniform(0.12, 0.2 if coated else 0.35)
    if coated:
        section["coating"] = rng.uniform(0.15, 0.3)
    elif rng.random() < 0.25:
        section |= {"voids": rng.uniform(0.04, 0.1), "void_radius": 0.8}
    own = _length(rng) if "mix" not in section else {}
    return DrawnCell(section | own, phases, coated, count)


def _table(rng: np.random.Generator, most: int, folder: Path) -> DrawnCell:
    width, height = rng.uniform(0.8, 1.2, 2).tolist()
    phases = ["fibre"] if rng.random() < 0.6 else ["glass", "carbon"]
    coated, void = rng.random() < 0.2, rng.random() < 0.25
    places = _placed(rng, width, height, int(rng.integers(1, most + 1)))
    rows = [{"x": x, "y": y, "phase": phases[k % len(phases)]} | _shape(rng, radius, coated)
            for k, (x, y, radius) in enumerate(places)]  # fmt: skip
    if void and len(rows) > 1 and rows[-1].keys().isdisjoint({"coating", "inner_radius"}):
        rows[-1]["phase"] = VOID
    used = {row["phase"] for row in rows} - {VOID}
    section = {"width": width, "height": height, "fibre_list": rows}
    coated = any("coating" in row for row in rows)
    return DrawnCell(section, sorted(used), coated, sum(row["phase"] != VOID for row in rows))


def _placed(rng: np.random.Generator, width: float, height: float, count: int) -> list[tuple[float, float, float]]:
    """Circles (x, y, radius) in a periodic cell, GAP apart."""
    placed: list[tuple[float, float, float]] = []
    for _ in range(TRIES):
        x, y = rng.uniform(0, width), rng.uniform(0, height)
        radius = rng.uniform(0.14, 0.3 if count < 3 else 0.2)
        away = [_distance(x - a, y - b, width, height) - radius - r for a, b, r in placed]
        if min(away, default=1.0) > GAP:
            placed.append((float(x), float(y), float(radius)))
        if len(placed) == count:
            break
    return placed


def _distance(dx: float, dy: float, width: float, height: float) -> float:
    return float(np.hypot(dx - width * np.round(dx / width), dy - height * np.round(dy / height)))


def _shape(rng: np.random.Generator, radius: float, coated: bool) -> Document:
    """Return a shape within a circle: round, elliptic, a polygon, or hollow.

    Round or elliptic ones with their coating.
    """
    if coated and rng.random() < 0.7:
        thickness = rng.uniform(0.15, 0.3)
        return {"radius": radius / (1 + thickness), "coating": thickness}
    kind = str(rng.choice(["round", "ellipse", "polygon", "hollow"], p=[0.4, 0.3, 0.15, 0.15]))
    if kind == "ellipse":
        return {"a": radius, "b": radius * rng.uniform(0.5, 0.9), "angle": rng.uniform(0, 180)}
    if kind == "polygon":
        sides = int(rng.integers(3, 7))
        return {"radius": radius, "sides": sides, "corner": rng.uniform(0.3, 0.7), "angle": rng.uniform(0, 90)}
    return {"radius": radius} | ({"inner_radius": radius * rng.uniform(0.3, 0.6)} if kind == "hollow" else {})


def _mesh(rng: np.random.Generator, most: int, folder: Path) -> DrawnCell:
    """Return a cell of the program as a user's mesh, sometimes without its last fibre."""
    count = int(rng.integers(1, most + 1))
    cell = {"geometry": "random", "fibres": count, "fibre_fraction": rng.uniform(0.15, 0.35), "min_gap": 0.15,
            "seed": int(rng.integers(1000)), "mesh_size": rng.uniform(0.2, 0.28)}  # fmt: skip
    mesh = generate(Cell(**cell), {})
    kept = np.ones(len(mesh.triangles), bool)
    if count > 1 and rng.random() < 0.3:
        x, y, radius = mesh.ellipses.circles[-1][:3]
        away = mesh.points[mesh.triangles].mean(axis=1) - [x, y]
        away -= np.round(away / mesh.period) * mesh.period
        kept, count = np.hypot(*away.T) > radius, count - 1
    write_part(folder / MESH, mesh, kept)
    has_void = {} if kept.all() else {"voids": True}
    return DrawnCell({"file": MESH} | has_void, ["fibre"], False, count)
