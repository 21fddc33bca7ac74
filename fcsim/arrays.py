"""The types of arrays, matrices and JSON values, once: shapes and units stand in the docstrings of what takes and gives them."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
type Matrix = sp.sparray | FloatArray
"""Sparse or dense; `isinstance(A, np.ndarray)` tells which."""
type Json = bool | int | float | str | list[Json] | dict[str, Json] | None
"""What a JSON file holds."""
