"""meshes/micrograph.csv: a window of random fibres in the form in which a micrograph is measured.

No micrograph is behind it.  The window is cut out of a periodic random cell of the program, 300 fibres of 50 %, so
that it is not periodic itself: fibres whose centres are in it are listed, in um, to 0.01 um, from the origin of a
stage.
"""

import numpy as np

from feti_homog.case.cell_section import Cell
from feti_homog.mesh.arrange import arrange

CELL = Cell(geometry="random", fibre_fraction=0.5, fibres=300, radius_spread=0.15, min_gap=0.04, seed=11)
RADIUS = 3.5  # um, in the mean
SHARE = np.array([0.9, 0.74])  # of the cell's sides
LEFT, BOTTOM = 1250.0, 830.0  # um
HEAD = "# Not measured: a window of a random cell, by tests/support/made_micrograph.py. Lengths in um."


def text() -> str:
    """Return the table."""
    whole = arrange(CELL)
    scale = RADIUS / whole.radii.mean()
    width, height = np.floor(scale * SHARE)
    centres, radii = np.round(scale * whole.centres, 2), np.round(scale * whole.radii, 2)
    inside = np.all((centres > 0) & (centres < [width, height]), axis=1)
    corner = f"# width = {width:g}, height = {height:g}, left = {LEFT:g}, bottom = {BOTTOM:g}"
    rows = np.column_stack([centres[inside] + [LEFT, BOTTOM], radii[inside]])
    return "\n".join([HEAD, corner, "x,y,radius", *(f"{x:.2f},{y:.2f},{r:.2f}" for x, y, r in rows.tolist()), ""])
