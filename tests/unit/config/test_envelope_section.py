"""The names of loads in [envelope]."""

from __future__ import annotations

from feti_homog.config import envelope_section
from feti_homog.mechanics import voigt


def test_names_are_those_of_results():
    for name in ("STRAINS", "STRESSES", "SPATIAL_STRAINS", "SPATIAL_STRESSES"):
        assert getattr(envelope_section, name) == getattr(voigt, name)
