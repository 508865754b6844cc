"""report.html as a reader has it: in Chromium, from a file, with no network to fetch from."""

import json
from pathlib import Path
from typing import Any

import pytest
from selenium.webdriver.common.by import By

KINDS = ("path", "angle", "stiffness")


def opened(chromium: Any, report: Path, width: int = 1200) -> None:
    """Open the page; drop the logs of earlier pages."""
    for log in ("browser", "performance"):
        chromium.get_log(log)
    chromium.set_window_size(width, 900)
    chromium.get(report.as_uri())


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


def test_pictures_are_drawn(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["stiffness"])
    images = chromium.find_elements(By.TAG_NAME, "img")
    assert len(images) >= 2 and all(image.get_property("naturalWidth") > 100 for image in images)


@pytest.mark.parametrize("width", [1200, 500])
def test_the_page_fits_its_window(chromium: Any, reports: dict[str, Path], width: int) -> None:
    opened(chromium, reports["path"], width)
    inner, needed = chromium.execute_script("return [window.innerWidth, document.documentElement.scrollWidth]")
    assert needed <= inner


def test_the_page_can_be_printed(chromium: Any, reports: dict[str, Path]) -> None:
    opened(chromium, reports["path"])
    assert len(chromium.print_page()) > 100_000  # base64 of a PDF


@pytest.mark.parametrize("kind", KINDS)
def test_no_table_runs_off_the_paper(chromium: Any, reports: dict[str, Path], kind: str) -> None:
    """A4 without Chromium's margins is 718 pixels wide; folded parts are printed, too."""
    chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    chromium.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 718, "height": 1046, "deviceScaleFactor": 1, "mobile": False}
    )
    try:
        opened(chromium, reports[kind])
        boxes = "return [...document.querySelectorAll('table, pre')].map(e => e.getBoundingClientRect().toJSON())"
        shown = chromium.execute_script(boxes)
        assert len(shown) >= 5 and all(box["right"] <= 719 and box["height"] > 0 for box in shown)
    finally:
        chromium.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
        chromium.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_names_of_a_case_are_words_not_programs(chromium: Any, reports: dict[str, Path]) -> None:
    name = json.loads((reports["path"].parent / "result.json").read_text())["case"]["name"]
    assert "<script>" in name
    opened(chromium, reports["path"])
    assert chromium.title.startswith(name)
    assert name in chromium.find_element(By.TAG_NAME, "h1").text
    assert chromium.execute_script("return window.hacked") is None
