"""Names of phases, and those that mean something to the program."""

from __future__ import annotations

import re

MATRIX = "matrix"
"""What is around the fibres."""
FIBRE = "fibre"
"""The fibres of cells that name no phases."""
COATING = "coating"
"""The rings around fibres."""
VOID = "void"
"""Where there is no material."""
PHASE = re.compile(rf"(?!{VOID}$)[A-Za-z0-9_-]+(:[A-Za-z0-9_-]+)?")
"""Any of them that has a material."""
FIBRE_PHASE = re.compile(rf"(?!({VOID}|{MATRIX}|{COATING})$)[A-Za-z0-9_-]+")
"""What fibres of a mix may be made of."""
