"""energy.png: the energies along a path, stacked, and the work of the loads, which they make up."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from feti_homog.report.plots.plot_helpers import plain, unit_label
from feti_homog.results import path_curves

# Of the parts in the order of `path_curves.energies`.
AREAS = {
    "stored in the bodies": "#9db8de",
    "stored in springs": "#5d86c4",
    "fracture energy": "#d98a54",
    **{f"{lost} beyond it": "#f0cfb3" for lost in path_curves.LOST.values()},
    **dict.fromkeys(path_curves.LOST.values(), "#d98a54"),
    "heat of friction": "#b8455f",
}


def figure(document: Mapping[str, Any]) -> Figure | None:
    """Return the energies per area along a path, stacked over the position on it; None of results without them."""
    stack = path_curves.energies(document)
    if stack is None:
        return None
    case = document["case"]
    picture = Figure(figsize=(7.2, 4.2), layout="constrained")
    axes = picture.subplots()
    colours = [AREAS[name] for name in stack.parts]
    axes.stackplot(stack.place, *stack.parts.values(), labels=[*stack.parts], colors=colours)
    axes.plot(stack.place, stack.work, color="0.15", linewidth=1.2, label="work of the loads")
    for leg in range(1, path_curves.legs(document)) if stack.by_legs else ():
        axes.axvline(leg, color="0.6", linewidth=0.6, linestyle=":")
    axes.set_xlim(stack.place[0], stack.place[-1])
    axes.set_ylim(bottom=min(0.0, float(stack.work.min())))
    axes.set_xlabel(stack.words)
    axes.set_ylabel(f"energy per area {unit_label(case['output'].get('stress_unit', '')) or '(unit of the moduli)'}")
    axes.set_title(f"{plain(case.get('name', ''))}: energies along the path".lstrip(": "))
    axes.spines[["top", "right"]].set_visible(False)
    handles, names = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], names[::-1], frameon=False, fontsize=9, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return picture
