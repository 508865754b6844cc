"""Aliases for NumPy's array types, whose shapes stand in docstrings, and for documents such as result.json."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Float32 = NDArray[np.float32]
Int = NDArray[np.int64]
Int32 = NDArray[np.int32]
Int8 = NDArray[np.int8]
Index = NDArray[np.intp]  # as NumPy itself numbers
Bool = NDArray[np.bool_]
AnyInt = NDArray[np.integer[Any]]
Array = NDArray[Any]
Document = Mapping[str, Any]
