"""A copy of a result of mixed loads in which one thing is false breaks the laws that it must break."""

import pytest
from support.falsifications import attribute, both, broken, document, entry, free_axial_traction, raised, scale
from support.verified_results import falsified

pytestmark = pytest.mark.slow

ENERGIES = ("work", "dissipated", "dissipated_strain_controlled")
TARGET = ("case", "load", "to")


def waypoint(number):
    return "case", "path", "waypoints", number


def another_component(content, _):
    content["case"]["load"]["to"]["S12"] = 0.1


WARMER = {"load", "stress", "phases", "equilibrium", "mean stress"}

FALSE = {
    "a temperature of the fields": (
        "cooled", attribute("temperature", state=3), WARMER | {"tables"},
    ),
    "a temperature of a point": ("cooled", document("path", 3, "temperature"), {"load", "tables"}),
    "a temperature of both": (
        "cooled", both(attribute("temperature", state=3), document("path", 3, "temperature")),
        WARMER,
    ),
    "a temperature of a point without fields": ("cooled, thinned", document("path", 2, "temperature"), {"load"}),
    "a temperature that stays": ("cooled", document(*waypoint(0), "temperature"), {"load"}),
    "a stress that is gone to": ("cooled", document(*waypoint(1), "S22", factor=1.01), {"stress load", "energy"}),
    "the kind of a component": ("cooled", document(*waypoint(3), to={"temperature": 0.0, "E22": 1.0}), {"load"}),
    "a work": ("cooled", document("path", 5, "work", factor=1.01), {"energy"}),
    "a work at a point without fields": ("cooled, thinned", document("path", 2, "work", factor=1.01), {"energy"}),
    "a work of increments": ("cooled by steps", document("path", -1, "work", factor=1.01), {"energy"}),
    "a work that is lost at a break": ("mixed", raised(4, 1e-3, *ENERGIES), {"energy"}),
    "a work that is lost along the fibres": ("axial", raised(4, 1e-3, *ENERGIES), {"energy"}),
    "a work that is lost in a cascade": ("cooled", raised(4, 1e-3, *ENERGIES), {"energy"}),
    "a work that is lost where nothing breaks": ("mixed", raised(13, 1e-3, *ENERGIES), {"energy"}),
    "a work that a break gives back": ("cooled", raised(11, -0.1, *ENERGIES), {"energy"}),
    "a work that a step gives back": ("cooled by steps", raised(7, -1.0, *ENERGIES), {"energy"}),
    "a dissipation of a rising stress": (
        "mixed", document("path", -1, "dissipated_strain_controlled", factor=1.01), {"energy"},
    ),
    "a stress that is zero": ("cooled", document("path", 4, "stress", 0, to=0.1), {"stress load", "tables"}),
    "a stress that is zero at a point without fields": (
        "cooled, thinned", document("path", 2, "stress", 0, to=0.1), {"stress load", "energy"},
    ),
    "a stress that is zero, of both": (
        "cooled", both(document("path", 4, "stress", 0, to=0.1), entry("stress", 0, 0.1, state=4)),
        {"stress load", "mean stress", "Hill"},
    ),
    "a strain that answers a stress": ("cooled", document("path", 5, "strain", 2), {"tables"}),
    "a strain of a point without fields": (
        "cooled, thinned", document("path", 2, "strain", 1, factor=1.01), {"energy"},
    ),
    "an energy stored after cooling": ("cooled", document("path", 5, "stored", factor=1.01), {"energy"}),
    "an energy of a point without fields": ("cooled, thinned", document("path", 2, "stored", factor=1.01), {"energy"}),
    "an axial traction on a broken bond": (
        "axial", free_axial_traction(13), {"equilibrium", "free faces", "Hill"},
    ),
    "an axial traction": ("axial", scale("axial_traction", state=3), {"equilibrium"}),
    "an axial strength too low": ("axial", document("case", "interface", "axial_strength", factor=0.99), {"strength"}),
    "an axial strength too high": ("axial", document("case", "interface", "axial_strength", factor=1.01), {"strength"}),
    "an axial stiffness": (
        "axial energy", document("case", "interface", "axial_stiffness", to=290.0),
        {"bond", "strength", "energy", "tables"},
    ),
    "a toughness too low": (
        "axial energy", document("case", "interface", "toughness", factor=0.98), {"strength", "energy"},
    ),
    "an energy of a tip": ("axial springs", document("path", -1, "tips", "G_II", 0), {"tables"}),
    "bonds that broke": ("axial", document("path", 4, "broke", factor=2), {"breaks", "strength"}),
    "a strain of a load": ("load", document("load", "strain", 0), {"tables"}),
    "a stress of a load": ("load", document("load", "stress", 0), {"tables"}),
    "a utilisation": ("load", document("phase_stresses", 0, "utilisation", 0), {"phases"}),
    "a position of a utilisation": (
        "load", document("phase_stresses", 1, "utilisation_at", 0, 0, factor=1.01), {"phases"},
    ),
    "a criterion": ("load", document("phase_stresses", 1, "criterion", to="von Mises"), {"phases"}),
    "a mode": ("load", document("phase_stresses", 1, "mode", 0, to="fibre compression"), {"phases"}),
    "no mode": ("load", document("phase_stresses", 1, "mode", to=[]), {"phases"}),
    "a strength": (
        "load", document("case", "material", "fibre", "strength", "axial_shear", factor=1.01), {"phases"},
    ),
    "no stresses of phases": ("load", document("phase_stresses", to=[]), {"phases"}),
    "a temperature of a load": ("load", document("load", "temperature"), {"tables"}),
    "an energy of a load": ("load", document("load", "stored", factor=1.01), {"energy"}),
    "an energy of springs of a load": ("load", document("load", "stored_in_springs", to=1e-3), {"energy"}),
    "open faces of a load": ("load with contact", document("load", "open", factor=2), {"tables"}),
    "a debonded length of a load": ("load with contact", document("load", "debonded_length", 0), {"tables"}),
    "a strain that is asked for": ("load", document(*TARGET, "E11"), {"load"}),
    "a temperature that is asked for": ("load", document(*TARGET, "temperature"), {"load"}),
    "a stress that is asked for": ("load", document(*TARGET, "S13", factor=1.01), {"stress load"}),
    "a stress in the plane that is asked for": (
        "load with contact", document(*TARGET, "S22", factor=1.01), {"stress load"},
    ),
    "a stress that was not asked for": ("load with contact", another_component, {"stress load"}),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_copy_breaks_its_laws(results, tmp_path, name):
    kind, edit, laws = FALSE[name]
    assert broken(falsified(results(kind), tmp_path / "copy", edit)) == laws | {"files"}
