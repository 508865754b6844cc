"""Reference numbers: each with its error and its source.

Voigt order 11, 22, 12 with engineering shear, stiffnesses and stresses in GPa.  All are of a cell of width 1 of the
reference composite: matrix E = 88, nu = 0.299, fibre E = 200, nu = 0.222, a fibre fraction of 0.4.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Reference:
    """Numbers, the absolute error of the worst of them, and where they come from."""

    value: tuple[float, ...]
    error: float
    source: str


SERIES = "Kolosov-Muskhelishvili or multipole series, least squares; two truncations agree to the digits given"

# (cell, plane): C11, C12, C33 of the bonded cell.
BONDED = {
    ("square", "strain"): Reference((151.155859, 55.537426, 45.078553), 5e-7, SERIES),
    ("square", "stress"): Reference((128.862996, 34.070020, 45.000421), 5e-7, SERIES),
    ("hexagonal", "strain"): Reference((149.690255, 56.975975, 46.357140), 5e-7, SERIES),
    ("hexagonal", "stress"): Reference((127.573943, 35.321585, 46.126179), 5e-7, SERIES),
}

# nu of the matrix: C11, C12, C33 of the hexagonal cell, E = 1 and fibres of 1000 and 0.3; plane strain, relative error.
NEARLY_INCOMPRESSIBLE = {
    0.4999: Reference((1289.5648, 1287.8861, 0.83934843), 2e-7, SERIES),
    0.49999: Reference((2213.6065, 2211.9276, 0.83944046), 2e-7, SERIES),
    0.499999: Reference((2384.5479, 2382.8690, 0.83944968), 2e-7, SERIES),
}

# cell: C11, C12, C33 with all fibres debonded and faces that may overlap, which is a cell with holes; plane strain.
VOID = {
    "square": Reference((40.268438, 9.710096, 6.303568), 5e-7, SERIES),
    "hexagonal": Reference((36.123857, 14.523762, 10.800047), 5e-7, SERIES),
}

# Square cell, plane strain, E11 = 1: the largest normal traction (at 0 degrees), the largest shear (at 41.5 degrees).
LARGEST_TRACTIONS = Reference((179.276113, 55.058455), 5e-7, SERIES)

# Square cell, plane strain, both strengths 0.1, stretched to E11 = 1: load factor, S11 and S22 where debonding begins.
ONSET = Reference((5.57799e-4, 0.0843146, 0.0309787), 5e-8, SERIES + "; 0.1 over the largest normal traction")

# Square cell, plane strain, the fibre debonded where |angle| < 60 degrees, tips bonded: C11, C22, C12 and C33 with
# faces that may overlap; with contact S11 and S22 under E11 = -1.
ARC_OF_120_DEGREES = Reference(
    (72.549, 128.352, 29.259, 28.884, -146.256, -60.185), 0.07, "curved quadratic elements, refined: below 5e-4 of each"
)

# The same to more digits: within 3e-5 of each entry above, which another program computed.
ARC_OF_120_DEGREES_FINE = Reference(
    (72.54333, 128.34813, 29.25731, 28.88186, -146.25474, -60.18571),
    5e-5,
    "own: mesh_size 0.02, tip_size 1e-6, order 2, 550 000 dofs of refine = 2, extrapolated from refine = 1 with h^4",
)

# (cell, k_n, k_t): C11, C12, C33 with elastic interfaces of these stiffnesses in GPa / width; plane strain.
ELASTIC = {
    ("hexagonal", 1000, 1000): Reference((122.31627, 41.047189, 40.634540), 5e-6, SERIES),
    ("hexagonal", 1000, 250): Reference((117.92832, 45.435125, 36.246598), 5e-6, SERIES),
    ("hexagonal", 10, 2.5): Reference((39.303404, 15.303089, 12.000157), 5e-7, SERIES),
    ("square", 1000, 250): Reference((119.65372, 45.923049, 36.555449), 5e-6, SERIES),
    ("square", 500, 500): Reference((107.972984, 33.641333, 36.986503), 5e-7, SERIES),
}

FORMULA = "closed form"
# Plane strain bulk modulus and shear modulus: the bounds of any arrangement, the lower and the upper.
VOIGT_MODULI = Reference((109.428, 53.057), 6e-4, FORMULA)
REUSS_MODULI = Reference((101.640, 44.245), 6e-4, FORMULA)
HASHIN_SHTRIKMAN_BULK = Reference((103.332600, 104.766783), 6e-7, FORMULA + " (Hashin 1965)")
HASHIN_SHTRIKMAN_SHEAR = Reference((46.276579, 47.611942), 6e-7, FORMULA + " (Hashin 1965)")

# One fibre (70 GPa, 0.2) in a large matrix (3.5 GPa, 0.4) under uniaxial stress s in plane strain, frictionless
# contact, one debond symmetric about the load, of the semi-angle t: G_I and G_II over
# G0 = (1 + kappa_m) / (8 mu_m) s^2 pi a.
# Published ones of boundary elements (Paris and others) and of finite elements (virtual crack closure, Di Stasio,
# thinPlyMechanics), who puts their difference at 5 %.
DEBONDED_FIBRE_BEM = {
    20: (0.193, 0.147), 40: (0.098, 0.486), 60: (0.00127, 0.666), 80: (0.0, 0.579), 100: (0.0, 0.337),
}  # fmt: skip
DEBONDED_FIBRE_FEM = {
    20: (0.2067, 0.1418), 40: (0.1163, 0.4800), 60: (0.0003, 0.6856), 80: (0.0, 0.6085), 100: (0.0, 0.3563),
}  # fmt: skip
# t: G / G0, whose modes need not be distinguished.
DEBONDED_FIBRE_TOTAL = {
    20: Reference((0.3487,), 4e-4, "own: quadratic elements, 150 000 dofs, cell of 80 radii; 160 radii agree"),
    40: Reference((0.5965,), 4e-4, "the same"),
    60: Reference((0.6860,), 4e-4, "the same"),
    80: Reference((0.6085,), 4e-4, "the same"),
    100: Reference((0.3563,), 4e-4, "the same"),
}

# Glass in epoxy (70 800 MPa, 0.22; 2790 MPa, 0.33), square cell, plane strain, 40 % of fibres of 7.5 um, strained along
# x1: bonds by energy, springs of 2025 and 506.25 MPa/um, toughness 2 J/m2, sensitivity to the mode 0.25.
# Strain and stress S11 in MPa where the first bond breaks.
GLASS_EPOXY_ONSET = Reference((0.01175333, 66.83636), 5e-6, SERIES)
PROTOTYPE = "independent prototype, straight linear triangles, exact events; the error is the difference of two meshes"
# (growth, length of elements in um): S11 in MPa at these multiples of the strain at onset, rising.
GLASS_EPOXY_MULTIPLES = (1.05, 1.2, 1.5, 2.0, 3.0)
GLASS_EPOXY_CURVES = {
    ("springs", 0.21): Reference((25.66, 27.11, 30.43, 37.50, 52.40), 1.1, PROTOTYPE),
    ("released", 0.21): Reference((24.51, 26.01, 29.91, 36.99, 52.15), 0.5, PROTOTYPE),
    ("released", 0.105): Reference((24.18, 25.81, 29.71, 36.91, 52.06), 0.4, PROTOTYPE),
}
# Debonded share of the interface at three times the strain at onset, elements of 0.21 and 0.105 um.
GLASS_EPOXY_DEBONDED = Reference((0.542, 0.543), 2e-3, PROTOTYPE)
# Dissipated energy over toughness times length along the snap-back, elements of 0.84, 0.42 and 0.21 um.
GLASS_EPOXY_DISSIPATED = {
    "released": Reference((1.042, 1.013, 1.004), 0.03, PROTOTYPE),
    "springs": Reference((1.85, 1.51, 1.29), 0.35, PROTOTYPE),
}

# Long fibres in space, axis 1 the fibre: E1, E2, G12, G23, nu12, nu23 in GPa, and expansions along 1 and 2 in 1e-6 / K.
# (composite, cell, fibre fraction).
ENGINEERING_CONSTANTS = {
    ("boron/aluminium", "square", 0.47): Reference(
        (215.334687, 143.955632, 54.3778718, 45.8243281, 0.194557155, 0.255133319, 10.9936815, 16.694874), 5e-7, SERIES
    ),
    ("boron/aluminium", "hexagonal", 0.47): Reference(
        (215.307177, 133.069989, 54.0482814, 50.7902548, 0.194921198, 0.309995291, 10.981677, 16.7314181), 5e-7, SERIES
    ),
    ("AS4/3501-6", "hexagonal", 0.60): Reference(
        (142.94677, 9.1812952, 5.8190872, 3.3297852, 0.25254888, 0.37866177, -0.077455915, 32.689245), 5e-7, SERIES
    ),
    ("glass/epoxy", "hexagonal", 0.55): Reference(
        (41.720812, 10.536603, 3.8936826, 3.7134324, 0.27089118, 0.41871477, 7.0467124, 30.341346), 5e-7, SERIES
    ),
}

# (cell, fibre fraction): axial shear modulus over that of the matrix at the contrasts 2, 10, 50 and infinity.
AXIAL_SHEAR_CONTRASTS = (2.0, 10.0, 50.0, np.inf)
AXIAL_SHEAR = {
    ("square", 0.1): Reference((1.068966, 1.178222, 1.212588, 1.222230), 1e-6, SERIES),
    ("square", 0.5): Reference((1.401025, 2.415467, 2.914594, 3.080198), 1e-6, SERIES),
    ("square", 0.7): Reference((1.615384, 4.061707, 6.335921, 7.432709), 1e-6, SERIES),
    ("hexagonal", 0.3): Reference((1.222224, 1.650634, 1.809975, 1.857210), 1e-6, SERIES),
    ("hexagonal", 0.5): Reference((1.400063, 2.386467, 2.852937, 3.004726), 1e-6, SERIES),
    ("hexagonal", 0.8): Reference((1.729477, 4.948865, 8.260013, 9.958625), 1e-6, SERIES),
}

# One glass fibre in epoxy (70 800 MPa, 0.22; 2790 MPa, 0.33), square cell, 40 %, plane strain, wholly debonded from the
# start, friction 0.2, rigid faces: S11, S22, S12 in MPa and the heat per area since the start, at (E11, E22, gamma12).
RUBBING_PROTOTYPE = "independent prototype, straight linear triangles, 40 small steps a leg; difference of two meshes"
RUBBING_WAYPOINTS = ((-0.01, -0.004, 0.0), (-0.01, -0.004, 0.02), (-0.01, -0.004, -0.02), (-0.01, -0.004, 0.02))
# By the length of elements for a radius of 7.5.
RUBBING_STRESSES = {
    0.42: (
        Reference((-92.117, -62.186, 0.0), 0.02, RUBBING_PROTOTYPE),
        Reference((-88.837, -65.005, 31.684), 0.03, RUBBING_PROTOTYPE),
        Reference((-88.123, -65.653, -31.890), 0.03, RUBBING_PROTOTYPE),
        Reference((-87.920, -65.838, 31.894), 0.04, RUBBING_PROTOTYPE),
    ),
    0.21: (
        Reference((-92.122, -62.197, 0.0), 0.02, RUBBING_PROTOTYPE),
        Reference((-88.867, -64.993, 31.682), 0.03, RUBBING_PROTOTYPE),
        Reference((-88.145, -65.648, -31.894), 0.03, RUBBING_PROTOTYPE),
        Reference((-87.952, -65.824, 31.898), 0.04, RUBBING_PROTOTYPE),
    ),
}
RUBBING_HEATS = {
    0.84: Reference((6.47e-4, 0.05060, 0.13593, 0.21860), 3e-3, RUBBING_PROTOTYPE),
    0.42: Reference((5.86e-4, 0.05032, 0.13484, 0.21641), 2e-3, RUBBING_PROTOTYPE),
    0.21: Reference((5.75e-4, 0.05024, 0.13456, 0.21588), 6e-4, RUBBING_PROTOTYPE),
}
