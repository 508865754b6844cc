"""Define the patterns of phase names, and the reserved names."""

import re

MATRIX = "matrix"
"""The phase around the fibres."""
FIBRE = "fibre"
"""The phase of fibres without a phase name."""
COATING = "coating"
"""The rings around fibres."""
VOID = "void"
"""Regions without material."""
PHASE = re.compile(rf"(?!-|{VOID}$)[A-Za-z0-9_-]+(:(?![0-9]+$)[A-Za-z0-9_-]+|:[1-9][0-9]{{0,8}})?")
"""A phase that has a material; numbers after the colon run from 1 to 999999999.  Spreadsheets evaluate "-1-1"."""
FIBRE_PHASE = re.compile(rf"(?!-|({VOID}|{MATRIX}|{COATING})$)[A-Za-z0-9_-]+")
"""A phase of the fibres in a mix."""
