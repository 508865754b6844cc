"""Generalized plane strain against one sparse system with three displacements a node, on the same mesh.

All of the stiffness (6, 6) and of the thermal stress, at any number of ranks: bonded, debonded, on springs, in contact.
"""

from pathlib import Path

import numpy as np
import pytest
from support.generalized_phases import CARBON, CRYSTAL, WOOD
from support.random_cells import random_cell
from support.spatial_cells import Twin, error, solved

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks]

TIGHT = 1e-9
MESHES = Path(__file__).parents[2] / "meshes"

CORDIERITE = {"young": 1.0, "poisson": 0.3, "expansion": 1e-7}
ORTHOTROPIC = {"matrix": WOOD, "fibre": CRYSTAL}
SPRINGS = {"normal_stiffness": 100.0, "tangential_stiffness": 30.0}
CUT = {"decomposition": {"subdomains": 7}}


def arcs(*given, **keys):
    """Return a section [interface] with arcs (fibre, centre, angle)."""
    debonded = [dict(zip(("fibre", "centre", "angle"), arc, strict=False)) for arc in given]
    return {"interface": {"debonded": debonded} | keys}


def springs_of(section):
    """Return (normal, tangential) of a section [interface], or None."""
    stiffnesses = section.get("normal_stiffness"), section.get("tangential_stiffness")
    return None if None in stiffnesses else stiffnesses


def compare(comm, tolerance=TIGHT, **case):
    """Return the result of a case, whose secants are those of the twin. Collective."""
    result, twin = solved(comm, **case), Twin(comm, **case)
    section = case.get("sections", {}).get("interface", {})
    how = {"contact": bool(section) and section.get("contact", True), "springs": springs_of(section)}
    signs = {1.0: (result.effective_stiffness, result.thermal_stress)}
    if result.effective_stiffness_compression is not None:
        signs[-1.0] = result.effective_stiffness_compression, result.thermal_stress_compression
    for sign, found in signs.items():
        for own, expected in zip(found, twin.secants(sign=sign, **how), strict=True):
            assert own is None or error(own, expected) < tolerance
    twin.destroy()
    return result


@pytest.mark.quick
@pytest.mark.parametrize(
    ("case", "sections"),
    [
        ({"geometry": "square", "refine": 1, "mesh_size": 0.3}, CUT),
        ({"geometry": "hexagonal", "order": 2, "mesh_size": 0.4}, CUT),
        ({"geometry": "hexagonal", "bodies": "plane"}, {}),
        ({"geometry": "random", "fibres": 3, "min_gap": 0.15, "seed": 3}, {}),
    ],
)
def test_bonded_cell_has_the_stiffness_of_its_twin(comm, case, sections):
    C = compare(comm, **ORTHOTROPIC, sections=sections, **case).effective_stiffness
    # The axes of the phases are not those of the cell: nothing vanishes but what has to.
    assert (np.abs(C[np.ix_([0, 1, 2], [5])]) > 1e-3).all() and abs(C[3, 4]) > 1e-3
    assert (C[np.ix_([0, 1, 2, 5], [3, 4])] == 0).all()


@pytest.mark.one_rank
def test_three_phases_of_a_users_mesh(comm):
    phases = {"matrix": WOOD, "fibre": CRYSTAL, "fibre:2": CARBON}
    cell = {"geometry": "mesh", "file": "two_fibres.msh", "folder": MESHES, "order": 2}
    compare(comm, sections={"material": phases}, **cell)


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("contrast", "sections"),
    [(1e6, {}), (1e-6, CUT), (1e-3, CUT)],
    ids=["whole 1e6", "cut 1e-6", "cut 1e-3"],
)
def test_any_contrast(comm, contrast, sections):
    compare(comm, matrix=CORDIERITE, fibre={"young": contrast, "poisson": 0.2, "expansion": 5e-6}, sections=sections)


