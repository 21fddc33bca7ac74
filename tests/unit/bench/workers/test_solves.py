"""Warming up: a method that hangs there is ended soon, and one that compiles is not."""

import multiprocessing
import os
import time
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from numba.core.event import trigger_event

from fcsim.bench.workers import killable, solves
from fcsim.problem import LocalProblem
from fcsim.solvers import SOLVERS, Method, Status
from fcsim.solvers.base import Iterate, Monitor, Options

HERE = os.getpid()
REACHED: list[str] = []
BEGUN, ENDED = (multiprocessing.get_context("fork").Event() for _ in range(2))


def hangs(problem: LocalProblem, r: np.ndarray, monitor: Monitor, options: Options) -> Iterate:
    time.sleep(60)
    return Iterate(r, Status.STAGNATED)


def compiles(problem: LocalProblem, r: np.ndarray, monitor: Monitor, options: Options) -> Iterate:
    """For numba's listeners this compiles for longer than the limit of the test below; here it need not again."""
    with trigger_event("numba:compile"):
        BEGUN.set()
        time.sleep(0.0 if os.getpid() == HERE else 6.0)
        ENDED.set()
    REACHED.append("compiled")
    return Iterate(r, Status.STAGNATED)


@pytest.fixture(autouse=True)
def table() -> Iterator[None]:
    SOLVERS["HANGS"] = Method(hangs, Options(), "mine", "this test")
    SOLVERS["COMPILES"] = Method(compiles, Options(), "mine", "this test")
    yield
    del SOLVERS["HANGS"], SOLVERS["COMPILES"]


def test_a_method_that_hangs_is_ended_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(solves, "HANGS", 0.5)
    begun = time.monotonic()
    solves.warm_on({("HANGS", 0): solves.small_problem(3)})
    assert time.monotonic() - begun < 30  # half of what it sleeps; it had 120 s


def test_a_method_that_compiles_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is run again here once its child has ended by itself. The clock goes while that compiles: how long it takes to begin is the
    machine's."""
    readings = list[float]()

    def clock() -> float:
        if BEGUN.is_set() and not ENDED.is_set():
            readings.append(time.monotonic())
        return readings[-1] - readings[0] if readings else 0.0

    monkeypatch.setattr(killable, "time", SimpleNamespace(monotonic=clock))
    monkeypatch.setattr(solves, "HANGS", 3.0)
    REACHED.clear()
    solves.warm_on({("COMPILES", 0): solves.small_problem(3)})
    assert REACHED == ["compiled"]
