"""A Sphinx extension that leads links to folders and modules of the repository to their pages, as GitHub does.

A folder's page is its README.md; a module's is that of the API reference.
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Any

from docutils import nodes
from sphinx.addnodes import download_reference, pending_xref
from sphinx.application import Sphinx


def setup(app: Sphinx) -> dict[str, Any]:
    app.connect("doctree-read", _lead_to_pages, priority=400)  # before downloads are collected, at 500
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
    """The page of a folder or module, given relative to the repository; None if it has none."""
    path = PurePosixPath(place)
    module = f"api/{path.with_suffix('')}/index" if path.suffix in ("", ".py") else ""
    if path.name == "__init__.py":
        module = f"api/{path.parent}/index"
    return next((page for page in (f"{path}/README", module) if page in pages), None)
