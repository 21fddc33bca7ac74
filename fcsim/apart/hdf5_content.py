"""What an HDF5 file holds, as another process has read it: groups, arrays, and what is neither."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import InputError

type About = dict[str, Any]  # JSON between two processes: each key's type is the sender's
type Asked = Callable[[str, int | None], tuple[About, bytearray]]
"""(name, count) -> the array of that name, of a vector the first `count` entries: what it is, and its bytes."""


@dataclass(frozen=True)
class Content:
    """Where the arrays come from that were not sent with the rest."""

    asked: Asked


def decoded(line: bytes) -> About:
    """An answer's JSON; InputError where it is none, which a reader gone mad may send."""
    try:
        found = json.loads(line)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise InputError("expected an HDF5 file, got one that makes its reader say nothing")
    return found


def _values(about: About, values: bytearray) -> Any:  # what JSON or the array says
    """An array, or what is in one without axes: a number, a text in bytes."""
    shape = tuple(about["shape"])
    if "texts" in about:
        texts = np.empty(len(about["texts"]), dtype=object)
        texts[:] = [text.encode("latin-1") for text in about["texts"]]
        return texts.reshape(shape)[()]
    dtype, count = np.dtype(about["dtype"]), int(np.prod(shape, dtype=np.int64))
    if count == 0:
        return np.zeros(shape, dtype)
    return np.frombuffer(values, dtype, count, about["at"]).reshape(shape)[()]


@dataclass(frozen=True)
class Link:
    """A link that leads elsewhere, and is not followed: its kind in h5py, as ExternalLink."""

    kind: str


class _Entry:
    def __init__(self, about: About, name: str, values: bytearray, content: Content) -> None:
        self.name, self._about, self._bytes, self._content = name, about, values, content

    @property
    def attrs(self) -> About:
        """Numbers, arrays and texts by name."""
        entries = self._about["attributes"].items()
        return {name: about["text"] if "text" in about else _values(about, self._bytes) for name, about in entries}


class Array(_Entry):
    """An array of a file: its values are asked for by `array[()]`, those of a vector's head by `array[:count]`.

    stored: bytes that it takes in the file; elsewhere: whether its values lie in other files (they cannot be asked for)
    """

    @property
    def dtype(self) -> np.dtype[np.generic]:
        return np.dtype(self._about["dtype"])

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(self._about["shape"])

    @property
    def ndim(self) -> int:
        return len(self.shape)

    @property
    def size(self) -> int:
        return int(np.prod(self.shape, dtype=object))

    @property
    def stored(self) -> int:
        return int(self._about["stored"])

    @property
    def elsewhere(self) -> bool:
        return bool(self._about["elsewhere"])

    @property
    def chunked(self) -> bool:
        return bool(self._about["chunked"])

    def __getitem__(self, key: tuple[()] | slice) -> Any:  # as h5py: text, a number or an array
        if self.elsewhere:
            raise InputError(f"{self.name}: expected values within this file, got data stored in others")
        if "values" in self._about:
            values = _values(self._about["values"], self._bytes)
            return values if key == () else values[key]
        count = None if isinstance(key, tuple) else key.stop
        return _values(*self._content.asked(self.name, count))


class Group(_Entry, Mapping[str, "Group | Array | Link"]):
    """A group of a file: a mapping from names to what is there; a / in a name leads through groups. KeyError: nothing is there; OSError:
    what is there cannot be read."""

    def _entries(self) -> About:
        if self._about["kind"] != "group":
            raise OSError(f"{self.name}: {self._about.get('why', 'no group')}")
        entries: About = self._about["entries"]
        return entries

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries())

    def __len__(self) -> int:
        return len(self._entries())

    def __getitem__(self, name: str) -> Group | Array | Link:
        first, _, rest = name.partition("/")
        about, place = self._entries()[first], f"{self.name.rstrip('/')}/{first}"
        if about["kind"] == "link":
            return Link(about["type"])
        if about["kind"] == "array":
            entry: Group | Array = Array(about, place, self._bytes, self._content)
        else:
            entry = Group(about, place, self._bytes, self._content)
            entry._entries()
        if not rest:
            return entry
        if not isinstance(entry, Group):
            raise KeyError(name)
        return entry[rest]

    def array(self, name: str) -> NDArray[Any]:  # of the type that the file has
        """The values of an array of this group; KeyError where there is none."""
        entry = self[name]
        if not isinstance(entry, Array):
            raise KeyError(f"{self.name}: no array {name}")
        return np.asarray(entry[()])
