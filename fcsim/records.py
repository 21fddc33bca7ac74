"""Frozen dataclasses as JSON: one schema for writer and reader, checked field by field.

record = read_record(Description, path)     # InputError that names file, key, what was expected and what came
write_record(path, record)
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import re
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.arrays import Json
from fcsim.errors import InputError
from fcsim.files import regular, replacing_for_good

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LARGEST = 64 * 2**20
"""[bytes] No record is as large; a file that is will not be loaded."""


@functools.cache
def _hints(kind: type) -> dict[str, type]:
    return typing.get_type_hints(kind)


def read_json(path: Path) -> Json:
    """The content of a JSON file; InputError where it is none, too large, or no UTF-8 text."""
    try:
        if regular(path).stat().st_size > LARGEST:
            raise InputError(f"{path}: expected a description of at most {LARGEST} bytes, got {path.stat().st_size}")
        # some editors begin a text of UTF-8 with a mark
        text = path.read_text(encoding="utf-8-sig")
        content: Json = json.loads(text, object_pairs_hook=_without_twins)
        if re.search(r"\\u[dD][89a-fA-F]", text):  # half a character, which no file of ours could take
            json.dumps(content, ensure_ascii=False).encode()
        return content
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: expected JSON: {error}") from None


def _without_twins(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    """An object's keys and values; ValueError for a key that comes twice, of which one would count and nobody knows which."""
    found = dict(pairs)
    if len(found) != len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"the key {next(name for name in names if names.count(name) > 1)!r} comes twice in one object")
    return found


def read_record[T](kind: type[T], path: Path) -> T:
    """Read a JSON file as a dataclass of type `kind`."""
    return from_json(kind, read_json(path), str(path))


def write_record(path: Path, record: object) -> None:
    """Write a dataclass as JSON, whole or not at all."""
    with replacing_for_good(path) as temporary:
        temporary.write_text(json_text(record), encoding="utf-8")


def json_text(record: object) -> str:
    """A dataclass, or another value, as indented JSON."""
    return json.dumps(to_json(record), indent=1, allow_nan=False) + "\n"


def to_json(value: object) -> Json:
    """The value in JSON's types: tuples as lists, paths and what JSON lacks (infinity, enumerations) as text."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: to_json(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): to_json(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list | set | frozenset):
        return [to_json(entry) for entry in value]
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(float(value))
    if value is None or isinstance(value, str | bool | int):
        return value
    if hasattr(value, "tolist"):  # NumPy's
        return to_json(value.tolist())
    return str(value)


def from_json[T](kind: type[T], value: object, where: str) -> T:
    """The JSON value as a value of type `kind`: of str, int, float (finite), bool, X | None, tuples, mappings and dataclasses of these.

    Keys that a dataclass does not know are left aside, so that newer files are read; fields without default must be there.
    """
    return typing.cast(T, _value(kind, value, where))


def _value(kind: type, value: object, where: str) -> object:
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        return None if value is None else _value(next(a for a in arguments if a is not types.NoneType), value, where)
    if origin is tuple:
        return tuple(_value(arguments[0], entry, f"{where}, entry {k + 1}") for k, entry in enumerate(_of(list, value, where)))
    if origin is not None and issubclass(origin, Mapping):
        return {key: _value(arguments[1], entry, f"{where}, {key!r}") for key, entry in _of(dict, value, where).items()}
    if dataclasses.is_dataclass(kind):
        return _dataclass(kind, _of(dict, value, where), where)
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        try:
            number = float(value)
        except OverflowError:  # a whole number that no float holds
            number = math.inf
        if not math.isfinite(number):
            raise InputError(f"{where}: expected a finite number, got {str(value)[:60]}")
        return number
    if kind is int and isinstance(value, bool):
        raise InputError(f"{where}: expected a whole number, got {value}")
    return _of(kind, value, where)


NAMES = {dict: "an object", list: "a list", str: "a text", int: "a whole number", float: "a number", bool: "true or false"}


def _of[T](kind: type[T], value: object, where: str) -> T:
    if not isinstance(value, kind):
        raise InputError(f"{where}: expected {NAMES.get(kind, kind.__name__)}, got {str(value)[:60]!r}")
    return value


def _dataclass[T: DataclassInstance](kind: type[T], content: dict[str, object], where: str) -> T:
    values = {}
    for field in dataclasses.fields(kind):
        if field.name in content:
            values[field.name] = _value(_hints(kind)[field.name], content[field.name], f"{where}, {field.name!r}")
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(f"{where}: expected the key {field.name!r}, found {', '.join(map(repr, list(content)[:8])) or 'none'}")
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
