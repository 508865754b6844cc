"""Results for readers: the printed summary, pictures, report.html, material cards.

Imports `materials`, `report.cards`, `report.text` and `results`.  Main entries: its own floors, from below `text`,
`plots`, `cards` and `page`.
"""

__all__ = ["page"]
