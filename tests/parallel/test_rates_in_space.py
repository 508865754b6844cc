"""Energy release rates at tips in generalized plane strain, on all numbers of ranks.

They are compared with differences of the stored energy, and with the exact solution for axial shear.
"""

import numpy as np
import pytest
from support.cases import FIBRE, MATRIX, case_of
from support.ranks import parallel_assert

from feti_homog import run

pytestmark = [pytest.mark.parallel, pytest.mark.one_rank]

SQUARE = {"geometry": "square", "fibre_fraction": 0.4, "mesh_size": 0.08, "order": 2}
RADIUS = np.sqrt(0.4 / np.pi)
PHASES = {"matrix": MATRIX | {"expansion": 60e-6}, "fibre": FIBRE | {"expansion": 5e-6}}
INCOMPRESSIBLE = {"matrix": {"young": 3.5, "poisson": 0.4999, "expansion": 60e-6}, "fibre": PHASES["fibre"]}
RIGID, TOUCHING = {"contact": False}, {"contact": True}
SPRINGS = {"contact": False, "normal_stiffness": 1000.0, "tangential_stiffness": 250.0, "axial_stiffness": 400.0}
ALL = {"E11": 0.2, "E22": 0.3, "gamma12": 0.4, "E33": 0.5, "gamma13": 0.6, "gamma23": 0.3, "temperature": -3000.0}
# Half of the difference of two openings, in degrees.
STEP = 0.5


def loaded(comm, load, opening, bond, centre=20.0, materials=PHASES, **cell):
    """Return the point under a load, and the area of the cell."""
    bonds = {"debonded": [{"fibre": 1, "angle": opening, "centre": centre}]} | bond
    sections = {"material": materials, "interface": bonds, "load": {"to": load}}
    result = run(case_of(SQUARE | cell, plane="generalized", **sections), comm)
    return result.load, result.cell.area


@pytest.mark.parametrize(
    ("load", "case", "error"),
    [
        ({"E33": 1.0}, {}, 2e-3),
        ({"gamma13": 1.0, "gamma23": 0.5}, {}, 2e-3),
        ({"E11": 0.2, "temperature": 5000.0}, {}, 2e-3),
        (ALL, {}, 2e-3),
        (ALL, {"order": 1, "refine": 2}, 6e-3),
        (ALL, {"materials": INCOMPRESSIBLE}, 2e-3),
        (ALL | {"E11": -0.4}, {"bond": TOUCHING}, 2e-3),
        (ALL, {"bond": SPRINGS}, 5e-3),
    ],
    ids=["along the fibres", "axial shear", "heat", "all", "linear", "incompressible", "contact", "springs"],
)
def test_the_rates_of_all_loads_are_what_the_energy_loses(comm, load, case, error):
    case = {"bond": RIGID} | case
    point, area = loaded(comm, load, 120.0, **case)
    tips, (less, more) = point.tips, (loaded(comm, load, 120.0 + 2 * half, **case)[0].stored for half in (-STEP, STEP))
    expected = area * (less - more) / (2 * np.radians(STEP) * RADIUS)
    parallel_assert(comm, len(tips.G) == 2 and abs(tips.G.sum() / expected - 1) < error)
    parallel_assert(comm, np.abs(tips.G_I + tips.G_II + tips.G_III - tips.G).max() < 1e-12)


@pytest.mark.parametrize("opening", [60.0, 140.0, 260.0])
def test_one_fibre_under_axial_shear_has_the_exact_rates(comm, opening):
    """The cell is 40 radii wide, so that the matrix has its stress far from the fibre.

    The exterior of an arc of the half angle t is the image of the exterior of a circle under the map
    R w (w + s) / (1 + s w), s = 1 / sin(t / 2).  Without a fibre, this gives

        G = pi tau^2 R / (2 mu) sin t cos^2(t / 2) or pi tau^2 R / (2 mu) sin t sin^2(t / 2)

    at each tip under S13 or S23, for an arc with its middle on the axis x1.  With a fibre, of the shear modulus mu_f,
    the solution is this one times A = 2 mu_f / (mu + mu_f), plus the solution for a hole times 1 - A.
    """
    widths, half = 40, np.radians(opening / 2)
    materials = {"matrix": {"young": 2.6, "poisson": 0.3}, "fibre": {"young": 60.0, "poisson": 0.2}}
    cell = {"fibre_fraction": np.pi / widths**2, "fibre_radius": 1.0, "mesh_size": 0.05}
    cell |= {"interface_size": 0.06 / widths, "tip_size": 6e-4 / widths}
    share = 2 * 25.0 / (1.0 + 25.0)
    for load, part in (("S13", np.cos(half / 2) ** 2), ("S23", np.sin(half / 2) ** 2)):
        point, _ = loaded(comm, {load: 1.0}, opening, RIGID, 0.0, materials, **cell)
        expected = share * np.pi / 2 * np.sin(half) * part
        parallel_assert(comm, np.abs(point.tips.G_III / expected - 1).max() < 5e-3)
        parallel_assert(comm, bool((point.tips.psi == 90.0).all() and (point.tips.G == point.tips.G_III).all()))
