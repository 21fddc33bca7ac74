"""fcsim atlas: problems with published numbers and closed forms, by limit analysis and by simulation, in one table."""

from __future__ import annotations

import argparse
import fnmatch
import math
from pathlib import Path
from typing import TYPE_CHECKING

from fcsim.command_line.terminal import print_table, say, say_json
from fcsim.errors import EXIT_OK, InputError

if TYPE_CHECKING:
    from fcsim.masonry.atlas import Answer

COLUMNS = ("problem", "question", "blocks", "published", "associative", "Coulomb", "first motion", "rigid", "deformable", "seconds")


def add_parser(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `atlas`."""
    atlas = commands.add_parser(
        "atlas",
        help="published masonry problems and closed forms, limit analysis beside simulation",
        description="Answer every masonry problem of a folder (JSON with its expected number) and those that are built by rule, by limit "
        "analysis and by simulation of rigid and deformable blocks, beside the published number. What was answered is not done again.",
    )
    atlas.add_argument("folder", nargs="?", type=Path, help="of masonry problems in JSON (default: those that are built by rule alone)")
    atlas.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the answers, atlas.csv and atlas.json")
    atlas.add_argument("--only", action="append", default=[], metavar="NAME", help="problems of this name or pattern alone (repeatable)")
    atlas.add_argument("--json", action="store_true", help="print JSON")
    atlas.set_defaults(act=_atlas)


def _atlas(options: argparse.Namespace) -> int:
    from fcsim.masonry.atlas import Entry, answers_of, built, of_folder, write_atlas
    from fcsim.masonry.collapse import Trial

    entries, left_out = of_folder(options.folder) if options.folder is not None else ((), ())
    asked = (*entries, *built())
    for pattern in options.only:
        if not fnmatch.filter([entry.name for entry in asked], pattern):
            raise InputError(f"--only: expected names of problems ({', '.join(repr(entry.name) for entry in asked)}), got {pattern!r}")
    if options.only:
        asked = tuple(entry for entry in asked if any(fnmatch.fnmatchcase(entry.name, pattern) for pattern in options.only))

    def begun(entry: Entry) -> None:
        say(f"{entry.name} ...", to_stderr=True)

    def told(seen: Trial) -> None:
        say(f"  multiplier {seen.multiplier:.6g} {'falls' if seen.falls else 'moves' if seen.moves else 'stands'}", to_stderr=True)

    answers = []
    for answer, _ in answers_of(options.out, asked, watch=told, begun=begun):
        answers.append(answer)
        write_atlas(options.out, answers, left_out)
    if options.json:
        say_json({"problems": answers, "left_out": left_out})
        return EXIT_OK
    print_table(COLUMNS, [_row(answer) for answer in answers], texts=2)
    for answer in answers:
        if answer.remark:
            say(f"{answer.name}: {answer.remark}")
    for name, reason in left_out:
        say(f"left out: {name}: {reason}")
    say(f"table: {options.out / 'atlas.csv'}, {options.out / 'atlas.json'}")
    return EXIT_OK


def _row(answer: Answer) -> tuple[str, ...]:
    def number(value: float | None) -> str:
        return "" if value is None else "any" if math.isinf(value) else f"{value:.5g}"

    def pair(low: float | None, high: float | None) -> str:
        return "" if low is None or high is None else f"{low:.4g} to {high:.4g}"

    published = number(answer.published) + ("" if answer.published_coulomb is None else f"; {number(answer.published_coulomb)}")
    seconds = answer.limit_seconds + answer.rigid_seconds + answer.soft_seconds
    coulomb = pair(answer.span_low, answer.span_high) if _apart(answer) else number(answer.coulomb)
    return (
        answer.name,
        answer.question,
        str(answer.blocks),
        published,
        number(answer.associative),
        coulomb,
        pair(answer.still, answer.moves),
        number(answer.simulated) if answer.simulated is not None else pair(answer.stands, answer.falls),
        pair(answer.soft_stands, answer.soft_falls),
        f"{seconds:.1f}",
    )


def _apart(answer: Answer) -> bool:
    low, high = answer.span_low, answer.span_high
    return low is not None and high is not None and high - low > 1e-4 * max(abs(high), 1e-300)
