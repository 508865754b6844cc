"""Case files with a fault in their materials, and what must be said of it."""

from __future__ import annotations

from support.base_case import BASE, FIBRE, ORTHOTROPIC, OUT_OF_PLANE, cell, changed, ended, fibre

# name: (content of the file, words that must stand in its faults)
FAULTY_MATERIALS: dict[str, tuple[str, tuple[str, ...]]] = {
    "no_fibre": (cell(FIBRE, ""), ("[material.fibre]: missing section",)),
    "no_matrix": (
        cell("[material.matrix]\nyoung = 88.0\npoisson = 0.299\n", ""),
        ("[material.matrix]: missing section",),
    ),
    "empty_material": (
        cell(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], "[material]\n"),
        ("[material.matrix]: missing section", "[material.fibre]: missing section"),
    ),
    "constants_of_no_phase": (
        ended("[material]\nyoung = 3.0\n"),
        ("[material.young]: unknown phase; it belongs to [material.PHASE]",),
    ),
    "american_phase": (
        cell("material.fibre", "material.fiber"),
        ("[material.fiber]: unknown phase; did you mean fibre?", "[material.fibre]: missing section"),
    ),
    "phase_of_mesh": (
        ended('[material."fibre:2"]\nyoung = 1.0\npoisson = 0.2\n'),
        ('[material."fibre:2"]: belongs to geometry = "mesh", not "hexagonal"',),
    ),
    "young_negative": (
        cell("200.0", "-200.0"),
        ("[material.fibre] young = -200.0: expected a number above 0",),
    ),
    "young_missing": (
        cell("young = 200.0\n", ""),
        ("[material.fibre] young: missing; expected a number above 0",),
    ),
    "young_mistyped": (
        cell("young = 200.0", "yuong = 200.0"),
        ("[material.fibre] yuong = 200.0: unknown key; did you mean young?",),
    ),
    "poisson_half": (
        cell("0.299", "0.5"),
        ("[material.matrix] poisson = 0.5: expected less than 0.5 in plane strain",),
    ),
    "poisson_above_half": (
        changed(("0.299", "0.51"), ('"strain"', '"stress"')),
        ("[material.matrix] poisson = 0.51: expected a number above -1 and at most 0.5",),
    ),
    "poisson_minus_one": (
        cell("0.299", "-1"),
        ("[material.matrix] poisson = -1: expected a number above -1",),
    ),
    "two_kinds": (
        fibre("young = 1.0\npoisson = 0.2\nE1 = 2.0\n"),
        ("[material.fibre] young, poisson (isotropic) and E1 (orthotropic): exclude each other",),
    ),
    "angle_of_isotropic": (
        fibre("young = 1.0\npoisson = 0.2\nangle = 30.0\n"),
        ("[material.fibre] young, poisson (isotropic) and angle (orthotropic): exclude each other",),
    ),
    "orthotropic_incomplete": (
        fibre("E1 = 10.0\nE2 = 5.0\nnu12 = 0.3\n", "stress"),
        ("[material.fibre] G12: missing",),
    ),
    "orthotropic_no_third": (
        fibre(ORTHOTROPIC),
        ("[material.fibre] E3, nu13, nu23: missing; plane strain needs them",),
    ),
    "orthotropic_unstable": (
        fibre(ORTHOTROPIC.replace("0.3", "1.5"), "stress"),
        ("[material.fibre] nu12 = 1.5: expected nu12^2 < E1/E2 = 2",),
    ),
    "orthotropic_unstable_third": (
        fibre(ORTHOTROPIC + OUT_OF_PLANE.replace("nu13 = 0.3", "nu13 = 1.4")),
        ("[material.fibre] E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance",),
    ),
    "stiffness_not_square": (
        fibre("stiffness = [[1, 0], [0, 1]]\n"),
        ("[material.fibre] stiffness = [[1, 0], [0, 1]]: expected a symmetric 3x3 array of numbers",),
    ),
    "stiffness_not_numbers": (
        fibre('stiffness = [[3, 1, "0"], [1, 3, 0], [0, 0, 1]]\n'),
        ("[material.fibre] stiffness = ", "expected a symmetric 3x3 array of numbers"),
    ),
    "stiffness_not_symmetric": (
        fibre("stiffness = [[3, 1, 0], [2, 3, 0], [0, 0, 1]]\n"),
        (
            "[material.fibre] stiffness = [[3.0, 1.0, 0.0], [2.0, 3.0, ",
            "expected a symmetric matrix",
        ),
    ),
    "stiffness_indefinite": (
        fibre("stiffness = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]\n"),
        ("[material.fibre] stiffness = ", "expected a positive definite matrix"),
    ),
}
