"""A Sphinx extension that leads links of the documents to pages of the manual.

A link to a folder or module of the repository goes to the page of its README.md, or to its page in the API reference. A
name in backticks below feti_homog, such as `mesh.mesh_fibres.unwrap`, links to the API reference.
"""

import re
from pathlib import PurePosixPath
from typing import Any

from docutils import nodes
from sphinx.addnodes import download_reference, pending_xref
from sphinx.application import Sphinx

PACKAGE = "feti_homog"
DOTTED = re.compile(r"[a-z_]+(\.\w+)+")


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("doctree-read", _lead_to_pages, priority=400)  # before downloads are collected, at 500
    app.connect("doctree-read", _link_names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _lead_to_pages(app: Sphinx, doctree: nodes.document) -> None:
    for link in list(doctree.findall(lambda node: isinstance(node, pending_xref | download_reference))):
        if link.get("reftype") != "myst" or link.get("refdomain") == "doc":
            continue
        place = app.env.relfn2path(link["reftarget"], link["refdoc"])[0]
        page = page_of(place, app.env.found_docs)
        if page:
            replaced = {"refdomain": "doc", "reftarget": page, "reftargetid": None}
            link.replace_self(pending_xref("", *link.children, **(link.attributes | replaced)))


def page_of(place: str, pages: set[str]) -> str | None:
    """Return the page of a folder or module, given relative to the repository; None if it has none."""
    path = PurePosixPath(place)
    module = f"api/{path.with_suffix('')}/index" if path.suffix in ("", ".py") else ""
    if path.name == "__init__.py":
        module = f"api/{path.parent}/index"
    return next((page for page in (f"{path}/README", module) if page in pages), None)


def _link_names(app: Sphinx, doctree: nodes.document) -> None:
    page = app.env.docname
    if page.startswith(f"{app.config.autoapi_root}/"):
        return
    for name in [node for node in doctree.findall(nodes.literal) if DOTTED.fullmatch(node.astext())]:
        target = f"{PACKAGE}.{name.astext().removeprefix(f'{PACKAGE}.')}"
        link = pending_xref("", refdomain="py", reftype="obj", reftarget=target, refdoc=page, refexplicit=True)
        name.replace_self(link)
        link += name
