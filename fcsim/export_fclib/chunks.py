"""Vectors as compressed chunks of an HDF5 file, without compressing again what stood in the file before."""

from __future__ import annotations

import hashlib
import zlib
from functools import partial

import h5py
import numpy as np
from numpy.typing import NDArray

from fcsim.threads import side_by_side

ENTRIES = 2**15
"""Of a chunk. Larger chunks make smaller files (W and M of the wall: a seventh less than in HDF5's own of 3000) and are more to compress
again where one entry moved."""

LEVEL = 3
"""Level 4, HDF5's default, takes a fifth more time for W and H and 2 % less room for M, none for W."""


class Compressor:
    """Writes vectors in chunks, shuffled and deflated as HDF5's own filters do it; every HDF5 reader takes them as they are.

    Over a series of files it remembers the chunks of each data set's last writing: one whose bytes are the same is stored as it was
    compressed then. Most of a simulation's problem stays from step to step, M but for the inertia of rotating rigid bodies, patterns and
    friction, and compressing it is most of the work of a file, chunks side by side. The memory is that of one file, as large as it is on
    the disk.
    """

    def __init__(self) -> None:
        self._known: dict[str, dict[bytes, bytes]] = {}

    def write(self, group: h5py.Group, name: str, values: NDArray[np.generic]) -> None:
        """Write values (size,), size > 0, as the data set `name` of their type."""
        size = min(len(values), ENTRIES)
        dataset = group.create_dataset(
            name, values.shape, values.dtype, chunks=(size,), shuffle=True, compression="gzip", compression_opts=LEVEL
        )
        chunks = [np.ascontiguousarray(values[first : first + size]) for first in range(0, len(values), size)]
        keys, before = [_key(chunk, size) for chunk in chunks], self._known.get(dataset.name, {})
        fresh = {key: chunk for key, chunk in zip(keys, chunks, strict=True) if key not in before}
        made = side_by_side([partial(_compressed, chunk, size) for chunk in fresh.values()])
        now = {key: before[key] for key in keys if key in before} | dict(zip(fresh, made, strict=True))
        for k, key in enumerate(keys):
            dataset.id.write_direct_chunk((k * size,), now[key])
        self._known[dataset.name] = now


def _key(chunk: NDArray[np.generic], size: int) -> bytes:
    """What tells a chunk from others of other bytes, types or sizes."""
    digest = hashlib.sha256(f"{size} {chunk.dtype.str}".encode())
    digest.update(chunk)
    return digest.digest()


def _compressed(chunk: NDArray[np.generic], size: int) -> bytes:
    """A chunk as HDF5 stores it: filled up with zeros to its size, the first bytes of all entries, then the second ones, ..., deflated."""
    whole = np.zeros(size, chunk.dtype)
    whole[: len(chunk)] = chunk
    return zlib.compress(np.ascontiguousarray(whole.view(np.uint8).reshape(size, -1).T), LEVEL)
