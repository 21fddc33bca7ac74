"""What work costs, counted, and what is decided by it: whether a matrix of contacts or of bodies is stored and eliminated dense or sparse.

Operations, bytes and small steps of an algorithm times three rates of a machine. Only ratios of costs decide anything, so the rates are
those of one reference machine, fixed: no clock takes part, and runs repeat bit by bit everywhere.

The graphs of contacts and bodies are those of packings and walls, whose elimination fills in little: its cost grows with the entries, that
of dense elimination with the cube of the size. This is the one place that decides; a problem's W is asked for by `Delassus.elimination`,
which knows contacts that come in joints besides.
"""

from __future__ import annotations

from dataclasses import dataclass

REAL = 8
"""Bytes of a number."""


@dataclass(frozen=True)
class Work:
    """Operations [flops], memory read and written [bytes], small steps (calls on short vectors)."""

    flops: float = 0.0
    bytes: float = 0.0
    steps: float = 0.0

    def __add__(self, other: Work) -> Work:
        return Work(self.flops + other.flops, self.bytes + other.bytes, self.steps + other.steps)

    def __rmul__(self, times: float) -> Work:
        return Work(times * self.flops, times * self.bytes, times * self.steps)


@dataclass(frozen=True)
class Machine:
    """Its three rates: dense linear algebra [flops/s], memory [bytes/s], the overhead of a small step [s]."""

    flops: float
    bytes: float
    step: float

    def seconds(self, work: Work) -> float:
        return work.flops / self.flops + work.bytes / self.bytes + work.steps * self.step


REFERENCE = Machine(flops=2.5e10, bytes=1.5e10, step=3e-6)
"""One core of a common processor of 2020; a step: a call of NumPy, LAPACK or a compiled function from Python, on a short vector."""

FILLED = 0.2
"""Share of the entries from which elimination fills in most of the rest, so that it is dense whatever the size."""
PASSES = 94
"""Times that sparse elimination and its solve read or write an entry with its index: 50 ns each, measured at 4 to 14 % of the entries."""
STEPS = 50
"""Small steps of handing a sparse matrix over."""
DENSE_UP_TO = 12_000
"""Unknowns up to which a dense factor is affordable (1.1 GB)."""
BLOCK_UP_TO = 1000
"""Unknowns of a body up to which its own matrix is factored dense, however sparse: many right-hand sides are solved for with it."""
SPARSE_FROM, SPARSE_FROM_RIGID, SUM_FILLED, SUM_UP_TO = 1000, 384, 0.4, 3000
"""While W is summed up over bodies: unknowns up to which it is dense (8 MB), and those of rigid bodies alone; from there on it is by block
rows where less than this share of the blocks is there, since joints may still be found in it, and always above so many unknowns (72 MB).
W of rigid bodies is mostly multiplied and swept, hardly ever eliminated: dense and then stored by block rows towers of 300 contacts took
1.4 times as long. The compiled front door, up to 384 unknowns, reads a dense one."""


def eliminated_dense(size: int, entries: int, steps: int = STEPS) -> bool:
    """Whether the LU of a matrix of that size with so many entries costs less dense than sparse; steps: small ones of the sparse way."""
    if size > DENSE_UP_TO:
        return False
    sparse = Work(bytes=PASSES * REAL * entries, steps=steps)
    return fills_in(size, entries) or REFERENCE.seconds(Work(flops=2 / 3 * size**3)) <= REFERENCE.seconds(sparse)


def fills_in(size: int, entries: int) -> bool:
    """Whether elimination fills in most of a matrix of that size with so many entries, and a dense factor is affordable."""
    return size <= DENSE_UP_TO and entries >= FILLED * size**2


def sparse_from(*, rigid: bool) -> int:
    """Unknowns up to which W is dense while it is summed up over bodies, all of them `rigid` or not."""
    return min(SPARSE_FROM, SPARSE_FROM_RIGID) if rigid else SPARSE_FROM


def summed_dense(size: int, entries: int, *, rigid: bool = False) -> bool:
    """Whether W of so many entries is stored dense while it is summed up over bodies; `entries` is not looked at up to `sparse_from`."""
    return size <= sparse_from(rigid=rigid) or (size <= SUM_UP_TO and entries >= SUM_FILLED * size**2)
