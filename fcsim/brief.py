"""What values that hold arrays show of themselves, in a line whatever they hold, and what of them is pickled and copied in depth."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LONGEST, IN_ALL = 60, 800
"""Characters of one field, and of all."""
_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")


def brief(value: DataclassInstance) -> str:
    """A dataclass in a line: Reactions(identity=int64 (4,), frame=float64 (4, 3, 3), r=float64 (4, 3)). For `__repr__ = brief`, so that a
    step at the prompt, in a notebook or in a debugger is not a hundred pages."""
    parts, length = [], 0
    for field in fields(value):
        if not field.repr:
            continue
        parts.append(f"{field.name}={shown(getattr(value, field.name, '?'))}")
        length += len(parts[-1]) + 2
        if length > IN_ALL:
            parts.append("...")
            break
    return f"{type(value).__name__}({', '.join(parts)})"


def counted(count: int, one: str) -> str:
    """How many of a thing whose plural ends in s: 1 block, 2 blocks."""
    return f"{count} {one}{'' if count == 1 else 's'}"


def of_any_process(text: str) -> str:
    """What a value shows of itself without the addresses in memory of functions and objects in it, which no other process has."""
    return _ADDRESS.sub("", text)


def shown(value: object) -> str:
    """One value in a line of at most `LONGEST` characters: a field, or what came where another was expected."""
    if value is None or isinstance(value, bool | int | float | Enum | np.generic):
        text = str(value) if isinstance(value, Enum | np.generic) else repr(value)
    elif isinstance(value, str | bytes):
        text = repr(value)
    elif hasattr(value, "shape") and hasattr(value, "dtype"):
        text = f"{getattr(value, 'format', '')} {value.dtype} {value.shape}".strip()
    elif is_dataclass(value):
        text = f"{type(value).__name__}(...)"
    elif isinstance(value, Mapping):
        text = f"{{{len(value)} entries}}" if len(value) > 4 else "{" + ", ".join(f"{k!r}: {shown(v)}" for k, v in value.items()) + "}"
    elif isinstance(value, tuple | list):
        text = "(" + ", ".join(shown(v) for v in value) + ")" if len(value) < 4 else f"({len(value)} x {type(value[0]).__name__})"
    elif callable(value) and hasattr(value, "__qualname__"):
        text = value.__qualname__
    else:
        text = f"{type(value).__name__}(...)"
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def by_fields(record: object) -> tuple[Callable[..., object], tuple[object, ...]]:
    """`__reduce__` of a dataclass: its class and the values of its fields. Factors, locks and other caches stay in the process, and are
    made anew where it is used."""
    given = {field.name: getattr(record, field.name) for field in fields(record) if field.init}  # type: ignore[arg-type] # a dataclass
    return _made, (type(record), {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in given.items()})


def _made(kind: Callable[..., object], given: dict[str, object]) -> object:
    return kind(**given)


def refused(*parts: str) -> Callable[[object], tuple[()]]:
    """`__reduce__` of what is not pickled, with the names of parts that are."""

    def refuse(record: object) -> tuple[()]:
        raise TypeError(
            f"a {type(record).__name__} holds factors and matrices of its process, and is neither pickled nor copied: take what is needed "
            f"of it, as {', '.join(parts)}"
        )

    return refuse
