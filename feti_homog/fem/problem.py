"""Unknowns on the plane mesh: displacements, their strains, and the unit loads.

With long fibres, strains do not vary along x3, and the plane x3 = 0 is a plane of symmetry of every phase.  Then the
displacements in the plane and along x3 have separate problems: generalized plane strain and axial shear.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class Problem:
    """Displacements u_i, i = 0..c-1, and strains: du_i/dx_k is part of the strain number `strain[i][k]`.

    Attributes:
        strain: c rows of two numbers.
        turns: whether a rigid body can turn without strain.
        loads: v unit load names, the m strains first; the others are uniform in the cell.
    """

    strain: tuple[tuple[int, int], ...]
    turns: bool
    loads: tuple[str, ...]

    @property
    def components(self) -> int:
        """c, displacements of a node."""
        return len(self.strain)

    @property
    def strains(self) -> int:
        """m, number of strains of the displacements."""
        return int(self.voigt.max()) + 1

    @property
    def stresses(self) -> int:
        """Number of loads that do work on stresses: displacement strains first."""
        return len(self.loads) - ("temperature" in self.loads)

    @cached_property
    def voigt(self) -> Int:
        """The array (c, 2) of `strain`."""
        return np.array(self.strain)

    def gradient(self, strain: Float) -> Float:
        """Return H (c, 2) of the displacements u = H y without rotation that have the strains (m,)."""
        shared = np.bincount(self.voigt.ravel())
        return np.asarray(strain[self.voigt] / shared[self.voigt])

    def dofs(self, nodes: Int) -> Int:
        """Return the degrees of freedom (cn,) at nodes (n,)."""
        return np.asarray((self.components * nodes[:, None] + np.arange(self.components)).ravel())

    def nodes(self, dofs: Int) -> Int:
        """Return the nodes (n,) of degrees of freedom (n,)."""
        return np.asarray(dofs // self.components)


PLANE = Problem(((0, 2), (2, 1)), turns=True, loads=("E11", "E22", "gamma12"))
"""Plane strain and plane stress."""

GENERALIZED = replace(PLANE, loads=(*PLANE.loads, "E33", "temperature"))
"""Generalized plane strain: the same displacements, under a uniform strain along x3 and a change of temperature too."""

AXIAL = Problem(((0, 1),), turns=False, loads=("gamma13", "gamma23"))
"""Axial shear: the displacement along x3."""
