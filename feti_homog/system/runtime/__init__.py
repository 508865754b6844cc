"""The process: memory, progress, locks of files, interrupts, standard streams; records that become documents.

Imports nothing.  Main entries: `progress.Progress`, `file_locks`, `standard_streams`.
"""
