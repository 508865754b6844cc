import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from PIL import Image
from support.sample_output import in_space, path_of, sample, write

from feti_homog.errors import CaseError, FetiHomogError
from feti_homog.report.plots import cell_picture, decimation, figures, plot_helpers
from feti_homog.report.plots.drawn_cell import DrawnCell, InterfaceEdges
from feti_homog.results.result_json import SCHEMA


def areas(points: Any, triangles: Any) -> Any:
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


@pytest.mark.parametrize(("limit", "group"), [(10_000, 1), (3000, 4), (600, 16), (10, 64)])
def test_coarser_triangles_have_the_means_of_theirs(tmp_path: Path, limit: int, group: int) -> None:
    whole = sample(8, refine=3)
    with h5py.File(write(tmp_path, whole), "r") as file:
        drawn = decimation.drawn_mesh(file, limit)
        stress = decimation.triangle_means(file["state/0/stress"], 1, drawn)
        displacement = decimation.nodal_values(file["state/2/displacement"], drawn)
    assert drawn.group == group and len(drawn.triangles) == 128 * 64 // group
    np.testing.assert_allclose(areas(drawn.points, drawn.triangles), group / 64 / 128, rtol=1e-12)
    # The stress is linear, so its mean is its value at the middle of the coarser triangle.
    middle = drawn.points[drawn.triangles].mean(axis=1)
    np.testing.assert_allclose(stress, 2.0 + middle[:, 1], rtol=1e-12)
    inside = (np.abs(middle - 0.5) < 0.25).all(axis=1)
    np.testing.assert_array_equal(drawn.body, inside)
    expected = 0.5 * drawn.points[:, ::-1] + 0.05 * np.sin(2 * np.pi * drawn.points[:, ::-1])
    np.testing.assert_allclose(displacement, expected, atol=1e-12)


def test_errors_at_tips_leave_colours_to_the_rest_of_the_cell(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path, sample(8, refine=3)), "r+") as file:
        for state in file["state"].values():
            state["mesh_error"][:] = 1.0
        file["state/0/mesh_error"][17] = 1e9
        picture = cell_picture.mesh_error(DrawnCell.of(file, 10_000))
        assert picture is not None
        least, most = picture.axes[0].child_axes[0].get_ylim()
        assert most == pytest.approx(1e4 * least) == pytest.approx(8192.0)  # of an element's error over its area


@pytest.mark.parametrize("block", [1, 7, 64, 1 << 18])
def test_decimation_does_not_depend_on_its_blocks(tmp_path: Path, block: int) -> None:
    with h5py.File(write(tmp_path, sample(4, refine=2)), "r") as file:
        whole = decimation.drawn_mesh(file, 200)
        means = decimation.triangle_means(file["state/1/stress"], 0, whole)
        drawn = decimation.drawn_mesh(file, 200, block)
        np.testing.assert_array_equal(drawn.triangles, whole.triangles)
        np.testing.assert_array_equal(drawn.points, whole.points)
        np.testing.assert_array_equal(decimation.triangle_means(file["state/1/stress"], 0, drawn), means)


def test_six_node_triangles_are_drawn_in_four(tmp_path: Path) -> None:
    whole = sample(4, order=2)
    with h5py.File(write(tmp_path, whole), "r") as file:
        fine, coarse = decimation.drawn_mesh(file), decimation.drawn_mesh(file, 100)
        stress = decimation.triangle_means(file["state/0/stress"], 0, fine)
    assert (len(fine.triangles), len(coarse.triangles)) == (128, 32)
    np.testing.assert_allclose(areas(fine.points, fine.triangles), 1 / 128, rtol=1e-12)
    np.testing.assert_allclose(areas(coarse.points, coarse.triangles), 1 / 32, rtol=1e-12)
    np.testing.assert_array_equal(stress[::4], whole.states[0].stress[:, 0])


def test_outlines_leave_out_the_cuts_within_a_body(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path, sample(8)), "r") as file:
        drawn = decimation.drawn_mesh(file)
    ends = drawn.points[decimation.outline_edges(drawn, drawn.body)]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert length == pytest.approx(4 + 2 * 4 * 0.5)  # the cell, and both sides of the fibre
    ends = drawn.points[decimation.outline_edges(drawn, drawn.subdomain)]
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).sum()
    assert length == pytest.approx(4 + 2 * 4 * 0.5 + 2 * 0.5)  # and both sides of the cut


