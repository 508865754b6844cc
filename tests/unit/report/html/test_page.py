"""report.html without a browser: what is on the page, and what of a folder that has no whole result."""

from __future__ import annotations

import base64
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from support.sample_output import in_space, sample

from feti_homog.errors import CaseError
from feti_homog.report.html import page
from feti_homog.report.html.page import TRIANGLES, viewer_data
from feti_homog.report.plots.decimation import drawn_mesh, nodal_values, triangle_means
from feti_homog.report.text.summary import answers, checks
from feti_homog.results import result_json
from feti_homog.results.field_file import FieldFile

CELL = {
    "width": 1.0, "height": 1.0, "elements": 32, "nodes": 30, "fractions": {"matrix": 0.75, "fibre": 0.25},
    "fibre_fraction": 0.25, "area": 1.0,
}  # fmt: skip
SOLVER = {"ranks": 1, "subdomains": 3, "dofs": 60, "iterations": [5, 6, 7], "rtol": 1e-8}
COUNTS = {"bonded": 5, "open": 3, "closed": 2, "broke": 1}
NAME = "a <b> & 'c'"


def document(kind: str, **more: Any) -> dict[str, Any]:
    """Return a result with three states, as many as the sample."""
    case = {
        "name": NAME, "cell": {"geometry": "square"}, "analysis": {"type": kind, "plane": "strain"},
        "output": {"stress_unit": "GPa"}, "path": {"strain": [1, 0, 0], "method": "events"}, "angle": {"strain": None},
    }  # fmt: skip
    case |= {} if kind == "stiffness" else {"interface": {"contact": True}}
    return {
        "schema": result_json.SCHEMA, "version": "0", "case": case, "cell": CELL, "solver": SOLVER, "status": "done",
        "checks": {"hill": 1e-12, "kkt_tension": 1e-3}, "check_tolerance": 1e-5, "kkt_tolerance": 1e-6,
        "warnings": [], "faults": ["a fault"], "timings": {"solve": 1.5},
    } | more  # fmt: skip


def path(points: int = 3) -> dict[str, Any]:
    loads = np.linspace(0.2, 1.0, points)
    rows = [COUNTS | {"load_factor": t, "strain": [t, 0, 0], "stress": [3 * t, t, 0]} for t in loads]
    return document("path", path=rows)


def angle() -> dict[str, Any]:
    rows = [COUNTS | {"angle": a, "stiffness": [[9 - a / 90, 2, 0], [2, 8, 0], [0, 0, 3]]} for a in (0, 90, 180)]
    return document("angle", angle=rows)


def envelope() -> dict[str, Any]:
    rows = [
        {"angle": a, "factor": 4.0, "fibre": 1, "bond_angle": 30.0, "normal": 1.0, "tangential": 0.0} for a in (0, 90)
    ]
    case = document("envelope")["case"] | {"envelope": {"plane": ["S22", "S12"]}}
    return document("envelope", case=case, envelope=[*rows, {"angle": 180}])


def test_the_table_of_an_envelope() -> None:
    (table,) = answers(envelope(), page.MOST_ROWS)
    assert table.title == "Onset of debonding; load (GPa)"
    assert [column.name for column in table.columns] == [
        "angle",
        "S22",
        "S12",
        "fibre",
        "bond_angle",
        "normal",
        "tangential",
    ]
    assert table.cells[1] == ["90", "0", "4", "1", "30", "1", "0"]
    assert table.cells[2] == ["180", "none", "none", "", "", "", ""]


def bonded() -> dict[str, Any]:
    stiffness = [[9.0, 2.0, 0.0], [2.0, 8.0, 0.0], [0.0, 0.0, 3.0]]
    bounds = {"voigt": stiffness, "reuss": stiffness, "hashin_shtrikman": {"bulk": [1.0, 2.0]}}
    moduli = {"E1": 8.5, "nu12": 0.25, "bulk": 1.5}
    return document("stiffness", effective_stiffness=stiffness, moduli=moduli, bounds=bounds)


def space() -> dict[str, Any]:
    stiffness, thermal = np.diag(np.arange(1.0, 7.0)), np.arange(6.0)
    about = {"E_axial": 3.0, "expansion_axial": None, "deviation": 0.1}
    found = {"effective_stiffness": stiffness, "thermal_stress": thermal, "constants": {"E1": 1.0}}
    return document("stiffness", **found, transversely_isotropic=about, estimates={"mori_tanaka": {"E_axial": 3.1}})


def angle_in_space() -> dict[str, Any]:
    rows = [COUNTS | {"angle": a, "stiffness": np.diag(np.arange(1.0, 7.0)).tolist()} for a in (0, 90, 180)]
    return document("angle", angle=rows)


