"""Results for readers: the printed summary, pictures, report.html, material cards.

Reads the files of `results`.  Main entries: its own floors, from below `text`, `plots`, `html` and `cards`.
"""
