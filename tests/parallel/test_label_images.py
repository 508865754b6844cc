"""Compare cells of label images with meshes of quadrilaterals, laminates and tables of circles, on any ranks."""

import numpy as np
import pytest
from mpi4py import MPI
from reference.closed_forms import lame, laminate
from support.cases import FIBRE, MATRIX
from support.label_images import CIRCLES, RUN, circles_in_pixels, labels_of, write_png
from support.other_formats import written
from support.pixel_images import quadrilaterals
from support.ranks import assert_certified
from support.verified_results import SPRINGS

from feti_homog import Case, run
from feti_homog.analysis.runner import compute
from feti_homog.errors import ConvergenceError

pytestmark = [pytest.mark.parallel, pytest.mark.few_ranks, pytest.mark.usefixtures("shared_interfaces")]

# In pieces, of which several ranks have interface nodes.
SPRUNG = {"interface": SPRINGS, "decomposition": {"subdomains": 50}}
LEAKY = {"interface": {"conductance": 3.0, "debonded": []}, "decomposition": {"subdomains": 50}}
CONDUCTORS = {"matrix": {"conductivity": 0.2}, "fibre": {"conductivity": 1.1}}


def solved(comm, path, cell=None, **sections):
    """Return the result of a cell, by default of the image at `path`. Collective."""
    image = {"geometry": "pixels", "file": str(path), "labels": {"0": "matrix", "1": "fibre"}}
    return compute(Case.parse(RUN | {"cell": image | (cell or {})} | sections), comm)


def saved(comm, path, image):
    """Write rows of labels from above on rank 0. Collective."""
    if comm.rank == 0:
        np.save(path, image)
    comm.barrier()
    return path


@pytest.mark.parametrize("boundary", ["periodic", "displacement", "traction"])
@pytest.mark.parametrize("sections", [{}, SPRUNG], ids=["bonded", "springs"])
def test_pixels_are_the_same_quadrilaterals_as_a_mesh(comm, shared_path, sections, boundary):
    image = (np.random.default_rng(1).random((16, 16)) < 0.4).astype(np.uint8)
    path = saved(comm, shared_path / "image.npy", image[::-1])
    if comm.rank == 0:
        written(quadrilaterals(image), shared_path / "quads.inp")
    comm.barrier()
    cell = {"geometry": "mesh", "file": str(shared_path / "quads.inp"), "boundary": boundary}
    expected = compute(Case.parse(RUN | {"cell": cell} | sections), comm)
    result = solved(comm, path, {"pixel": 1 / 16, "boundary": boundary}, **sections)
    C, other = result.effective_stiffness, expected.effective_stiffness
    assert np.abs(C - other).max() < 1e-11 * other.max()
    assert any("smooth = false: stepped interfaces" in remark for remark in result.remarks) == bool(sections)
    errors, others = result.mesh_error.effective_stiffness, expected.mesh_error.effective_stiffness
    assert np.abs(errors - others).max() < 1e-7 * others.max()  # whatever the pieces; fits in another order of elements


def plane_strain(phase):
    """Return the stiffness (3, 3) in plane strain."""
    lam, mu = lame(phase)
    return np.array([[lam + 2 * mu, lam, 0.0], [lam, lam + 2 * mu, 0.0], [0.0, 0.0, mu]])


@pytest.mark.parametrize("pixel", [1e-6, 0.5])
def test_rows_of_pixels_are_a_laminate(comm, shared_path, pixel):
    """Stresses across and strains along layers are uniform, which linear elements represent exactly."""
    rows = np.array([0, 1, 1, 0, 1, 0, 0, 0], np.uint8)
    path = saved(comm, shared_path / "layers.npy", np.repeat(rows[:, None], 6, axis=1))
    C = solved(comm, path, {"pixel": pixel}).effective_stiffness
    expected = laminate([plane_strain(phase) for phase in (MATRIX, FIBRE)], [5 / 8, 3 / 8], across=1)
    assert np.abs(C - expected).max() < 1e-11 * C.max()


def with_voids(comm, folder, image, boundary="periodic", out=None, **sections):
    """Return the result of an image, -1 in voids. Collective."""
    path = saved(comm, folder / "image.npy", image[::-1] % 3)
    labels = {"0": "matrix", "1": "fibre", "2": "void"}
    document = {"geometry": "pixels", "file": str(path), "labels": labels, "boundary": boundary, "pixel": 1 / 12}
    return run(Case.parse(RUN | {"cell": document} | sections), comm, out=out)


HOLES = np.zeros((12, 12), int)
HOLES[2:5, 3:7], HOLES[8:11, 8:11], HOLES[6:9, 3:5], HOLES[2:4, 9:11] = 1, 1, -1, -1


