"""report.html as a reader has it: in Chromium, from a file, with no network to fetch from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait

KINDS = ("path", "angle", "stiffness")
CURVES = {"path": 4, "angle": 2, "stiffness": 1}
LINES = {"path": [6, 3, 3, 1], "angle": [4, 3], "stiffness": [1]}
CANVASES = """
const found = [];
const look = (node) => {
    for (const child of node.children) {
        if (child.tagName === "CANVAS") found.push(child);
        if (child.shadowRoot) look(child.shadowRoot);
        look(child);
    }
};
look(arguments[0]);
return found.map((canvas) => {
    const pixels = canvas.width && canvas.height
        ? canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data : [];
    return [canvas.width, canvas.height, new Set(pixels).size];
});
"""
LINES_DRAWN = """
return Object.values(Bokeh.documents[0].roots()).map((figure) =>
    figure.renderers.filter((renderer) => renderer.glyph.type === "Line"
        && renderer.visible && renderer.data_source.get_length() > 1).length);
"""
RINGS = """
return Bokeh.documents.flatMap((page) => [...page.all_models]).filter((model) => model.name === "shown")
    .map((source) => [source.data.x[0], source.data.y[0]]);
"""


def opened(chromium: Any, report: Path, width: int = 1200) -> None:
    """Open the page and wait for its curves; drop the logs of earlier pages."""
    for log in ("browser", "performance"):
        chromium.get_log(log)
    chromium.set_window_size(width, 900)
    chromium.get(report.as_uri())
    WebDriverWait(chromium, 30).until(
        lambda browser: all(
            any(colours > 2 for _, _, colours in browser.execute_script(CANVASES, box))
            for box in browser.find_elements(By.CLASS_NAME, "curve")
        )
    )


def view(chromium: Any) -> str:
    """Return the picture of the state that is shown."""
    return str(chromium.execute_script("return document.getElementById('view').toDataURL()"))


def label(chromium: Any) -> str:
    return str(chromium.find_element(By.ID, "label").text)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_is_fetched_and_no_error_reported(chromium: Any, reports: dict[str, Path], kind: str) -> None:
    opened(chromium, reports[kind])
    events = [json.loads(entry["message"])["message"] for entry in chromium.get_log("performance")]
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert reports[kind].as_uri() in asked
    assert not [url for url in asked if url != reports[kind].as_uri() and not url.startswith(("data:", "blob:"))]
    fetched = chromium.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert not [url for url in fetched if not url.startswith(("data:", "blob:"))]
    assert not [entry for entry in chromium.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


def test_a_page_that_fetches_would_be_seen(chromium: Any, tmp_path: Path) -> None:
    """The checks above can fail."""
    page = tmp_path / "fetching.html"
    page.write_text("<img src='http://nowhere.test/a.png'><script>undefinedFunction()</script>")
    opened(chromium, page)
    events = [json.loads(entry["message"])["message"] for entry in chromium.get_log("performance")]
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert "http://nowhere.test/a.png" in asked
    assert any(entry["level"] == "SEVERE" for entry in chromium.get_log("browser"))


@pytest.mark.parametrize("kind", KINDS)
def test_the_slider_goes_through_the_states(chromium: Any, reports: dict[str, Path], kind: str) -> None:
    opened(chromium, reports[kind])
    slider = chromium.find_element(By.ID, "state")
    count = int(slider.get_attribute("max")) + 1
    result = json.loads((reports[kind].parent / "result.json").read_text())
    assert count == (len(result["states"]) if kind == "path" else {"angle": 9, "stiffness": 3}[kind])
    first = label(chromium), view(chromium)
    seen = {first}
    for _ in range(count - 1):
        slider.send_keys(Keys.ARROW_RIGHT)
        seen.add((label(chromium), view(chromium)))
    assert len({picture for _, picture in seen}) == count
    slider.send_keys(Keys.HOME)
    assert (label(chromium), view(chromium)) == first
    assert chromium.execute_script(CANVASES, chromium.find_element(By.CLASS_NAME, "stage"))[0][2] > 50


def test_stress_scale_and_colours_can_be_chosen(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["path"])
    before = view(chromium)
    chromium.find_element(By.CSS_SELECTOR, "#component option:nth-child(2)").click()
    other = view(chromium)
    assert chromium.find_element(By.ID, "middle").text.startswith("S22")
    chromium.find_element(By.ID, "common").click()
    common = view(chromium)
    scale = chromium.find_element(By.ID, "scale")
    scale.clear()
    scale.send_keys("3", Keys.TAB)
    assert len({before, other, common, view(chromium)}) == 4


def test_a_button_shows_the_peak(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["path"])
    result = json.loads((reports["path"].parent / "result.json").read_text())
    buttons = {each.text: each for each in chromium.find_elements(By.CSS_SELECTOR, "#marks button")}
    next(button for words, button in buttons.items() if words.endswith("peak") and "after" not in words).click()
    assert "peak: " in label(chromium)
    assert any(y == pytest.approx(result["peak"]["stress"], abs=1e-12) for _, y in chromium.execute_script(RINGS))


def test_play_goes_on_by_itself(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["angle"])
    first = label(chromium)
    chromium.find_element(By.ID, "play").click()
    WebDriverWait(chromium, 20).until(lambda browser: label(browser) != first)
    chromium.find_element(By.ID, "play").click()


@pytest.mark.parametrize("kind", KINDS)
def test_the_curves_are_drawn(chromium: Any, reports: dict[str, Path], kind: str) -> None:
    opened(chromium, reports[kind])
    boxes = chromium.find_elements(By.CLASS_NAME, "curve")
    assert len(boxes) == CURVES[kind]
    for box in boxes:
        width, height, _ = max(chromium.execute_script(CANVASES, box), key=lambda canvas: canvas[0])
        assert width > 400 and height > 200
    assert chromium.execute_script(LINES_DRAWN) == LINES[kind]


@pytest.mark.parametrize("kind", ["path", "angle"])
def test_rings_on_the_curves_are_at_the_state_shown(chromium: Any, reports: dict[str, Path], kind: str) -> None:
    opened(chromium, reports[kind])
    result = json.loads((reports[kind].parent / "result.json").read_text())
    chromium.find_element(By.ID, "state").send_keys(Keys.END)
    last = result[kind][-1]
    rings = chromium.execute_script(RINGS)
    wanted = [last["bonded"], last["open"], last["closed"]]
    if kind == "path":
        wanted += last["stress"]
    else:
        wanted += [last["stiffness"][i][j] for i, j in ((0, 0), (1, 1), (0, 1), (2, 2))]
    for value in wanted:
        assert any(y == pytest.approx(value, abs=1e-12) for _, y in rings)


@pytest.mark.parametrize("width", [1200, 500])
def test_the_page_fits_its_window(chromium: Any, reports: dict[str, Path], width: int) -> None:
    opened(chromium, reports["path"], width)
    inner, needed = chromium.execute_script("return [window.innerWidth, document.documentElement.scrollWidth]")
    assert needed <= inner


def test_the_page_can_be_printed(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["path"])
    assert len(chromium.print_page()) > 100_000  # base64 of a PDF


def test_names_of_a_case_are_words_not_programs(chromium: Any, reports: dict[str, Path]) -> None:
    name = json.loads((reports["path"].parent / "result.json").read_text())["case"]["name"]
    assert "<script>" in name
    opened(chromium, reports["path"])
    assert chromium.title.startswith(name)
    assert name in chromium.find_element(By.TAG_NAME, "h1").text
    assert chromium.execute_script("return window.hacked") is None
