"""Parameters of a case, and other values, read from the texts of the command line by their types."""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.errors import InputError
from fcsim.running.case import CaseScript

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

SWITCHES = {"on": True, "true": True, "yes": True, "1": True, "off": False, "false": False, "no": False, "0": False}


def read_value(text: str, kind: type) -> bool | int | float | str:
    """The text as a value of the type bool, int, float or str; ValueError for what is none: a switch misspelt, not a number."""
    if kind is bool:
        if text.lower() not in SWITCHES:
            raise ValueError(text)
        return SWITCHES[text.lower()]
    value: int | float | str = kind(text)
    if isinstance(value, float) and math.isnan(value):
        raise ValueError(text)
    return value


def parse_parameters(script: CaseScript, assignments: Mapping[str, str]) -> DataclassInstance:
    """Return the case's Parameters with `name=value` texts read as the fields' types; unknown names and bad values are refused."""
    kinds = typing.get_type_hints(script.parameters)
    known = {f.name: f for f in dataclasses.fields(script.parameters)}
    values = {}
    for name, text in assignments.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, 1)
            mean = f"; did you mean {near[0]}?" if near else ""
            raise InputError(f"--set {name}={text}: case {script.name} has the parameters {', '.join(known)}{mean}")
        values[name] = _parse(name, text, kinds[name], script.name)
    return script.parameters(**values)


def _parse(name: str, text: str, kind: type, case: str) -> object:
    refused = InputError(f"--set {name}={text}: case {case} expects {_kind_name(kind)}")
    if typing.get_origin(kind) is tuple:
        items = [item for item in text.strip("()").split(",") if item.strip()]
        arguments = typing.get_args(kind)
        kinds = [arguments[0]] * len(items) if len(arguments) == 2 and arguments[1] is Ellipsis else list(arguments)
        if len(kinds) != len(items):
            raise refused
        return tuple(_parse(name, item.strip(), k, case) for item, k in zip(items, kinds, strict=True))
    if typing.get_origin(kind) is typing.Literal:
        if text not in typing.get_args(kind):
            raise refused
        return text
    if typing.get_origin(kind) in (typing.Union, types.UnionType):  # a value or none
        choices = [choice for choice in typing.get_args(kind) if choice is not type(None)]
        if len(choices) != len(typing.get_args(kind)) and text.lower() == "none":
            return None
        if len(choices) == 1:
            return _parse(name, text, choices[0], case)
    if kind not in (int, float, str, bool, Path):
        raise InputError(f"--set {name}={text}: this parameter of case {case}, of type {_kind_name(kind)}, is set from Python only")
    try:
        return Path(text) if kind is Path else read_value(text, kind)
    except (TypeError, ValueError):
        raise refused from None


def _kind_name(kind: type) -> str:
    if typing.get_origin(kind) is typing.Literal:
        return "one of " + ", ".join(map(str, typing.get_args(kind)))
    if typing.get_origin(kind) is tuple:
        return f"{len(typing.get_args(kind))} values separated by commas"
    return {bool: "on or off", int: "a whole number", float: "a number"}.get(kind, getattr(kind, "__name__", str(kind)))
