"""Provide helpers for all pictures: style, triangles and lines, colour ranges, labels."""

import io
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import TriMesh
from matplotlib.colors import Colormap, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Path2D
from matplotlib.tri import Triangulation

from feti_homog.case import bond_laws, interface_section
from feti_homog.errors import escaped
from feti_homog.materials import voigt
from feti_homog.report.plots.decimation import DrawnMesh, node_means, triangle_means
from feti_homog.report.text.tables import with_micro
from feti_homog.results import atomic, path_curves
from feti_homog.typing import Array, Document

# Symbols of macroscopic strains and stresses by name, and of local stresses.
SYMBOLS = {
    **{name: f"{name[:-2].replace('gamma', chr(92) + 'gamma')}_{{{name[-2:]}}}" for name in voigt.SPATIAL_STRAINS},
    **{name: rf"\Sigma_{{{name[1:]}}}" for name in voigt.SPATIAL_STRESSES},
    "temperature": r"\Delta{T}",  # without a space, at which titles are wrapped
}
DERIVED = {"von_mises": r"\sigma_{vM}", "principal": r"\sigma_{1}"}  # from all components
STRESS_SYMBOLS = {name: rf"\sigma_{{{name[1:]}}}" for name in voigt.SPATIAL_STRESSES} | DERIVED
# Table of each stress in a state of result.h5, and its column if the table has several.
STRESS_TABLES: dict[str, tuple[str, int | None]] = {
    **{name: ("stress", column) for column, name in enumerate(voigt.STRESSES)},
    "S33": ("stress_33", None),
    **{name: ("axial_stress", column) for column, name in enumerate(voigt.AXIAL_STRESSES)},
    **dict.fromkeys(DERIVED, ("stress_33", None)),  # and the tables of all other components
}
OUTLIERS = 0.005  # area fraction that may lie outside a colour range, at either end
# Colours of curves, by Okabe and Ito: colour-blind readers can tell them apart.
INK = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# Colours of macroscopic stresses: a component has the same colour in all pictures.
STRESS_INK = dict(zip(("S11", "S22", "S12", "S33", "S23", "S13"), INK, strict=False))
ENTRY_INK = dict(zip(("C11", "C22", "C33", "C12", "C44", "C55", "C66"), INK, strict=True))  # colours of entries
MESH = "0.4"  # colour of element sides
NARROW = 5.0  # inches; panels of narrower pictures are stacked, and have short labels
LEAST_TEXT = 7.5  # points; journals take no smaller text
STYLE = {
    "font.size": 10, "axes.titlesize": "medium", "figure.titlesize": "medium", "axes.spines.top": False,
    "axes.spines.right": False, "legend.frameon": False, "legend.columnspacing": 1.2, "legend.handlelength": 1.6,
}  # fmt: skip
DPI = 200


@dataclass(frozen=True)
class Look:
    """The format, size and title of pictures.

    Attributes:
        format: file format, "png", "pdf" or "svg".
        size: width and height in centimetres; None keeps the size of each picture.
        title: text above the picture; None keeps the title of each picture.
    """

    format: str = "png"
    size: tuple[float, float] | None = None
    title: str | None = None

    @property
    def style(self) -> dict[str, Any]:
        """Return Matplotlib's style parameters, with smaller text in a small picture."""
        width = 18.0 if self.size is None else self.size[0]
        return STYLE | {"font.size": max(10.0 * min(width / 18.0, 1.0), LEAST_TEXT)}

    def figure(self, width: float, height: float, layout: Any = "constrained") -> Figure:
        """Return an empty figure of the chosen size, else of `width` and `height` in inches."""
        size = (width, height) if self.size is None else (self.size[0] / 2.54, self.size[1] / 2.54)
        return Figure(figsize=size, layout=layout)


PLAIN = Look()


def save(figure: Figure, path: Path, look: Look = PLAIN) -> Path:
    """Write the figure in the format of `look`; return the file path.

    Pictures without a chosen size have no margins.  Raises FetiHomogError if the file cannot be written.
    """
    if look.title is not None:
        set_title: Any = figure.suptitle if figure.get_suptitle() else figure.axes[0].set_title
        set_title(plain(look.title)).set_in_layout(bool(look.title))  # without a band for an empty title
    for text in [*figure.texts, *(axes.title for axes in figure.axes)]:
        text.set_wrap(True)
    # Level 4 compresses in a third of the time of the default, 6, to files that are 3 % larger.
    more = {"pil_kwargs": {"compress_level": 4}} if look.format == "png" else {}
    how: dict[str, Any] = {"format": look.format, "dpi": DPI, "bbox_inches": None if look.size else "tight"} | more
    with missing_letters_as_boxes(), io.BytesIO() as content:  # Matplotlib would raise other errors on a full disk
        figure.savefig(content, **how)
        return atomic.replace(path.with_suffix(f".{look.format}"), lambda part: part.write_bytes(content.getvalue()))


