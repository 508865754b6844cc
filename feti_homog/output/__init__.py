"""What a run leaves behind: files, the printed summary, pictures, report.

May use `homogenization` and the floors below it.  Main entries: its own floors, from
above `report`, `plots`, `text`, `files`.
"""

from __future__ import annotations

import os

# Debian's h5py chooses its MPI build when it is first imported.
os.environ.setdefault("H5PY_ALWAYS_USE_MPI", "1")
