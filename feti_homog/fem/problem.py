"""Define the problems on the plane mesh: displacements, their strains, and the unit loads.

With long fibres, strains do not vary along x3, and the plane x3 = 0 is a plane of symmetry of every phase.  So the
displacements in the plane (generalized plane strain) and the displacement along x3 (axial shear) are independent.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from feti_homog.typing import Float, Int


@dataclass(frozen=True)
class Problem:
    """A problem with c displacements u_i on the plane, their m strains (displacement strains), and v unit loads.

    Attributes:
        strain: c rows of two numbers; du_i/dx_k is part of the strain number `strain[i][k]`.
        turns: whether a body can rotate in the plane without strain.
        loads: names of the v unit loads: first the m displacement strains, then loads that are uniform in the cell.
    """

    strain: tuple[tuple[int, int], ...]
    turns: bool
    loads: tuple[str, ...]

    @property
    def components(self) -> int:
        """Return the number c of displacements at a node."""
        return len(self.strain)

    @property
    def strains(self) -> int:
        """Return the number m of displacement strains."""
        return int(self.voigt.max()) + 1

    @property
    def stresses(self) -> int:
        """Return the number of loads with a conjugate stress or heat flux: all but the temperature change."""
        return sum(load != "temperature" for load in self.loads)

    @cached_property
    def voigt(self) -> Int:
        """Return the strain numbers `strain` as an array (c, 2)."""
        return np.array(self.strain)

    def gradient(self, strain: Float) -> Float:
        """Return the displacement gradient H (c, 2) for displacement strains `strain` (m,), without rotation."""
        count = np.bincount(self.voigt.ravel())
        return np.asarray(strain[self.voigt] / count[self.voigt])

    def dofs(self, nodes: Int) -> Int:
        """Return the degrees of freedom (cn,) at nodes (n,), node by node."""
        return np.asarray((self.components * nodes[:, None] + np.arange(self.components)).ravel())

    def nodes(self, dofs: Int) -> Int:
        """Return the node (n,) of every degree of freedom (n,)."""
        return np.asarray(dofs // self.components)


PLANE = Problem(((0, 2), (2, 1)), turns=True, loads=("E11", "E22", "gamma12"))
"""Plane strain or plane stress: the displacements in the plane."""

GENERALIZED = replace(PLANE, loads=(*PLANE.loads, "E33", "temperature"))
"""Generalized plane strain: as PLANE, with a uniform strain along x3 and a temperature change as further loads."""

AXIAL = Problem(((0, 1),), turns=False, loads=("gamma13", "gamma23"))
"""Axial shear: the displacement along x3."""

CONDUCTION = replace(AXIAL, loads=("dT/dx1", "dT/dx2", "dT/dx3"))
"""Conduction: the temperature in place of a displacement, with a uniform temperature gradient along x3 as a load."""
