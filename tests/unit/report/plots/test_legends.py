"""Text of pictures: legends, scales, numbers of points."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Annotation
from PIL import Image
from support.sample_output import in_space, path_of, sample, write

from feti_homog.report.plots import deformed_panels, figures, plot_helpers, response_curves
from feti_homog.report.plots.drawn_cell import BONDED, CLOSED, LoadLabels
from feti_homog.report.plots.path_picture import figure as path_picture
from feti_homog.results.result_json import SCHEMA

pytestmark = pytest.mark.slow


def drawn(directory: Path, look: plot_helpers.Look = plot_helpers.PLAIN) -> dict[str, Figure]:
    """Return the figures of a result by the names of their files, without the animation."""
    found: dict[str, Figure] = {}

    def keep(figure: Figure, path: Path, look: plot_helpers.Look) -> Path:
        found[path.name] = figure
        return path

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plot_helpers, "save", keep)
        patch.setattr(deformed_panels, "animation", lambda *_: directory)
        figures.plot(directory, look)
    return found


@pytest.fixture(scope="module")
def of_cases(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Figure]:
    """Provide the figures of unit strains."""
    return drawn(write(tmp_path_factory.mktemp("cases"), sample(4)).parent)


@pytest.fixture(scope="module")
def of_path(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Figure]:
    """Provide the figures of a path whose load falls once."""
    return drawn(write(tmp_path_factory.mktemp("path"), sample(4), path_of([0.5, 0.2, 1.0])).parent)


def panels(figure: Figure) -> list[tuple[str, str, dict[str, np.ndarray]]]:
    """Return the two labels of each panel, and by name the heights of its curves."""
    return [
        (axes.get_xlabel(), axes.get_ylabel(), {str(c.get_label()): np.asarray(c.get_ydata()) for c in axes.lines})
        for axes in figure.axes
    ]


def legends(figure: Figure) -> list[Legend]:
    found = [*figure.legends, *(axes.get_legend() for axes in figure.axes)]
    return [legend for legend in found if legend is not None]


def entries(figure: Figure) -> list[str]:
    return [text.get_text() for legend in legends(figure) for text in legend.get_texts()]


def test_legends_cover_nothing(of_cases: dict[str, Figure], of_path: dict[str, Figure]) -> None:
    for name, figure in [*of_cases.items(), *of_path.items()]:
        (canvas := FigureCanvasAgg(figure)).draw()
        renderer: Any = canvas.get_renderer()
        boxes = [axes.get_window_extent(renderer) for axes in figure.axes if axes.axison]
        boxes += [axes.xaxis.label.get_window_extent(renderer) for axes in figure.axes if axes.axison]
        for legend in legends(figure):
            box = legend.get_window_extent(renderer)
            assert not [other for other in boxes if other.width and box.shrunk(0.99, 0.95).overlaps(other)], name


def test_a_picture_has_no_white_around_it(tmp_path: Path) -> None:
    figure = Figure(figsize=(4, 3), layout="constrained")
    figure.add_artist(Line2D([0.4, 0.6], [0.5, 0.5], color="black", linewidth=4))
    plot_helpers.save(figure, tmp_path / "picture.png")
    with Image.open(tmp_path / "picture.png") as picture:
        assert picture.size == pytest.approx((0.2 * 800 + 40, 40), abs=12)


def test_the_grey_outline_has_its_name(of_cases: dict[str, Figure]) -> None:
    assert entries(of_cases["case_E11.png"]) == ["in contact", "open", "undeformed"]


@pytest.mark.parametrize(("status", "names"), [(CLOSED, ["in contact"]), (2, ["open"])])
def test_the_legend_of_tractions_has_only_what_is_there(tmp_path: Path, status: int, names: list[str]) -> None:
    whole = sample(4)
    states = tuple(replace(state, status=np.where(state.status == BONDED, BONDED, status)) for state in whole.states)
    write(tmp_path, replace(whole, states=states), None)
    assert [text.get_text() for text in drawn(tmp_path)["interface.png"].legends[0].texts] == names


def test_a_path_of_small_strains_is_magnified_and_says_so(tmp_path: Path) -> None:
    whole, small = sample(4), 0.002
    states = tuple(
        replace(s, strain=small * s.strain, displacement=small * s.displacement, jump=0.2 * small * s.jump)
        for s in whole.states
    )
    write(tmp_path, replace(whole, states=states), path_of([0.001, 0.0015, 0.002]))
    with h5py.File(tmp_path / "result.h5") as file:
        scale = deformed_panels.shown_scale(file, path_of([0.001, 0.0015, 0.002]))
        opening = max(file[f"state/{k}/jump"][:, 0].max() for k in range(3))
    assert scale * opening > 0.02
    title: Any = drawn(tmp_path)["path_states.png"].get_suptitle()
    assert title.endswith(f"displacement × {scale:g}")
    # Another title leaves the scale in the picture.
    panels = drawn(tmp_path, plot_helpers.Look(title=""))["path_states.png"]
    assert panels.axes[-1].get_ylabel().endswith(f"displacement × {scale:g}")


def in_six(points: list[tuple[float, float, float]], path: dict[str, Any], **more: Any) -> dict[str, Any]:
    """Return the document of a path in generalized plane strain of load factors with gamma13 and S13."""
    counts = {"bonded": 4, "open": 3, "closed": 3, "broke": 1}
    rows = [
        counts | {"load_factor": t, "strain": [0, 0, 0, 0, e, 0], "stress": [1e-9, 0, 0, 0, s, 0]} | more
        for t, e, s in points
    ]
    document = path_of([])
    document["case"] |= {"analysis": {"type": "path", "plane": "generalized"}, "path": {"method": "events"} | path}
    return document | {"path": rows}


def test_under_a_given_shear_its_stress_alone_is_drawn_over_its_strain_at_a_rising_load() -> None:
    document = in_six([(0.5, 1.0, 2.0), (0.4, 1.5, 1.6), (1.0, 4.0, 4.0)], {"to": {"S13": 4.0}})
    figure = path_picture(document)
    upper = figure.axes[0]
    assert figure.axes[-1].get_xlabel() == r"macroscopic strain $\gamma_{13}$"
    assert entries(figure)[:3] == [r"$\Sigma_{13}$", "all equilibria", "rising load"]
    thick = max(upper.lines, key=lambda line: line.get_linewidth())
    np.testing.assert_allclose(thick.get_xydata(), [[0, 0], [1, 2], [2, 2], [4, 4]])


def test_a_change_of_temperature_has_an_axis_of_its_own() -> None:
    points = [(0.5, 0.0, 0.0), (0.8, 1.0, 2.0), (1.0, 2.0, 3.0)]
    figure = path_picture(
        in_six(points, {"waypoints": [{"temperature": -9.0}, {"S13": 3.0}]}, temperature=-9.0, broke=0)
    )
    labels = [axes.get_ylabel() for axes in figure.axes]
    assert any("temperature" in label for label in labels) and "later legs" in entries(figure)
    heated = figure.axes[next(k for k, label in enumerate(labels) if "temperature" in label)]
    np.testing.assert_allclose(heated.lines[0].get_xydata(), [[0, 0], [0, -9], [1, -9], [2, -9]])  # from no load on
    low, high = heated.get_ylim()
    assert low < -9.0 < 0.0 < high


def test_words_of_a_load_leave_out_what_is_not_seen() -> None:
    strain = np.array([0.02, -0.007, 3e-8, 0.0, 0.01, 6e-5])
    lines = LoadLabels().label({"strain": strain, "temperature": -100.0}, 2).splitlines()
    assert len(lines) == 3 and "33" not in "".join(lines) and r"{6}{\cdot}10^{-5}" in lines[1] and "-100" in lines[2]


@pytest.mark.parametrize(("stress", "shown"), [(7.0, "{7}"), (1e-13, "{0}")])
def test_words_of_a_path_with_many_strains_are_the_leading_one_and_its_stress(stress: float, shown: str) -> None:
    state = {"strain": np.array([-0.01, 0.05, -0.01, 0.0, 0.001, 0.0]), "stress": np.array([0, stress, 0, 0, 1, 0])}
    document = in_six([(0.5, 0.0, 0.0), (1.0, 2.0, 3.0)], {"to": {"S13": 3.0, "S22": 7.0}})
    for point in document["path"]:
        point["strain"], point["stress"] = state["strain"].tolist(), [0.0, 7.0, 0.0, 0.0, 1.0, 0.0]
    words = LoadLabels.of(document).words(state | {"temperature": -100.0})
    assert words == ["$E_{22}={0.05}$", rf"$\Sigma_{{22}}={shown}$", r"$\Delta{T}={-100}$"]
    few = {"strain": np.array([0.0, 0.05, 0.0, 0.0, 0.001, 0.0]), "stress": state["stress"]}
    assert LoadLabels.of(document).words(few) == ["$E_{22}={0.05}$", r"$\gamma_{13}={0.001}$"]


def test_a_single_load_has_a_picture_that_says_what_it_gives(tmp_path: Path) -> None:
    whole = sample(4)
    point = {"strain": [0.02, -0.01, 0.003], "stress": [6.0, 0.0, 0.0]}
    case = {"analysis": {"type": "load", "plane": "strain"}, "load": {"to": {"S11": 6.0}}, "output": {}}
    write(tmp_path, replace(whole, states=whole.states[:1]), {"schema": SCHEMA, "case": case, "load": point})
    title = drawn(tmp_path)["load.png"].axes[0].get_title()
    assert r"$\Sigma_{11}={6}$" in title and "E_" not in title


def test_points_of_a_path_are_numbered_where_its_curve_folds_back(of_path: dict[str, Figure]) -> None:
    figure = of_path["path.png"]
    upper, lower = figure.axes
    assert {"0", "1", "2"} <= {text.get_text() for text in upper.texts if isinstance(text, Annotation)}
    np.testing.assert_allclose(lower.lines[0].get_xdata(), [0.5, 0.2, 1.0])
    np.testing.assert_allclose(lower.lines[1].get_xdata(), [0.5, 1.0])  # where the load rises
    stresses = {r"$\Sigma_{11}$": 3.0, r"$\Sigma_{22}$": 1.0, r"$\Sigma_{12}$": 0.5}
    (_, stress, named), (strain, nodes, counted) = panels(figure)
    assert (strain, stress) == ("macroscopic strain $E_{11}$", "stress\n(GPa)")
    for name, factor in stresses.items():
        np.testing.assert_allclose(named[name][-1], factor)
    assert nodes == "interface\nnodes"
    assert [counted[name].tolist() for name in ("bonded", "in contact", "open")] == [[5] * 2, [2] * 2, [3] * 2]


def test_the_picture_of_a_path_names_the_bonds_of_its_landmarks() -> None:
    document = path_of([0.5, 0.2, 1.0])
    document["peak"] = {"first_break_fibre": 3, "first_break_angle": -45.0, "fibre": 2, "angle": 12.5}
    words = " ".join(entries(path_picture(document)))
    assert "first break 1.5 GPa\nfibre 3 at -45°" in words and "fibre 2 at 12.5°" in words
    document = path_of([1.0, 0.5, 0.2])  # one mark where both are one point
    assert "first break and largest so far 3 GPa" in entries(path_picture(document))


@pytest.mark.parametrize("kind", ["stiffness", "stress"])
def test_curves_against_the_angle_have_their_names_and_units(kind: str) -> None:
    """C11 and so on are the entries of that place."""
    numbers = 10.0 * np.arange(1.0, 4.0)[:, None] + np.arange(1.0, 4.0) if kind == "stiffness" else [11.0, 22.0, 12.0]
    document = path_of([])
    points = [{"angle": a, kind: ((1 + a) * np.array(numbers)).tolist(), "strain": [0.1, 0, 0]} for a in (0, 1)]
    counts = {"bonded": 5, "open": 3, "closed": 2}
    document |= {"angle": [counts | point for point in points], "path": None}
    document["case"] |= {"angle": {}, "analysis": {"type": "angle", "plane": "strain"}}
    what = {"stiffness": "effective stiffness", "stress": "macroscopic stress"}[kind]
    ((_, label, found),) = panels(response_curves.angle(document))
    assert label == f"{what} (GPa)"
    named = {name: values for name, values in found.items() if name.startswith("$")}
    assert len(named) >= 3
    for name, values in named.items():
        place = float("".join(letter for letter in name.partition(" (")[0] if letter.isdigit()))
        assert list(values) == [place, 2 * place], name


def test_tractions_and_jumps_have_their_names_and_units(tmp_path: Path) -> None:
    """Beside half of the fibre, from its lower left corner: where each of the sample's ten nodes is."""
    whole = sample(4)
    write(tmp_path, in_space(whole), None)
    picture = drawn(tmp_path)["interface.png"]
    assert picture.get_suptitle().endswith(", one of the loads")
    traction, jump, *_ = panels(picture)
    assert (traction[1], jump[1]) == ("traction (GPa)", "jump (mm)")
    k = np.arange(10.0)
    values = {r"$t_\mathrm{n}$": k, r"$t_\mathrm{t}$": -k, r"$t_\mathrm{a}$": k}
    for (_, _, found), expected in ((traction, values), (jump, {"gap": 0.1 * k, "slip": 0.2 * k, "axial slip": -k})):
        for name, numbers in expected.items():
            assert sorted(set(found[name].tolist())) == pytest.approx(sorted(numbers)), name


