"""sensitivities.png: the relative changes of constants by those of the parameters of a case, as a heat map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from feti_homog.report.plots.plot_helpers import plain
from feti_homog.report.text import sensitivity_tables

CELL = (0.95, 0.42)  # inches of an entry
LETTER = 0.085  # inches
FAINTEST = 0.005  # below which an entry has no number
DARK = 0.6  # share of the largest from which numbers are white


def figure(document: Mapping[str, Any]) -> Figure | None:
    """Return the elasticities d ln c / d ln p, a row for each p and a column for each c; None without sensitivities."""
    tables = sensitivity_tables.sensitivities(document)
    if not tables or not tables[0].rows:
        return None
    names = [plain(str(row[0])) for row in tables[0].rows]
    values = np.array([[np.nan if isinstance(entry, str) else entry for entry in row[1:]] for row in tables[0].rows])
    left = 0.4 + LETTER * max(map(len, names))
    size = left + CELL[0] * values.shape[1] + 1.2, 1.2 + CELL[1] * len(names)
    picture = Figure(figsize=size, layout="constrained")
    axes = picture.subplots()
    most = max(float(np.abs(values[np.isfinite(values)]).max(initial=0.0)), FAINTEST)
    image = axes.imshow(values, cmap="RdBu_r", norm=Normalize(-most, most), aspect="auto")
    for (row, column), value in np.ndenumerate(values):
        words = "-" if np.isnan(value) else f"{value:.2f}" if abs(value) >= FAINTEST else ""
        axes.text(column, row, words, ha="center", va="center", color="white" if abs(value) > DARK * most else "black")
    axes.set_xticks(range(values.shape[1]), [column.name for column in tables[0].columns[1:]])
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(length=0, labeltop=True, labelbottom=False)
    axes.spines[:].set_visible(False)
    picture.colorbar(image, ax=axes, label="relative change / relative change")
    title = "change of a constant (%) by a change of a parameter by 1 %"
    picture.suptitle(f"{plain(document['case'].get('name', ''))}: {title}".lstrip(": "), fontsize=11)
    return picture