@pytest.mark.parametrize(
    ("boundary", "sections"),
    [("periodic", SPRUNG), ("displacement", {}), ("traction", SPRUNG)],
    ids=["periodic", "displacement", "traction"],
)
def test_voids_are_holes_in_a_mesh_of_quadrilaterals(comm, shared_path, sections, boundary):
    result = with_voids(comm, shared_path, HOLES, boundary, **sections)
    if comm.rank == 0:
        written(quadrilaterals(HOLES), shared_path / "quads.inp")
    comm.barrier()
    cell = {"geometry": "mesh", "file": str(shared_path / "quads.inp"), "voids": True, "boundary": boundary}
    expected = compute(Case.parse(RUN | {"cell": cell} | sections), comm)
    C, other = result.effective_stiffness, expected.effective_stiffness
    assert np.abs(C - other).max() < 1e-11 * other.max()
    assert result.cell.fractions == pytest.approx(expected.cell.fractions, rel=1e-12)
    assert sum(result.cell.fractions.values()) == pytest.approx(1 - 10 / 144)


@pytest.mark.parametrize(
    ("boundary", "sections"),
    [("periodic", LEAKY), ("displacement", LEAKY), ("traction", {})],
    ids=["periodic", "displacement", "traction"],
)
def test_pixels_conduct_as_the_same_quadrilaterals(comm, shared_path, sections, boundary):
    """With voids, which insulate."""
    sections = sections | {"material": CONDUCTORS, "analysis": {"type": "conductivity"}}
    result = with_voids(comm, shared_path, HOLES, boundary, shared_path / "out", **sections)
    if comm.rank == 0:
        written(quadrilaterals(HOLES), shared_path / "quads.inp")
    assert_certified(comm, shared_path / "out")
    cell = {"geometry": "mesh", "file": str(shared_path / "quads.inp"), "voids": True, "boundary": boundary}
    expected = compute(Case.parse(RUN | {"cell": cell} | sections), comm)
    k, other = result.effective_conductivity, expected.effective_conductivity
    assert np.abs(k - other).max() < 1e-11 * other.max()


@pytest.mark.parametrize(("touching", "sections"), [(True, SPRUNG), (False, {})], ids=["touching", "apart"])
def test_voids_on_the_sides_and_voids_that_touch(comm, shared_path, touching, sections):
    """A periodic image may begin anywhere: steps by an even number of pixels keep the diagonals."""
    image = HOLES.copy()
    if touching:
        image[5, 5] = image[9, 5] = image[4, 2] = -1
    expected = with_voids(comm, shared_path, image, **sections).effective_stiffness
    moved = np.roll(image, (4, 2), (0, 1))
    assert all((side < 0).any() for side in (moved[0], moved[-1], moved[:, 0], moved[:, -1]))
    found = with_voids(comm, shared_path, moved, out=shared_path / "out", **sections).effective_stiffness
    assert np.abs(found - expected).max() < 1e-11 * expected.max()
    assert_certified(comm, shared_path / "out")


def test_drawn_voids_are_those_of_the_table(comm, shared_path):
    """One across a side and one across the corners."""
    circles = np.array([(0.95, 0.4, 0.16), (0.02, 0.98, 0.13), (0.4, 0.3, 0.15), (0.55, 0.7, 0.14)])
    if comm.rank == 0:
        image = labels_of(circles[:2], 150) // 255 * 2 + labels_of(circles[2:], 150) // 255
        write_png(shared_path / "circles.png", image)
    comm.barrier()
    order = {"order": 2, "mesh_size": 0.05}
    names = ["void", "void", "fibre", "fibre"]
    rows = [{"x": x, "y": y, "radius": r, "phase": k} for (x, y, r), k in zip(circles.tolist(), names, strict=True)]
    cell = {"geometry": "table", "fibre_list": rows, "width": 1.0, "height": 1.0, **order}
    expected = compute(Case.parse(RUN | {"cell": cell}), comm).effective_stiffness
    for more, error in (({"smooth": True, **order}, 2e-3), ({}, 1e-2)):
        labels = {"0": "matrix", "1": "fibre", "2": "void"}
        result = solved(comm, shared_path / "circles.png", {"labels": labels, "pixel": 1 / 150, **more})
        assert np.abs(result.effective_stiffness - expected).max() < error * expected.max()
        assert result.cell.fractions["fibre"] == pytest.approx(np.pi * (circles[2:, 2] ** 2).sum(), rel=1e-2)


def test_first_row_of_an_image_is_the_upper_one_and_mirrors_make_it_whole(comm, shared_path):
    image = (np.random.default_rng(3).random((7, 5)) < 0.4).astype(np.uint8)
    whole = np.block([[image[::-1], image[::-1, ::-1]], [image, image[:, ::-1]]])  # from above
    mirrored = solved(comm, saved(comm, shared_path / "part.npy", image), {"window": "mirrored"})
    expected = solved(comm, saved(comm, shared_path / "whole.npy", whole))
    assert np.array_equal(mirrored.effective_stiffness, expected.effective_stiffness)
    assert (mirrored.cell.width, mirrored.cell.height) == (10.0, 14.0)
    assert np.abs(mirrored.effective_stiffness[:2, 2]).max() < 0.05 * mirrored.effective_stiffness[0, 0]
    upper = np.zeros((6, 6), np.uint8)
    upper[0, :3] = 1
    result = solved(comm, saved(comm, shared_path / "upper.npy", upper))
    assert result.fibres[0].centre == pytest.approx((1.5, 5.5))


