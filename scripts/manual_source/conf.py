"""Settings of Sphinx for `scripts/manual`, which puts the sources into build/manual_source."""

import sys
from importlib.metadata import distribution
from pathlib import Path

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(HERE), str(ROOT)]

from docstrings import add_filters  # noqa: E402
from pygments.lexers.special import TextLexer  # noqa: E402
from sphinx.highlighting import lexers  # noqa: E402

from feti_homog import __version__  # noqa: E402

project = "feti_homog"
author = "feti_homog authors"
release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.mathjax",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "autoapi.extension",
    "docstrings",
    "formulas",
    "repository_links",
]

myst_enable_extensions = ["alert", "amsmath", "colon_fence", "dollarmath", "html_image"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4

autoapi_dirs = [str(ROOT / "feti_homog")]
autoapi_root = "api"
autoapi_add_toctree_entry = False
autoapi_options = ["members", "undoc-members", "show-inheritance", "show-module-summary"]
autoapi_template_dir = str(HERE / "templates")
autoapi_prepare_jinja_env = add_filters
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
napoleon_use_ivar = True
default_role = "py:obj"
# autoapi does not see constants that are assigned several at a time; the annotation `type` is taken for a field.
suppress_warnings = ["autoapi.python_import_resolution", "ref.python"]

highlight_language = "none"
lexers["geo"] = TextLexer()  # files of gmsh
smartquotes = False

html_theme = "furo"
html_title = f"{project} {release}"
# MathJax in one file, with its fonts.
MATHJAX = distribution("sphinx-mathjax-offline").locate_file("sphinx-mathjax-offline/static/mathjax/tex-svg-full.js")
html_static_path = [str(HERE / "static"), str(MATHJAX)]
mathjax_path = MATHJAX.name
html_css_files = ["manual.css"]
html_copy_source = False
html_show_copyright = False


def setup(app):
    app.connect("html-page-context", _with_short_tree, priority=400)


def _with_short_tree(app, page, template, context, doctree):
    """Unfold the tree of pages only towards the page: whole trees would dominate the build."""
    tree = context["toctree"]
    if page.startswith("_modules/"):
        context["toctree"] = lambda **_: ""
    else:
        context["toctree"] = lambda **options: tree(**(options | {"collapse": True}))
