"""A Chromium without a window and without a network, and reports of small runs."""

import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from support.base_case import BASE
from support.held_ports import held_ports
from support.jobs import mpirun

# Nothing listens there: whatever the page would ask a network for fails, and is in the log.
NOWHERE = "http://127.0.0.1:9"
ARGUMENTS = (
    "--headless=new",
    "--no-sandbox",  # Chromium refuses to run as root with it
    "--disable-dev-shm-usage",
    "--disable-gpu",
    "--disable-background-networking",
    f"--proxy-server={NOWHERE}",
    "--window-size=1200,900",
)
NAME = 'single <script>window.hacked = 1</script> & "fibre"'
PATH = """
[interface]
normal_strength = 5.0
tangential_strength = 5.0
[path]
strain = [0.2, 0.0, 0.0]
[output]
report = true
pictures = false
stress_unit = "GPa </script><script>window.hacked = 2</script>"
"""
ANGLE = """
[interface]
debonded = [{fibre = "all"}]
[angle]
values = [0, 90, 180]
[output]
report = true
pictures = false
"""
STIFFNESS = """
[output]
report = true
"""
ENDS = {"path": PATH, "angle": ANGLE, "stiffness": STIFFNESS}


@pytest.fixture(scope="session")
def reports(tmp_path_factory: Any) -> dict[str, Path]:
    """report.html of a run of each analysis."""
    folder, found = tmp_path_factory.mktemp("reports"), {}
    for kind, end in ENDS.items():
        case, out = folder / f"{kind}.toml", folder / kind
        text = BASE.replace("mesh_size = 0.05", "mesh_size = 0.2").replace('type = "stiffness"', f'type = "{kind}"')
        if kind == "stiffness":  # its estimates make the widest table
            text = text.replace('plane = "strain"', 'plane = "generalized"')
        case.write_text(f"name = '''{NAME}'''\n{text}{end}")
        run = mpirun(0, "-m", "feti_homog", "run", case, "--out", out)
        assert run.returncode == 0, run.stdout + run.stderr
        found[kind] = out / "report.html"
    return found


@pytest.fixture(scope="session")
def chromium() -> Iterator[Any]:
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or ""
    for argument in ARGUMENTS:
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    with ExitStack() as stack:
        (port,) = held_ports(stack, 1)
        browser = webdriver.Chrome(service=Service(shutil.which("chromedriver"), port=port), options=options)
        yield browser
        browser.quit()
