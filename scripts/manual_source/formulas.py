"""A Sphinx extension that checks each formula during the build: MathJax would show faults only to readers."""

import re
from typing import Any

from docutils import nodes
from docutils.utils.math import MathError, pick_math_environment
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("doctree-read", _warn_of_faults)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _warn_of_faults(app: Sphinx, doctree: nodes.document) -> None:
    for node in doctree.findall(lambda node: isinstance(node, nodes.math | nodes.math_block)):
        if words := fault(node.astext()):
            logger.warning("formula %r: %s", node.astext(), words, location=node)


def fault(formula: str) -> str:
    """Return the part of a formula in TeX that docutils does not understand; empty if there is none."""
    formula = re.sub(r"\\tag\{[^{}]*\}", "", formula).strip()  # known to MathJax only
    outside = re.sub(r"\\begin\{(\w+\*?)\}.*?\\end\{\1\}", "", formula, flags=re.DOTALL)
    if r"\\" in outside:
        environment = pick_math_environment(formula)
        formula = rf"\begin{{{environment}}}{formula}\end{{{environment}}}"
    try:
        tex2mathml(formula)
    except MathError as error:
        return str(error)
    return ""
