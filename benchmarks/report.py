"""What the measuring scripts write: Markdown tables, a CSV to go on from, and the circumstances of the measurement."""

from __future__ import annotations

import argparse
import csv
import os
import platform
import shlex
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import fcsim
from fcsim.files import replacing


def table(header: Sequence[str], rows: Iterable[Sequence[str]], left: int = 1) -> list[str]:
    """A Markdown table; the first `left` columns are aligned to the left, the others to the right."""
    rule = [":---" if column < left else "---:" for column in range(len(header))]
    return ["| " + " | ".join(cells) + " |" for cells in (header, rule, *rows)] + [""]


def processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.is_file():
        for line in cpuinfo.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def command(options: argparse.Namespace, arguments: Sequence[str]) -> str:
    """The command as another user would give it: the folder or files by the word FILES, interpreters and reports by their names."""
    given = {str(path) for path in options.paths}
    words: list[str] = []
    for argument in arguments:
        if argument not in given:
            words.append(Path(argument).name if Path(argument).is_absolute() else argument)
        elif "FILES" not in words:
            words.append("FILES")
    return f"python benchmarks/{Path(sys.argv[0]).name} {shlex.join(words)}"


def circumstances(options: argparse.Namespace, arguments: Sequence[str], more: Iterable[str] = ()) -> list[str]:
    """Machine, load, versions and command, as Markdown."""
    names = ("numpy", "scipy", "numba")
    versions = ", ".join(
        [f"fcsim {fcsim.__version__}", f"Python {platform.python_version()}", *(f"{n} {version(n)}" for n in names), *more]
    )
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    threads = os.environ.get("OMP_NUM_THREADS", "not set")
    return [
        f"    {command(options, arguments)}",
        "",
        f"* Machine: {processor()}, {os.cpu_count()} processors, {platform.system()}; OMP_NUM_THREADS = {threads}.",
        f"* Load (1, 5, 15 minutes) at the end: {load}. One busy process is ours; more than 1 means that times are contended.",
        f"* Versions: {versions}.",
        "",
    ]


class Record:
    """Rows of a CSV file, written as they come, so that an interrupted measurement can be gone on with."""

    def __init__(self, path: Path, fields: Sequence[str], resume: bool) -> None:
        self.path, self.fields = path, fields
        self.rows: list[dict[str, Any]] = []
        if resume and path.is_file():
            with path.open(newline="", encoding="utf-8") as file:
                self.rows = [_typed(row) for row in csv.DictReader(file)]
        path.parent.mkdir(parents=True, exist_ok=True)
        self.keep(lambda _: True)

    def keep(self, wanted: Callable[[dict[str, Any]], bool]) -> None:
        """Write the file anew with the rows that are wanted."""
        self.rows = [{key: row.get(key) for key in self.fields} for row in self.rows if wanted(row)]
        with replacing(self.path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, self.fields)
            writer.writeheader()
            writer.writerows(self.rows)

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        rows = [{key: row.get(key) for key in self.fields} for row in rows]
        self.rows += rows
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, self.fields).writerows(rows)


TEXTS = {"problem", "form", "method", "family", "status", "what", "program", "configuration", "storage"}


def _typed(row: dict[str, str]) -> dict[str, Any]:
    return {key: (text or None) if key in TEXTS else _value(text) for key, text in row.items()}


def _value(text: str) -> Any:
    if text in ("", "True", "False"):
        return {"": None, "True": True, "False": False}[text]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def write_markdown(path: Path, lines: Iterable[str]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
