"""What numba compiles in this process while it goes on: that is no part of a method's time, and takes longer than many limits."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable

_count = 0


def compiled_so_far() -> int:
    """How many functions were compiled since `watch`; those loaded from numba's cache are not among them."""
    return _count


def watch(tell: Callable[[bool], None]) -> None:
    """From now on call tell(True) when numba begins to compile and tell(False) when it has ended, in whatever thread."""
    if "numba" not in sys.modules:
        return
    from numba.core.event import Event, Listener, register

    lock = threading.Lock()

    class Compilations(Listener):
        depth = 0

        def on_start(self, event: Event) -> None:
            with lock:
                self.depth += 1
                if self.depth == 1:
                    tell(True)

        def on_end(self, event: Event) -> None:
            global _count
            with lock:
                _count += 1
                self.depth -= 1
                if self.depth == 0:
                    tell(False)

    register("numba:compile", Compilations())
