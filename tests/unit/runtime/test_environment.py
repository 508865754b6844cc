"""Settings of a process, and libraries that are optional."""

from __future__ import annotations

import sys

import pytest

from feti_homog.errors import LibraryError
from feti_homog.runtime import environment


def test_settings_of_the_user_stay():
    variables = {"OMP_NUM_THREADS": "4"}
    environment.prepare(variables)
    assert variables == environment.SETTINGS | {"OMP_NUM_THREADS": "4"}


def test_numpy_is_not_loaded_before_the_settings():
    import subprocess

    program = "import sys, feti_homog.__main__; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True).stdout == "False\n"


def test_a_report_without_its_libraries_is_refused_in_a_line(monkeypatch):
    environment.require_report()
    monkeypatch.setattr(environment, "find_spec", lambda name: None)
    with pytest.raises(LibraryError, match=r"^report.html needs bokeh and jinja2: pip install 'feti_homog\[report\]'$"):
        environment.require_report()
