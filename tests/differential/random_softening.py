"""Random laws that soften in place of those of brittle bonds, and strengths that differ from fibre to fibre."""

import numpy as np

from differential.random_loads import STRENGTH
from differential.random_phases import Document
from differential.transforms import sections
from feti_homog.case.bond_laws import COHESIVE, REGISTRY, STIFFNESSES

PEAK = STRENGTH / 4  # strengths, about: under the loads of other paths many bonds lose teeth, some part
SOFTENING = [law.name for law in REGISTRY if law.softens]
# Share of the paths, and of the envelopes, whose bonds soften.
SOFT = {"path": 0.35, "envelope": 0.2}
SCATTERED = 0.2  # share of the cases whose bonds break, or of tables, with strengths of their own for each fibre
TEETH = {1: 0.3, 2: 0.5, 3: 0.2}  # and their shares of the cases: a path has as many events as its bonds have teeth
BRITTLE = {"criterion", "growth", "toughness", "mode_sensitivity", "axial_strength", *STIFFNESSES, *COHESIVE[:2]}
# Openings / that of the peak and tractions / the peak of tables: straight, with a plateau, with a tail.
BRANCHES = (([1.0, 4.0], [1.0, 0.0]), ([1.0, 2.0, 5.0], [1.0, 1.0, 0.0]), ([1.0, 1.5, 4.0, 8.0], [1.0, 0.4, 0.1, 0.0]))


def random_softening(rng: np.random.Generator, document: Document, length: float) -> None:
    """Let the bonds of a path or an envelope soften, each pair by numbers of its own; not of every case."""
    analysis, plane = document["analysis"]["type"], document["analysis"]["plane"]
    if rng.random() > SOFT.get(analysis, 0.0):
        return
    name, word = str(rng.choice(SOFTENING)), str(rng.choice(["law", "criterion"], p=[0.7, 0.3]))
    common: Document = {word: name} | _teeth(rng)
    peak = PEAK * float(rng.uniform(0.4, 1.6)), float(10 ** rng.uniform(0.6, 2.0)) / length
    if name == "table":
        openings, tractions = BRANCHES[rng.integers(len(BRANCHES))]
        common["openings"] = [float(u * peak[0] / peak[1]) for u in openings]
        common["tractions"] = [float(t * peak[0]) for t in tractions]
    for section in sections(document):
        for key in BRITTLE & section.keys():
            del section[key]
        section |= common | _numbers(rng, name, length)
        if plane == "generalized" and "axial_stiffness" not in section and rng.random() < 0.5:
            section["axial_stiffness"] = float(10 ** rng.uniform(0.6, 2.0)) / length
        if rng.random() < 0.6:
            section["mixing_exponent"] = float(rng.uniform(0.7, 3.0))


def _teeth(rng: np.random.Generator) -> Document:
    """Return how many teeth bonds have, or what limits them."""
    if rng.random() < 0.25:
        return {"softening_tolerance": float(rng.uniform(0.3, 0.6))}
    return {"teeth": int(rng.choice([*TEETH], p=[*TEETH.values()]))}


def _numbers(rng: np.random.Generator, name: str, length: float) -> Document:
    """Stiffnesses, strengths and toughnesses of a pair; those in opening follow from a table."""
    found: Document = {}
    for kind in ("normal", "tangential")[name == "table" :]:
        stiffness, strength = float(10 ** rng.uniform(0.6, 2.0)) / length, PEAK * float(rng.uniform(0.4, 1.6))
        found |= {f"{kind}_stiffness": stiffness, f"{kind}_strength": strength}
        found[f"{kind}_toughness"] = strength**2 / (2 * stiffness) * float(10 ** rng.uniform(0.05, 0.8))
    return found


def random_scatter(rng: np.random.Generator, document: Document) -> None:
    """Give the fibres of a path or an envelope strengths of their own; not of every case."""
    rows = document["cell"].get("fibre_list", [])
    if document["analysis"]["type"] not in SOFT or rng.random() > SCATTERED:
        return
    if rows and rng.random() < 0.5:
        for row in rows:
            row["strength"] = float(rng.uniform(0.7, 1.3))
        return
    scatter = {"shape": float(rng.uniform(4.0, 20.0)), "seed": int(rng.integers(1000))}
    for section in sections(document):
        section["scatter"] = scatter


def random_rubbing(rng: np.random.Generator, document: Document) -> None:
    """Let the damaged share of bonds with friction rub, of half of them."""
    for section in sections(document):
        if section.get("friction") and softens(document) and rng.random() < 0.5:
            section["friction_on_damage"] = True


def softens(document: Document) -> bool:
    """Return True if the bonds of a case soften."""
    return any(section.get("law", section.get("criterion")) in SOFTENING for section in sections(document))