@pytest.mark.one_rank
@pytest.mark.parametrize("G_axial", [1e-4, 28.0, 1e5])
def test_fibres_that_shear_along_unlike_across(comm, G_axial):
    compare(comm, fibre=CARBON | {"G_axial": G_axial}, geometry="hexagonal")


@pytest.mark.one_rank
def test_nearly_incompressible_matrix(comm):
    compare(comm, matrix={"young": 3.0, "poisson": 0.4999, "expansion": 50.0}, order=2, mesh_size=0.3)


OPEN = [(1, 20.0, 80.0), (2, -100.0, 200.0)], [(1, 0.0, 360.0)], [("all", 0.0, 360.0)]


@pytest.mark.one_rank
@pytest.mark.parametrize("given", OPEN, ids=str)
def test_free_faces(comm, given):
    compare(comm, **ORTHOTROPIC, geometry="hexagonal", sections=arcs(*given, contact=False))


@pytest.mark.one_rank
def test_free_faces_of_curved_elements(comm):
    sections = arcs((1, 20.0, 80.0), (2, 0.0, 360.0), contact=False)
    compare(comm, **ORTHOTROPIC, geometry="hexagonal", order=2, mesh_size=0.3, tip_size=0.2, sections=sections)


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("springs", "given"),
    [
        (SPRINGS, [(1, 20.0, 80.0)]),
        ({"normal_stiffness": 0.5, "tangential_stiffness": 2.0}, []),
        (dict.fromkeys(SPRINGS, 1e5), [(1, 20.0, 80.0)]),
    ],
    ids=["stiff", "soft", "very stiff"],
)
def test_elastic_interfaces(comm, springs, given):
    compare(comm, **ORTHOTROPIC, geometry="hexagonal", sections=arcs(*given, contact=False, **springs))


@pytest.mark.one_rank
def test_elastic_interfaces_of_curved_elements(comm):
    compare(comm, **ORTHOTROPIC, order=2, mesh_size=0.3, sections=arcs(**SPRINGS) | CUT)


@pytest.mark.one_rank
@pytest.mark.parametrize("given", [[("all", 20.0, 80.0)], OPEN[1]], ids=["arc", "whole"])
@pytest.mark.parametrize("springs", [{}, SPRINGS], ids=["glue", "springs"])
def test_contact(comm, given, springs):
    sections = arcs(*given, **springs)
    result = compare(comm, **ORTHOTROPIC, mesh_size=0.25, tip_size=0.1, sections=sections)
    C, compression = result.effective_stiffness, result.effective_stiffness_compression
    assert error(C, compression) > 1e-3
    # Along the fibres nothing opens or closes.
    assert error(C[3:5, 3:5], compression[3:5, 3:5]) < TIGHT


def test_contact_by_another_preconditioner(comm):
    compare(
        comm, mesh_size=0.25, tip_size=0.1, petsc={"feti_pc_type": "lumped"}, sections=arcs(("all", 0.0, 90.0)) | CUT
    )


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("expansions", "angle"),
    [((5e-6, 1e-7), 80.0), ((2.0, 2.0), 80.0), ((0.0, 0.0), 360.0), ((0.0, 1.0), 360.0)],
    ids=str,
)
def test_contact_under_a_temperature(comm, expansions, angle):
    phases = {"matrix": {"young": 1.0, "poisson": 0.3}, "fibre": {"young": 10.0, "poisson": 0.2}}
    for phase, expansion in zip(phases.values(), expansions, strict=True):
        phase["expansion"] = expansion
    compare(comm, **phases, mesh_size=0.25, tip_size=0.1, sections=arcs((1, 20.0, angle)))


# A matrix in one piece: forces between pieces of a stiff one would hide those of a soft fibre at this tolerance.
WHOLE = {"decomposition": {"subdomains": 2}}


