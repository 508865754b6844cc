"""Mesh label images: compare pixels with quadrilaterals and laminates, test mirrors, outlines and faults."""

import builtins

import numpy as np
import pytest
from mpi4py import MPI
from PIL import Image
from support.cases import case_of
from support.other_formats import written
from support.pixel_images import MATERIALS, case, quadrilaterals, random_image

from feti_homog import Case, run
from feti_homog.errors import CaseError, MeshError
from feti_homog.mesh.fill import pixel_mesher
from feti_homog.microstructure import label_image

LABELS = {"0": "matrix", "1": "fibre"}


@pytest.mark.parametrize("suffix", [".png", ".tif", ".npy"])
def test_pixels_are_the_same_quadrilaterals(tmp_path, suffix):
    image, phases = random_image(12, 3, phases=2), ("matrix", "fibre", "fibre:2")
    found = run(case(tmp_path / f"a{suffix}", image, phases, pixel=1 / 12), MPI.COMM_SELF)
    document = case(tmp_path / "a.npy", image, phases).resolved()
    document["cell"] = {"geometry": "mesh", "file": str(written(quadrilaterals(image), tmp_path / "a.inp"))}
    expected = run(Case.parse(document), MPI.COMM_SELF)
    scale = expected.effective_stiffness[0, 0]
    assert np.abs(found.effective_stiffness - expected.effective_stiffness).max() < 1e-13 * scale
    assert found.cell.fractions == pytest.approx(expected.cell.fractions, rel=1e-14)
    centres = np.array([[fibre.centre for fibre in result.fibres] for result in (found, expected)])
    assert np.abs(centres[0] - centres[1]).max() < 1e-12


def test_rows_count_from_the_top_and_lengths_are_pixels(tmp_path):
    image = np.zeros((6, 8), int)
    image[1, 2:4] = 1  # from below
    result = run(case(tmp_path / "a.png", image, pixel=0.5), MPI.COMM_SELF)
    assert (result.cell.width, result.cell.height) == (4.0, 3.0)
    assert result.fibres[0].centre == pytest.approx([1.5, 0.75]) and result.cell.fibre_fraction == pytest.approx(1 / 24)


def test_a_laminate_of_rows_has_its_closed_form(tmp_path):
    image = np.zeros((10, 7), int)
    image[3:7] = 1
    plane = {name: np.linalg.inv(compliance(**MATERIALS[name])) for name in LABELS.values()}
    m, f = (plane[name] for name in ("matrix", "fibre"))
    share = 0.4

    def mean(of):
        return (1 - share) * of(m) + share * of(f)

    C22, C33 = 1 / mean(lambda c: 1 / c[1, 1]), 1 / mean(lambda c: 1 / c[2, 2])
    C12 = C22 * mean(lambda c: c[0, 1] / c[1, 1])
    C11 = mean(lambda c: c[0, 0] - c[0, 1] ** 2 / c[1, 1]) + C12**2 / C22
    expected = [[C11, C12, 0], [C12, C22, 0], [0, 0, C33]]
    for cell in ({}, {"window": "mirrored"}, {"smooth": True}):
        found = run(case(tmp_path / "a.png", image, **cell), MPI.COMM_SELF).effective_stiffness
        assert np.abs(found - expected).max() < 1e-8 * C11


def compliance(young, poisson):
    """(3, 3) compliance in plane strain."""
    p = poisson
    return (1 + p) / young * np.array([[1 - p, -p, 0], [-p, 1 - p, 0], [0, 0, 2]])


def test_a_mirrored_window_is_the_mirrored_image(tmp_path):
    image = random_image(6, 1)
    found = run(case(tmp_path / "a.png", image, window="mirrored"), MPI.COMM_SELF)
    whole = np.block([[image, image[:, ::-1]], [image[::-1], image[::-1, ::-1]]])
    expected = run(case(tmp_path / "b.png", whole), MPI.COMM_SELF).effective_stiffness
    assert np.array_equal(found.effective_stiffness, expected)
    assert np.abs(expected[:2, 2]).max() < 1e-12 * expected[0, 0] and found.cell.width == 12


FIBRES = [(0.1, 0.3, 0.2), (0.55, 0.5, 0.18), (0.8, 0.85, 0.15), (0.3, 0.8, 0.14)]


def drawn(size):
    """(size, size) image of FIBRES on the torus, rows from below."""
    x = (np.arange(size) + 0.5) / size
    apart = [[(x - centre + 0.5) % 1 - 0.5 for centre in fibre[:2]] for fibre in FIBRES]
    pairs = zip(apart, FIBRES, strict=True)
    return np.any([dx[None] ** 2 + dy[:, None] ** 2 < r * r for (dx, dy), (*_, r) in pairs], axis=0).astype(int)


