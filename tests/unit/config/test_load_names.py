"""The names of loads in [envelope], [path] and [load]."""

from __future__ import annotations

from feti_homog.config import load_names
from feti_homog.mechanics import voigt


def test_names_are_those_of_results():
    for name in ("STRAINS", "STRESSES", "SPATIAL_STRAINS", "SPATIAL_STRESSES"):
        assert getattr(load_names, name) == getattr(voigt, name)
