"""Programs under mpiexec, each in a session of its own that ends in time, whatever its ranks do."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

LAUNCHER = Path(sys.executable).parent / "mpiexec"
COMPILING = Path(__file__).parents[2] / "compiling.py"


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str


Program = Callable[..., Ended]


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
