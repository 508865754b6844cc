"""Read the labels of a picture's axes with their units, and the values that its legend names."""

from typing import Any

import numpy as np


def panels(figure: Any) -> list[tuple[str, str, dict[str, np.ndarray]]]:
    """Read the two labels of each panel of a Matplotlib figure, and by name the heights of its curves."""
    return [
        (
            axes.get_xlabel(),
            axes.get_ylabel(),
            {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.lines},
        )
        for axes in figure.axes
    ]


def curves(figure: Any) -> tuple[str, str, dict[str, np.ndarray]]:
    """Read labels and curves of a Bokeh figure."""
    named = {item.label.value: item.renderers[0] for item in figure.legend[0].items}
    heights = {name: np.asarray(drawn.data_source.data[drawn.glyph.y]) for name, drawn in named.items()}
    return figure.xaxis[0].axis_label, figure.yaxis[0].axis_label, heights
