"""Random bonds and loads of every analysis and plane state, in a cell whose matrix has a modulus of about one."""

from typing import Any

import numpy as np

from differential.random_cells import DrawnCell
from differential.random_phases import Document

NAMES = {
    3: (("E11", "E22", "gamma12"), ("S11", "S22", "S12")),
    6: (("E11", "E22", "E33", "gamma23", "gamma13", "gamma12"), ("S11", "S22", "S33", "S23", "S13", "S12")),
}
STRAIN = 0.012  # of loads, about
STRENGTH = 0.012
TEMPERATURE = 200.0
MOST_LEGS = 3
STEPS = 6  # of a path by increments
RUB = 0.5  # share of the paths with contact whose faces have friction


def components(plane: str) -> int:
    """Count the strains of a plane state."""
    return 6 if plane == "generalized" else 3


def random_bonds(rng: np.random.Generator, analysis: str, plane: str, cell: DrawnCell, length: float) -> Document:
    """`interface`: one section, or of coated cells sometimes one for each pair of phases."""
    breaks = analysis in ("path", "envelope")
    has_arcs = not breaks or rng.random() < 0.4
    common: Document = {"contact": bool(rng.random() < 0.7) and not (analysis == "envelope" and has_arcs)}
    if breaks:
        common["criterion"] = str(rng.choice(["max", "quadratic", "energy"], p=[0.35, 0.25, 0.4]))
    if common.get("criterion") == "energy":
        common["growth"] = str(rng.choice(["released", "springs"]))
    pairs: list[Document] = [{}]
    if cell.coated and rng.random() < 0.6:
        pairs = [{"between": ["coating", "matrix"]}, {"between": ["coating", cell.phases[0]]}]
        rng.shuffle(pairs)
    sections = []
    for pair in pairs:
        arcs = {"debonded": _arcs(rng, analysis, cell.fibres)} if has_arcs else {}
        sections.append(common | _law(rng, common, breaks, plane, length) | pair | arcs)
    return {"interface": sections[0] if len(sections) == 1 else sections}


def _law(rng: np.random.Generator, common: Document, breaks: bool, plane: str, length: float) -> Document:
    """Glue or springs, and strengths or a toughness."""
    by_energy = common.get("criterion") == "energy"
    keys = ["normal", "tangential", *(["axial"] if plane == "generalized" and rng.random() < 0.6 else [])]
    springs = {f"{key}_stiffness": float(10 ** rng.uniform(0.3, 2.3)) / length for key in keys}
    law: Document = springs if by_energy or rng.random() < 0.35 else {}
    if by_energy:
        law["toughness"] = float(STRENGTH**2 / 2 / springs["normal_stiffness"] * rng.uniform(0.7, 2.5))
        law["mode_sensitivity"] = float(rng.uniform(0.05, 1.0))
    elif breaks:
        law |= {f"{key}_strength": STRENGTH * float(rng.uniform(0.7, 1.6)) for key in keys}
    return law


def random_friction(rng: np.random.Generator, sections: list[Document]) -> None:
    """Give the faces of a path with contact a coefficient of friction, of each pair its own; not of every path."""
    if not sections or not sections[0]["contact"] or rng.random() > RUB:
        return
    for section in sections:
        section["friction"] = float(rng.uniform(0.1, 0.9))
        if section.get("growth") == "released":
            section["growth"] = "springs"


def _arcs(rng: np.random.Generator, analysis: str, fibres: int) -> list[Document]:
    arcs: list[Document] = []
    for _ in range(rng.integers(1, 3)):
        arc: Document = {"fibre": "all" if rng.random() < 0.5 else int(rng.integers(1, fibres + 1))}
        arc["centre"] = float(rng.uniform(-180, 180))
        if analysis != "angle":
            arc["angle"] = 360.0 if rng.random() < 0.15 else float(rng.uniform(30, 220))
        arcs.append(arc)
    return arcs


def random_loads(rng: np.random.Generator, analysis: str, plane: str, expands: bool) -> Document:
    """Return the section of the analysis."""
    if analysis == "angle":
        values = sorted(rng.uniform(20, 200, 2).tolist())
        by_strain = plane != "generalized" and rng.random() < 0.5
        strain = {"strain": (STRAIN * rng.normal(size=3)).tolist()} if by_strain else {}
        return {"angle": {"values": [0.0, *values, *([360.0] if rng.random() < 0.3 else [])]} | strain}
    if analysis == "load":
        return {"load": {"to": random_load(rng, plane, expands)}}
    if analysis == "path":
        return {"path": _path(rng, plane, expands)}
    if analysis == "envelope":
        axes = rng.choice(NAMES[components(plane)][rng.integers(2)], 2, replace=False)
        cooled = {"temperature": -0.1 * TEMPERATURE} if expands and rng.random() < 0.5 else {}
        return {"envelope": {"plane": axes.tolist(), "directions": int(rng.integers(4, 9))} | cooled}
    return {}


def _path(rng: np.random.Generator, plane: str, expands: bool) -> Document:
    if plane != "generalized" and rng.random() < 0.25:
        path: Document = {"strain": (STRAIN * rng.normal(size=3)).tolist()}
    elif rng.random() < 0.2:
        path = {"to": random_load(rng, plane, expands)}
    else:
        legs = int(rng.integers(1, MOST_LEGS + 1))
        path = {"waypoints": [random_load(rng, plane, expands) for _ in range(legs)]}
        if plane != "generalized" and rng.random() < 0.4:
            path["waypoints"] = (STRAIN * rng.normal(size=(legs, 3))).tolist()
    if rng.random() < 0.25:
        path |= {"method": "increments", "increments": STEPS, "release": str(rng.choice(["all", "worst"]))}
    return path


def random_load(rng: np.random.Generator, plane: str, expands: bool) -> dict[str, Any]:
    """Draw a strain or a stress of some components, and a change of temperature."""
    strains, stresses = NAMES[components(plane)]
    load: dict[str, Any] = {}
    for strain, stress in zip(strains, stresses, strict=True):
        kind = rng.choice(3, p=[0.4, 0.2, 0.4])
        if kind < 2:
            load[stress if kind else strain] = STRAIN * float(rng.normal())
    load = load or {"E11": STRAIN}
    return load | ({"temperature": TEMPERATURE * float(rng.normal())} if expands and rng.random() < 0.5 else {})
