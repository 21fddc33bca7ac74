"""How many faults are tried, with which seed, and the processes in which they are tried.

Without FCSIM_FAULTS a few of each kind, in less than a minute; FCSIM_FAULTS=1 (`make faults`) 20 000 FCLIB files, 5000 meshes, 3000
options, 40 kills and ten sizes of disks; FCSIM_FAULTS=0.1 a tenth of that. FCSIM_FAULTS_SEED chooses the seed (0), FCSIM_FAULTS_KEEP a
folder for the files of what was found.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import resource
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.errors import FcsimError
from fcsim.memory import own_addresses

SCALE = float(os.environ.get("FCSIM_FAULTS", "0"))
SEED = int(os.environ.get("FCSIM_FAULTS_SEED", "0"))
SECONDS, PATIENCE, MEMORY = 20.0, 300.0, 4 * 2**30
"""A case may take 20 s of the processor and 4 GiB beyond what the program has; waiting is a hang after 300 s, on busy machines too."""
NUMBERS = (0, 1, -1, 2, 7, 2**31, 2**62, -(2**40), 10**400, -(10**30), 1e300, -1e300, 1e-300, 5e-324, 1e20, 0.5, -0.0)
VALUES: tuple[Any, ...] = (
    *NUMBERS,
    float("nan"),
    float("inf"),
    None,
    True,
    "",
    "x",
    "../../x",
    "\x1b[2J",
    "\ud800",
    [],
    {},
    [[]],
    {"a": []},
    "9" * 400,
)
"""What files of text get in the place of their numbers, texts and lists."""
WORDS = (b"0", b"-0.0", b"-1", b"1e20", b"1e400", b"nan", b"inf", b"99999999999999999999", b"4294967296", b"\xff\xfe", b"", b'"', b"x")
LATE = ("more than", "waiting for")
Case = Callable[[int], str]
"""Tries the case of a number and says what is wrong ("": nothing); what it raises but FcsimError is a finding too."""


@pytest.fixture
def how_many() -> Callable[[int, int], int]:
    """(a few, all) -> how many are tried now."""
    return lambda few, all_of_them: max(few, round(SCALE * all_of_them))


@pytest.fixture
def generator() -> Callable[..., np.random.Generator]:
    """A generator of its own for each name and number, so that a finding is repeated alone."""

    def make(name: str, number: int = 0) -> np.random.Generator:
        return np.random.default_rng([SEED, number, *name.encode()])

    return make


def _work(case: Case, first: int, last: int, pipe: Connection) -> None:
    """Try the cases one after the other in this process, telling which is begun and what was wrong."""
    most = int(own_addresses()) + MEMORY
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for number in range(first, last):
        pipe.send(("begun", number, time.process_time()))
        try:
            found = case(number)
        except FcsimError as refused:
            found = "" if str(refused) else "an error without a word"
        except BaseException as error:
            where = [f"{Path(f.filename).name}:{f.lineno}" for f in traceback.extract_tb(error.__traceback__) if "fcsim" in f.filename]
            found = f"{type(error).__name__}: {str(error)[:200]} at {' '.join(where[-3:])}"
        pipe.send(("ended", number, found))
    os._exit(0)


def _processor_time(pid: int) -> float:
    with contextlib.suppress(OSError, ValueError, IndexError):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
    return 0.0


def _batch(case: Case, first: int, last: int) -> tuple[int, list[tuple[int, str]]]:
    """Try cases in one child until it ends: how far it came, and what was found."""
    fork = multiprocessing.get_context("fork")
    receiver, sender = fork.Pipe(duplex=False)
    child = fork.Process(target=_work, args=(case, first, last, sender))
    child.start()
    sender.close()
    assert child.pid is not None
    findings: list[tuple[int, str]] = []
    number, begun, used, how = first, time.monotonic(), 0.0, ""
    while True:
        if not receiver.poll(0.5):
            if _processor_time(child.pid) - used > SECONDS:
                how = f"more than {SECONDS:g} s of the processor"
            elif time.monotonic() - begun > PATIENCE:
                how = f"waiting for more than {PATIENCE:g} s"
            if how:
                child.kill()
                break
            continue
        try:
            kind, number, detail = receiver.recv()
        except EOFError:
            break
        if kind == "begun":
            begun, used = time.monotonic(), detail
        elif detail:
            findings.append((number, detail))
    child.join()
    code = child.exitcode or 0
    if how or code:
        name = signal.Signals(-code).name if code < 0 and not how else f"exit code {code}"
        findings.append((number, how or name))
    return number + 1, findings


@pytest.fixture
def apart() -> Callable[[Case, int], list[tuple[int, str]]]:
    """Try cases 0, 1, ... in children with limits: many in one child, since a fork costs more than most cases; a child that ends before its
    time was ended by the case it was at, and another goes on behind that. What took too long is tried once more in a child of its
    own, since the first of a kind may have been compiling: if that ends in time, it was no finding."""

    def run(case: Case, count: int) -> list[tuple[int, str]]:
        findings: list[tuple[int, str]] = []
        first = 0
        while first < count:
            last = min(first + 500, count)
            while first < last:
                first, found = _batch(case, first, last)
                if found and found[-1][1].startswith(LATE):
                    found = [*found[:-1], *_batch(case, first - 1, first)[1]]
                findings += found
        return findings

    return run


@pytest.fixture
def keep(tmp_path: Path) -> Iterator[Callable[[Path, str, int], Path]]:
    """Copy the file of a finding to the folder FCSIM_FAULTS_KEEP under its test's name and number."""

    def copy(path: Path, name: str, number: int) -> Path:
        folder = Path(os.environ.get("FCSIM_FAULTS_KEEP", tmp_path / "kept"))
        folder.mkdir(parents=True, exist_ok=True)
        place = folder / f"{name}-seed{SEED}-{number}{path.suffix}"
        place.write_bytes(path.read_bytes())
        return place

    yield copy


