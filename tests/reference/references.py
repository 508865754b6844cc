"""Reference numbers: each with its error and its source.

Voigt order 11, 22, 12 with engineering shear, stiffnesses and stresses in GPa.  All are of a cell of width 1 of the
reference composite: matrix E = 88, nu = 0.299, fibre E = 200, nu = 0.222, a fibre fraction of 0.4.
"""

from __future__ import annotations

from dataclasses import dataclass


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
