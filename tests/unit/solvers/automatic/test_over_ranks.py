"""What `auto` does over ranks where Newton fails, here with one rank's W: ADMM, then Newton from where that has led."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim.problem import LocalProblem
from fcsim.solvers import Memory
from fcsim.solvers.automatic import over_ranks
from fcsim.solvers.automatic.pause import FAILS, Pause
from fcsim.solvers.automatic.race import RaceOptions
from fcsim.solvers.base import Iterate, Monitor, Status

Q, MU = np.array([-1.0, 0.5, 0.0, -1.0, 0.0, 3.0]), np.full(2, 0.8)
UNIQUE = LocalProblem(np.eye(6), Q, MU)
ANSWER = np.array([1.0, -0.5, 0.0, 1.0, 0.0, -0.8])
"""W = 1, contact by contact: one sticks, r_T = -q_T, the other slides, |r_T| = mu r_N against its velocity."""
SHARED = LocalProblem(np.kron(np.ones((2, 2)), np.eye(3)), np.tile([-1.0, 0.0, 0.0], 2), MU)


def test_newton_goes_on_from_where_admm_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    starts: list[np.ndarray] = []
    newton = over_ranks.newton

    def fails_at_first(problem: LocalProblem, r: np.ndarray, *arguments: Any) -> Iterate:
        starts.append(r)
        return newton(problem, r, *arguments) if len(starts) > 1 else Iterate(r, Status.SINGULAR)

    monkeypatch.setattr(over_ranks, "newton", fails_at_first)
    watch = Monitor(Q, MU, 3, 1e-10, memory=Memory.of(np.arange(2)))
    found = over_ranks.automatic_over_ranks(UNIQUE, np.zeros(6), watch, RaceOptions())
    assert found.status is Status.SOLVED and found.r == pytest.approx(ANSWER, abs=1e-9)
    assert not starts[0].any() and 0 < np.abs(starts[1] - ANSWER).max() < 0.5  # of 1 from zero
    assert watch.memory is not None and watch.memory.earlier(Pause) is None


def test_where_both_of_newton_s_tries_fail_it_pauses() -> None:
    watch = Monitor(SHARED.q, MU, 3, 1e-10, memory=Memory.of(np.arange(2)))
    found = over_ranks.automatic_over_ranks(SHARED, np.zeros(6), watch, RaceOptions())
    assert watch.memory is not None
    assert found.status in FAILS and watch.best <= over_ranks.NEAR and watch.memory.earlier(Pause) is not None
    done = watch.iterations
    assert over_ranks.automatic_over_ranks(SHARED, np.zeros(6), watch, RaceOptions()).status is Status.STAGNATED
    assert watch.iterations == done