def pytest_report_header(config: Any) -> str:
    return f"faults: scale {SCALE:g}, seed {SEED}"


@pytest.fixture
def values() -> tuple[Any, ...]:
    return VALUES


@pytest.fixture
def mutate_json() -> Callable[[Any, np.random.Generator], Any]:
    """(value, generator) -> the value with another value somewhere in it."""

    def mutate(value: Any, random: np.random.Generator) -> Any:
        if isinstance(value, dict) and value and random.random() < 0.8:
            key = str(random.choice(list(value)))
            if random.random() < 0.1:
                return {name: entry for name, entry in value.items() if name != key}
            return value | {key: mutate(value[key], random)}
        if isinstance(value, list) and value and random.random() < 0.8:
            place = int(random.integers(len(value)))
            return [*value[:place], mutate(value[place], random), *value[place + 1 :]]
        return VALUES[int(random.integers(len(VALUES)))]

    return mutate


@pytest.fixture
def mutate_text() -> Callable[[bytes, np.random.Generator], bytes]:
    """(text, generator) -> the text with bytes changed, taken away or doubled."""

    def mutate(text: bytes, random: np.random.Generator) -> bytes:
        place, length = int(random.integers(len(text))), int(random.integers(1, 30))
        new = [b"", bytes(random.integers(0, 256, length, dtype=np.uint8)), text[place : place + length] * 2, b"\n", b",,", b'"', b"\x00"]
        return text[:place] + new[int(random.integers(len(new)))] + text[place + length :]

    return mutate


@pytest.fixture
def mutate_bytes() -> Callable[[bytes, np.random.Generator], bytes]:
    """(content, generator) -> the content of a file of which words of a text, or bytes, are replaced, taken away or doubled."""

    def mutate(content: bytes, random: np.random.Generator) -> bytes:
        if random.random() < 0.6 and (words := content.split(b" ")) and len(words) > 20:
            for _ in range(int(random.integers(1, 3))):
                place = int(random.integers(len(words)))
                ending = b"\n" + words[place].partition(b"\n")[2] if b"\n" in words[place] else b""
                words[place] = WORDS[int(random.integers(len(WORDS)))] + ending
            return b" ".join(words)
        place, length = int(random.integers(len(content))), int(random.integers(1, 40))
        new = (b"", content[place : place + length] * 2, bytes(random.integers(0, 256, length, dtype=np.uint8)), b"\x00" * length)
        return content[:place] + new[int(random.integers(len(new)))] + content[place + length :]

    return mutate
