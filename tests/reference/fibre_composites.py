"""Unidirectional composites in three dimensions: their phases and reference constants.

Phases are (6, 6) compliances and (6,) expansions, x3 along the fibres, Voigt order [11, 22, 33, 23, 13, 12]; GPa and
1e-6/K.  The constants are (fibre: L, across: T) E_L, E_T, G_L, G_T, nu_L, nu_T, alpha_L, alpha_T of the bonded cell.
"""

from dataclasses import dataclass

import numpy as np

from feti_homog.materials.engineering_constants import TransverseIsotropy, transversely_isotropic_part


def compliance(E_L, E_T, nu_L, nu_T, G_L):
    """(6, 6), of a material transversely isotropic about x3."""
    S = np.diag([1 / E_T, 1 / E_T, 1 / E_L, 1 / G_L, 1 / G_L, 2 * (1 + nu_T) / E_T])
    S[0, 1] = S[1, 0] = -nu_T / E_T
    S[:2, 2] = S[2, :2] = -nu_L / E_L
    return S


def fibre_like(E_L, E_T, nu_L, nu_T, G_L, alpha_L=None, alpha_T=None) -> TransverseIsotropy:
    strains = None if alpha_L is None else [alpha_T, alpha_T, alpha_L, 0, 0, 0]
    return transversely_isotropic_part(np.linalg.inv(compliance(E_L, E_T, nu_L, nu_T, G_L)), strains)


def isotropic(E, nu, alpha=None) -> TransverseIsotropy:
    return fibre_like(E, E, nu, nu, E / 2 / (1 + nu), alpha, alpha)


@dataclass(frozen=True)
class Composite:
    matrix: TransverseIsotropy
    fibre: TransverseIsotropy
    fraction: float
    constants: tuple[float, ...]


BORON, ALUMINIUM = isotropic(379.3, 0.1, 8.1), isotropic(68.3, 0.3, 23.0)
CARBON, EPOXY = fibre_like(235.0, 14.0, 0.2, 0.25, 28.0, -0.9, 9.0), isotropic(4.8, 0.34, 54.0)
GLASS, SOFT_EPOXY = isotropic(73.0, 0.22, 5.0), isotropic(3.45, 0.35, 54.0)

# Source: Kolosov-Muskhelishvili or multipole series, least squares, all digits.
HEXAGONAL = {
    "boron/aluminium": Composite(
        ALUMINIUM, BORON, 0.47,
        (215.307177, 133.069989, 54.0482814, 50.7902548, 0.194921198, 0.309995291, 10.981677, 16.7314181),
    ),
    "AS4/3501-6": Composite(
        EPOXY, CARBON, 0.6,
        (142.94677, 9.1812952, 5.8190872, 3.3297852, 0.25254888, 0.37866177, -0.077455915, 32.689245),
    ),
    "glass/epoxy": Composite(
        SOFT_EPOXY, GLASS, 0.55,
        (41.720812, 10.536603, 3.8936826, 3.7134324, 0.27089118, 0.41871477, 7.0467124, 30.341346),
    ),
}  # fmt: skip
SQUARE = {
    "boron/aluminium": Composite(
        ALUMINIUM, BORON, 0.47,
        (215.334687, 143.955632, 54.3778718, 45.8243281, 0.194557155, 0.255133319, 10.9936815, 16.694874),
    ),
}  # fmt: skip

# (arrangement, fibre fraction): G_L / G_m at the contrasts G_f / G_m = 2, 10, 50; last digit +-1.  Source: multipole
# series; Perrins, McKenzie, McPhedran 1979 tabulate the same cells.
CONTRASTS = (2.0, 10.0, 50.0)
AXIAL_SHEAR = {
    ("square", 0.1): (1.068966, 1.178222, 1.212588),
    ("square", 0.5): (1.401025, 2.415467, 2.914594),
    ("square", 0.7): (1.615384, 4.061707, 6.335921),
    ("hexagonal", 0.3): (1.222224, 1.650634, 1.809975),
    ("hexagonal", 0.5): (1.400063, 2.386467, 2.852937),
    ("hexagonal", 0.8): (1.729477, 4.948865, 8.260013),
}