@contextmanager
def missing_letters_as_boxes() -> Iterator[None]:
    """Context manager: silence warnings about letters that the font lacks.  Matplotlib draws boxes instead."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"Glyph \d+")
        yield


def finish_curves(*panels: Axes) -> None:
    """Add faint grids to the panels of a figure, and below them a legend of all panels that have none of their own."""
    for axes in panels:
        faint_grid(axes)
    labelled = {h.get_label(): h for a in panels if a.get_legend() is None for h in a.get_legend_handles_labels()[0]}
    legend_below(panels[0].figure, [*labelled.values()])


def legend_below(figure: Any, handles: Sequence[Any], limit: int = 5) -> None:
    """Add a legend below the axes.  It has as many columns as fit into the figure, at most `limit`."""
    for columns in range(min(len(handles), limit), 0, -1):
        legend = figure.legend(handles=handles, loc="outside lower center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            break
        legend.remove()


def faint_grid(axes: Axes) -> None:
    """Draw a faint grid behind the content of the axes."""
    axes.grid(color="0.92", linewidth=0.6)
    axes.set_axisbelow(True)


def shade_triangles(axes: Axes, drawn: DrawnMesh, points: Array, values: Array, norm: Normalize, colours: Any) -> Any:
    """Draw triangles in smooth colours by nodal values (p,) at `points` (p, 2).  Returns the drawn mesh."""
    mesh = add_triangles(axes, points, drawn.triangles)
    mesh.set(array=values, norm=norm, cmap=colours)
    return mesh


def add_triangles(axes: Axes, points: Array, triangles: Array) -> TriMesh:
    """Add triangles to the axes as pixels, also in vector graphics.

    Matplotlib's `tripcolor` makes paths of all triangles to find limits, which takes longer than the rest of a plot.
    """
    x, y = points.T
    mesh = TriMesh(Triangulation(x, y, triangles), rasterized=True)
    mesh.set_in_layout(False)
    axes.add_collection(mesh, autolim=False)
    axes.update_datalim(points)
    return mesh


def draw_segments(
    axes: Axes, segments: Array, colour: str, width: float, cap: Literal["butt", "round"] = "butt"
) -> None:
    """Draw segments (e, 2, 2) as one path, without darker joints."""
    path = Path2D(segments.reshape(-1, 2), [Path2D.MOVETO, Path2D.LINETO] * len(segments))
    lines = PathPatch(path, fill=False, edgecolor=colour, linewidth=width, capstyle=cap, snap=False)
    axes.add_artist(lines)
    lines.set_clip_path(axes.patch)
    axes.update_datalim(path.vertices)  # as `add_patch` does, one segment after the other


def colour_range(values: Array, areas: Array | None = None) -> tuple[Normalize, Colormap, str]:
    """Choose the colour range and the colour map of a stress.

    Zero is white, tension red and pressure blue in all pictures.  The range is the `value_range` of values (n,) or
    (states, n), or symmetric about zero if tension and pressure are similar.  Without `areas` (n,), the many small
    elements at tips, where stresses are singular, widen the range.  Returns range, map, and ends like `value_range`.
    """
    norm, extend = value_range(values, areas)
    bottom, top = float(norm.vmin or 0.0), float(norm.vmax or 0.0)
    largest = max(-bottom, top) or 1.0
    if min(-bottom, top) > 0.5 * largest:
        bottom, top = -largest, largest
        norm, extend = Normalize(bottom, top), _outside(values, bottom, top)
    # A range far from zero still begins with a light colour.
    first, last = min(0.5 + 0.5 * bottom / largest, 0.55), max(0.5 + 0.5 * top / largest, 0.45)
    colours: Any = ListedColormap(mpl.colormaps["RdBu_r"](np.linspace(first, last, 256)))
    colours.colorbar_extend = extend
    return norm, colours, extend


def value_range(values: Array, areas: Array | None = None) -> tuple[Normalize, str]:
    """Choose the colour range of a field.

    At most 0.5 % of `areas` (None: equal areas) lies beyond either end, in each state of values (states, n).  A field
    uniform to 1 % has one colour.  Returns the range, and the ends with values beyond: "min", "max", "both", "neither".
    """
    low, high = float(values.min()), float(values.max())
    if high - low <= 0.01 * max(abs(low), abs(high), 1e-300):
        middle = 0.5 * (low + high)
        half = 0.5 * (abs(middle) or 1.0)
        return Normalize(middle - half, middle + half), "neither"
    # Like numpy.percentile, weighted by area.
    ends = []
    for state in np.atleast_2d(values):
        order, weights = np.argsort(state), np.ones_like(state) if areas is None else areas
        below = np.cumsum(weights[order]) - weights[order]
        ends.append(np.interp([OUTLIERS, 1.0 - OUTLIERS], below / max(float(below[-1]), 1e-300), state[order]))
    bottom, top = float(np.min(ends)), float(np.max(ends))
    slack = 0.05 * (top - bottom)
    bottom, top = (low if bottom - low < slack else bottom), (high if high - top < slack else top)
    return Normalize(bottom, top), _outside(values, bottom, top)


def _outside(values: Array, bottom: float, top: float) -> str:
    beyond = bool(values.min() < bottom), bool(values.max() > top)
    return {(True, True): "both", (True, False): "min", (False, True): "max"}.get(beyond, "neither")


def magnification(displacement: float, size: float, opening: float = 0.0, largest: float = math.inf) -> float:
    """Choose a displacement factor: 1, 2 or 5 times a power of ten.

    The factor is at most `largest`, and 1 without displacement.  The largest displacement is drawn as about a tenth of
    the cell size, or up to a quarter to show a narrow opening.
    """
    if displacement == 0.0:
        return 1.0
    ideal = 0.1 * size / displacement
    if opening > 0.0:
        ideal = max(ideal, min(0.04 * size / opening, 0.25 * size / displacement))
    power = 10.0 ** math.floor(math.log10(min(ideal, largest)))
    rounded = [factor * power for factor in (1, 2, 5, 10) if factor * power <= largest]
    return min(rounded, key=lambda scale: abs(math.log(scale / ideal)))


def stress_component(chosen: str, states: Sequence[Any]) -> str:
    """Return `chosen` or, for "auto", the stress conjugate to the largest strain of the states.

    Strains without a macroscopic stress are left out, unless no stress acts at all.
    """
    if chosen != "auto":
        return chosen
    strains, stresses = (np.array([state.attrs[name] for state in states]) for name in ("strain", "stress"))
    loaded = path_curves.components_above(path_curves.FAINT, stresses) or list(range(strains.shape[1]))
    return voigt.voigt_names(strains.shape[1])[1][loaded[int(np.abs(strains[:, loaded]).max(axis=0).argmax())]]


def nodal_stress(state: Any, component: str, drawn: DrawnMesh) -> Array:
    """Return the stress at each drawn node (p,): the mean over the adjacent triangles of its body."""
    name, column = STRESS_TABLES[component]
    table = state[name]
    if component in DERIVED:  # by element means, as in `viewed_states`
        shears = state["axial_stress"][:] if "axial_stress" in state else np.zeros((len(table), 2))
        parts = state["stress"][:], table[:], shears
        table = voigt.spatial_von_mises(*parts) if component == "von_mises" else voigt.spatial_principal(*parts)[:, 0]
    return node_means(triangle_means(table, column, drawn), drawn)


def bond_limits(case: Document) -> list[str]:
    """Describe every interface law in one line.  With several laws, the lines begin with the phases."""
    bonds, output = interface_section.interface_tables(case) or [{}], case.get("output", {})
    stress, length = (with_micro(output.get(name, "")) for name in ("stress_unit", "length_unit"))
    units = stress, f"{stress} {length}" if stress and length else ""
    if len(bonds) == 1:
        return [_limits(bonds[0], units)]
    return [f"{plain('-'.join(bond['between']))}: {_limits(bond, units)}" for bond in bonds]


def _limits(bond: Document, units: tuple[str, str]) -> str:
    """Describe an interface law; `units` are for stresses and for energies per area."""
    criterion, (stress, energy) = bond.get("criterion", bond_laws.DEFAULT), units
    law, phrases = bond_laws.LAWS[criterion], list[str]()
    for symbol, key, of_stress in law.symbols:
        if bond.get(key):
            phrases.append(f"${symbol}={bond[key]:g}$ {plain(stress if of_stress else energy)}".rstrip())
    name = f"{criterion} law" if law.softens else f"law {criterion}"
    return ", ".join([name, *phrases]) if phrases else "no debonding by load"


def plain(text: str) -> str:
    """Escape control characters of a user's text, and dollar signs, which mark Matplotlib's formulas."""
    return escaped(text, "\n").replace("$", r"\$")


def unit_label(label: str) -> str:
    return f"({plain(with_micro(label))})" if label else ""


def stress_label(label: str) -> str:
    """Return the stress unit for an axis.  Without a `label` it is the unit of the moduli."""
    return unit_label(label) or "(unit of the moduli)"


def stress_unit(case: Document) -> str:
    """Return the stress unit of a case for an axis."""
    return stress_label(case.get("output", {}).get("stress_unit", ""))


def title_of(case: Document, phrase: str) -> str:
    """Join the case name, if any, and `phrase` to a title."""
    return f"{plain(case.get('name', ''))}: {phrase}".lstrip(": ")