def test_smooth_outlines_give_the_constants_of_the_table_that_was_drawn(comm, shared_path):
    if comm.rank == 0:
        write_png(shared_path / "circles.png", labels_of(CIRCLES, 150))
    comm.barrier()
    labels, order = {"0": "matrix", "255": "fibre"}, {"order": 2, "mesh_size": 0.05}
    smooth = solved(comm, shared_path / "circles.png", {"labels": labels, "smooth": True, "pixel": 1 / 150, **order})
    rows = [{"x": x, "y": y, "radius": r} for x, y, r in CIRCLES]
    cell = {"geometry": "table", "fibre_list": rows, "width": 1.0, "height": 1.0, **order}
    table = compute(Case.parse(RUN | {"cell": cell}), comm)
    C, expected = smooth.effective_stiffness, table.effective_stiffness
    pixels = solved(comm, shared_path / "circles.png", {"labels": labels, "pixel": 1 / 150}).effective_stiffness
    assert (
        np.abs(C - expected).max() < 3e-4 * expected.max() and np.abs(pixels - expected).max() < 1e-3 * expected.max()
    )
    allowed = table.mesh_error.effective_stiffness + smooth.mesh_error.effective_stiffness
    # Areas of circles in pixels are off by 1e-3, and constants with them.
    assert (np.abs(C - expected) < allowed + 1e-3 * expected.max()).all()
    area = np.pi * sum(r**2 for *_, r in CIRCLES)
    assert smooth.cell.fractions["fibre"] == pytest.approx(area, rel=2e-3)


def test_ranks_agree_and_files_obey_every_law(comm, shared_path):
    image = circles_in_pixels(30)
    path = saved(comm, shared_path / "image.npy", image)
    for name, cell in {"steps": {}, "smooth": {"smooth": True, "mesh_size": 0.1}}.items():
        document = {"geometry": "pixels", "file": str(path), "labels": {"0": "matrix", "1": "fibre"}, **cell}
        case = Case.parse(RUN | {"cell": document} | SPRUNG)
        together = run(case, comm, out=shared_path / name).effective_stiffness
        alone = compute(case, MPI.COMM_SELF).effective_stiffness
        assert np.abs(together - alone).max() < 1e-9 * alone.max()
        assert_certified(comm, shared_path / name)


def test_mesh_errors_exceed_their_estimates_where_phases_meet_at_points(comm, shared_path):
    """A checkerboard has the conductivity sqrt(k_1 k_2) (Keller, J. Math. Phys. 5, 1964, 548)."""
    path = saved(comm, shared_path / "board.npy", np.kron(np.eye(2), np.ones((4, 4))).astype(np.uint8))
    materials = {"matrix": {"conductivity": 1.0}, "fibre": {"conductivity": 10.0}}
    cell = {"pixel": 1 / 8, "order": 2, "refine": 1}
    result = solved(comm, path, cell, material=materials, analysis={"type": "conductivity"})
    error = result.effective_conductivity[0, 0] - np.sqrt(10.0)
    assert 4.0 < error / result.mesh_error.effective_conductivity[0, 0] < 20.0
    assert not result.mesh_error.effective_conductivity[2, :2].any()  # exactly zero without conductivity k13 or k23
    assert any("phases meet at points: mesh errors exceed their estimates" in line for line in result.remarks)


def test_equal_bonds_break_together_at_an_increment_that_reaches_their_strength(comm, shared_path):
    """Under S12 both interfaces of layers carry 0.02 at the step where the weaker breaks: only rounding is above."""
    path = saved(comm, shared_path / "layers.npy", np.outer([0, 1, 1, 0, 0, 2, 2, 0], np.ones(6, np.uint8)))
    image = {"geometry": "pixels", "file": str(path), "labels": {"0": "matrix", "1": "fibre", "2": "glass"}}
    bonds = [
        {"between": ["matrix", phase], "normal_strength": 1.0, "tangential_strength": strength, "friction": friction}
        for phase, strength, friction in (("fibre", 0.01, 0.3), ("glass", 0.02, 0.6))
    ]
    legs = [{"S22": -0.1, "S11": 0.0, "S12": 0.0}, {"S12": 0.1}]
    sections = {"analysis": {"type": "path", "plane": "strain"}, "interface": bonds}
    sections["path"] = {"method": "increments", "increments": 20, "waypoints": legs}
    moduli = {"matrix": (3.0, 0.3), "fibre": (70.0, 0.2), "glass": (20.0, 0.2)}
    materials = {phase: {"young": young, "poisson": poisson} for phase, (young, poisson) in moduli.items()}
    with pytest.raises(ConvergenceError) as error:
        compute(Case.parse(RUN | {"cell": image, "material": materials} | sections), comm)
    assert [point.broke for point in error.value.result.path if point.broke] == [12, 12]
