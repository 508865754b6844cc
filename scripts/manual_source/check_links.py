"""Fail if a page of the manual links to a missing file or a missing place, or loads a file of another host.

Usage: check_links.py FOLDER
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

LOADED = {"img", "script", "link", "source", "iframe"}


class Page(HTMLParser):
    """References of an HTML file, (tag, address) pairs, and the names of its places."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[tuple[str, str]] = []
        self.places: set[str] = set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value for name, value in attrs if value}
        self.links += [(tag, values[name]) for name in ("href", "src") if name in values]
        self.places |= {values[name] for name in ("id", "name") if name in values}


def faults(folder: Path) -> list[str]:
    """Return a line for each broken reference and for each file that a page loads from another host."""
    pages = {path.resolve(): Page(path) for path in folder.rglob("*.html")}
    return [
        f"{path.relative_to(folder.resolve())}: <{tag}> {address}: {words}"
        for path, page in pages.items()
        for tag, address in page.links
        if (words := _fault(path, tag, address, pages))
    ]


def _fault(path: Path, tag: str, address: str, pages: dict[Path, Page]) -> str:
    parts = urlsplit(address)
    if parts.scheme or parts.netloc:
        return "of another host" if tag in LOADED and parts.scheme != "data" else ""
    target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
    if not target.is_file():
        return "no such file"
    if target in pages and parts.fragment and unquote(parts.fragment) not in pages[target].places:
        return "no such place in the page"
    return ""


if __name__ == "__main__":
    found = faults(Path(sys.argv[1]))
    print(*found, sep="\n", file=sys.stderr, end="\n" if found else "")
    sys.exit(bool(found))
