"""The names of macroscopic stresses and strains, in Voigt order."""

from __future__ import annotations

STRESSES, STRAINS = ("S11", "S22", "S12"), ("E11", "E22", "gamma12")
SPATIAL_STRESSES = ("S11", "S22", "S33", "S23", "S13", "S12")
SPATIAL_STRAINS = ("E11", "E22", "E33", "gamma23", "gamma13", "gamma12")
TEMPERATURE = "temperature"