def test_smooth_outlines_have_the_constants_of_the_table(tmp_path):
    size = 160
    sizes = {"order": 2, "mesh_size": 0.05}
    found = run(case(tmp_path / "a.png", drawn(size), smooth=True, pixel=1 / size, **sizes), MPI.COMM_SELF)
    document = case(tmp_path / "a.png", None).resolved()
    rows = [dict(zip(("x", "y", "radius"), fibre, strict=True)) for fibre in FIBRES]
    document["cell"] = {"geometry": "table", "width": 1.0, "height": 1.0, "fibre_list": rows, **sizes}
    expected = run(Case.parse(document), MPI.COMM_SELF)
    assert found.cell.fibre_fraction == pytest.approx(expected.cell.fibre_fraction, abs=5e-4)
    scale = expected.effective_stiffness[0, 0]
    assert np.abs(found.effective_stiffness - expected.effective_stiffness).max() < 3e-3 * scale
    centres = np.array([fibre.centre for fibre in found.fibres])
    away = (centres[:, None] - np.array(FIBRES)[:, :2] + 0.5) % 1 - 0.5
    assert np.linalg.norm(away, axis=2).min(axis=0).max() < 0.5 / size
    pixels = run(case(tmp_path / "a.png", None, pixel=1 / size), MPI.COMM_SELF)
    assert np.abs(pixels.effective_stiffness - expected.effective_stiffness).max() < 3e-2 * scale


def test_smooth_outlines_preserve_the_areas_of_the_image(tmp_path):
    """Of small fibres, too, whose steps have few directions."""
    rng = np.random.default_rng(1)
    x, image = np.arange(120) + 0.5, np.zeros((120, 120), int)
    for i, j in np.ndindex(6, 6):
        a, b = 20 * np.array([i, j]) + rng.uniform(6, 14, 2)
        image[(x - a) ** 2 + (x[:, None] - b) ** 2 < rng.uniform(4, 6) ** 2] = 1
    mesh = pixel_mesher.read_cell(case(tmp_path / "a.npy", image, smooth=True, order=2, mesh_size=0.02).cell)
    (remark,) = mesh.remarks
    share = image.mean()
    assert remark.endswith(f"smooth = true: fractions in the image: matrix {1 - share:.6g}, fibre {share:.6g}")
    found = run(case(tmp_path / "a.npy", None, smooth=True, order=2, mesh_size=0.02), MPI.COMM_SELF)
    assert found.cell.fibre_fraction == pytest.approx(share, rel=1e-2)


def test_smooth_fibres_may_have_coatings_but_no_third_phase_beside_them(tmp_path):
    x = np.arange(60) + 0.5 - 30
    distance = np.hypot(x[None], x[:, None])
    image = (distance < 20).astype(int) + (distance < 14)
    phases = ("matrix", "fibre:2", "fibre")
    fractions = run(case(tmp_path / "a.png", image, phases, smooth=True, order=2), MPI.COMM_SELF).cell.fractions
    assert fractions["fibre"] == pytest.approx(np.pi * 14**2 / 3600, abs=3e-3)
    image[:30][image[:30] > 0] = 2  # the coating ends at the matrix
    with pytest.raises(MeshError, match="touch beside a third phase"):
        run(case(tmp_path / "b.png", image, phases, smooth=True), MPI.COMM_SELF)


def test_smooth_outlines_name_the_missing_library(tmp_path, monkeypatch):
    real = builtins.__import__
    monkeypatch.setattr(
        builtins, "__import__", lambda name, *rest: real("no_such_module" if name == "skimage" else name, *rest)
    )
    with pytest.raises(CaseError, match="needs scikit-image"):
        run(case(tmp_path / "a.png", np.eye(9), smooth=True), MPI.COMM_SELF)


def stored(path, image, **more):
    if path.suffix in (".npy", ".npz"):
        np.save(path, image) if path.suffix == ".npy" else np.savez(path, *image)
    else:
        Image.fromarray(image).save(path, **more)
    return path


GREY = np.eye(4, dtype=np.uint8)


@pytest.mark.parametrize(
    ("name", "image", "expected"),
    [
        ("a.png", np.stack([GREY, GREY, 2 * GREY], -1), "mode RGB with colours .*: save it with a palette"),
        ("a.png", np.stack([GREY] * 4, -1), "mode RGBA with colours or transparency"),
        ("a.tif", GREY.astype(np.float32) / 3, "4x4 values of type float32; expected one whole number"),
        ("a.npy", np.stack([GREY] * 3), "3x4x4 values of type uint8; .* in rows; cut one layer out of a stack"),
        ("a.png", np.arange(144, dtype=np.uint8).reshape(12, 12), "or into a table by fibres --image"),
        ("a.npy", 0.5 * GREY, "4x4 values of type float64; expected one whole number a pixel, in rows"),
        ("a.npy", GREY[:1], "4 x 1 pixels; expected two rows"),
        ("a.npz", [GREY, GREY], "2 arrays; expected one"),
        (
            "a.png",
            2 * GREY,
            "no phase for 2; a.png has 0: 75 %, 2: 25 %\n"
            '.*labels 1 = "fibre": no pixel has it; a.png has 0: 75 %, 2: 25 %$',
        ),
        ("a.npy", np.array([{}] * 4, object), "cannot be read: Object arrays"),
    ],
)
def test_faults_of_images(tmp_path, name, image, expected):
    with pytest.raises(CaseError, match=expected):
        label_image.read_labels(stored(tmp_path / name, image), LABELS, False)


