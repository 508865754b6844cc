"""Random cells, bonds and loads against brute force, others at every number of ranks."""

import numpy as np
import pytest
from support.generalized_phases import CRYSTAL, WOOD
from support.loaded_twins import EPOXY_GLASS, compare_paths

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

STRESS_OF = {
    "E11": "S11", "E22": "S22", "gamma12": "S12", "E33": "S33", "gamma13": "S13", "gamma23": "S23",
}  # fmt: skip
UNLIKE = (WOOD | {"expansion": [4e-5, 6e-5, 2e-5]}, CRYSTAL | {"expansion": [4e-6, 6e-6, -2e-6]})
STRENGTH = 0.03


@pytest.mark.parametrize("number", range(6))
def test_random_paths_are_those_of_brute_force(comm, number):
    rng = np.random.default_rng([comm.size, number, 11])
    plane = ("generalized", "strain", "generalized", "stress")[number % 4]
    in_space = plane == "generalized"
    interface = random_bonds(rng, in_space)
    case = {
        "cell": random_cell(rng),
        "phases": UNLIKE if in_space and rng.random() < 0.5 else EPOXY_GLASS,
        "plane": plane,
        "interface": interface,
        "petsc": {"feti_pc_type": "influence"} if "toughness" in interface else None,
    }
    compare_paths(comm, **case, path={"waypoints": random_waypoints(rng, in_space)})


def random_cell(rng):
    """Keys of a cell of one or two fibres."""
    cell = ({}, {"geometry": "hexagonal"}, {"order": 2, "mesh_size": 0.3})[rng.integers(3)]
    return cell | {"bodies": str(rng.choice(["torus", "plane"]))}


def random_bonds(rng, in_space):
    """Return a section [interface]: strengths or toughness, glue or springs, with an arc or without."""
    keys = ["normal", "tangential", *(["axial"] if in_space else [])]
    springs = {f"{key}_stiffness": float(10 ** rng.uniform(0.5, 2.5)) for key in keys}
    if rng.random() < 0.4:
        toughness = STRENGTH**2 / 2 / springs["normal_stiffness"] * rng.uniform(0.5, 2.0)
        law = {"toughness": float(toughness), "mode_sensitivity": float(rng.uniform(0.05, 1.0))}
        bonds = springs | law | {"criterion": "energy", "growth": str(rng.choice(["released", "springs"]))}
    else:
        strengths = {f"{key}_strength": STRENGTH * float(rng.uniform(0.7, 2.0)) for key in keys}
        bonds = strengths | {"criterion": str(rng.choice(["max", "quadratic"]))}
        bonds |= springs if rng.random() < 0.4 else {}
    if rng.random() < 0.4:
        angle = float(rng.choice([70.0, 150.0, 360.0]))
        bonds["debonded"] = [{"fibre": 1, "centre": float(rng.uniform(-180, 180)), "angle": angle}]
    return bonds | {"contact": bool(rng.random() < 0.8)}


def random_waypoints(rng, in_space):
    """Up to three loads of up to three components each, some with a temperature."""
    names = list(STRESS_OF)[: 6 if in_space else 3]
    waypoints = []
    for leg in range(rng.integers(1, 4)):
        chosen = rng.choice(names, size=rng.integers(1, 4), replace=False)
        by_stress = rng.random(len(chosen)) < 0.5
        load = {
            STRESS_OF[str(name)] if stress else str(name): float(rng.normal() * (0.03 if stress else 0.02))
            for name, stress in zip(chosen, by_stress, strict=True)
        }
        cooled = in_space and rng.random() < (0.5 if leg == 0 else 0.2)
        waypoints.append(load | ({"temperature": float(rng.choice([-150.0, 100.0]))} if cooled else {}))
    return waypoints
