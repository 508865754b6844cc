"""Case N of a seed: its document and files, drawn alike wherever it is asked for."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from differential.random_cells import random_cell
from differential.random_loads import random_bonds, random_friction, random_loads
from differential.random_phases import Document, random_phases
from differential.random_softening import random_rubbing, random_scatter, random_softening
from differential.transforms import sections
from feti_homog import Case

ANALYSES = {"stiffness": 0.2, "angle": 0.1, "path": 0.4, "load": 0.15, "envelope": 0.15}
PLANES = {"strain": 0.35, "stress": 0.25, "generalized": 0.4}
TOLERANCES = (1e-10, 1e-12)
SOLVERS: tuple[Document, ...] = (
    {"feti_pc_type": "influence"},
    {"feti_pc_type": "lumped"},
    {"feti_coarse_space": "adaptive"},
    {"feti_dual_operator": "implicit"},
)
DECOMPOSITIONS: tuple[Document, ...] = (
    {},
    {"decomposition": {"subdomains": 4}},
    {"decomposition": {"subdomains": 7}},
    {"decomposition": {"max_dofs": 200}},
)
# Streams of random numbers of a case: those of one do not depend on how many others draw.
CASE, RELATIONS, ON_ALL_RANKS, FRICTION, RUBBING, SOFTENING, SCATTER = range(7)


@dataclass(frozen=True)
class Drawn:
    """A case as a document, with its number and the folder of its files."""

    seed: int
    number: int
    document: Document
    folder: Path

    @property
    def case(self) -> Case:
        """The case itself.  Raises CaseError."""
        return self.parsed(self.document)

    @property
    def plane(self) -> str:
        """Its plane state."""
        return str(self.document["analysis"]["plane"])

    @property
    def analysis(self) -> str:
        """Its type of analysis."""
        return str(self.document["analysis"]["type"])

    @property
    def rtol(self) -> float:
        """The tolerance of its solver."""
        return float(self.document["petsc"]["feti_ksp_rtol"])

    def parsed(self, document: Document) -> Case:
        """Another case with its files.  Raises CaseError."""
        return Case.parse(document, self.folder)


def stream(seed: int, number: int, which: int) -> np.random.Generator:
    """Return the random numbers of a case for one of the uses above."""
    return np.random.default_rng([seed, number, which])


def draw(seed: int, number: int, folder: Path) -> Drawn:
    """Case `number` of a seed; a user's mesh is written to `folder`."""
    rng = stream(seed, number, CASE)
    analysis, plane = (str(rng.choice([*of], p=[*of.values()])) for of in (ANALYSES, PLANES))
    cell = random_cell(rng, folder, small=analysis == "path")
    names = [*cell.phases, *(["coating"] if cell.coated else [])]
    phases = random_phases(rng, cell.section, names, plane)
    document: Document = {
        "name": f"case {number} of seed {seed}",
        "cell": cell.section,
        "material": phases,
        "analysis": {"type": analysis, "plane": plane},
        "output": {"pictures": False} | ({"states": "all"} if analysis == "path" else {}),
        "petsc": {"feti_ksp_rtol": float(rng.choice(TOLERANCES))},
    }
    length = cell.section.get("width", 3 * cell.section.get("fibre_radius", 1 / 3))
    if analysis in ("path", "envelope", "angle") or rng.random() < 0.65:
        document |= random_bonds(rng, analysis, plane, cell, length)
    expands = all(material.keys() & {"expansion", "expansion_axial"} for material in phases.values())
    document |= random_loads(rng, analysis, plane, expands)
    document |= DECOMPOSITIONS[rng.choice(len(DECOMPOSITIONS), p=[0.6, 0.2, 0.15, 0.05])]
    if analysis in ("stiffness", "load") and rng.random() < 0.4:
        document["petsc"] |= SOLVERS[rng.integers(len(SOLVERS))]
    random_softening(stream(seed, number, SOFTENING), document, length)
    random_scatter(stream(seed, number, SCATTER), document)
    if analysis == "path":
        random_friction(stream(seed, number, FRICTION), sections(document))
        random_rubbing(stream(seed, number, RUBBING), document)
    return Drawn(seed, number, document, folder)
