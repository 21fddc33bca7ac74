"""Frozen dataclasses as rows of a CSV table: one schema for writer and reader, checked cell by cell.

Fields are of str, int, float, bool, or one of these | None (an empty cell). Floats are written with all their digits.
"""

from __future__ import annotations

import csv
import dataclasses
import functools
import io
import types
import typing
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.errors import InputError
from fcsim.files import regular, replacing_for_good

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

type Kind = type[bool] | type[int] | type[float] | type[str]
"""What a cell holds."""

EXPECTED: dict[Kind, str] = {bool: "true or false", int: "a whole number", float: "a number", str: "a text"}


@functools.cache
def columns(kind: type[DataclassInstance]) -> dict[str, tuple[Kind, bool]]:
    """The columns of a row of type `kind`: their types, and whether a cell may be empty."""
    found: dict[str, tuple[Kind, bool]] = {}
    for name, hint in typing.get_type_hints(kind).items():
        if name not in {field.name for field in dataclasses.fields(kind)}:
            continue
        choices = typing.get_args(hint) if typing.get_origin(hint) in (typing.Union, types.UnionType) else (hint,)
        found[name] = next(choice for choice in choices if choice is not types.NoneType), types.NoneType in choices
    return found


def cells(row: DataclassInstance) -> list[str]:
    """The texts of a row."""
    return [cell(getattr(row, field.name)) for field in dataclasses.fields(row)]


def cell(value: object) -> str:
    """A value as the text of its cell, on one line, bytes of file names and arguments that are no UTF-8 as their numbers: \\udcff."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(float(value))  # NumPy's floats included
    return " ".join(str(value).splitlines()).encode(errors="backslashreplace").decode()


def line(values: Iterable[object]) -> str:
    """One line of CSV with its end."""
    file = io.StringIO()
    csv.writer(file, lineterminator="\n").writerow(values)
    return file.getvalue()


def read_cell(kind: Kind, text: str) -> bool | int | float | str:
    """The text as a value; ValueError for what is none."""
    if kind is bool:
        if text.lower() not in ("true", "false"):
            raise ValueError(text)
        return text.lower() == "true"
    return kind(text)


def write_table(path: Path, kind: type[DataclassInstance], rows: Iterable[DataclassInstance]) -> Path:
    """Write rows with their header, whole or not at all."""
    with replacing_for_good(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        file.write(line(columns(kind)))
        file.writelines(line(cells(row)) for row in rows)
    return path


def read_rows(path: Path, *, whole: bool = False) -> list[list[str]]:
    """The cells of a table of text, header first, torn last lines as they are; InputError where the file is no text.

    whole: a quotation mark that is not closed is refused: it takes all lines behind it into one cell
    """
    try:
        text = regular(path).read_text(encoding="utf-8-sig")  # spreadsheets begin it with a mark
        if "\0" in text:
            raise InputError(f"{path}: expected a table as text, it holds zero bytes")
        return list(csv.reader(io.StringIO(text, newline=""), strict=whole))
    except csv.Error as error:
        raise InputError(f"{path}: expected a table whose quotation marks are closed ({error})") from None
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected a table as UTF-8 text ({error})") from None


def read_table[T: DataclassInstance](path: Path, kind: type[T], rows: list[list[str]] | None = None) -> list[T]:
    """Read a table of rows of type `kind`; `rows` where the cells are there already. InputError with file, line and column.

    Columns whose fields have a default may be missing at the right, as in tables of earlier versions.
    """
    given = read_rows(path) if rows is None else rows
    names = tuple(columns(kind))
    required = sum(field.default is dataclasses.MISSING for field in dataclasses.fields(kind))
    header = tuple(given[0]) if given else ()
    if not required <= len(header) <= len(names) or header != names[: len(header)]:
        raise InputError(f"{path}: expected the columns {','.join(names)}; got {','.join(header)[:500] or 'nothing'}")
    return [_row(kind, header, cells, f"{path}, line {number}") for number, cells in enumerate(given[1:], 2)]


def _row[T: DataclassInstance](kind: type[T], header: tuple[str, ...], texts: list[str], where: str) -> T:
    if len(texts) != len(header):
        raise InputError(f"{where}: expected {len(header)} columns, got {len(texts)}")
    values: dict[str, object] = {}
    for name, text in zip(header, texts, strict=True):
        of, optional = columns(kind)[name]
        try:
            values[name] = None if optional and not text else read_cell(of, text)
        except ValueError:
            raise InputError(f"{where}, column {name}: expected {EXPECTED[of]}, got {text[:60]!r}") from None
    try:
        return kind(**values)
    except InputError as error:
        raise InputError(f"{where}, {error}") from None
