"""The atlas in a folder: an answer a file, kept from run to run, and all of them as a table.

DIR/answers/NAME.json   an answer, with the code (a digest of fcsim's sources) and the file that it was made of: where both are the same
                        it is not made again
DIR/atlas.csv, DIR/atlas.json
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

from fcsim.arrays import Json
from fcsim.errors import InputError, NotConverged
from fcsim.masonry.atlas.answers import Answer, answered
from fcsim.masonry.atlas.entries import Collapse, Entry
from fcsim.masonry.collapse import Watch
from fcsim.records import json_text, read_record, write_record
from fcsim.tables import write_table
from fcsim.version import __version__


@dataclass(frozen=True)
class _Kept:
    """An answer as it is kept; made_of: the code and what was asked."""

    made_of: str
    answer: Answer


def answers_of(
    directory: Path, entries: Sequence[Entry], *, watch: Watch = lambda trial: None, begun: Callable[[Entry], None] = lambda entry: None
) -> Iterator[tuple[Answer, bool]]:
    """Yield the answers to entries, and whether each was there already; those that are made are kept in the folder.

    An entry that cannot be answered has a row whose remark says why.
    """
    twice = sorted({entry.name for entry in entries if [other.name for other in entries].count(entry.name) > 1})
    if twice:
        raise InputError(f"atlas: expected different names of problems, got {', '.join(map(repr, twice))} more than once")
    (directory / "answers").mkdir(parents=True, exist_ok=True)
    for entry in entries:
        path = directory / "answers" / f"{re.sub(r'[^A-Za-z0-9_.-]+', '_', entry.name)}.json"
        made_of = _made_of(entry)
        if path.is_file():
            kept = read_record(_Kept, path)
            if kept.made_of == made_of:
                yield kept.answer, True
                continue
        begun(entry)
        try:
            answer = answered(entry, watch=watch)
        except (InputError, NotConverged) as error:
            answer = Answer(entry.name, 0, getattr(entry, "quantity", ""), entry.number, remark=str(error), source=entry.source)
        write_record(path, _Kept(made_of, answer))
        yield answer, False


def write_atlas(directory: Path, answers: Sequence[Answer], left_out: Sequence[tuple[str, str]] = ()) -> None:
    """Write the rows: atlas.csv, and atlas.json with the files that were left out and why."""
    directory.mkdir(parents=True, exist_ok=True)
    write_table(directory / "atlas.csv", Answer, answers)
    write_record(directory / "atlas.json", {"version": __version__, "problems": answers, "left_out": [list(pair) for pair in left_out]})


@cache
def _code() -> str:
    """A digest of all sources of fcsim: a change anywhere below the answers may change them, also between two versions."""
    package = Path(__file__).parents[2]
    digest = sha256(__version__.encode())
    for source in sorted(package.rglob("*.py")):
        digest.update(f"{source.relative_to(package).as_posix()}\n".encode() + source.read_bytes())
    return digest.hexdigest()


def _made_of(entry: Entry) -> str:
    """A fingerprint of the code and of all numbers of an entry."""
    said: Json = [_code(), type(entry).__name__, repr(entry.number), repr(entry.coulomb), entry.source]
    text = json_text(said)
    if isinstance(entry, Collapse):
        problem = entry.asked
        text += repr((problem.dimension, problem.mu, sorted(problem.between.items()), problem.loads))
        for block in problem.blocks:
            text += repr((block.name, block.density, block.mass, block.support, block.surface.points.tolist(), block.surface.polygons))
    else:
        text += repr({key: value for key, value in asdict(entry).items() if not callable(value)})
    return sha256(text.encode()).hexdigest()
