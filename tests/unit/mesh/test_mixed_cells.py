"""Random cells of several phases: fractions, radii and gaps, and the cells of one phase among them."""

import numpy as np
import pytest
from support.generated_meshes import generate
from unit.microstructure.test_arrangement import smallest_gap

from feti_homog.case.cell_section import Cell
from feti_homog.case.cell_sizes import fibre_counts
from feti_homog.errors import MeshError
from feti_homog.mesh.arrange import arrange
from feti_homog.mesh.fill.element_estimate import ElementEstimate
from feti_homog.mesh.fill.gmsh_mesher import arrangement_scale

MIX = {"glass": 0.3, "carbon": 0.25}
RADII = {"glass": 6.0, "carbon": 3.5}


def cell_of(**keys) -> Cell:
    return Cell(**{"geometry": "random", "mix": MIX, "seed": 3, "mesh_size": 0.1} | keys)


def shares(arrangement) -> dict[str, float]:
    area = np.pi * arrangement.radii**2
    return {name: area[np.array(arrangement.phase) == name].sum() for name in arrangement.phases[1:]}


@pytest.mark.parametrize(
    "keys",
    [
        {"fibres": 20},
        {"fibres": 25, "radii": RADII},
        {"width": 70.0, "radii": RADII},
        {"fibres": 12, "radius_spread": 0.3},
    ],
)
def test_each_phase_has_its_fraction_and_gaps_are_kept(keys):
    cell = cell_of(**keys)
    found = arrange(cell)
    assert shares(found) == pytest.approx(MIX, abs=1e-14)
    assert {name: found.phase.count(name) for name in MIX} == fibre_counts(cell)
    assert smallest_gap(found) >= cell.min_gap * 2 * found.radii.mean() * (1 - 1e-12)
    assert ElementEstimate.of(cell, None).fibres == len(found.radii)
    assert ElementEstimate.of(cell, None).mean_radius == pytest.approx(np.sqrt((found.radii**2).mean()), rel=1e-12)


@pytest.mark.parametrize("size", [{"fibres": 60}, {"width": 100.0}])
def test_radii_are_those_asked_for_within_half_a_fibre(size):
    cell = cell_of(radii=RADII, **size)
    found = arrange(cell)
    radii = arrangement_scale(cell, found) * found.radii
    for name, count in fibre_counts(cell).items():
        own = radii[np.array(found.phase) == name]
        assert np.ptp(own) < 1e-12 * own[0]
        assert own[0] / RADII[name] == pytest.approx(1.0, abs=0.5 / count)


def test_coatings_are_those_of_each_fibre():
    found = arrange(cell_of(fibres=12, radii=RADII, coating=0.1))
    assert found.coating == pytest.approx(0.1 * found.radii)
    assert found.phases == ("matrix", "carbon", "glass", "coating")


def test_a_mix_of_one_phase_is_the_cell_of_that_fraction():
    plain = arrange(Cell(geometry="random", fibre_fraction=0.5, fibres=15, radius_spread=0.3, seed=5))
    named = arrange(cell_of(mix={"glass": 0.5}, fibres=15, radius_spread=0.3, seed=5))
    assert np.array_equal(plain.centres, named.centres) and np.array_equal(plain.radii, named.radii)
    assert set(named.phase) == {"glass"}


def test_the_mesh_has_the_areas_of_each_phase():
    mesh = generate(cell_of(fibres=9, radii=RADII, mesh_size=0.02))
    corners = mesh.points[mesh.triangles]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = np.bincount(mesh.phase, (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2)
    found = dict(zip(mesh.phases, areas / areas.sum(), strict=True))
    assert found == pytest.approx(MIX | {"matrix": 0.45}, rel=0.02)


def test_what_cannot_be_arranged_names_the_mix():
    with pytest.raises(
        MeshError, match=r"^\[cell\] mix = \{glass = 0.6, carbon = 0.3\} with min_gap = 0.05 and fibres"
    ):
        arrange(cell_of(mix={"glass": 0.6, "carbon": 0.3}, fibres=9))
    with pytest.raises(MeshError, match=r"^\[cell\] mix = \{glass = 1e-14\}: a fibre has a radius of"):
        generate(cell_of(mix={"glass": 1e-14}, fibres=1))
