"""Pictures of a whole path: texts in the width of a column, and one colour range for all states."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text
from support.sample_output import sample, write

from feti_homog.errors import CaseError
from feti_homog.report.plots import deformed_panels, figures, plot_helpers
from feti_homog.results.result_json import SCHEMA


def path_of(strains: list[float]) -> dict[str, Any]:
    """Return the document of a path whose points have these strains E11."""
    counts = {"bonded": 5, "open": 3, "closed": 2, "broke": 1}
    points = [counts | {"load_factor": abs(e), "strain": [e, 0, 0], "stress": [3 * e, e, 0.5 * e]} for e in strains]
    case = {
        "name": "a case with a name of several words, longer than a column",
        "analysis": {"type": "path", "plane": "strain"},
    }
    case |= {"interface": {"contact": True, "criterion": "max", "normal_strength": 0.06}}
    case |= {"path": {"strain": [1.0, 0.0, 0.0], "method": "events"}, "output": {"stress_unit": "GPa"}}
    return {"schema": SCHEMA, "case": case, "path": points}


def texts(figure: Figure) -> list[Text]:
    """Return the texts in a picture, without tick labels beyond the limits of their axis."""
    hidden = set()
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            margin = 1e-6 * (high - low)
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                if not (axes.axison and low - margin <= tick.get_loc() <= high + margin):
                    hidden |= {tick.label1, tick.label2}
    return [text for text in figure.findobj(Text) if text.get_visible() and text.get_text() and text not in hidden]


@pytest.mark.slow
@pytest.mark.parametrize("strains", [[0.5, 0.2, 1.0], [-0.015, -0.011, -0.01]], ids=["rising", "small and negative"])
def test_texts_in_a_column_of_a_paper_are_whole_and_apart(
    tmp_path: Path, monkeypatch: Any, strains: list[float]
) -> None:
    """In pictures of 8.5 x 7 cm no text leaves the canvas or lies on another text."""
    whole = sample(4)
    states = tuple(
        replace(state, strain=strains[k] * np.array([1.0, -0.3, 0.0])) for k, state in enumerate(whole.states)
    )
    write(tmp_path, replace(whole, states=states), path_of(strains))
    found: dict[str, Figure] = {}
    save = plot_helpers.save

    def keep(figure: Figure, path: Path, look: plot_helpers.Look) -> Path:
        found[path.name] = figure
        return save(figure, path, look)

    monkeypatch.setattr(plot_helpers, "save", keep)
    figures.plot(tmp_path, plot_helpers.Look(size=(8.5, 7.0)))
    assert {"path.png", "path_states.png", "interface.png", "partition.png"} <= found.keys()
    for name, figure in found.items():
        (canvas := FigureCanvasAgg(figure)).draw()
        renderer: Any = canvas.get_renderer()
        boxes = {text: text.get_window_extent(renderer) for text in texts(figure)}
        assert len(boxes) > 5
        for text, box in boxes.items():
            assert min(box.min) >= -1.0 and (box.max <= figure.bbox.max + 1.0).all(), (name, text)
        for (text, box), (other, beside) in combinations(boxes.items(), 2):
            assert not box.shrunk(0.95, 0.8).overlaps(beside.shrunk(0.95, 0.8)), (name, text, other)


def test_panels_have_the_colours_of_all_states(tmp_path: Path, monkeypatch: Any) -> None:
    """A state without a landmark and of the other sign counts; the end of far larger stresses does not."""
    document = path_of([0.1, 0.2, 1.0])
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda document: {0: "peak", 2: "end"})
    write(tmp_path, sample(4), document)
    with h5py.File(tmp_path / "result.h5", "r+") as file:
        for number, value in enumerate((2.0, -3.0, 3.5)):
            table = file[f"state/{number}/stress"]
            table[:] = value * np.linspace(0.0, 1.0, len(table))[:, None]
            file[f"state/{number}"].attrs["point"] = number
        ranges = []
        for last in (1.0, 100.0):
            file["state/2/stress"][:] *= last
            cell = deformed_panels.DeformedCell.of_states(file, range(3), document, 1.0, 10_000)
            ranges.append((cell.colours[0].vmin, cell.colours[0].vmax))
    assert ranges[0][0] == -ranges[0][1] and 2.5 < ranges[0][1] <= 3.5
    assert ranges[1][0] == -ranges[1][1] and 2.0 < ranges[1][1] <= 3.0


def test_a_state_of_a_path_is_drawn_by_its_mark(tmp_path: Path, monkeypatch: Any) -> None:
    marks = {0: "first break and largest stress", 2: "end"}
    monkeypatch.setattr(deformed_panels.landmarks, "marks", lambda document: marks)
    write(tmp_path, sample(4), document := path_of([0.1, 0.2, 1.0]))
    with h5py.File(tmp_path / "result.h5") as file:
        points = {number: int(state.attrs["point"]) for number, state in file["state"].items()}
        assert {*marks} <= {*points.values()}
        for word, point in (("first break", 0), ("largest stress", 0), ("end", 2)):
            ((name, _),) = figures.of_fields(tmp_path, file, document, plot_helpers.PLAIN, word)
            assert points[name.removeprefix("state_")] == point
        with pytest.raises(CaseError, match=r"--state peak: .*, first break, largest stress\), .*, end\)"):
            next(figures.of_fields(tmp_path, file, document, plot_helpers.PLAIN, "peak"))
