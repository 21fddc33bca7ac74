"""Which values the parameters take: lists, ranges, rows of a table, and every combination of them."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from fcsim.errors import InputError
from fcsim.tables import read_rows

MOST = 100_000
"""More combinations than anybody makes: a slip of the pen."""
_RANGE = re.compile(r"(?P<first>[^/\s]+?)\.\.(?P<last>[^/\s]+)/(?P<count>\d+)(?P<log>log)?")
_NUMBER = r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?"
_WITHOUT_COUNT = re.compile(rf"{_NUMBER}\.\.{_NUMBER}")


def read_over(text: str) -> tuple[str, tuple[str, ...]]:
    """The name and the values of NAME=VALUES: a,b,c or a range, FIRST..LAST/COUNT, both ends included, with equal distances, or with equal
    ratios as FIRST..LAST/COUNTlog. Values that hold commas themselves have ; between them: divisions=8,4,4;16,8,8.

    Raises InputError where there is no name, no value, or a range that is none.
    """
    name, equals, values = text.partition("=")
    name = name.strip()
    if not equals or not name:
        raise InputError(f"--over {text}: expected NAME=VALUE,VALUE,... or NAME=FIRST..LAST/COUNT")
    found = _RANGE.fullmatch(values.strip())
    if found is not None:
        return name, _range(f"--over {text}", found["first"], found["last"], int(found["count"]), found["log"] is not None)
    if _WITHOUT_COUNT.fullmatch(values.strip()):
        raise InputError(f"--over {text}: expected how many values the range has, FIRST..LAST/COUNT: {name}={values.strip()}/5")
    parts = [part.strip() for part in values.split(";" if ";" in values else ",")]
    if ";" in values and not parts[-1]:  # one value with commas: divisions=8,4,4;
        parts.pop()
    if not parts or not all(parts):
        raise InputError(f"--over {text}: expected values with commas between (or ; where they hold commas), got an empty one")
    return name, tuple(parts)


def _range(where: str, first: str, last: str, count: int, geometric: bool) -> tuple[str, ...]:
    try:
        a, b = float(first), float(last)
    except ValueError:
        raise InputError(f"{where}: expected numbers as the ends of a range, got {first!r} and {last!r}") from None
    if not (math.isfinite(a) and math.isfinite(b)) or a == b:
        raise InputError(f"{where}: expected two different finite numbers as the ends of a range, got {first} and {last}")
    if not 2 <= count <= MOST:
        raise InputError(f"{where}: expected from 2 to {MOST} values of a range, got {count}")
    if geometric and (a == 0 or b == 0 or (a > 0) != (b > 0)):
        raise InputError(f"{where}: expected ends of one sign, not 0, of a range with equal ratios, got {first} and {last}")
    span = b / a if geometric else b - a
    if not math.isfinite(span) or span == 0:
        what = "ratio" if geometric else "distance"
        raise InputError(f"{where}: expected ends whose {what} a number of 64 bits holds, got {first} and {last}")
    shares = [k / (count - 1) for k in range(1, count - 1)]
    inner = [a * span**s if geometric else a + span * s for s in shares]
    return (_short(a), *map(_short, inner), _short(b))


def _short(value: float) -> str:
    """To twelve digits, whole numbers without a point: 0.3 rather than 0.30000000000000004."""
    return f"{value:.0f}" if value == round(value) and abs(value) < 1e15 else f"{value:.12g}"


def read_table_of_values(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file, whose header names parameters: one combination a row, empty lines and those that begin with # left out."""
    if not path.is_file():
        raise InputError(f"--table {path}: expected a CSV file, found none")
    lines = [[cell.strip() for cell in row] for row in read_rows(path, whole=True)]
    header, *rows = [row for row in lines if any(row) and not row[0].startswith("#")] or [[]]
    if not rows or not all(header) or len(set(header)) != len(header):
        raise InputError(f"--table {path}: expected a header of different names and at least one row, got {','.join(header) or 'nothing'}")
    for number, row in enumerate(rows, 1):
        if len(header) == 1 and any(mark in header[0] for mark in ";\t|"):
            raise InputError(f"--table {path}: expected commas between the cells and points in numbers, got {header[0][:200]!r}")
        if len(row) != len(header):
            raise InputError(f"--table {path}, row {number}: expected {len(header)} values ({', '.join(header)}), got {len(row)}")
        if not all(row):
            raise InputError(f"--table {path}, row {number}: expected a value of {header[row.index('')]!r}, got an empty cell")
    return [dict(zip(header, row, strict=True)) for row in rows]


def combinations(over: Sequence[tuple[str, Sequence[str]]], table: Sequence[Mapping[str, str]] = ()) -> list[dict[str, str]]:
    """Every combination of the values of `over`, the last name changing fastest, with every row of the table.

    Raises InputError where a name comes twice, or where there are none or more than MOST.
    """
    names = [*(table[0] if table else ()), *(name for name, _ in over)]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise InputError(f"--over, --table: expected each name once, got {', '.join(twice)} more than once")
    if not names:
        raise InputError("--over, --table: expected at least one parameter to vary, got none")
    count = math.prod((len(table) or 1, *(len(values) for _, values in over)))
    if count > MOST:
        raise InputError(f"--over: expected at most {MOST} combinations, got {count}")
    names, several = [name for name, _ in over], [values for _, values in over]
    grid = [dict(zip(names, values, strict=True)) for values in itertools.product(*several)]
    return [{**row, **place} for row in (table or [{}]) for place in grid]
