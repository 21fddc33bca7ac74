"""What was just computed, kept for whoever asks for the same next: pure functions of small arrays that many parts of a step call."""

from __future__ import annotations

import threading
from collections.abc import Callable

from fcsim.arrays import FloatArray


class Recent:
    """The last values, read-only, of a function of arrays; equal arguments, bit by bit, give the very same array."""

    def __init__(self, function: Callable[..., FloatArray], count: int = 4) -> None:
        """count: how many values are kept; whoever came first goes first."""
        self._function, self._count = function, count
        self._values: dict[tuple[bytes, ...], FloatArray] = {}
        self._changing = threading.Lock()  # files of a step are written beside the next one

    def __call__(self, *arrays: FloatArray) -> FloatArray:
        """The function's value; one that is kept, if there is one."""
        key = tuple(array.tobytes() for array in arrays)
        value = self._values.get(key)
        if value is None:
            value = self._function(*arrays)
            value.setflags(write=False)
            with self._changing:
                while len(self._values) >= self._count:
                    del self._values[next(iter(self._values))]
                self._values[key] = value
        return value
