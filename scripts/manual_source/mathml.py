"""A Sphinx extension that writes formulas as MathML: browsers show it without a script or a font from elsewhere.

A formula that cannot be read is a warning of the build.
"""

from __future__ import annotations

import re
from typing import Any, NoReturn

from docutils import nodes
from docutils.utils.math import MathError, pick_math_environment
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.util import logging

logger = logging.getLogger(__name__)


def setup(app: Sphinx) -> dict[str, Any]:
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(translator: Any, node: nodes.math) -> NoReturn:
    translator.body.append(_mathml(translator, node, node.astext(), block=False))
    raise nodes.SkipNode


def _block(translator: Any, node: nodes.math_block) -> NoReturn:
    # docutils knows no \tag: the number stands behind the formula.
    formula = re.sub(r"\\tag\{([^{}]*)\}", r"\\qquad\\text{(\1)}", node.astext().strip())
    if "\\\\" in formula and not formula.startswith("\\begin"):
        formula = f"\\begin{{{(name := pick_math_environment(formula))}}}{formula}\\end{{{name}}}"
    translator.body.append(translator.starttag(node, "div", CLASS="math"))
    translator.body.append(_mathml(translator, node, formula, block=True))
    translator.body.append("</div>\n")
    raise nodes.SkipNode


def _mathml(translator: Any, node: nodes.Element, formula: str, block: bool) -> str:
    try:
        return tex2mathml(formula, as_block=block)
    except MathError as error:
        logger.warning("formula %r: %s", formula, error, location=node)
        return f"<code>{translator.encode(formula)}</code>"
