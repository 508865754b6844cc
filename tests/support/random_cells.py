"""Random cells, debonded sets and strains, from a seeded generator that every rank draws from alike."""

import numpy as np


def random_cell(rng):
    """Return a case of 1 to 6 fibres, of about a hundred to three hundred nodes, for `make_case`."""
    fibres = int(rng.integers(1, 7))
    geometry = "random" if fibres > 2 else ("square", "hexagonal")[fibres - 1]
    order = int(rng.integers(1, 3))
    cell = {
        "geometry": geometry,
        "fibre_fraction": rng.uniform(0.15, 0.45),
        "order": order,
        "mesh_size": rng.uniform(0.12, 0.2) * order,
        "bodies": str(rng.choice(["torus", "plane"])),
        "plane": str(rng.choice(["strain", "stress"])),
        "matrix": {"young": 1.0, "poisson": rng.uniform(0.0, 0.42)},
        "fibre": {"young": 10.0 ** rng.uniform(-3, 3), "poisson": rng.uniform(0.0, 0.42)},
        "decomposition": {"subdomains": int(rng.integers(1, 13))} if rng.random() < 0.5 else {},
    }
    if geometry == "random":
        cell |= {"fibres": fibres, "min_gap": 0.1, "seed": int(rng.integers(1000)), "radius_spread": 0.3}
    return cell


def random_bonded(rng, reference):
    """(k,) which interface nodes of a `QuadraticProgramme` are bonded: arcs open, a fibre wholly, or but for a node."""
    bonded = np.ones(len(reference.key), bool)
    for f in np.unique(reference.fibre):
        own = np.flatnonzero(reference.fibre == f)
        kind = rng.choice(["bonded", "arcs", "debonded", "one"], p=[0.2, 0.5, 0.2, 0.1])
        if kind in ("debonded", "one"):
            bonded[own] = False
        if kind == "one":
            bonded[rng.choice(own)] = True
        for _ in range(rng.integers(1, 4) if kind == "arcs" else 0):
            away = (reference.angle[own] - rng.uniform(0, 360) + 180) % 360 - 180
            bonded[own[np.abs(away) < rng.uniform(5, 100)]] = False
    return bonded


def random_strain(rng):
    """One component, or all three, of either sign."""
    strain = rng.normal(size=3)
    return strain * np.eye(3)[rng.integers(3)] if rng.random() < 0.3 else strain
