"""Results in which one thing is false, of mixed loads, in space, of conduction and of envelopes, break their laws."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.falsifications import (
    MATRIX,
    attribute,
    both,
    broken,
    document,
    entry,
    free_axial_traction,
    raised,
    scale,
    shift,
)
from support.verified_results import falsified

from feti_homog.verify.check_constants import check_conductivity
from feti_homog.verify.findings import Findings, checks

pytestmark = pytest.mark.slow

ENERGIES = ("work", "dissipated", "dissipated_strain_controlled")
TARGET = ("case", "load", "to")


def waypoint(number):
    return "case", "path", "waypoints", number


def another_component(content, _):
    content["case"]["load"]["to"]["S12"] = 0.1


def warmer(_, file):
    file["state/0"].attrs["temperature"] = 1e-2


MATERIAL = {"stress", "phases", "equilibrium", "mean stress", "Hill"}
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
    "a stress that is zero": ("cooled", document("path", 4, "stress", 0, to=0.1), {"stress load", "mean stress"}),
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
    "a mode": ("load", document("phase_stresses", 1, "mode", 0, to="axial compression"), {"phases"}),
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
    # Generalized plane strain.
    "a stress along the fibres": ("spatial", scale("stress_33", state=3), {"stress"}),
    "an axial stress": ("spatial", scale("axial_stress", state=5), {"stress"}),
    "an axial stress that there is none of": ("spatial", shift("axial_stress"), {"stress"}),
    "an axial displacement": (
        "spatial", shift("axial_displacement", state=5),
        {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
    "an axial traction of a unit strain": ("spatial", scale("axial_traction", state=6), {"equilibrium"}),
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
    # Conduction.
    "a conductivity": ("conductivity", document("effective_conductivity", 2, 2), {"tables"}),
    "a coupling of conductivities": (
        "conductance", document("effective_conductivity", 0, 1, factor=1.01), {"tables", "symmetry"},
    ),
    "a conductivity of a phase": (
        "conductivity", document("case", "material", "fibre", "conductivity", "axial"),
        {"stress", "mean stress", "bounds"},
    ),
    "a tensor of a phase": (
        "conductance", document("case", "material", "fibre", "conductivity", 0, 0),
        {"stress", "equilibrium", "mean stress"},
    ),
    "a conductance": ("conductance", document("case", "interface", "conductance", factor=1.01), {"bond"}),
    "a bound of conductivities": (
        "conductivity", document("conductivity_estimates", "hashin_shtrikman", 1), {"bounds"},
    ),
    "Wiener's bound": ("conductivity", document("conductivity_estimates", "wiener", 0), {"bounds"}),
    "a conductivity beyond its bounds": (
        "conductivity", document("effective_conductivity", 0, 0, factor=10.0), {"bounds", "tables"},
    ),
    "a mean of conductivities": ("conductivity", document("conductivity_estimates", "axial"), {"bounds"}),
    "a temperature of a conduction": (
        "conductivity", shift("axial_displacement"), {"stress", "periodicity", "jump", "equilibrium", "mean stress"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FALSE)
def test_a_falsified_copy_breaks_its_laws(results, tmp_path, name):
    kind, edit, laws = FALSE[name]
    assert broken(falsified(results(kind), tmp_path / "copy", edit)) == laws | {"files"}


STRESS, ENERGY, SPACE = "envelope", "envelope by energy", "envelope in space"


def onset_by(share):
    """All of the load at onset, so that it stays in the plane."""

    def edit(content, _):
        point = content["envelope"][3]
        for name in ("strain", "stress"):
            point[name] = [share * value for value in point[name]]
        point["factor"] *= share

    return edit


def entry_of(name, change, number=1):
    def edit(content, _):
        content["envelope"][number][name] = change(content["envelope"][number][name])

    return edit


def component(name, place, by):
    def edit(content, _):
        vector = content["envelope"][2][name]
        vector[place] += by * max(map(abs, vector))

    return edit


def no_onset(content, _):
    content["envelope"][5] = {"angle": content["envelope"][5]["angle"]}


def one_direction_less(content, _):
    del content["envelope"][-1]


ENVELOPES = {
    "a load a little larger": (STRESS, onset_by(1 + 1e-6), {"onset"}),
    "a load a little smaller": (STRESS, onset_by(1 - 1e-6), {"onset"}),
    "a factor": (STRESS, entry_of("factor", lambda v: v * (1 + 1e-6)), {"load"}),
    "a strain of stresses": (STRESS, component("strain", 0, 1e-6), {"load", "onset"}),
    "a stress that is not named": (STRESS, component("stress", 0, 1e-6), {"load"}),
    "a direction": (STRESS, entry_of("angle", lambda v: v + 1e-6), {"load"}),
    "another bond": (STRESS, entry_of("bond_angle", lambda v: v + 1.0), {"tables"}),
    "another share": (STRESS, entry_of("tangential", lambda v: v + 1e-6), {"onset"}),
    "no onset": (STRESS, no_onset, {"onset"}),
    "one less": (STRESS, one_direction_less, {"load"}),
    "too large a load of tips": (ENERGY, onset_by(10.0), {"onset"}),
    "another mode": (ENERGY, entry_of("psi", lambda v: v + 1e-4), {"onset"}),
    "a load in space": (SPACE, onset_by(1 + 1e-6), {"load", "onset"}),
    "a share along the fibre": (SPACE, entry_of("axial", lambda v: v + 1e-6), {"onset"}),
    "a strain in space": (SPACE, component("strain", 3, 1e-6), {"load"}),
}


@pytest.mark.parametrize("name", ENVELOPES)
def test_one_false_number_is_found(results, tmp_path, name):
    kind, edit, laws = ENVELOPES[name]
    found = broken(falsified(results(kind), tmp_path / "copy", edit))
    assert found >= laws, found


@pytest.mark.parametrize("bonds", [{}, {"conductance": 3.0}], ids=str)
@pytest.mark.parametrize("with_bounds", [True, False])
def test_bounds_of_conductivities_are_those_of_bonds_without_resistance(bonds, with_bounds):
    """Two halves that conduct 1 and 3 across the fibres, 2 and 4 along; k^ef is Hashin and Shtrikman's lower bound."""
    k, A = np.diag([5 / 3, 5 / 3, 3.0]), np.zeros((2, 6, 6))
    A[:, [2, 3, 4], [2, 3, 4]] = [[2.0, 1.0, 1.0], [4.0, 3.0, 3.0]]
    bounds = {"wiener": [1.5, 2.0], "hashin_shtrikman": [5 / 3, 1.8]} if with_bounds else {}
    forms = {"axial": 3.0, "wiener": None, "hashin_shtrikman": None} | bounds
    content = {"effective_conductivity": k, "conductivity_estimates": forms}
    files = SimpleNamespace(document=content, interfaces=[bonds])
    found = Findings(checks(1e-9, False))
    check_conductivity(found, SimpleNamespace(files=files, fractions=np.array([0.5, 0.5]), stiffnesses=A))
    assert [one.name for one in found.worst() if not one.holds] == ["bounds"] * (bool(bonds) is with_bounds)
