"""Newton's steps shortened by the error of all contacts where it stalls: lengths beside W's own products, answers by their residuals."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.problem import scaled_error
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton import iterations
from fcsim.solvers.newton.spaces import LENGTHS, LocalSpace
from fcsim.solvers.newton.systems import choice, condensed
from tests.unit.solvers.newton.systems.test_two_level import walls


def test_a_shortened_step_brings_the_error_down_where_the_whole_one_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall of 35 bricks, whose weight is laid on at once, with lengths asked for after every system."""
    monkeypatch.setattr(condensed, "TWO_LEVEL_FROM", 1)
    monkeypatch.setattr(choice, "TWO_LEVEL_FROM", 1)
    monkeypatch.setattr(iterations, "STALLED", -1)
    length, taken = LocalSpace.length, []

    def watched(space: LocalSpace, monitor: Monitor, error: float) -> float:
        t = length(space, monitor, error)
        W = space._system.operator

        def at(part: float) -> float:
            r = space._r + part * space._dr
            return monitor.error(r, W.affine(r, space._q))

        assert t in LENGTHS
        if t < 1:
            taken.append((at(t), at(1.0), at(0.0), min(map(at, LENGTHS))))
        return t

    monkeypatch.setattr(LocalSpace, "length", watched)
    for step in walls(1e-6, courses="5", blocks="6.5", steps="4"):
        assert scaled_error(step.reduction.local, step.result.r, floor=1e-3) <= 1e-6
    assert taken
    shortened, whole, before, least = np.array(taken).T
    assert np.all(shortened < before) and np.all(whole > 0.999 * before)
    assert np.all(shortened <= 1.001 * least)  # u carried along differs by round-off
