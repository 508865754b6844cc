"""What a run leaves behind: result.json, result.h5 with result.xdmf, pictures and the printed summary."""

from __future__ import annotations

import os

# Debian's h5py chooses its MPI build when it is first imported.
os.environ.setdefault("H5PY_ALWAYS_USE_MPI", "1")
