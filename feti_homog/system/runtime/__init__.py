"""The process: memory, progress, file locks, signals, standard streams; descriptions of record fields.

Imports nothing.  Main entries: `standard_streams.Progress`, `file_locks`, `input_files`.
"""

from feti_homog.system.runtime.records import described

__all__ = ["described", "file_locks", "input_files", "process", "records", "standard_streams"]
