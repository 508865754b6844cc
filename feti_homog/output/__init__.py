"""What a run leaves behind: files, the printed summary, pictures, report, material cards.

May use `homogenization` and the floors below it.  Main entries: its own floors, from
above `cards`, `report`, `plots`, `text`, `files`.
"""
