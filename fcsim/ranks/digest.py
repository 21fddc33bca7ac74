"""What stands for arrays where the arrays themselves are not there to compare with: on another rank, or no longer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fcsim.ranks._digest_kernels import digest as digest_of_words

WORD = 8  # bytes


def lanes(numbers: NDArray) -> bytes:
    """Of the bits of numbers, which are many: quick, and not proof against who means to deceive."""
    own = np.ascontiguousarray(numbers).reshape(-1).view(np.uint8)
    whole, out = own[: len(own) // WORD * WORD].view(np.uint64), np.empty(4, dtype=np.uint64)
    digest_of_words(whole if whole.flags.aligned else whole.copy(), out)
    return out.tobytes() + own[len(whole) * WORD :].tobytes()


def digest_of(*arrays: NDArray) -> bytes:
    """Of arrays with their shapes and types."""
    return b"".join(f"{array.dtype.str}{array.shape}".encode() + lanes(array) for array in arrays)
