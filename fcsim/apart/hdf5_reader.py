"""What the process does that reads HDF5 files: it lists what a file holds, with the values of what is small or stored as it is.

A request is a line of JSON: {"path", "seconds", "memory"} for all that a file holds, and with {"name", "count"} for one array or the first
entries of a vector. An answer is a line of JSON that ends with the number of bytes which follow it: the arrays, see `_Answer`. Nothing is
read that lies in other files: links and data elsewhere are listed as such.
"""

from __future__ import annotations

import json
import os
import resource
import signal
import sys
import time
from typing import BinaryIO

import h5py
import numpy as np

from fcsim.apart.hdf5_content import About
from fcsim.memory import own_addresses

ENTRIES, DEPTH = 20_000, 12
"""More than any file of ours has."""
SMALL, PER_BYTE = 2**16, 8
"""[bytes] What is not larger, and not larger for each byte that it has in the file, is sent without being asked for."""
MANY_TEXTS = 10_000


class _Answer:
    """What is sent: `about` as JSON, which names the places of arrays in the bytes that follow."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._end = 0

    def store(self, values: np.ndarray) -> About:
        """Take an array: numbers as their bytes, texts of any length as lists."""
        if values.dtype.kind == "O":
            texts = [t if isinstance(t, bytes) else str(t).encode("utf-8", "surrogateescape") for t in values.ravel().tolist()]
            return {"shape": values.shape, "texts": [t.decode("latin-1") for t in texts]}
        place = self._end
        self._add(np.ascontiguousarray(values).tobytes())
        return {"dtype": values.dtype.str, "shape": values.shape, "at": place}

    def _add(self, part: bytes) -> None:
        part += b"\0" * (-len(part) % 16)  # what follows is aligned
        self._parts.append(part)
        self._end += len(part)

    def send(self, about: About, out: BinaryIO) -> None:
        out.write(json.dumps(about).encode() + b"\n%d\n" % self._end)
        out.writelines(self._parts)
        out.flush()


def _text(name: str | bytes) -> str:
    """A name; h5py gives bytes for those that are no UTF-8."""
    return name if isinstance(name, str) else name.decode("utf-8", "surrogateescape")


def _attribute(value: object, answer: _Answer) -> About:
    if isinstance(value, str):
        return {"text": value}
    values = np.asarray(value)
    if values.dtype.kind not in "fiubS":
        return {"text": repr(value)[:1000]}
    return answer.store(values)


def _attributes(entry: h5py.Group | h5py.Dataset, answer: _Answer) -> About:
    return {_text(name): _attribute(entry.attrs[name], answer) for name in entry.attrs}


def _numbers_or_texts(dataset: h5py.Dataset) -> bool:
    """Whether it holds numbers, switches, or texts: no references, no records."""
    kind = dataset.dtype.kind
    return kind in "fiubS" or (kind == "O" and h5py.check_string_dtype(dataset.dtype) is not None)


def _array(dataset: h5py.Dataset, answer: _Answer) -> About:
    stored = dataset.id.get_storage_size()
    elsewhere = bool(dataset.external) or dataset.is_virtual
    about = {"kind": "array", "dtype": dataset.dtype.str, "shape": dataset.shape, "stored": stored, "elsewhere": elsewhere}
    about["chunked"] = dataset.chunks is not None
    unpacked = dataset.size * dataset.dtype.itemsize if dataset.size is not None else None
    if unpacked is None:  # an empty dataspace
        return {**about, "shape": (0,), "dtype": "|V1"}
    few = unpacked <= max(SMALL, PER_BYTE * stored) and (dataset.dtype.kind != "O" or dataset.size <= MANY_TEXTS)
    if not elsewhere and few and _numbers_or_texts(dataset):
        about["values"] = answer.store(np.asarray(dataset[()], dtype=dataset.dtype))
    return about


def _entry(group: h5py.Group, name: str, depth: int, answer: _Answer, count: list[int]) -> About:
    """What is under a name; what cannot be read is said there, since it may not matter."""
    count[0] += 1
    if count[0] > ENTRIES:
        raise ValueError(f"groups in a circle, or more than {ENTRIES} entries")
    try:
        link = group.get(name, getlink=True)
        if not isinstance(link, h5py.HardLink):
            return {"kind": "link", "type": type(link).__name__}
        entry = group[name]
        if isinstance(entry, h5py.Dataset):
            return {**_array(entry, answer), "attributes": _attributes(entry, answer)}
        if not isinstance(entry, h5py.Group):
            return {"kind": "broken", "why": f"{type(entry).__name__}, neither group nor array"}
    except Exception as error:  # h5py raises anything on a damaged file
        return {"kind": "broken", "why": f"{type(error).__name__}: {error}"[:500]}
    return _group(entry, depth, answer, count)


def _group(group: h5py.Group, depth: int, answer: _Answer, count: list[int]) -> About:
    if depth > DEPTH:
        return {"kind": "broken", "why": f"groups in a circle, or deeper than {DEPTH}"}
    try:
        names, attributes = list(group), _attributes(group, answer)
    except Exception as error:  # h5py raises anything on a damaged file
        return {"kind": "broken", "why": f"{type(error).__name__}: {error}"[:500]}
    return {
        "kind": "group",
        "attributes": attributes,
        "entries": {_text(name): _entry(group, name, depth + 1, answer, count) for name in names},
    }


def _read(request: About, answer: _Answer) -> About:
    path = os.fsencode(request["path"])
    if not h5py.is_hdf5(path):
        return {"error": "expected an HDF5 file, got something else"}
    with h5py.File(path, "r") as file:
        if "name" not in request:
            return _group(file, 0, answer, [0])
        dataset, count = file[request["name"]], request["count"]
        values = dataset[()] if count is None or dataset.ndim != 1 else dataset[: max(count, 0)]
        return answer.store(np.asarray(values, dtype=dataset.dtype))


def _limit(request: About, own: int) -> None:
    """Seconds of the processor and bytes of addresses for this request alone."""
    for what, most in ((resource.RLIMIT_CPU, int(time.process_time()) + request["seconds"]), (resource.RLIMIT_AS, own + request["memory"])):
        hard = resource.getrlimit(what)[1]
        resource.setrlimit(what, (most if hard == resource.RLIM_INFINITY else min(most, hard), hard))


def main() -> int:
    """Answer until there is nobody to ask."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for those who ask
    requests, out = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what libraries print is no answer
    for what in (resource.RLIMIT_CORE, resource.RLIMIT_FSIZE):  # it writes nothing
        resource.setrlimit(what, (0, 0))
    own = int(own_addresses())
    for line in requests:
        answer, request = _Answer(), json.loads(line)
        _limit(request, own)
        try:
            about = _read(request, answer)
        except Exception as error:  # h5py raises anything on a damaged file
            answer, about = _Answer(), {"error": f"the HDF5 file is truncated or damaged: {error}"[:1000]}
        answer.send(about, out)
    return 0