def test_several_interfaces_have_lines_of_the_title_that_are_within_the_picture():
    document = path_of([0.0, 0.1])
    bond = {"contact": True, "criterion": "max", "normal_strength": 0.03125, "tangential_strength": 0.05125}
    document["case"] |= {
        "name": "a_case_of_several_interfaces",
        "interface": [bond | {"between": pair} for pair in (["coating", "matrix"], ["glass", "coating"])],
    }
    figure = path_picture(document)
    FigureCanvasAgg(figure).draw()
    title = figure.axes[0].title
    assert title.get_text().count("\n") == 2
    assert figure.bbox.x0 <= title.get_window_extent().x0 and title.get_window_extent().x1 <= figure.bbox.x1


def test_what_breaks_the_bonds_is_in_the_title():
    case = {"interface": {"criterion": "quadratic", "normal_strength": 0.06}, "output": {"stress_unit": "GPa"}}
    assert plot_helpers.bond_limits(case) == ["law quadratic, $R^\\mathrm{n}=0.06$ GPa"]
    assert plot_helpers.bond_limits({"interface": {"criterion": "energy", "toughness": 3e-5}}) == [
        "law energy, $G_\\mathrm{Ic}=3e-05$"
    ]
    law = {"criterion": "table", "normal_strength": 6.0, "tangential_strength": 8.0, "normal_toughness": 0.02}
    words = ["table law, $N=6$, $S=8$, $G_\\mathrm{n}=0.02$, $G_\\mathrm{t}=0.04$"]
    assert plot_helpers.bond_limits({"interface": law | {"tangential_toughness": 0.04}}) == words
    assert plot_helpers.bond_limits({}) == ["no debonding by load"]
