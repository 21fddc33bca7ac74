"""Vectors as compressed chunks of an HDF5 file, without compressing again what stood in the file before."""

from __future__ import annotations

import hashlib
import zlib

import h5py
import numpy as np
from numpy.typing import NDArray

ENTRIES = 2**15
"""Of a chunk. Larger chunks make smaller files (W and M of the wall: a seventh less than in HDF5's own of 3000) and are more to compress
again where one entry moved."""

LEVEL = 3
"""Level 4, HDF5's default, takes a fifth more time for W and H and 2 % less room for M, none for W."""


class Compressor:
    """Writes vectors in chunks, shuffled and deflated as HDF5's own filters do it; every HDF5 reader takes them as they are.

    Over a series of files it remembers the chunks of each data set's last writing: one whose bytes are the same is stored as it was
    compressed then. Most of a simulation's problem stays from step to step, M but for the inertia of rotating rigid bodies, patterns and
    friction, and compressing it is most of the work of a file. The memory is that of one file, as large as it is on the disk.
    """

    def __init__(self) -> None:
        self._known: dict[str, dict[bytes, bytes]] = {}

    def write(self, group: h5py.Group, name: str, values: NDArray[np.generic]) -> None:
        """Write values (size,), size > 0, as the data set `name` of their type."""
        size = min(len(values), ENTRIES)
        dataset = group.create_dataset(
            name, values.shape, values.dtype, chunks=(size,), shuffle=True, compression="gzip", compression_opts=LEVEL
        )
        before, now = self._known.get(dataset.name, {}), dict[bytes, bytes]()
        for first in range(0, len(values), size):
            chunk = np.ascontiguousarray(values[first : first + size])
            digest = hashlib.sha256(f"{size} {chunk.dtype.str}".encode())
            digest.update(chunk)
            key = digest.digest()
            compressed = before.get(key) or now.get(key) or _compressed(chunk, size)
            dataset.id.write_direct_chunk((first,), compressed)
            now[key] = compressed
        self._known[dataset.name] = now


def _compressed(chunk: NDArray[np.generic], size: int) -> bytes:
    """A chunk as HDF5 stores it: filled up with zeros to its size, the first bytes of all entries, then the second ones, ..., deflated."""
    whole = np.zeros(size, chunk.dtype)
    whole[: len(chunk)] = chunk
    return zlib.compress(np.ascontiguousarray(whole.view(np.uint8).reshape(size, -1).T), LEVEL)