@pytest.mark.one_rank
@pytest.mark.parametrize(
    ("sections", "soft"),
    [(CUT, "fibre"), (arcs((1, 20.0, 150.0)) | WHOLE, "matrix"), (arcs((1, 0.0, 360.0)) | WHOLE, "fibre")],
    ids=["cut", "arc", "whole"],
)
def test_a_soft_phase_alone_expands(comm, soft, sections):
    """At the default tolerance: what it would do alone is what errors are small parts of."""
    phases = {name: {"young": 450.0, "poisson": 0.0, "expansion": 0.0} for name in ORTHOTROPIC}
    phases[soft] = {"young": 8e-5, "poisson": 0.4, "expansion": 30.0}
    compare(
        comm, tolerance=1e-7, **phases, petsc={"feti_ksp_rtol": 1e-8}, mesh_size=0.25, tip_size=0.1, sections=sections
    )


@pytest.mark.one_rank
def test_what_strains_no_phase_across_closes_nothing(comm):
    """Without Poisson's effect E33 makes neither forces nor gaps."""
    phases = {"matrix": {"young": 1.0, "poisson": 0.0}, "fibre": {"young": 10.0, "poisson": 0.0}}
    result = compare(comm, **phases, sections=arcs((1, 20.0, 80.0)))
    c = np.array([result.cell.fractions[phase] for phase in ("matrix", "fibre")])
    assert result.effective_stiffness[:, 2] == pytest.approx([0, 0, c @ [1.0, 10.0], 0, 0, 0], abs=1e-12)
    assert result.thermal_stress is None and result.thermal_expansion is None


@pytest.mark.parametrize("number", range(3))
def test_random_cells(comm, number):
    # Other cells on other numbers of ranks.
    rng = np.random.default_rng([comm.size, number, 3])
    cell = {k: v for k, v in random_cell(rng).items() if k in ("geometry", "fibre_fraction", "bodies", "seed")}
    cell |= {"fibres": 3, "min_gap": 0.15} if cell["geometry"] == "random" else {}
    sections, phases = dict(CUT), {name: random_phase(rng) for name in ORTHOTROPIC}
    sections |= arcs(("all", rng.uniform(-180, 180), rng.uniform(20, 200)), contact=bool(number % 2))
    if number > 1:
        sections["interface"] |= dict(zip(SPRINGS, (10.0 ** rng.uniform(-1, 2, size=2)).tolist(), strict=True))
    compare(comm, **phases, sections=sections, **cell | {"mesh_size": 0.25, "tip_size": 0.1})


def random_phase(rng):
    """Return a stiffness (6, 6) with x3 normal to a plane of symmetry and nothing more, and an expansion."""
    C, scale = np.zeros((6, 6)), 10.0 ** rng.uniform(-1, 1)
    for block in ([0, 1, 2, 5], [3, 4]):
        A = rng.normal(size=(len(block), len(block)))
        C[np.ix_(block, block)] = scale * (A @ A.T + 0.3 * np.eye(len(block)))
    return {"stiffness": ((C + C.T) / 2).tolist(), "expansion": rng.normal(size=3).tolist()}


@pytest.mark.one_rank
@pytest.mark.parametrize("contact", [False, True])
def test_stiffness_at_every_opening(comm, contact):
    debonded = [{"fibre": "all", "centre": 15.0}]
    sections = {"interface": {"debonded": debonded, "contact": contact}, "angle": {"values": [0, 60, 200, 360]}}
    case = {"analysis": "angle", "mesh_size": 0.25, "tip_size": 0.1, "sections": sections} | ORTHOTROPIC
    points, twin = solved(comm, **case).angle, Twin(comm, **case)
    for point in points:
        C, thermal = twin.secants(point.angle, contact=contact)
        assert error(point.stiffness, C) < TIGHT and error(point.thermal_stress, thermal) < TIGHT
    sizes = [np.trace(point.stiffness) for point in points]
    assert (np.diff(sizes) < 0).all() and len(sizes) == 4
    twin.destroy()
