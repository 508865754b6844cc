"""What a run leaves behind: files, the printed summary, pictures, report.

May use `homogenization` and the floors below it.  Main entries: its own floors, from
above `report`, `plots`, `text`, `files`.
"""
