"""Represent fibre outlines: discs, ellipses, rounded polygons and other convex curves; build them from table rows.

Imports nothing.  Main entries: `convex_sums.Outlines`, `shapes.SHAPES`.
"""

from typing import TYPE_CHECKING

from feti_homog.microstructure.shapes.ellipses import Conics, Discs, Ellipses
from feti_homog.microstructure.shapes.outlines import directions, gaps, on_circle

__all__ = ["Conics", "Discs", "Ellipses", "Outlines", "convex_sums", "directions", "gaps", "on_circle", "shapes"]

if TYPE_CHECKING:
    from feti_homog.microstructure.shapes.convex_sums import Outlines
else:
    Outlines = object  # cells without polygons do not load `convex_sums`
