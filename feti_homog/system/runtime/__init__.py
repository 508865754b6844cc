"""The process: memory, progress, locks of files, signals, standard streams; records for documents.

Imports nothing.  Main entries: `progress_bar.Progress`, `file_locks`, `standard_streams`.
"""

from feti_homog.system.runtime.records import described

__all__ = [
    "described", "file_locks", "input_files", "process", "progress_bar", "records", "standard_streams",
]  # fmt: skip