def written(directory: Path, result: dict[str, Any], points: Sequence[int] = (0, 1, 2), spatial: bool = False) -> Path:
    from mpi4py import MPI

    whole = in_space(sample(4)) if spatial else sample(4)
    *parts, _ = vars(whole).values()
    with FieldFile(directory, MPI.COMM_SELF, *parts) as file:
        for k, state in enumerate(whole.states):
            file.write_state(k, replace(state, point=points[k]))
    result_json.write(directory, result)
    return directory


class Words(HTMLParser):
    """The tags and the text of a page, and the data of its viewer."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.text, self.data, self._within = list[str](), list[str](), "", ""
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        self.tags.append(tag)
        self._within = tag if tag in ("script", "style") else ""
        if dict(attributes).get("id") == "data":
            self._within = "data"

    def handle_endtag(self, tag: str) -> None:
        self._within = ""

    def handle_data(self, data: str) -> None:
        if self._within == "data":
            self.data += data
        elif not self._within:
            self.text.append(data.strip())


def test_the_states_of_a_path_know_their_points(tmp_path: Path) -> None:
    directory = written(tmp_path, path(9) | {"states": [0, 5, 8]}, points=(0, 5, 8))
    page.write(directory)
    shown = json.loads(Words((tmp_path / "report.html").read_text(encoding="utf-8")).data)["states"]
    assert [(state["number"], state["point"]) for state in shown] == [(0, 0), (1, 5), (2, 8)]
    assert [state["mark"] for state in shown] == ["first break", "", "peak and end"]


@pytest.mark.parametrize("result", [path, angle, bonded])
def test_the_page_has_what_there_is(tmp_path: Path, result: Callable[[], dict[str, Any]]) -> None:
    directory = written(tmp_path, result())
    (tmp_path / "cell.png").write_bytes(b"a picture")
    assert page.write(directory) == tmp_path / "report.html"
    words = Words((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert any(text.startswith(NAME) for text in words.text) and "b" not in words.tags
    assert {"hill", "holds", "a fault", "done"} <= set(words.text)
    assert ("kkt_tension" in words.text) == ("fails" in words.text) == (result is not bonded)
    assert words.tags.count("img") == 1 and "svg" not in words.tags
    assert [state["label"] for state in json.loads(words.data)["states"]] == [state.label for state in sample(4).states]


@pytest.mark.parametrize("result", [space, angle_in_space])
def test_the_page_of_a_cell_in_space(tmp_path: Path, result: Callable[[], dict[str, Any]]) -> None:
    words = Words(page.write(written(tmp_path, result(), spatial=True)).read_text(encoding="utf-8"))
    assert {"S33", "gamma23", "mori tanaka", "3.1", "E axial"} <= set(words.text) or result is angle_in_space
    assert {"C66", "C44"} <= set(words.text) or result is space
    shown = json.loads(words.data)
    assert shown["components"] == ["S11", "S22", "S33", "S23", "S13", "S12"] and shown["component"] == 2
    assert [state["load"] for state in shown["states"]] == ["E33 = 1", "temperature = 1", "gamma13 = -1"]
    assert all(len(state["fields"]) == len(state["stress"]) == 6 for state in shown["states"])


def test_a_case_without_fields_has_its_curves(tmp_path: Path) -> None:
    result = path()
    result["case"]["output"]["fields"] = False
    result_json.write(tmp_path, result)
    words = Words(page.write(tmp_path).read_text(encoding="utf-8"))
    assert words.data == "" and "Curves" in words.text and "Deformed states" not in words.text


def test_the_viewer_draws_the_fields(tmp_path: Path) -> None:
    """Displacements to 1 / 32767 of the largest, stresses to 1 / 255 of their range."""
    with h5py.File(written(tmp_path, path()) / "result.h5", "a") as file:
        file["state/1/status"][0] = 2  # then no two kinds of nodes are as many
        shown, drawn = viewer_data(file, path()), drawn_mesh(file, TRIANGLES)
        for number, state in enumerate(shown["states"]):
            steps = np.frombuffer(base64.b64decode(state["displacement"]), "<i2").reshape(-1, 2)
            exact = nodal_values(file[f"state/{number}/displacement"], drawn)
            np.testing.assert_allclose(state["unit"] * steps, exact, atol=np.abs(exact).max() / 32767)
            for column, field in enumerate(state["fields"]):
                values = np.frombuffer(base64.b64decode(field["values"]), "u1")
                width = field["high"] - field["low"]
                exact = triangle_means(file[f"state/{number}/stress"], column, drawn)
                clipped = np.clip(exact, field["low"], field["high"])
                np.testing.assert_allclose(field["low"] + width * values / 255, clipped, atol=0.6 * width / 255)
            assert state["nodes"] == np.bincount(file[f"state/{number}/status"][:], minlength=3).tolist()
    assert shown["component"] == 0 and shown["points"] and shown["common"]


def test_one_scale_is_that_of_all_states_but_the_end(tmp_path: Path) -> None:
    """At the end of a path that falls and rises again stresses may be many times those before."""
    fallen = path()
    for point, stress in zip(fallen["path"], (9.0, 1.0, 3.0), strict=True):
        point["stress"] = [stress, 0.0, 0.0]
    with h5py.File(written(tmp_path, fallen) / "result.h5", "a") as file:
        file["state/2/stress"][...] *= 1e3
        shown = viewer_data(file, fallen)
        before = np.concatenate([file[f"state/{k}/stress"][:, 0] for k in range(2)])
    assert [state["mark"] for state in shown["states"]] == ["first break and peak", "after the peak", "end"]
    low, high = shown["ranges"][0]
    assert before.min() - 0.1 <= low < high <= before.max() + 0.1


def test_the_table_of_a_load() -> None:
    point = COUNTS | {"strain": [0.1, 0.2, 0.3], "stress": [4.0, 5.0, 6.0], "stored": 7.0}
    (table,) = answers(document("load", load=point), page.MOST_ROWS)
    expected = {"E11": "0.1", "E22": "0.2", "gamma12": "0.3", "S11": "4", "S22": "5", "S12": "6", "stored": "7"}
    found = dict(table.cells)
    assert {name: found[name] for name in expected} == expected and (found["open"], found["closed"]) == ("3", "2")


def test_many_points_are_some_rows(tmp_path: Path) -> None:
    peak, table = answers(path(500), page.MOST_ROWS)
    assert peak.title == "Peak of the path" and peak.cells[0][0] in ("first break", "peak")
    last = dict(zip((column.name for column in table.columns), table.cells[-1], strict=True))
    expected = {"bonded": "5", "open": "3", "closed": "2", "load_factor": "1", "S11": "3", "S22": "1", "S12": "0"}
    assert {name: last[name] for name in expected} == expected and table.title.endswith("stress (GPa)")
    assert len(table.rows) == page.MOST_ROWS and "60 of 500" in table.title
    assert (table.cells[0][0], table.cells[-1][0]) == ("0", "499")


def test_bounds_stand_on_both_sides_of_what_was_computed() -> None:
    result = bonded()
    result["bounds"]["voigt"] = [[10.0, 2.0, 0.0], [2.0, 8.5, 0.0], [0.0, 0.0, 3.5]]
    result["bounds"]["reuss"] = [[7.0, 2.0, 0.0], [2.0, 6.5, 0.0], [0.0, 0.0, 2.5]]
    *_, table = answers(result, page.MOST_ROWS)
    assert [column.name for column in table.columns] == ["", "lower", "computed", "upper"]
    assert table.cells == [
        ["C11 Reuss, Voigt", "7", "9", "10"],
        ["C22 Reuss, Voigt", "6.5", "8", "8.5"],
        ["C33 Reuss, Voigt", "2.5", "3", "3.5"],
        ["bulk Hashin-Shtr.", "1", "1.5", "2"],
    ]
    result["bounds"]["reuss"][0][0] = 9.5
    *_, table = answers(result, page.MOST_ROWS)
    assert table.cells[0] == ["C11 Reuss, Voigt", "9.5", "9", "10", "outside"] and len(table.cells[1]) == 4


def test_checks_of_contact_have_a_limit_of_their_own() -> None:
    result = document("load", checks={"hill": 2e-6, "kkt_tension": 2e-6})
    assert [(check.law, check.limit, check.holds) for check in checks(result)] == [
        ("hill", 1e-5, True), ("kkt_tension", 1e-6, False),
    ]  # fmt: skip


def no_folder(directory: Path) -> Path:
    return directory / "nothing"


def no_result(directory: Path) -> Path:
    return directory


def no_fields(directory: Path) -> Path:
    result_json.write(directory, path())
    return directory


def cut_fields(directory: Path) -> Path:
    file = written(directory, path()) / "result.h5"
    file.write_bytes(file.read_bytes()[:5000])
    return directory


def no_states(directory: Path) -> Path:
    with h5py.File(written(directory, path()) / "result.h5", "a") as file:
        del file["state/1"]
    return directory


def no_checks(directory: Path) -> Path:
    result_json.write(directory, {k: v for k, v in path().items() if k != "checks"})
    return directory


def a_sweep(directory: Path) -> Path:
    (directory / "sweep.json").write_text("{}")
    return directory


FAULTY = (no_folder, no_result, no_fields, cut_fields, no_states, no_checks, a_sweep)


@pytest.mark.parametrize("faulty", FAULTY, ids=lambda make: make.__name__)
def test_a_missing_or_damaged_result_is_one_line(tmp_path: Path, faulty: Callable[[Path], Path]) -> None:
    directory = faulty(tmp_path)
    with pytest.raises(CaseError) as caught:
        page.write(directory)
    (line,) = caught.value.faults
    assert str(directory) in line and "\n" not in line and caught.value.exit_code == 2
    assert not (directory / "report.html").exists()
