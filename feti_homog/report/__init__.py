"""Present results to readers: the printed summary, pictures, report.html, material cards.

Imports `materials`, `report.cards`, `report.text` and `results`.  Main entries: the layers `text`, `plots`, `cards` and
`page`, from the lowest to the highest.
"""

__all__ = ["page"]