def palette(image):
    """Return an image with a palette of three colours."""
    picture = Image.fromarray(image, "P")
    picture.putpalette([10, 20, 30, 200, 0, 0, 0, 90, 0])
    return picture


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("palette.png", lambda path: palette(GREY).save(path)),
        ("bits.png", lambda path: Image.fromarray(GREY > 0).save(path)),
        ("grey_as_colours.png", lambda path: stored(path, np.stack([GREY] * 3, -1))),
        ("opaque.png", lambda path: stored(path, np.stack([*[GREY] * 3, np.full_like(GREY, 255)], -1))),
        ("short.tif", lambda path: stored(path, GREY.astype(np.uint16))),
        ("packed.tif", lambda path: stored(path, GREY, compression="tiff_lzw")),
        ("deflated.tif", lambda path: stored(path, GREY.astype(np.uint16), compression="tiff_adobe_deflate")),
        ("real.tif", lambda path: stored(path, GREY.astype(np.float32))),
        ("bool.npy", lambda path: stored(path, GREY > 0)),
        ("long.npy", lambda path: stored(path, GREY.astype(np.int64))),
        ("real.npy", lambda path: stored(path, GREY.astype(float))),
    ],
)
def test_images_as_people_make_them(tmp_path, name, write):
    write(tmp_path / name)
    phase, phases = label_image.read_labels(tmp_path / name, LABELS, False)
    assert np.array_equal(phase[::-1], GREY) and phases == ("matrix", "fibre")


def test_damaged_and_large_images_are_refused(tmp_path):
    whole = stored(tmp_path / "a.png", GREY).read_bytes()
    (tmp_path / "a.png").write_bytes(whole[:40])
    with pytest.raises(CaseError, match="is no image, or damaged"):
        label_image.read_image(tmp_path / "a.png")
    with pytest.raises(CaseError, match="2 images; expected one"):
        label_image.read_image(stored(tmp_path / "b.tif", GREY, save_all=True, append_images=[Image.fromarray(GREY)]))
    Image.new("1", (9000, 9000)).save(tmp_path / "c.png")  # 10 KB
    with pytest.raises(CaseError, match=r"9000 x 9000 pixels; .* at most 10000000 pixels"):
        label_image.read_image(tmp_path / "c.png")
    with (tmp_path / "d.npy").open("wb") as stream:
        head = {"descr": "<i8", "fortran_order": False, "shape": (10**6, 10**6)}
        np.lib.format.write_array_header_1_0(stream, head)
    with pytest.raises(CaseError, match="cannot be read: Unable to allocate"):
        label_image.read_image(tmp_path / "d.npy")


@pytest.mark.parametrize(
    ("cell", "expected"),
    [
        ({"labels": {"0": "fibre"}}, "expected a table of phases, one of them matrix"),
        ({"labels": {"01": "matrix"}}, "expected a table of phases, one of them matrix"),
        ({"pixel": 0}, "pixel = 0: expected a number at least"),
        ({"mesh_size": 0.1}, "mesh_size: belongs to smooth = true"),
        ({"window": "cut"}, 'expected "periodic" or "mirrored" for geometry = "pixels"'),
        ({"file": "a.csv"}, "expected the name of a .png, .tif, .npy or .npz file"),
        ({"file": "missing.png"}, "no such file"),
    ],
)
def test_faults_of_keys(tmp_path, cell, expected):
    with pytest.raises(CaseError) as caught:
        case(tmp_path / "a.png", np.eye(9), **cell)
    (line,) = caught.value.faults
    assert expected in line


def test_a_resolved_case_is_the_case(tmp_path):
    for cell in ({}, {"smooth": True, "mesh_size": 0.1}):
        first = case(tmp_path / "a.png", np.eye(9), **cell)
        assert Case.parse(first.resolved()).resolved() == first.resolved()


@pytest.mark.parametrize("smooth", [False, True], ids=["polygons", "smooth"])
def test_failures_of_gmsh_name_a_cure(tmp_path, monkeypatch, smooth):
    def fail(dimension):
        raise Exception("no memory")  # gmsh raises this class

    gmsh = pytest.importorskip("gmsh")
    monkeypatch.setattr(gmsh.model.mesh, "generate", fail)
    if smooth:
        cell, key = case(tmp_path / "a.png", np.kron(np.eye(2), np.ones((9, 9))), smooth=True), "smooth = true"
    else:
        (tmp_path / "a.csv").write_text("x,y,radius,sides\n0.5,0.5,0.3,6\n")
        cell, key = case_of({"geometry": "table", "file": "a.csv", "width": 1.0, "height": 1.0}, tmp_path), "fibres"
    words = rf"^\[cell\] {key}: gmsh cannot fill the outlines \(no memory\); expected larger"
    with pytest.raises(MeshError, match=words):
        run(cell, MPI.COMM_SELF)
