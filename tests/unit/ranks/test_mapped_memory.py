"""Blocks of memory that ranks have in common: who may write where, and what is left of them."""

from __future__ import annotations

import gc
import os
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from fcsim.arrays import IntArray
from fcsim.ranks.mapped_memory import LEAST, MOST, CommonMemory, in_common
from tests.unit.ranks.conftest import Program

SIDE = 100  # arrays of 80 000 bytes


def side_by_side(work: Callable[[int, CommonMemory], None], ranks: int = 2) -> None:
    """Have each of the ranks, threads here, do its work."""
    meeting, told, errors = threading.Barrier(ranks), [np.empty(0, dtype=np.int64)] * ranks, []

    def exchange(number: int, own: IntArray) -> IntArray:
        told[number] = own
        meeting.wait(10)
        every = np.stack(told)
        meeting.wait(10)
        return every

    def run(number: int) -> None:
        try:
            work(number, CommonMemory(number, ranks, lambda own: exchange(number, own)))
        except BaseException as error:
            errors.append(error)
            meeting.abort()

    threads = [threading.Thread(target=run, args=(number,)) for number in range(ranks)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if errors:
        raise errors[0]


def test_what_one_rank_writes_all_have() -> None:
    def work(number: int, memory: CommonMemory) -> None:
        a, flags = memory.array((SIDE, SIDE), np.float64), memory.array((SIDE * SIDE,), np.bool_)
        assert a is not None and flags is not None and in_common(a[3:]) and a.flags.c_contiguous and not in_common(a.copy())
        a[number::3], flags[number::3] = number + 1.5, number == 1
        memory.meet()
        for k in range(3):
            assert np.all(a[k::3] == k + 1.5) and np.all(flags[k::3] == (k == 1))

    side_by_side(work, 3)


def test_nobody_writes_where_another_rank_still_reads() -> None:
    """Rank 1 keeps a view of the first array, through any number of others; when that goes too, the block is taken again."""

    def work(number: int, memory: CommonMemory) -> None:
        first = memory.array((SIDE, SIDE), np.float64)
        assert first is not None
        address, view = first.ctypes.data, first[10:20, ::2] if number else None
        first[number::2] = -1.0
        memory.meet()
        del first
        seen = set()
        for k in range(6):
            other = memory.array((SIDE, SIDE), np.float64)
            assert other is not None and other.ctypes.data != address
            seen.add(other.ctypes.data)
            other[number::2] = k
            memory.meet()
            assert np.all(other == k)
            del other
        assert len(seen) == 2  # one is let go of while the next is asked for
        assert view is None or np.all(view == -1.0)
        del view
        gc.collect()
        memory.meet()
        again = memory.array((SIDE, SIDE), np.float64)
        assert again is not None and again.ctypes.data == address

    side_by_side(work)


def test_blocks_are_few_and_go_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fcsim.ranks.mapped_memory.IDLE", idle := 20)

    def work(number: int, memory: CommonMemory) -> None:
        assert memory.array((LEAST // 16,), np.float64) is None
        kept = [memory.array((600,), np.float64) for _ in range(MOST + 5)]
        assert [a is None for a in kept] == [False] * MOST + [True] * 5
        assert all(a is None or in_common(a) for a in kept)
        before = memory.bytes
        del kept
        for _ in range(2 * idle + 2):
            memory.meet()
        assert before > MOST * 4800 and memory.bytes == 0
        assert memory.array((600,), np.float64) is not None

    side_by_side(work)


def test_where_a_rank_gets_none_nobody_has_any(monkeypatch: pytest.MonkeyPatch) -> None:
    given = os.open

    def refusing(path: str, *how: int) -> int:
        if str(path).startswith("/proc/") and threading.current_thread() is not threading.main_thread():
            raise PermissionError(path)
        return given(path, *how)

    monkeypatch.setattr("fcsim.ranks.mapped_memory.os.open", refusing)
    descriptors = len(list(Path("/proc/self/fd").iterdir()))

    def work(number: int, memory: CommonMemory) -> None:
        assert memory.array((SIDE, SIDE), np.float64) is None and memory.array((SIDE, SIDE), np.float64) is None
        memory.meet()

    side_by_side(work)
    assert len(list(Path("/proc/self/fd").iterdir())) == descriptors


KILLED = """
import os, signal, time
import numpy as np
from fcsim.ranks import for_parts, in_parts, sharing
from fcsim.ranks.mapped_memory import in_common

def fill(begin, end):
    rows[begin:end] = 1.0

with sharing() as world:
    rows = for_parts((200_000,), 1)
    in_parts("rows", len(rows), 1, fill, rows)
    assert in_common(rows) and np.all(rows == 1.0)
    if world.number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    more = for_parts((300_000,), 1)
    in_parts("rows", len(rows), 1, fill, rows)
    print("went on")
"""


@pytest.mark.slow
def test_a_rank_that_is_killed_leaves_no_memory_behind(mpiexec: Program, tmp_path: Path) -> None:
    before = set(Path("/dev/shm").iterdir())
    (tmp_path / "killed.py").write_text(KILLED, encoding="utf-8")
    ended = mpiexec(3, tmp_path / "killed.py")
    assert ended.code != 0 and "went on" not in ended.out
    left = set(Path("/dev/shm").iterdir()) - before
    assert not [path for path in left if "fcsim" in path.name]
    assert not [number for number in processes_with("memfd:fcsim") if number != os.getpid()]


def processes_with(name: str) -> list[int]:
    """Processes that have a file of this name in their memory."""
    found = []
    for maps in Path("/proc").glob("[0-9]*/maps"):
        with suppress(OSError):
            found += [int(maps.parent.name)] if name in maps.read_text(errors="replace") else []
    return found
