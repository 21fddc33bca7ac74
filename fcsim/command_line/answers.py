"""How a command answers: as lines for people, as one JSON document (--json), or with nothing but errors (--quiet).

Commands say lines and print tables through `fcsim.command_line.terminal`, which asks here where they go. What a program would want to
have in whole is given to `answer` as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from fcsim.arrays import Json
from fcsim.records import to_json


@dataclass
class Answer:
    """What a command has answered so far. quiet: nothing is shown; document: what JSON will hold, None where lines are shown; lost: why
    standard output did not take the whole answer, a full disk; spoken: whether a line has gone to standard output."""

    quiet: bool = False
    document: dict[str, Json] | None = None
    tables: list[Json] = field(default_factory=list)
    lines: list[Json] = field(default_factory=list)
    lost: str = ""
    spoken: bool = False

    @property
    def silent(self) -> bool:
        """Whether lines do not go to standard output."""
        return self.quiet or self.document is not None

    def whole(self) -> dict[str, Json]:
        """The document with the tables and lines that no values stand for."""
        found = dict(self.document or {})
        for name, said in (("tables", self.tables), ("text", self.lines)):
            if said:
                found[name] = said
        return found


_LINES = Answer()
_CURRENT: ContextVar[Answer] = ContextVar("answer", default=_LINES)


@contextmanager
def answering(*, quiet: bool, as_json: bool) -> Iterator[Answer]:
    """Within the block lines and tables go where they are asked for."""
    now = Answer(quiet, {} if as_json else None)
    token = _CURRENT.set(now)
    try:
        yield now
    finally:
        _CURRENT.reset(token)


def current() -> Answer:
    """How the command that runs now answers."""
    return _CURRENT.get()


def answer(values: Mapping[str, object]) -> bool:
    """Put values into the JSON document; True where there is one, so that the lines that say the same need not be said."""
    document = current().document
    if document is None:
        return False
    document.update({name: to_json(value) for name, value in values.items()})
    return True


def table_of(header: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> Json:
    """A table as JSON: title, and a row as an object by the columns' names; cells that are numbers as numbers."""
    names = [name or f"column {k + 1}" for k, name in enumerate(header)]
    content: list[Json] = [dict(zip(names, map(_cell, row), strict=True)) for row in rows]
    return {"title": title, "rows": content}


def _cell(text: str) -> Json:
    for kind in (int, float):
        try:
            return to_json(kind(text))
        except ValueError:
            continue
    return text
