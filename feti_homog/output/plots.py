"""The pictures of a result: the cell, the deformed cell of each load case, the tractions on a fibre."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from feti_homog.errors import FetiHomogError
from feti_homog.output import fields, results
from feti_homog.output.draw import Array, Drawing, drawing, on_nodes, on_triangles, outlines

COMPONENTS = ("S11", "S22", "S12")
CASES = ("E11", "E22", "G12")
AXIS_NAMES = {"E11": "E_{11}", "E22": "E_{22}", "G12": "\\gamma_{12}", "S11": "\\sigma_{11}"}
SYMBOLS = AXIS_NAMES | {"S22": "\\sigma_{22}", "S12": "\\sigma_{12}"}
MATRIX, FIBRES = "#e9e6df", ("Blues", "Oranges", "Greens", "Purples", "Reds", "Greys")
MESH_LINES = 8000  # triangles up to which their edges are drawn
STYLE = {"font.size": 11, "axes.titlesize": 12, "axes.linewidth": 0.8, "savefig.dpi": 200, "figure.dpi": 200}