@pytest.fixture(scope="module")
def of_strains(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Provide the pictures of unit strains."""
    return figures.plot(write(tmp_path_factory.mktemp("strains"), sample(4)).parent)


def assert_drawn(paths: list[Path], cases: list[str]) -> None:
    assert [path.name for path in paths] == ["cell.png", "partition.png", "mesh_error.png", *cases, "interface.png"]
    for path in paths:
        picture = imread(path)
        assert min(picture.shape[:2]) > 500 and picture[..., :3].std() > 0.1


@pytest.mark.slow
def test_all_pictures_are_made_and_texts_of_the_user_are_no_formulas(
    tmp_path: Path, of_strains: list[Path], recwarn: pytest.WarningsRecorder
) -> None:
    cases = ["case_E11.png", "case_E22.png", "case_gamma12.png"]
    assert_drawn(of_strains, cases)
    example = sample(4, order=2)
    header = replace(example.header, title="costs $\\frac{1$ or 纤维", stress_unit="$$GPa$$", length_unit="$")
    write(tmp_path, replace(example, header=header))
    assert_drawn(figures.plot(tmp_path), cases)
    assert not [warning for warning in recwarn if "Glyph" in str(warning.message)]


PATH, COUNTS = path_of([0.5, 0.2, 1.0]), {"bonded": 5, "open": 3, "closed": 2}
ANGLES = [COUNTS | {"angle": angle, "stiffness": [[9, 2, 0], [2, 8, 0], [0, 0, 3]]} for angle in (0, 90, 180)]
ANGLE_CASE = {"analysis": {"type": "angle", "plane": "strain"}, "angle": {"values": [0, 90, 180]}}
LISTS = [
    (PATH, ["path_states.png", "path.gif", "interface.png", "path.png"]),
    ({"schema": SCHEMA, "case": PATH["case"] | ANGLE_CASE, "angle": ANGLES},
     ["angle_states.png", "interface.png", "angle.png"]),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("document", "names"), LISTS, ids=["path", "angle"])
def test_pictures_of_paths_and_angles_are_made(tmp_path: Path, document: dict[str, Any], names: list[str]) -> None:
    write(tmp_path, sample(4), document)
    paths = figures.plot(tmp_path)
    assert [path.name for path in paths] == ["cell.png", "partition.png", "mesh_error.png", *names]
    for path in paths:
        with Image.open(path) as picture:
            assert getattr(picture, "n_frames", 1) == (3 if path.suffix == ".gif" else 1)
            assert np.asarray(picture.convert("RGB")).std() > 20 and min(picture.size) > 300


def test_without_fields_only_curves_are_drawn(tmp_path: Path) -> None:
    document = PATH | {"case": PATH["case"] | {"output": {"fields": False}}}
    (tmp_path / "result.json").write_text(json.dumps(document))
    assert [path.name for path in figures.plot(tmp_path)] == ["path.png"]


def test_faces_are_as_their_worst_node(tmp_path: Path) -> None:
    with h5py.File(write(tmp_path, sample(8)), "r") as file:
        drawn = decimation.drawn_mesh(file)
        interface_edges = InterfaceEdges.of(file, drawn, decimation.outline_edges(drawn, drawn.body))
        ends = file["interface/points"][:][interface_edges.nodes]
        states = interface_edges.state(file["state/0/status"][:])
    np.testing.assert_allclose(ends, drawn.points[interface_edges.edges], atol=1e-12)
    # Two sides of five nodes: bonded, closed, open, bonded, closed and open, bonded, closed, open, bonded.
    expected = {(0.25, x): state for x, state in zip((5, 7, 9, 11), (1, 2, 2, 1), strict=True)}
    expected |= {(0.75, x): state for x, state in zip((5, 7, 9, 11), (2, 1, 2, 2), strict=True)}
    middle = ends.mean(axis=1)
    assert len(states) == 2 * len(expected)
    assert [expected[y, round(16 * x)] for x, y in middle] == states.tolist()


@pytest.mark.slow
def test_loads_in_space_have_their_pictures(tmp_path: Path) -> None:
    """Strain along the fibres and a temperature deform the cell; axial shear has lines of its displacement."""
    write(tmp_path, in_space(sample(4)))
    assert_drawn(figures.plot(tmp_path), ["case_E33.png", "case_temperature.png", "case_minus_gamma13.png"])
    before, after = (figures.plot(tmp_path, state=1, component=name)[0].read_bytes() for name in (None, "S23"))
    assert before != after


@pytest.mark.parametrize(("extent", "step"), [(1.0, 0.1), (1.2, 0.1), (1.32, 0.2), (36.0, 5.0), (7.2e5, 1e5)])
def test_lines_of_displacement_are_at_round_steps(extent: float, step: float) -> None:
    label, corners = np.zeros(1, int), np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    drawn = decimation.DrawnMesh(8, 1, 1, np.arange(3), corners, np.arange(3)[None], label, label, label, label)
    state = {"axial_displacement": extent * np.array([0.0, 1.0, 0.5])}
    assert cell_picture.draw_levels(Figure().subplots(), state, drawn) == pytest.approx(step)


@pytest.mark.slow
def test_the_case_chooses_component_and_scale(tmp_path: Path, of_strains: list[Path]) -> None:
    before = [path.read_bytes() for path in of_strains]
    output = {"stress": "S22", "deformation_scale": 0.3}
    write(tmp_path, sample(4), {"schema": SCHEMA, "case": {"output": output}})
    after = [path.read_bytes() for path in figures.plot(tmp_path)]
    assert before[:3] == after[:3] and all(a != b for a, b in zip(before[3:6], after[3:6], strict=True))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "begin"), [("png", b"\x89PNG"), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_a_state_is_drawn_alone_in_the_size_and_format_of_a_paper(tmp_path: Path, kind: str, begin: bytes) -> None:
    write(tmp_path, sample(4))
    (path,) = figures.plot(tmp_path, plot_helpers.Look(kind, (9.0, 8.0), "whole $"), 1, "S12")
    content = path.read_bytes()
    assert path.name == f"state_1.{kind}" and content.startswith(begin)
    if kind == "png":
        assert imread(path).shape[:2] == pytest.approx((8.0 / 2.54 * 200, 9.0 / 2.54 * 200), abs=2)
    if kind == "svg":
        assert content.count(b"<image") == 2 and len(content) < 500_000  # the field and its bar are pixels
    with h5py.File(tmp_path / "result.h5") as file:
        label = file["state/1"].attrs["label"]
    assert figures.plot(tmp_path, plot_helpers.Look(kind, (9.0, 8.0), "whole $"), label, "S12") == [path]
    with pytest.raises(CaseError, match=r"--state 7: expected the number or label of a state of .*: 0 \(\w+.*, 2 \("):
        figures.plot(tmp_path, state=7)
    with pytest.raises(CaseError, match=r"--component S13: expected a stress that .* has: S11, S22 or S12"):
        figures.plot(tmp_path, component="S13")


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (np.linspace(1, 2, 1001), (1, 2, "neither")),
        (np.linspace(-1, 2, 1001), (-1, 2, "neither")),
        (np.append(np.linspace(1, 2, 1001), 50), (1, 2, "max")),
        (np.append(np.linspace(1, 2, 1001), -50), (1, 2, "min")),
        (np.full(9, 4.0) + 1e-9 * np.arange(9), (2, 6, "neither")),
    ],
)
def test_the_colour_range_leaves_out_outliers(values: Any, expected: tuple[float, float, str]) -> None:
    norm, colours, extend = plot_helpers.colour_range(values)
    assert (norm.vmin, norm.vmax) == pytest.approx(expected[:2], abs=0.02)
    assert extend == expected[2]
    red, _, blue = np.moveaxis(colours(norm(np.array([-1.0, 0.0, 1.0, norm.vmax])))[:, :3], 1, 0)
    assert red[3] > 2.0 * blue[3] and red[2] > blue[2]  # tension is red
    if expected[0] < 0.0:  # zero is white, pressure blue
        assert min(red[1], blue[1]) > 0.9 and blue[0] > red[0]


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        ([(-34.0, -8.0), (-20.0, 23.0)], (-34.0, 34.0)),  # of similar size
        ([(-34.0, -8.0), (0.0, 6.0)], (-34.0, 6.0)),
        ([(1.0, 2.0), (0.0, 0.0)], (0.0, 2.0)),
    ],
)
def test_the_colour_range_of_states_has_both_signs(states: Any, expected: tuple[float, float]) -> None:
    values = np.array([np.linspace(*ends, 1001) for ends in states])
    norm, _, extend = plot_helpers.colour_range(values)
    assert (norm.vmin, norm.vmax, extend) == (*expected, "neither")
    values[0, 0], values[-1, -1] = -90.0, 90.0
    assert plot_helpers.colour_range(values)[2] == "both"


def test_values_count_by_their_area() -> None:
    """Most of a thousand values at a tip, which is no part of the cell, are beyond the colours."""
    values = np.append(np.linspace(1, 2, 1001), np.linspace(-90, 90, 1001))
    areas = np.append(np.ones(1001), np.full(1001, 1e-9))
    norm, _, extend = plot_helpers.colour_range(values, areas)
    assert (norm.vmin, norm.vmax) == pytest.approx((1, 2), abs=0.02) and extend == "both"


def test_a_missing_or_broken_result_is_reported(tmp_path: Path) -> None:
    with pytest.raises(FetiHomogError, match=r"^cannot draw .*result\.h5: "):
        figures.plot(tmp_path)
    (tmp_path / "result.h5").write_text("nothing")
    with pytest.raises(FetiHomogError, match=r"^cannot draw .*result\.h5: "):
        figures.plot(tmp_path)


@pytest.mark.parametrize("schema", [{}, {"schema": SCHEMA + 1}])
def test_a_result_of_another_schema(tmp_path: Path, schema: dict[str, int]) -> None:
    write(tmp_path, sample(4))
    (tmp_path / "result.json").write_text(json.dumps({"case": {}} | schema))
    found = rf"result\.json: its schema is {schema.get('schema', 'none')}, this program reads schema {SCHEMA}"
    with pytest.raises(CaseError, match=found):
        figures.plot(tmp_path)
