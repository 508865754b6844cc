"""Case files with a fault in their materials, and the line that must report it."""

from support.base_case import (
    AXIAL,
    BASE,
    FIBRE,
    ORTHOTROPIC,
    OUT_OF_PLANE,
    SPATIAL,
    TRANSVERSE,
    cell,
    changed,
    ended,
    fibre,
)

GIVEN = "young = 1.0\npoisson = 0.2\n"

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
    "nearly_rigid_fibres": (
        fibre("young = 1e17\npoisson = 0.2\n"),
        ("[material.fibre], [material.matrix]: stiffnesses that differ by a factor of 9.4e+14: expected at most",),
    ),
    "nearly_void_matrix": (
        fibre(
            "stiffness = [[1e20, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 1, 0, 0, 0], "
            "[0, 0, 0, 1, 0, 0], [0, 0, 0, 0, 1, 0], [0, 0, 0, 0, 0, 1]]\n",
            "generalized",
        ),
        ("[material.fibre], [material.matrix]: stiffnesses that differ by a factor of 8.5e+17: expected at most",),
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
    "words_of_textbooks": (
        cell("young = 200.0", "E = 200.0\nG = 82.0"),
        (
            "[material.fibre] E = 200.0: unknown key; did you mean young?",
            "G = 82.0: unknown key; it follows from young",
        ),
    ),
    "words_of_bonds": (
        cell("young = 200.0", "young = 200.0\n[interface]\nstrength = 1.0\n[material.other]"),
        ("unknown key; did you mean normal_strength or tangential_strength?", "[interface] debonded: missing; "),
    ),
    "strength_of_a_phase": (
        cell("young = 200.0", "young = 200.0\nstrength = 3.0"),
        ("[material.fibre] strength = 3.0: unknown key; phases do not break; bonds do, see normal_strength",),
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
    "poisson_half_in_space": (
        changed(("0.299", "0.5"), ('"strain"', '"generalized"')),
        ("[material.matrix] poisson = 0.5: expected less than 0.5 in generalized plane strain",),
    ),
    "orthotropic_no_axial_shear": (
        fibre(ORTHOTROPIC + OUT_OF_PLANE, "generalized"),
        ("[material.fibre] G13, G23: missing; generalized plane strain needs them",),
    ),
    "orthotropic_unstable_in_space": (
        fibre(ORTHOTROPIC + OUT_OF_PLANE.replace("nu13 = 0.3", "nu13 = 1.4") + "G13 = 1\nG23 = 1\n", "generalized"),
        ("[material.fibre] E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance",),
    ),
    "transverse_incomplete": (
        fibre("E_transverse = 14.0\n", "stress"),
        ("[material.fibre] nu_transverse: missing; expected a number above -1 and below 1",),
    ),
    "shear_across_a_fibre": (
        fibre(TRANSVERSE + AXIAL + "G_axial = 15.0\nG_transverse = 7.0\n", "generalized"),
        ("G_transverse = 7.0: unknown key; give nu_transverse = E_transverse / (2 G_transverse) - 1",),
    ),
    "transverse_no_axial": (
        fibre(TRANSVERSE),
        ("[material.fibre] E_axial, nu_axial: missing; plane strain needs them",),
    ),
    "transverse_no_shear": (
        fibre(TRANSVERSE + AXIAL, "generalized"),
        ("[material.fibre] G_axial: missing; generalized plane strain needs it",),
    ),
    "transverse_ratio_one": (
        fibre(TRANSVERSE.replace("0.25", "1"), "stress"),
        ("[material.fibre] nu_transverse = 1: expected a number above -1 and below 1",),
    ),
    "transverse_ratio_nearly_one": (
        fibre(TRANSVERSE.replace("0.25", "0.99999999999999"), "stress"),
        ("[material.fibre] nu_transverse = 0.99999999999999: expected a number above -1 and below 1; no material",),
    ),
    "transverse_unstable": (
        fibre(TRANSVERSE + AXIAL.replace("0.2", "2.6")),
        ("nu_axial = 2.6: expected nu_axial^2 < (1 - nu_transverse) E_axial/(2 E_transverse) = 6.29464",),
    ),
    "transverse_and_orthotropic": (
        fibre(TRANSVERSE + "E1 = 1.0\n"),
        ("[material.fibre] E1 (orthotropic) and E_transverse, nu_transverse (transversely isotropic): exclude each",),
    ),
    "angle_of_transverse": (
        fibre(TRANSVERSE + AXIAL + "angle = 30\n"),
        ("[material.fibre] angle (orthotropic) and E_axial, E_transverse, nu_axial, nu_transverse (transversely iso",),
    ),
    "stiffness_of_four": (
        fibre("stiffness = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n"),
        ("or 6x6 in the order 11, 22, 33, 23, 13, 12",),
    ),
    "stiffness_of_the_plane_in_space": (
        fibre("stiffness = [[3, 1, 0], [1, 3, 0], [0, 0, 1]]\n", "generalized"),
        ("[material.fibre] stiffness: expected 6x6 in generalized plane strain; 3x3 serves one plane state only",),
    ),
    "stiffness_not_symmetric_in_space": (
        fibre(SPATIAL.replace("[9, 3,", "[9, 4,"), "generalized"),
        ("[material.fibre] stiffness = ", "expected a symmetric matrix"),
    ),
    "stiffness_indefinite_in_space": (
        fibre(SPATIAL.replace("[0, 0, 0, 3,", "[0, 0, 0, -3,"), "stress"),
        ("[material.fibre] stiffness = ", "expected a positive definite matrix"),
    ),
    "stiffness_couples_shears": (
        fibre(
            SPATIAL.replace("0, 0, 0, 4]", "0, 0.25, 0, 4]").replace("[0, 0, 0, 3, 0.5, 0]", "[0, 0, 0, 3, 0.5, 0.25]")
        ),
        ("[material.fibre] stiffness: C46 = 0.25: expected 0; x3 must be normal to a plane of symmetry",),
    ),
    "expansion_by_half": (
        fibre(TRANSVERSE + AXIAL + "expansion_axial = 1e-6\n"),
        ("[material.fibre] expansion_transverse: missing; expansion_axial needs it",),
    ),
    "expansion_across_alone": (
        fibre(TRANSVERSE + AXIAL + "expansion_transverse = 1e-6\n"),
        ("[material.fibre] expansion_axial: missing; expansion_transverse needs it",),
    ),
    "expansion_twice": (
        fibre(TRANSVERSE + AXIAL + "expansion = 1e-6\nexpansion_axial = 1e-6\nexpansion_transverse = 1e-6\n"),
        ("[material.fibre] expansion, expansion_axial, expansion_transverse: exclude each other",),
    ),
    "expansion_of_a_form_without_axis": (
        fibre(GIVEN + "expansion_axial = 1e-6\nexpansion_transverse = 1e-6\n"),
        ("[material.fibre] young, poisson (isotropic) and expansion_axial, expansion_transverse (transversely isotr",),
    ),
    "expansion_of_isotropic_by_axes": (
        fibre(GIVEN + "expansion = [1e-6, 1e-6, 2e-6]\n"),
        ("[material.fibre] expansion = [1e-06, 1e-06, 2e-06]: expected a number",),
    ),
    "expansion_of_two_axes": (
        fibre(ORTHOTROPIC + OUT_OF_PLANE + "expansion = [1e-6, 2e-6]\n"),
        ("[material.fibre] expansion = [1e-06, 2e-06]: expected a number or a list of three numbers",),
    ),
    "expansion_alone": (
        fibre("expansion = 1e-6\n"),
        ("[material.fibre] young: missing", "[material.fibre] poisson: missing"),
    ),
}
