"""Define names for types: NumPy arrays (docstrings give their shapes), documents such as result.json, communicators."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm as Intracomm
else:
    Intracomm = Any  # importing mpi4py.MPI starts MPI

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]
Bool = NDArray[np.bool_]
AnyInt = NDArray[np.integer[Any]]
Array = NDArray[Any]
Document = Mapping[str, Any]
