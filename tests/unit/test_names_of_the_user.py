"""Names of the user in outputs are texts: no formulas of spreadsheets or pictures, no orders to a terminal."""

import csv
import io
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from support.base_case import changed

from feti_homog.case import cases
from feti_homog.errors import CaseError
from feti_homog.microstructure import phase_names
from feti_homog.report.plots import plot_helpers
from feti_homog.results import result_json

FORMULAS = ("=1+1", "+1+1", "-2-3", "@SUM(A1)", "=cmd|'/c calc'!A1", "-")


@pytest.mark.parametrize("text", FORMULAS)
def test_spreadsheets_compute_no_text_of_a_table(text: str) -> None:
    numbers = ["-1", "+2.5", "-1e-05", "-1.5E+10", -3.0, "1-2", ""]
    ((cell, *others),) = csv.reader(io.StringIO(result_json.csv_text([[text, *numbers]])))
    assert cell == f"'{text}" and others == [str(number) for number in numbers]


@pytest.mark.parametrize("text", ["$x^2$", r"\frac{1}{2}$", "$$a_b$$ $", r"\$x_1\$", "^_{}", "$a$ $b$"])
def test_pictures_draw_texts_of_the_user_literally(text: str) -> None:
    drawn = []
    for words, parses in ((plot_helpers.plain(text), True), (text, False)):
        canvas = FigureCanvasAgg(Figure(figsize=(3, 1)))
        canvas.figure.text(0.1, 0.5, words, parse_math=parses)
        canvas.draw()
        drawn.append(np.asarray(canvas.buffer_rgba()))
    assert drawn[0].std() > 0 and np.array_equal(*drawn)


@pytest.mark.parametrize("pattern", [phase_names.PHASE, phase_names.FIBRE_PHASE])
def test_spreadsheets_compute_no_name_of_a_phase(pattern: re.Pattern[str]) -> None:
    assert not any(map(pattern.fullmatch, FORMULAS)) and pattern.fullmatch("e-glass_1")


NAMED = {
    "case": (("[cell]", 'name = "\\u001b[31m"\n[cell]'), "name = "),
    "unit": (("[analysis]", '[output]\nstress_unit = "G\\u0007Pa"\n[analysis]'), "[output] stress_unit"),
    "phase": (("[analysis]", '[material."fi\\u0007bre"]\nyoung = 1.0\npoisson = 0.3\n[analysis]'), "[material."),
    "pair": (("[analysis]", '[interface]\nbetween = ["a\\u0007", "matrix"]\n[analysis]'), "[interface] between"),
}


@pytest.mark.parametrize("name", NAMED)
def test_control_characters_in_names_are_refused_in_one_line(name: str, tmp_path: Path) -> None:
    change, place = NAMED[name]
    with pytest.raises(CaseError) as caught:
        cases.parse(tomllib.loads(changed(change)), tmp_path)
    lines = [line for line in caught.value.faults if line.startswith(place)]
    assert len(lines) == 1 and all(line.isprintable() for line in caught.value.faults)


def test_pictures_draw_no_control_characters() -> None:
    assert plot_helpers.plain("a\x1b[31m\x00\u202e") == r"a\x1b[31m\x00\u202e"
