"""Memory that the ranks of one machine have in common: each writes its rows of an array, and all have it, without copies.

A block is an anonymous file (memfd_create) of rank 0, which the others map as well: it has no name in /dev/shm, and is gone with the last
process that has it, however that ends. Blocks are kept for the next arrays of about their size. Nobody may write into an array that another
rank still reads: a rank notes which blocks it has let go of, and tells that when ranks meet; after that all know, without asking, which
blocks nobody has, and take the same ones for the same arrays.
"""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fcsim.arrays import IntArray

WORDS, BITS = 4, 62
MOST = WORDS * BITS
"""Blocks at a time: what is asked for beyond that is each rank's own."""

LEAST = 1 << 12
"""[bytes] Smaller arrays are exchanged as they are."""

IDLE = 1000
"""Meetings after which a block that nobody has asked for goes back to the system."""


class Meeting(Protocol):
    """Ranks that give each other numbers: own (k,) of all ranks, in their order (size, k)."""

    def __call__(self, own: IntArray) -> IntArray: ...


class _Block:
    """Memory of `size` bytes at an address; used: the meeting before which it was asked for last."""

    def __init__(self, size: int, memory: mmap.mmap) -> None:
        self.size, self._memory, self.used = size, memory, 0
        self.address = np.frombuffer(memory, dtype=np.uint8).ctypes.data


class _Lease:
    """What an array on a block has for its base: when that goes, with the array's last view, this rank has let go of the block."""

    def __init__(self, block: _Block, shape: tuple[int, ...], dtype: np.dtype, let_go: Callable[[], None]) -> None:
        self._block, self._let_go = block, let_go  # the block: its memory stays mapped as long as somebody reads it
        self.__array_interface__ = {"shape": shape, "typestr": dtype.str, "data": (block.address, False), "version": 3}

    def __del__(self) -> None:
        self._let_go()


def in_common(array: NDArray) -> bool:
    """Whether an array, or a view of one, lies in memory that ranks have in common."""
    base = array.base
    return isinstance(base.base if isinstance(base, np.ndarray) else base, _Lease)


class CommonMemory:
    """The blocks of `size` ranks of one machine, of which this is rank `number`. All ranks ask for the same arrays, in the same order."""

    def __init__(self, number: int, size: int, exchange: Meeting) -> None:
        """exchange: by which ranks meet."""
        self._number, self._size, self._exchange = number, size, exchange
        self._blocks: list[_Block | None] = []
        self._of_size: dict[int, list[int]] = {}  # their numbers: to look through all of them for each array takes longer than to meet
        self._free = 0  # which blocks nobody has, as of the last meeting
        self._released = 0  # which blocks this rank has let go of
        self._let_go: list[int] = []  # and since then, on any thread
        self._meetings, self._refused = 0, False

    @property
    def bytes(self) -> int:
        """What the blocks take."""
        return sum(block.size for block in self._blocks if block is not None)

    def array(self, shape: tuple[int, ...], dtype: DTypeLike) -> NDArray | None:
        """An array that all ranks have in common, of any numbers; None where there is no such memory, on all ranks alike."""
        kind = np.dtype(dtype)
        size = math.prod(shape) * kind.itemsize
        if size < LEAST or self._refused:
            return None
        place = self._place_of(_rounded(size))
        block = None if place is None else self._blocks[place]
        if place is None or block is None:
            return None
        self._free &= ~(1 << place)
        self._released &= ~(1 << place)
        block.used = self._meetings
        return np.asarray(_Lease(block, shape, kind, lambda: self._let_go.append(place)))

    def meet(self) -> None:
        """Wait for all ranks: what each has written before, all read after it."""
        while self._let_go:
            self._released |= 1 << self._let_go.pop()
        words = [self._released >> BITS * k & (1 << BITS) - 1 for k in range(WORDS)]
        free = -1
        for told in self._exchange(np.array(words, dtype=np.int64)).tolist():
            free &= sum(word << BITS * k for k, word in enumerate(told))
        self._free, self._meetings = free, self._meetings + 1
        if self._meetings % IDLE == 0:
            self._return_idle()

    def _place_of(self, size: int) -> int | None:
        """A block of the size that nobody has."""
        for place in self._of_size.get(size, ()):
            if self._free >> place & 1:
                return place
        empty = next((place for place, block in enumerate(self._blocks) if block is None), len(self._blocks))
        if empty == MOST:
            return None
        block = self._mapped(size)
        self._refused = block is None
        if block is None:
            return None
        self._blocks[empty : empty + 1] = [block]
        self._of_size.setdefault(size, []).append(empty)
        return empty

    def _return_idle(self) -> None:
        for place, block in enumerate(self._blocks):
            if block is not None and self._free >> place & 1 and block.used < self._meetings - IDLE:
                self._blocks[place] = None
                self._of_size[block.size].remove(place)
                self._free &= ~(1 << place)

    def _mapped(self, size: int) -> _Block | None:
        """A new block, None where a rank cannot have it."""
        own, memory, descriptor = np.zeros(2, dtype=np.int64), None, -1
        with suppress(OSError, AttributeError):  # no such call in this system
            if self._number == 0:
                descriptor = os.memfd_create("fcsim")
                os.posix_fallocate(descriptor, 0, size)  # a machine without memory says so here
                own[:] = os.getpid(), descriptor
        process, theirs = self._exchange(own)[0].tolist()
        with suppress(OSError, ValueError):
            if process:
                if self._number:
                    descriptor = os.open(f"/proc/{process}/fd/{theirs}", os.O_RDWR | os.O_CLOEXEC)
                memory = mmap.mmap(descriptor, size, flags=mmap.MAP_SHARED | getattr(mmap, "MAP_POPULATE", 0))
        everyone = self._exchange(np.array([memory is not None, 0], dtype=np.int64))[:, 0].all()
        if descriptor >= 0:
            os.close(descriptor)
        return _Block(size, memory) if memory is not None and everyone else None


def _rounded(size: int) -> int:
    """Up to an eighth more [bytes], in whole pages, so that arrays which grow from step to step take the same block."""
    step = max(mmap.PAGESIZE, 1 << max(0, size.bit_length() - 4))
    return -(-size // step) * step
