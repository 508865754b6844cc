"""Names of phases, and the reserved ones."""

import re

MATRIX = "matrix"
"""What is around the fibres."""
FIBRE = "fibre"
"""The fibres of cells that name no phases."""
COATING = "coating"
"""The rings around fibres."""
VOID = "void"
"""Where there is no material."""
PHASE = re.compile(rf"(?!{VOID}$)[A-Za-z0-9_-]+(:(?![0-9]+$)[A-Za-z0-9_-]+|:[1-9][0-9]{{0,8}})?")
"""Any of them that has a material; numbers after the colon are from 1 to 999999999."""
FIBRE_PHASE = re.compile(rf"(?!({VOID}|{MATRIX}|{COATING})$)[A-Za-z0-9_-]+")
"""What fibres of a mix may be made of."""
