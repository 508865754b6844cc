"""report.html without a browser: what is on the page, and what of a folder that has no whole result."""

import base64
import re
import tomllib
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from feti_homog.errors import CaseError
from feti_homog.report import page
from feti_homog.report.cards import export
from feti_homog.report.text.summary import answers
from feti_homog.results import output_folder, result_json

CELL = {
    "width": 1.0, "height": 1.0, "elements": 32, "nodes": 30, "fractions": {"matrix": 0.75, "fibre": 0.25},
    "fibre_fraction": 0.25, "area": 1.0,
}  # fmt: skip
SOLVER = {
    "ranks": 1, "subdomains": 3, "dofs": 60, "iterations": [5, 6, 7], "rtol": 1e-8, "multipliers": 20, "kernel_dim": 3,
    "coarse_dim": 3,
}  # fmt: skip
COUNTS = {"bonded": 5, "open": 3, "closed": 2, "broke": 1}
NAME = "a <b> & 'c'"


def document(kind: str, **more: Any) -> dict[str, Any]:
    """Return a result with three states, as many as the sample."""
    case = {
        "name": NAME, "cell": {"geometry": "square", "order": 1, "refine": 0},
        "analysis": {"type": kind, "plane": "strain"},
        "output": {"stress_unit": "GPa"}, "path": {"strain": [1, 0, 0], "method": "events"},
    }  # fmt: skip
    case |= {} if kind == "stiffness" else {"interface": {"contact": True}}
    return {
        "schema": result_json.SCHEMA, "version": "0", "date": "<2026>",
        "case": case, "cell": CELL, "solver": SOLVER, "status": "done",
        "checks": {"hill": 1e-12, "kkt_tension": 1e-3}, "check_tolerance": 1e-5, "kkt_tolerance": 1e-6,
        "warnings": [], "faults": ["a fault"], "timings": {"solve": 1.5}, "memory": 1 << 20,
    } | more  # fmt: skip


def path(points: int = 3) -> dict[str, Any]:
    loads = np.linspace(0.2, 1.0, points)
    energies = {
        "dissipated": 0.1,
        "dissipated_strain_controlled": 0.1,
        "stored_in_springs": 0.0,
        "stored": 0.9,
        "fracture_energy": 0.1,
        "work": 1.0,
        "debonded_share": 0.3,
        "debonded_length": 0.3,
        "debonding_angle": 100.0,
    }
    rows = [COUNTS | energies | {"load_factor": t, "strain": [t, 0, 0], "stress": [3 * t, t, 0]} for t in loads]
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


def test_pictures_of_the_page_are_files_of_a_result() -> None:
    """So that a run into a folder in use removes the pictures of the run before."""
    names = {f"{name}.png" for name in page.PICTURES}
    assert {name for name in names if not output_folder.RESULT_FILE.fullmatch(name)} == set()


def test_the_table_of_an_envelope() -> None:
    table, *_ = answers(envelope() | bonded_numbers(), page.MOST_ROWS)
    assert table.title == "Onset of debonding or softening in the plane S22, S12 (GPa): 3 directions"
    assert [column.name for column in table.columns] == ["angle", "S22", "S12", "fibre", "at", "normal", "tangent"]
    assert table.cells[1] == ["90", "0", "4", "1", "30.00", "1", "0"]
    assert table.cells[2] == ["180", "none", "none", "", "", "", ""]


def bonded_numbers() -> dict[str, Any]:
    stiffness = [[9.0, 2.0, 0.0], [2.0, 8.0, 0.0], [0.0, 0.0, 3.0]]
    bounds = {"voigt": stiffness, "reuss": stiffness, "hashin_shtrikman": {"bulk": [1.0, 2.0]}}
    return {"effective_stiffness": stiffness, "moduli": {"E1": 8.5, "nu12": 0.25, "bulk": 1.5}, "bounds": bounds}


def bonded() -> dict[str, Any]:
    return document("stiffness", **bonded_numbers())


