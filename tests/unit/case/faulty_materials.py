"""Case files with a fault in their materials, below the words that must report it."""

import numpy as np
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
    faults,
    fibre,
)

GIVEN = "young = 1.0\npoisson = 0.2\n"


def conducting(*lines: str, fibre: str = "conductivity = 1.0") -> str:
    """Return a case of conductivity with these lines at its end."""
    matrix = "[material.matrix]\nyoung = 88.0\npoisson = 0.299\n"
    edits = (matrix, "[material.matrix]\nconductivity = 0.2\n"), (FIBRE, f"[material.fibre]\n{fibre}\n")
    case = changed(*edits, ('type = "stiffness"\nplane = "strain"', 'type = "conductivity"'))
    return "\n".join([case, *lines, ""])


FAULTY_MATERIALS: dict[str, str] = {
    **faults(BASE, {
        "[material.fibre] young = -200.0": "expected a number above 0",
        "[material.fibre] strength = 3.0": "expected a table such as {principal = 80.0}",
        "[material.matrix] poisson = 0.5": "expected less than 0.5 in plane strain",
        "[material.matrix] poisson = -1": "expected a number above -1",
    }),
    **faults(cell('"strain"', '"stress"'), {
        "[material.matrix] poisson = 0.51": "expected a number above -1 and at most 0.5",
    }),
    **faults(fibre(ORTHOTROPIC, "stress"), {
        "[material.fibre] nu12 = 1.5": "expected nu12^2 < E1/E2 = 2",
    }),
    **faults(fibre(SPATIAL), {
        "[material.fibre] stiffness = [[1, 0], [0, 1]]": "expected a symmetric 3x3 array of numbers",
        '[material.fibre] stiffness = [[3, 1, "0"], [1, 3, 0], [0, 0, 1]]': "expected a symmetric 3x3 array of numbers",
        "[material.fibre] stiffness = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]":
            "expected a symmetric 3x3 array of numbers in the order 11, 22, 12, or 6x6 in the order 11, 22, 33, 23, 13",
    }),
    **faults(cell('"strain"', '"generalized"'), {
        "[material.matrix] poisson = 0.5": "expected less than 0.5 in generalized plane strain",
    }),
    **faults(fibre(TRANSVERSE, "stress"), {
        "[material.fibre] nu_transverse = 1": "expected a number above -1 and below 1",
        "[material.fibre] nu_transverse = 0.99999999999999": "expected a number above -1 and below 1; no material",
    }),
    **faults(fibre(TRANSVERSE + AXIAL, "strain"), {
        "[material.fibre] nu_axial = 2.6":
            "expected nu_axial^2 < (1 - nu_transverse) E_axial/(2 E_transverse) = 6.29464",
    }),
    **faults(fibre(ORTHOTROPIC + OUT_OF_PLANE, "strain"), {
        "[material.fibre] expansion = [1e-06, 2e-06]": "expected a number or a list of three numbers",
    }),
    "[material.fibre]: missing section": cell(FIBRE, ""),
    "[material.matrix]: missing section": cell("[material.matrix]\nyoung = 88.0\npoisson = 0.299\n", ""),
    "[material.matrix]: missing section\n[material.fibre]: missing section":
        cell(BASE[BASE.index("[material.matrix]") : BASE.index("[analysis]")], "[material]\n"),
    "[material.young]: unknown phase; it belongs to [material.PHASE]": ended("[material]\nyoung = 3.0\n"),
    "[material.fibre], [material.matrix]: stiffnesses that differ by a factor of 9.4e+14: expected at most":
        fibre("young = 1e17\npoisson = 0.2\n"),
    "[material.fibre], [material.matrix]: stiffnesses that differ by a factor of 8.5e+17: expected at most":
        fibre(f"stiffness = {np.diag([1e20, 1, 1, 1, 1, 1]).tolist()}\n", "generalized"),
    "[material.fiber]: unknown phase; did you mean fibre?\n[material.fibre]: missing section":
        cell("material.fibre", "material.fiber"),
    '[material."fibre:2"]: belongs to geometry = "mesh", not "hexagonal"':
        ended('[material."fibre:2"]\nyoung = 1.0\npoisson = 0.2\n'),
    "[material.fibre] young: missing; expected a number above 0": cell("young = 200.0\n", ""),
    "[material.fibre] yuong = 200.0: unknown key; did you mean young?": cell("young = 200.0", "yuong = 200.0"),
    "[material.fibre] tensile_strength = 4.9: unknown key; did you mean strength?":
        cell("young = 200.0", "young = 200.0\ntensile_strength = 4.9"),
    "[material.fibre] Xt = 4.9: unknown key; did you mean strength?": cell("young = 200.0", "young = 200.0\nXt = 4.9"),
    "[material.fibre] E = 200.0: unknown key; did you mean young?\nG = 82.0: unknown key; it follows from young":
        cell("young = 200.0", "E = 200.0\nG = 82.0"),
    "unknown key; did you mean normal_strength or tangential_strength?\n[interface] debonded: missing; ":
        cell("young = 200.0", "young = 200.0\n[interface]\nstrength = 1.0\n[material.other]"),
    "[material.fibre] young, poisson (isotropic) and E1 (orthotropic): exclude each other":
        fibre("young = 1.0\npoisson = 0.2\nE1 = 2.0\n"),
    "[material.fibre] young, poisson (isotropic) and angle (orthotropic): exclude each other":
        fibre("young = 1.0\npoisson = 0.2\nangle = 30.0\n"),
    "[material.fibre] G12: missing": fibre("E1 = 10.0\nE2 = 5.0\nnu12 = 0.3\n", "stress"),
    "[material.fibre] E2: missing\n[material.fibre] nu12: missing\n[material.fibre] G12: missing\n"
    "[material.fibre] E3, nu13, nu23: missing; plane strain needs them; axis 3 is along the fibres; for data sheets":
        fibre("E1 = 230.0\n"),
    "[material.fibre] E_transverse: missing; expected a number above 0\n"
    "[material.fibre] nu_transverse, G_transverse: missing; expected one\n"
    "[material.fibre] nu_axial, G_axial: missing; generalized plane strain needs them":
        fibre("E_axial = 230.0\n", "generalized"),
    "[material.fibre] nu_transverse, G_transverse: missing; expected one\n"
    "[material.fibre] nu_axial: missing; plane strain needs it":
        fibre("E_axial = 230.0\nE_transverse = 14.0\n"),
    "[material.fibre] E3, nu13, nu23: missing; plane strain needs them": fibre(ORTHOTROPIC),
    "[material.fibre] E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance":
        fibre(ORTHOTROPIC + OUT_OF_PLANE.replace("nu13 = 0.3", "nu13 = 1.4")),
    "[material.fibre] stiffness = [[3.0, 1.0, 0.0], [2.0, 3.0, 0.0], [0.0, 0.0, 1.0]]: expected a symmetric matrix":
        fibre("stiffness = [[3, 1, 0], [2, 3, 0], [0, 0, 1]]\n"),
    "[material.fibre] stiffness = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: expected a positive definite":
        fibre("stiffness = [[1, 2, 0], [2, 1, 0], [0, 0, 1]]\n"),
    "[material.fibre] G13, G23: missing; generalized plane strain needs them":
        fibre(ORTHOTROPIC + OUT_OF_PLANE, "generalized"),
    "E1, E2, E3, nu12, nu13, nu23: expected a positive definite compliance":
        fibre(ORTHOTROPIC + OUT_OF_PLANE.replace("nu13 = 0.3", "nu13 = 1.4") + "G13 = 1\nG23 = 1\n", "generalized"),
    "[material.fibre] nu_transverse, G_transverse: missing; expected one":
        fibre("E_transverse = 14.0\nstrength = {von_mises = 3.0}\n", "stress"),
    "[material.fibre] nu_transverse, G_transverse: both given; expected one":
        fibre(TRANSVERSE + AXIAL + "G_axial = 15.0\nG_transverse = 7.0\n", "generalized"),
    "[material.fibre] G_transverse = 3.5: expected more than E_transverse/4 = 3.5; no material is stable otherwise":
        fibre("E_transverse = 14.0\nG_transverse = 3.5\n", "stress"),
    "[material.fibre] GT: axis 1 of a data sheet is along the fibres, which are along x3 here: give G_transverse\n"
    "[material.fibre] E_axial, nu_axial: missing; plane strain needs them":
        fibre("E_transverse = 14.0\nGT = 7.0\n"),
    "[material.fibre] E11, E_22, G12, nu12, alpha1: axis 1 of a data sheet is along the fibres, which are along x3 "
    "here: give E_axial, E_transverse, G_axial, nu_axial, expansion_axial\n"
    "[material.fibre] nu_transverse, G_transverse: missing; expected one":
        fibre("E11 = 230.0\nE_22 = 15.0\nG12 = 15.0\nnu12 = 0.2\nalpha1 = 1e-6\n"),
    "[material.fibre] expansion = [0.0, 1e-05, 1e-05]: expected a number, or expansion_axial and expansion_transverse":
        fibre(TRANSVERSE + AXIAL + "expansion = [0.0, 1e-5, 1e-5]\n"),
    "[material.fibre] E_axial, nu_axial: missing; plane strain needs them": fibre(TRANSVERSE),
    "[material.fibre] G_axial: missing; generalized plane strain needs it": fibre(TRANSVERSE + AXIAL, "generalized"),
    "[material.fibre] E1 (orthotropic) and E_transverse, nu_transverse (transversely isotropic): exclude each":
        fibre(TRANSVERSE + "E1 = 1.0\n"),
    "[material.fibre] angle (orthotropic) and E_axial, E_transverse, nu_axial, nu_transverse (transversely iso":
        fibre(TRANSVERSE + AXIAL + "angle = 30\n"),
    "[material.fibre] stiffness: expected 6x6 in generalized plane strain; 3x3 serves one plane state only":
        fibre("stiffness = [[3, 1, 0], [1, 3, 0], [0, 0, 1]]\n", "generalized"),
    "[material.fibre] stiffness = [[9.0, 4.0, 2.0, 0.0, 0.0, 0.5], [3.0, 8.0, 2.0, 0.0, 0.0...: expected a symmetric":
        fibre(SPATIAL.replace("[9, 3,", "[9, 4,"), "generalized"),
    "[material.fibre] stiffness = [[9.0, 3.0, 2.0, 0.0, 0.0, 0.5], [3.0, 8.0, 2.0, 0.0, 0.0...: expected a positive":
        fibre(SPATIAL.replace("[0, 0, 0, 3,", "[0, 0, 0, -3,"), "stress"),
    "[material.fibre] stiffness: C46 = 0.25: expected 0; x3 must be normal to a plane of symmetry":
        fibre(SPATIAL.replace("0, 0, 0, 4]", "0, 0.25, 0, 4]").replace("0, 3, 0.5, 0]", "0, 3, 0.5, 0.25]")),
    "[material.fibre] expansion_transverse: missing; expansion_axial needs it":
        fibre(TRANSVERSE + AXIAL + "expansion_axial = 1e-6\n"),
    "[material.fibre] expansion_axial: missing; expansion_transverse needs it":
        fibre(TRANSVERSE + AXIAL + "expansion_transverse = 1e-6\n"),
    "[material.fibre] expansion, expansion_axial, expansion_transverse: exclude each other":
        fibre(TRANSVERSE + AXIAL + "expansion = 1e-6\nexpansion_axial = 1e-6\nexpansion_transverse = 1e-6\n"),
    "[material.fibre] young, poisson (isotropic) and expansion_axial, expansion_transverse (transversely isotr":
        fibre(GIVEN + "expansion_axial = 1e-6\nexpansion_transverse = 1e-6\n"),
    "[material.fibre] expansion = [1e-06, 1e-06, 2e-06]: expected a number":
        fibre(GIVEN + "expansion = [1e-6, 1e-6, 2e-6]\n"),
    "[material.fibre] young: missing\n[material.fibre] poisson: missing": fibre("expansion = 1e-6\n"),
    '[material.fibre] young, poisson: missing; conductivity alone serves [analysis] type = "conductivity"':
        fibre("conductivity = 1\n"),
    '[material.fibre] conductivity: missing; [analysis] type = "conductivity" needs it': conducting(fibre=GIVEN),
    "[material.fibre] conductivity = -1.0: expected a table {axial, transverse}, a symmetric 3x3 array of numbers or a":
        conducting(fibre="conductivity = -1.0"),
    "[material.fibre] conductivity.transverse: missing; expected a number above 0":
        conducting(fibre="conductivity = {axial = 1.0}"),
    "[material.fibre] conductivity = [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: expected a symmetric matrix":
        conducting(fibre="conductivity = [[1.0, 0.5, 0.0], [0, 1, 0], [0, 0, 1]]"),
    "[material.fibre] conductivity = [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]: expected a positive definite":
        conducting(fibre="conductivity = [[1.0, 2.0, 0.0], [2.0, 1, 0], [0, 0, 1]]"),
    "[material.fibre], [material.matrix]: conductivities that differ by a factor of 5.0e+16: expected at most":
        conducting(fibre="conductivity = 1e16"),
    '[interface] normal_stiffness = 3.0: belongs to [analysis] type = "stiffness" or "angle" or "path" or "load" or':
        conducting("[interface]", "debonded = []", "normal_stiffness = 3.0"),
    '[interface] normal_strength = 3.0: belongs to [analysis] type = "path" or "envelope", not "conductivity"':
        conducting("[interface]", "debonded = []", "normal_strength = 3.0"),
    '[interface] contact = true: belongs to [analysis] type = "stiffness"':
        conducting("[interface]", "debonded = []", "contact = true"),
    "[interface] conductance = 0: expected a conductance above 0, or inf":
        conducting("[interface]", "debonded = []", "conductance = 0"),
    '[interface] conductance = 2.0: belongs to [analysis] type = "conductivity", not "stiffness"':
        ended("[interface]\ndebonded = []\nconductance = 2.0\n"),
    '[load]: belongs to [analysis] type = "load", not "conductivity"': conducting("[load]", "to = {E11 = 1.0}"),
    '[output] stress = "S11": belongs to [analysis] type = "stiffness"': conducting("[output]", 'stress = "S11"'),
    '[output] deformation_scale = 2.0: belongs to [analysis] type = "stiffness"':
        conducting("[output]", "deformation_scale = 2.0"),
    '[analysis] plane = "strain": expected "conduction", or no plane\n'
    '[material.fibre] conductivity: missing; [analysis] type = "conductivity" needs it':
        conducting(fibre=GIVEN).replace('type = "conductivity"', 'type = "conductivity"\nplane = "strain"'),
    "[material.fibre] k = 1.0: unknown key; did you mean conductivity?\n[material.fibre] conductivity: missing; exp":
        conducting(fibre="k = 1.0"),
    '[analysis] plane = "strain": expected "conduction", or no plane, in type = "conductivity"':
        conducting().replace('type = "conductivity"', 'type = "conductivity"\nplane = "strain"'),
    '[analysis] plane = "conduction": belongs to type = "conductivity"': cell('"strain"', '"conduction"'),
}  # fmt: skip
