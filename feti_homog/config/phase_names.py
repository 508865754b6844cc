"""Names of phases, and those that mean something to the program."""

from __future__ import annotations

import re

MATRIX = "matrix"
"""What is around the fibres."""
FIBRE = "fibre"
"""The fibres of cells that name no phases."""
COATING = "coating"
"""The rings around fibres."""
PHASE = re.compile(r"(?!void$)[A-Za-z0-9_-]+(:[A-Za-z0-9_-]+)?")
"""Any of them; "void" is where there is no material."""
FIBRE_PHASE = re.compile(rf"(?!(void|{MATRIX}|{COATING})$)[A-Za-z0-9_-]+")
"""What fibres of a mix may be made of."""
