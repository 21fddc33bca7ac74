"""The types of arrays, once: shapes and units stand in the docstrings of what takes and gives them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Matrix = Any  # a scipy.sparse array or a dense ndarray
