"""The terminal: one progress bar and one style of tables for all commands.

A reader that leaves early (`| head -1`) ends what is shown, not the work; what files and cases say is shown without the control
characters that a terminal would obey. rich is loaded when a bar is made, and only a terminal needs it.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stdout, suppress
from importlib.util import find_spec
from types import TracebackType
from typing import TextIO

from fcsim.command_line.answers import current, table_of
from fcsim.records import json_text


def printable(text: object) -> str:
    """The text with control characters, which could move the cursor or retitle the window, as escapes; line ends and tabs stay."""
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in str(text))


def say(text: object = "", *, to_stderr: bool = False) -> None:
    """Print a line, or keep it for the answer in JSON; nothing from then on where the reader has left, or where the file that takes it is
    full, which the command says at its end. A line on standard error is for people and is always shown."""
    if not to_stderr and current().silent:
        current().lines.append(printable(text))
        return
    write(text, to_stderr=to_stderr)


def say_json(document: object) -> None:
    """Print a value, or a dataclass, as JSON."""
    say(json_text(document).rstrip())


def write(text: object = "", *, to_stderr: bool = False) -> None:
    """Print a line, whatever was asked for."""
    stream = sys.stderr if to_stderr else sys.stdout
    current().spoken |= not to_stderr
    try:
        print(printable(text), file=stream, flush=True)
    except OSError as error:
        silence(stream)
        if not to_stderr and not isinstance(error, BrokenPipeError):
            current().lost = error.strerror or type(error).__name__


def one_line(text: str) -> str:
    """The text with its line ends as escapes: names of files may have some."""
    return text.replace("\n", "\\n")


def silence(stream: TextIO) -> None:
    """Let a standard stream write to nowhere, also what Python flushes at its end."""
    try:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
    except (OSError, ValueError):  # a stream that is no file
        return


@contextmanager
def prints_aside() -> Iterator[None]:
    """Within the block what scripts, plugins and libraries in C print goes to standard error: standard output is for one JSON document."""
    sys.stdout.flush()
    try:
        kept = os.dup(1)
        os.dup2(2, 1)
    except OSError:  # closed: nothing can be printed there
        with redirect_stdout(sys.stderr):
            yield
        return
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        with suppress(OSError, AttributeError):  # where there is no C library to load by no name
            ctypes.CDLL(None).fflush(None)  # C keeps what it prints to pipes and files until its end: that would be after the document
        os.dup2(kept, 1)
        os.close(kept)


def open_streams() -> None:
    """Put nothing in the place of standard streams that are closed (`2>&-`): a file of results would take their number, and what a library
    prints would go into it."""
    while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(number, True)
    os.close(number)
    sys.stdin = sys.stdin or open(0, encoding="utf-8", closefd=False)  # noqa: SIM115 - as long as the program
    sys.stdout = sys.stdout or open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - likewise
    sys.stderr = sys.stderr or open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 - likewise


def any_encoding() -> None:
    """Let standard output and errors show what their encoding lacks (ASCII: é, ‖) as escapes rather than fail."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def table_lines(header: Sequence[str], rows: Iterable[Sequence[str]], *, texts: int = 1) -> list[str]:
    """A table in aligned columns, two spaces apart: the first `texts` columns to the left, numbers to the right."""
    lines = [tuple(one_line(printable(cell)) for cell in line) for line in (header, *rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(header))]
    aligned = (
        "  ".join(cell.ljust(width) if k < texts else cell.rjust(width) for k, (cell, width) in enumerate(zip(line, widths, strict=True)))
        for line in lines
    )
    return [line.rstrip() for line in aligned]


def print_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, title: str = "", texts: int = 1) -> None:
    """Print a table under its title, or keep it for the answer in JSON."""
    if current().silent:
        current().tables.append(table_of(header, list(rows), title))
        return
    if title:
        say(f"\n{title}")
    for line in table_lines(header, rows, texts=texts):
        say(line)


class Bar:
    """A progress bar on a terminal and in a notebook; elsewhere a line every `lines`-th part of the work, none where `lines` is 0 or
    where only errors are asked for.

    own_estimate: what is shown beside the bar says how long it will take
    """

    def __init__(self, what: str, *, lines: int = 10, own_estimate: bool = False) -> None:
        quiet = current().quiet
        self._what, self._lines, self._told = what, 0 if quiet else lines, -1
        self._live = _rich_bar(own_estimate) if not quiet and (sys.stderr.isatty() or in_notebook()) else None
        self._tasks: dict[str, int] = {}

    def __enter__(self) -> Bar:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        if self._live is not None:
            self._live.stop()

    def update(self, done: int, total: int, text: str = "", *, what: str = "") -> None:
        """Show how far the work has come, and a text beside; another `what` begins a bar of its own."""
        what = what or self._what
        if self._live is not None:
            if what not in self._tasks:
                self._tasks[what] = self._live.add_task(what, total=total, text="")
            self._live.update(self._tasks[what], completed=done, total=total, text=printable(text))
            return
        part = self._lines * done // max(total, 1)
        if self._lines and text and (part > self._told or done == total):
            self._told = part
            say(f"{what} {done} of {total}: {text}", to_stderr=True)

    def say(self, text: str) -> None:
        """A line that stays, above the bar; none where only errors are asked for."""
        if current().quiet:
            return
        if self._live is not None:
            self._live.console.print(printable(text), highlight=False, markup=False)
        else:
            say(text, to_stderr=True)


def in_notebook() -> bool:
    """Whether this is a notebook with the widgets that a bar is drawn by: a kernel of Jupyter and ipywidgets."""
    if "ipykernel" not in sys.modules or find_spec("ipywidgets") is None:
        return False
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


def _rich_bar(own_estimate: bool):  # type: ignore[no-untyped-def]  # rich may be absent
    """The bar itself, None without rich."""
    try:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    except ImportError:
        return None
    left = () if own_estimate else (TextColumn("left"), TimeRemainingColumn())
    columns = (TextColumn("{task.description}"), MofNCompleteColumn(), BarColumn(), TimeElapsedColumn(), *left)
    return Progress(*columns, TextColumn("{task.fields[text]}", markup=False), console=Console(stderr=True), transient=True)
