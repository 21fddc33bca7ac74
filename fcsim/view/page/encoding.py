"""Arrays as text within a page: whole numbers of few bytes, differences from instant to instant, gzip, base64.

A browser undoes it in a few lines (`decode` in arrays.js): what changes little from one instant to the next costs little.
"""

from __future__ import annotations

import base64
import gzip
import math

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray

Encoded = dict[str, object]


def scaled(values: FloatArray) -> Encoded:
    """Values (n, ...), n instants or contacts, as int16 multiples of `scale`: to 1.6e-5 of the largest. What is not finite is 0."""
    finite = np.where(np.isfinite(values), values, 0.0)
    scale = float(np.abs(finite).max(initial=0.0)) / 32767 or 1.0
    return {**whole(np.round(finite / scale).astype(np.int16)), "scale": scale}


def whole(values: NDArray[np.integer]) -> Encoded:
    """Whole numbers (n, ...) of 1, 2 or 4 bytes: the first entry and differences along n, modulo the type's range; each byte of all
    numbers beside the same one of the others, where gzip finds what repeats."""
    rows = values.reshape(len(values), math.prod(values.shape[1:]))
    unsigned = rows.astype(rows.dtype.newbyteorder("<")).view(f"<u{rows.dtype.itemsize}")
    differences = np.diff(unsigned, axis=0, prepend=np.zeros((1, rows.shape[1]), unsigned.dtype))
    planes = np.ascontiguousarray(differences).view(np.uint8).reshape(-1, rows.dtype.itemsize).T
    packed = gzip.compress(np.ascontiguousarray(planes).tobytes(), 9, mtime=0)
    return {"type": rows.dtype.name, "row": rows.shape[1], "n": len(rows), "data": base64.b64encode(packed).decode("ascii")}


def largest(values: FloatArray) -> float:
    """The largest length of vectors (n, 3), or of numbers (n,); what is not finite counts as 0, as in `scaled`."""
    finite = np.where(np.isfinite(values), values, 0.0)
    return float((np.abs(finite) if finite.ndim == 1 else np.linalg.norm(finite, axis=1)).max(initial=0.0))


def size(content: object) -> int:
    """Bytes of all encoded arrays within nested lists and mappings."""
    if isinstance(content, dict):
        return sum(size(value) for value in content.values())
    if isinstance(content, list):
        return sum(map(size, content))
    return len(content) if isinstance(content, str) else 0
