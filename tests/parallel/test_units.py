"""Every number of result.json in other units: of stress from 1e-20 to 1e20, of length from 1e-9 to 1e9."""

import pytest
from support.dimensions import Units, differences
from support.generalized_phases import CARBON
from support.ranks import parallel_assert

from feti_homog import Case, run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

# Powers of four, of which also the root changes no digit: 1.4e-20 and 7.4e19.
EXACT_UNITS = [Units(stress=4.0**-33), Units(stress=4.0**33)]
ROUNDED_UNITS = [Units(1e-20, 1e9, 1e-3), Units(1e20, 1e-9, 1e3)]
ROUNDING = 1e-9

EPOXY = {"young": 3.45, "poisson": 0.35, "expansion": 54e-6}
GLASS = {"young": 73.0, "poisson": 0.22, "expansion": 5e-6}
STRENGTH = {"normal_strength": 0.03, "tangential_strength": 0.04}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0, "axial_stiffness": 20.0}
PLANE_SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
ENERGY = PLANE_SPRINGS | {"criterion": "energy", "toughness": 1e-5}
ARC = {"debonded": [{"fibre": 1, "centre": 20.0, "angle": 80.0}]}
PIECES = {"cell": {"geometry": "random", "fibres": 3, "min_gap": 0.1}, "decomposition": {"subdomains": 8}}
# Sparse factors alone, by the library that has thresholds.
BY_MUMPS = {"feti_dual_operator": "implicit", "feti_sub_pc_factor_mat_solver_type": "mumps"}

CASES = {
    "bonded": {"analysis": "stiffness"},
    "pieces": {"analysis": "stiffness", "interface": ARC} | PIECES,
    "MUMPS": {"analysis": "stiffness", "interface": ARC | PLANE_SPRINGS, "petsc": BY_MUMPS, "fibre": CARBON},
    "space": {"analysis": "stiffness", "plane": "generalized", "interface": ARC | SPRINGS, "fibre": CARBON},
    "angles": {"analysis": "angle", "interface": {"debonded": [{"fibre": 1}]}, "angle": {"values": [0.0, 60.0]}},
    "strengths": {"analysis": "path", "interface": STRENGTH, "path": {"waypoints": [{"S11": 0.06}, {"S11": 0.02}]}},
    "energy": {"analysis": "path", "interface": ENERGY, "path": {"strain": [0.03, 0.0, 0.0]}},
    "cooled": {
        "analysis": "path",
        "plane": "generalized",
        "interface": STRENGTH | {"axial_strength": 0.025},
        "path": {"waypoints": [{"temperature": -100.0}, {"S11": 0.03, "gamma13": 0.02}]},
    },
    "conductivity": {
        "analysis": "conductivity",
        "plane": "conduction",
        "interface": ARC | {"conductance": 2.0},
        "matrix": {"conductivity": 0.2},
        "fibre": {"conductivity": {"axial": 10.0, "transverse": 1.5}},
    },
    "bonded conductors": {
        "analysis": "conductivity",
        "plane": "conduction",
        "matrix": {"conductivity": 0.2},
        "fibre": {"conductivity": 3.0},
    },
    "envelope": {"analysis": "envelope", "interface": STRENGTH, "envelope": {"plane": ["S11", "S22"], "directions": 4}},
}


def document(analysis, plane="strain", cell=None, petsc=None, fibre=GLASS, matrix=EPOXY, **sections):
    """Return a case; phases expand where that is solved for."""
    phases = {"matrix": matrix, "fibre": fibre}
    if plane != "generalized":
        phases = {
            name: {k: v for k, v in phase.items() if not k.startswith("expansion")} for name, phase in phases.items()
        }
    return {
        "cell": {"geometry": "square", "width": 1.0, "fibre_fraction": 0.4, "mesh_size": 0.3} | (cell or {}),
        "material": phases,
        "analysis": {"type": analysis, "plane": plane},
        "petsc": {"feti_ksp_rtol": 1e-12} | (petsc or {}),
        "output": {"pictures": False, "fields": False},
    } | sections


@pytest.mark.parametrize("name", CASES)
def test_every_number_has_its_dimension(comm, name):
    """To the last digit in units that change none; sums over three ranks have no fixed order."""
    written = document(**CASES[name])
    before = run(Case.parse(written), comm)
    number = [*CASES].index(name) % 2
    for units in (EXACT_UNITS[number], ROUNDED_UNITS[number]):
        off = differences(before, run(Case.parse(units.case(written)), comm), units)
        if units in ROUNDED_UNITS or comm.size > 2:
            off = {place: by for place, by in off.items() if not (by < ROUNDING or place.startswith("solver."))}
        parallel_assert(comm, not off, f"{units}: {off}")