def space() -> dict[str, Any]:
    stiffness, thermal = np.diag(np.arange(1.0, 7.0)), np.arange(6.0)
    about = {"E_axial": 3.0, "expansion_axial": None, "deviation": 0.1}
    found = {"effective_stiffness": stiffness, "thermal_stress": thermal, "constants": {"E1": 1.0}}
    result = document("stiffness", **found, transversely_isotropic=about, estimates={"mori_tanaka": {"E_axial": 3.1}})
    result["case"]["analysis"]["plane"] = "generalized"
    return result


def angle_in_space() -> dict[str, Any]:
    rows = [COUNTS | {"angle": a, "stiffness": np.diag(np.arange(1.0, 7.0)).tolist()} for a in (0, 90, 180)]
    return document("angle", angle=rows)


def written(directory: Path, result: dict[str, Any]) -> Path:
    result_json.write(directory, result)
    return directory


class Words(HTMLParser):
    """The tags and the text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags, self.text, self._is_style = list[str](), list[str](), False
        self.verbatim, self._is_pre = list[str](), False
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: Any) -> None:
        self.tags.append(tag)
        self._is_style, self._is_pre = tag == "style", tag == "pre"
        self.verbatim += [""] * self._is_pre

    def handle_endtag(self, tag: str) -> None:
        self._is_style = self._is_pre = False

    def handle_data(self, data: str) -> None:
        if not self._is_style:
            self.text.append(data.strip())
        if self._is_pre:
            self.verbatim[-1] += data


@pytest.mark.parametrize("result", [path, angle, bonded])
def test_the_page_has_what_there_is(tmp_path: Path, result: Callable[[], dict[str, Any]]) -> None:
    directory = written(tmp_path, result())
    (tmp_path / "cell.png").write_bytes(b"a picture")
    assert page.write(directory) == tmp_path / "report.html"
    words = Words((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert any(text.startswith(NAME) for text in words.text) and "b" not in words.tags
    assert {"hill", "pass", "a fault", "done"} <= set(words.text)
    assert ("kkt_tension" in words.text) == ("FAIL" in words.text) == (result is not bonded)
    assert words.tags.count("img") == 1 and "svg" not in words.tags
    assert "feti-homog 0, run of <2026>" in words.text
    _, *cards, case = words.verbatim
    assert tomllib.loads(case) == result()["case"] and cards == []


@pytest.mark.parametrize("result", [space, angle_in_space])
def test_the_page_of_a_cell_in_space(tmp_path: Path, result: Callable[[], dict[str, Any]]) -> None:
    words = Words(page.write(written(tmp_path, result())).read_text(encoding="utf-8"))
    assert {"S33", "gamma23", "mori tanaka", "3.1", "E_axial"} <= set(words.text) or result is angle_in_space
    assert {"C66", "C44"} <= set(words.text) or result is space
    cards = [text for text in words.text if text.startswith("Material card, ")]
    assert cards == [f"Material card, {form}" for form in export.FORMATS] * (result is space)
    if cards:
        assert words.verbatim[1:-1] == [export.card(tmp_path, form, "orthotropic") for form in export.FORMATS]


CAPTIONS = {
    "case_gamma12": "Deformed cell under gamma12",
    "case_minus_E11": "Deformed cell under minus E11",
    "case_dT_dx1": "Flux and isotherms under a unit gradient along x1",
    "case_dT_dx2": "Flux and isotherms under a unit gradient along x2",
    "mesh_error": "Estimated error of the mesh",
    "sensitivities": "Relative changes of constants with each parameter",
    "state_7": "Deformed cell, state 7",
}


def test_pictures_stand_above_their_own_words(tmp_path: Path) -> None:
    for name in CAPTIONS:
        (tmp_path / f"{name}.png").write_bytes(name.encode())
    text = page.write(written(tmp_path, bonded())).read_text(encoding="utf-8")
    figure = re.compile(r'<img src="data:image/png;base64,([^"]+)" alt="([^"]+)"><figcaption>([^<]+)</figcaption>')
    assert {base64.b64decode(data).decode(): alt for data, alt, _ in figure.findall(text)} == CAPTIONS
    assert all(alt == caption for _, alt, caption in figure.findall(text))


@pytest.mark.parametrize(("status", "verdict"), [("done", "good"), ("not converged", "bad")])
def test_the_head_has_the_verdict_and_remarks_are_words(tmp_path: Path, status: str, verdict: str) -> None:
    result = document("stiffness", **bonded_numbers(), status=status, remarks=["a <script>"], warnings=["<i>"])
    text = page.write(written(tmp_path, result)).read_text(encoding="utf-8")
    assert f'<p class="status {verdict}">{status}</p>' in text and not {"script", "i"} & {*Words(text).tags}
    assert '<p class="remark"><strong>Remark</strong> a &lt;script&gt;</p>' in text
    assert '<p class="warning"><strong>Warning</strong> &lt;i&gt;</p>' in text
    (policy,) = re.findall('<meta http-equiv="Content-Security-Policy" content="([^"]+)">', text)
    allowed = dict(each.split(" ", 1) for each in policy.split("; "))
    assert allowed == {"default-src": "'none'", "style-src": "'unsafe-inline'", "img-src": "data:"}


def test_an_older_result_has_no_date(tmp_path: Path) -> None:
    old = {key: value for key, value in bonded().items() if key != "date"}
    words = Words(page.write(written(tmp_path, old)).read_text(encoding="utf-8"))
    assert "feti-homog 0" in words.text


def test_the_table_of_a_load() -> None:
    point = COUNTS | {"strain": [0.1, 0.2, 0.3], "stress": [4.0, 5.0, 6.0], "stored": 7.0, "free_motions": 1}
    result = document("load", load=point | {"stored_in_springs": 0.0, "debonded_share": 0.5})
    result["case"]["load"] = result["case"].pop("path")
    (table,) = answers(result, page.MOST_ROWS)
    assert table.cells == [["strain", "0.1", "0.2", "0.3"], ["stress (GPa)", "4", "5", "6"]]
    assert {"Stored per area (GPa): 7", "5 bonded, 3 open, 2 closed interface nodes"} <= {*table.below}


def test_many_points_are_some_rows(tmp_path: Path) -> None:
    (table,) = answers(path(500), page.MOST_ROWS)
    assert any(line.startswith("S11 (GPa) at the end of the path, no peak yet: 3 at") for line in table.above)
    last = dict(zip((column.name for column in table.columns), table.cells[-1], strict=True))
    expected = {"bonded": "5", "open": "3", "closed": "2", "load": "1.000000", "S11": "3", "S22": "1"}
    assert {name: last[name] for name in expected} == expected
    assert len(table.rows) == page.MOST_ROWS and "500 events, 60 shown" in table.title
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
        ["C33 (gamma12) Reuss, Voigt", "2.5", "3", "3.5"],
        ["bulk Hashin-Shtr.", "1", "1.5", "2"],
    ]
    result["bounds"]["reuss"][0][0] = 9.5
    *_, table = answers(result, page.MOST_ROWS)
    assert table.cells[0] == ["C11 Reuss, Voigt", "9.5", "9", "10", "outside"] and len(table.cells[1]) == 4


def no_folder(directory: Path) -> Path:
    return directory / "nothing"


def no_result(directory: Path) -> Path:
    return directory


def no_checks(directory: Path) -> Path:
    result_json.write(directory, {k: v for k, v in path().items() if k != "checks"})
    return directory


def a_sweep(directory: Path) -> Path:
    (directory / "sweep.json").write_text("{}")
    return directory


FAULTY = (no_folder, no_result, no_checks, a_sweep)


@pytest.mark.parametrize("faulty", FAULTY, ids=lambda make: make.__name__)
def test_a_missing_or_damaged_result_is_one_line(tmp_path: Path, faulty: Callable[[Path], Path]) -> None:
    directory = faulty(tmp_path)
    with pytest.raises(CaseError) as caught:
        page.write(directory)
    (line,) = caught.value.faults
    assert str(directory) in line and "\n" not in line and caught.value.exit_code == 2
    assert not (directory / "report.html").exists()
