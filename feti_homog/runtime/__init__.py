"""The process: memory, progress, locks of files, interrupts, standard streams; records that become documents.

May use `errors` alone.  Main entries: `progress.Progress`, `file_locks`, `standard_streams`.
"""
