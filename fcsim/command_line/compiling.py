"""What a command says while numba compiles: a first run takes a minute or two for that, in which nothing else would be seen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

PATIENCE = 3.0
"""[s] of compilation before it is spoken of: a kernel or two are compiled as fast as a step is made."""

COMPILING = "compiling what this run computes with"
"""How that line begins."""


@contextmanager
def saying_so(say: Callable[[str], None]) -> Iterator[None]:
    """Within the block one line is said, once functions have been compiled for `PATIENCE` seconds; what numba loads from its cache is
    not compiled."""
    from numba.core.event import Event, Listener, register, unregister

    class Compilations(Listener):
        """Told under numba's lock: by one thread at a time, a function that another one calls within this one."""

        depth, begin, spent, said = 0, 0.0, 0.0, False

        def on_start(self, event: Event) -> None:
            if self.depth == 0:
                self.begin = monotonic()
            self.depth += 1

        def on_end(self, event: Event) -> None:
            self.depth -= 1
            spent = self.spent + monotonic() - self.begin
            if self.depth == 0:
                self.spent = spent
            if spent > PATIENCE and not self.said:
                self.said = True
                say(f"{COMPILING}, once: up to two minutes, which later runs do not take")

    listener = Compilations()
    register("numba:compile", listener)
    try:
        yield
    finally:
        unregister("numba:compile", listener)
