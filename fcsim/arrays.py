"""The types of arrays, matrices and JSON values, once: shapes and units stand in the docstrings of what takes and gives them; and what is
a number, of which the arguments that are to be one are asked."""

from __future__ import annotations

import math
import sys
from typing import TypeGuard

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


def is_number(value: object, *, infinite: bool = False) -> TypeGuard[float]:
    """Whether a value is one real number, finite unless `infinite` allows others: an int that a float holds, a float, NumPy's, an array
    of no dimension. True, "0.3", None, NaN and other arrays are none."""
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value[()]
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return False
    if isinstance(value, int):
        return abs(value) <= sys.float_info.max
    return math.isfinite(value) or (infinite and not math.isnan(value))


def is_whole(value: object, least: int) -> TypeGuard[int]:
    """Whether a value is a whole number of at least `least`: an int or NumPy's; True and 2.0 are none."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= least)


def is_vector(values: object, size: int) -> bool:
    """Whether the values are a vector (size,) of finite numbers."""
    found = numbers_of(values)
    return found.shape == (size,) and bool(np.isfinite(found).all())


def numbers_of(values: object) -> FloatArray:
    """The values as floats in an array of their shape; an empty one (0,) for what are no real numbers: texts, truth values, functions."""
    try:
        given = np.asarray(values)
    except (TypeError, ValueError):  # rows of unlike lengths
        return np.empty(0)
    return given.astype(np.float64) if given.dtype.kind in "iuf" else np.empty(0)
