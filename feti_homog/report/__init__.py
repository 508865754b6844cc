"""Results for readers: the printed summary, pictures, report.html, material cards.

Imports `materials`, `report.text` and `results`.  Main entries: its own floors, from below `text`, `plots`, `page` and
`cards`.
"""

__all__ = ["page"]
