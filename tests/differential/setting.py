"""A random case with its result on one rank, and how the result of the same case, found otherwise, is measured."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from differential.comparison import apart, envelopes_apart
from differential.paths import paths_apart
from differential.random_cases import Drawn
from differential.random_phases import Document
from feti_homog import run


@dataclass(frozen=True)
class Compared:
    """The deviation of the two sides of a relation, its kind, and a note of what was not compared."""

    deviation: float
    what: str
    note: str = ""


# Estimates by the mesh that is refined less, on which cuts keep the displacements of the mesh: a fifth is as far off
# as 1e-8 of others.
WEIGHT_OF_NESTED = 5e-8
# Estimates are small differences, of a hundredth of the stresses or less.
WEIGHT_OF_DIFFERENCES = 1e-2


@dataclass(frozen=True)
class Setting:
    """A case with its result on one rank, and what a relation may use.

    Attributes:
        comm: the ranks that solve, all of which call.
        base: result.json of the case, and `files` its folder.
        rng: the same on all ranks.
        work: an empty folder.
    """

    drawn: Drawn
    base: Any
    files: Path
    comm: Any
    rng: np.random.Generator
    work: Path

    def solved(self, document: Document, **keys: Any) -> Any:
        """result.json of another case.  Collective."""
        result = run(self.drawn.parsed(document), self.comm, **({"fields": True} | keys))
        return json.loads(json.dumps(result.document, default=lambda array: array.tolist()))

    def compared(self, other: Any, pieces: bool = False) -> Compared:
        """Return the result of the same case, found otherwise, against the base.

        Subdomains are others if `pieces`, and where more ranks than the base's solve it.
        """
        found, note = apart(self.base, other), ""
        is_cut = (pieces or self.comm.size > 1) and self.drawn.parsed(self.drawn.document).cell.refine > 0
        weight = WEIGHT_OF_NESTED if is_cut else WEIGHT_OF_DIFFERENCES
        if self.drawn.analysis == "path":
            points, note = paths_apart(self.base, other, self.files)
            found += points
        if self.drawn.analysis == "envelope":
            found += envelopes_apart(self.base["envelope"], other["envelope"])
        return Compared(*max((off * weight if "mesh_error" in path else off, path) for off, path in found), note)
