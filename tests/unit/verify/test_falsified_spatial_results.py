"""A copy of a result of generalized plane strain in which one thing is false breaks the laws that it must break."""

import pytest
from support.falsifications import MATRIX, attribute, broken, document, free_axial_traction, scale, shift
from support.verified_results import falsified

pytestmark = pytest.mark.slow

MATERIAL = {"stress", "phases", "equilibrium", "mean stress", "Hill"}


def warmer(_, file):
    file["state/0"].attrs["temperature"] = 1e-2


WARMER = {"load", "stress", "phases", "equilibrium", "mean stress"}
FALSE = {
    "a stress along the fibres": ("spatial", scale("stress_33", state=3), {"stress"}),
    "an axial stress": ("spatial", scale("axial_stress", state=5), {"stress"}),
    "an axial stress that there is none of": ("spatial", shift("axial_stress"), {"stress"}),
    "an axial displacement": (
        "spatial", shift("axial_displacement", state=5),
        {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
    "an axial traction": ("spatial", scale("axial_traction", state=6), {"equilibrium"}),
    "an axial traction of springs": ("spatial springs", scale("axial_traction", state=5), {"equilibrium"}),
    "an axial traction on a free face": (
        "spatial contact", free_axial_traction(5), {"equilibrium", "free faces", "Hill"},
    ),
    "an axial jump": ("spatial contact", scale("axial_jump", state=5), {"jump"}),
    "an expansion": (
        "spatial", document("case", *MATRIX, "expansion", factor=1.01),
        {"stress", "phases", "equilibrium", "mean stress", "Hill", "Levin"},
    ),
    "an axial shear modulus": (
        "spatial", document("case", "material", "fibre", "G13", factor=1.01), MATERIAL,
    ),
    "axial springs": ("spatial springs", document("case", "interface", "tangential_stiffness", factor=1.01), {"bond"}),
    "a temperature": (
        "spatial", attribute("temperature", state=4), WARMER,
    ),
    "a temperature that there is none of": ("spatial", warmer, WARMER),
    "an entry of a spatial stiffness": (
        "spatial", document("effective_stiffness", 3, 3), {"tables", "moduli", "compliance"},
    ),
    "a count of an angle": ("spatial springs", document("angle", 1, "open", factor=2), {"tables"}),
    "an axial entry of an angle": ("spatial springs", document("angle", 1, "stiffness", 4, 4), {"tables"}),
    "a compliance": ("spatial", document("compliance", 2, 2), {"compliance"}),
    "a thermal stress": ("spatial", document("thermal_stress", 2), {"tables", "compliance", "moduli"}),
    "a thermal stress of an angle": (
        "spatial springs", document("angle", 1, "thermal_stress", 0), {"tables"},
    ),
    "a thermal stress under minus one": ("spatial contact", document("thermal_stress_compression", 1), {"tables"}),
    "an axial rate of a tip": ("spatial contact", document("tips", "G_III", 8), {"rates"}),
    "a load of a tip": ("spatial contact", document("tips", "load", 8, to="S13"), {"rates"}),
    "a thermal expansion": ("spatial", document("thermal_expansion", 0), {"compliance"}),
    "a constant of space": ("spatial", document("constants", "nu13"), {"moduli"}),
    "a constant about the fibres": ("spatial", document("transversely_isotropic", "G_axial"), {"moduli"}),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_copy_breaks_its_laws(results, tmp_path, name):
    kind, edit, laws = FALSE[name]
    assert broken(falsified(results(kind), tmp_path / "copy", edit)) == laws | {"files"}
