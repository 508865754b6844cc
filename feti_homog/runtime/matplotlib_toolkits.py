"""Matplotlib's toolkits beside those of another Matplotlib on the same machine."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from pathlib import Path


def prefer_own_toolkits() -> None:
    """Let `mpl_toolkits` be found beside the `matplotlib` that will be imported; Matplotlib itself is not imported.

    An environment with --system-site-packages takes `matplotlib` from its own folder, but Debian's
    matplotlib-nspkg.pth has bound `mpl_toolkits` to Debian's at the start of Python: Matplotlib cannot import its 3-D
    axes from there, and says so whenever it is loaded.
    """
    matplotlib = find_spec("matplotlib")
    if matplotlib is None or matplotlib.origin is None:
        return
    own = Path(matplotlib.origin).parents[1] / "mpl_toolkits"
    if own.is_dir():
        toolkits = importlib.import_module("mpl_toolkits")
        toolkits.__path__ = [str(own), *(path for path in toolkits.__path__ if path != str(own))]
