"""Programs under mpiexec, each in a session of its own that ends in time, whatever its ranks do."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest

LAUNCHER = Path(sys.executable).parent / "mpiexec"
COMPILING = Path(__file__).parents[2] / "compiling.py"


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str


Program = Callable[..., Ended]
OnRanks = Callable[[str, int], list[dict[str, Any]]]

TOGETHER = {
    2: {"test_one_body": "one_body", "test_unlike": "unlike", "test_distributed": "walls", "test_clocks": "clocks"},
    3: {"test_parts": "parts", "test_same_bits": "scenarios", "test_two_level": "two_level"},
}
"""Programs of this folder, by the tests that ask for them, which so many ranks do one after the other: by themselves half of their time
would be imports. The one that changes clocks is the last."""


def end(process: subprocess.Popen[str]) -> None:
    process.terminate()
    with suppress(subprocess.TimeoutExpired):
        process.wait(5)
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


@pytest.fixture(scope="session")
def mpiexec() -> Program:
    """mpiexec(ranks, *arguments of python, timeout, cwd, env): how it ended. `timeout` is for ranks that hang, on whatever busy machine."""
    if not LAUNCHER.exists():
        pytest.skip("no mpiexec beside this Python")

    def run(
        ranks: int, *arguments: str | Path, timeout: float = 600, cwd: Path | None = None, env: Mapping[str, str] | None = None
    ) -> Ended:
        script = [str(COMPILING)] if str(arguments[0]).endswith(".py") else []  # whose ranks need the same functions at once
        command = [str(LAUNCHER), "-n", str(ranks), sys.executable, *script, *map(str, arguments)]
        own = {**os.environ, "FCSIM_THREADS": "1", **(env or {})}
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=cwd, env=own, start_new_session=True
        ) as process:
            try:
                out, err = process.communicate(timeout=timeout)
            except subprocess.TimeoutExpired:
                end(process)
                out, err = process.communicate()
                pytest.fail(f"{ranks} ranks did not end within {timeout} s: {out[-2000:]} {err[-2000:]}")
        return Ended(process.returncode, out, err)

    return run


@pytest.fixture(scope="session")
def on_ranks(mpiexec: Program, tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> OnRanks:
    """on_ranks(program, ranks): what a program of this folder has written on each rank. Those of `TOGETHER` whose tests are asked for are
    done with it."""
    tests = {item.path.stem for item in request.session.items}

    @cache  # of a failure too: each test would begin the ranks anew
    def started(programs: tuple[str, ...], ranks: int) -> tuple[Path, Ended]:
        folder = tmp_path_factory.mktemp("ranks")
        for name in programs:
            (folder / name).mkdir()
        together = Path(__file__).with_name("together.py")
        return folder, mpiexec(ranks, together, folder, *programs, env={"PYTHONPATH": str(COMPILING.parents[1])})

    @cache
    def found(program: str, ranks: int) -> list[dict[str, Any]]:
        with_it = tuple(name for test, name in TOGETHER.get(ranks, {}).items() if test in tests)
        folder, ended = started(with_it if program in with_it else (program,), ranks)
        assert ended.code == 0, ended.err
        return [json.loads((folder / program / f"{rank}.json").read_text(encoding="utf-8")) for rank in range(ranks)]

    return found
