"""Methods chained as stages: each goes on from the best iterate so far, with the caller's own tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcsim.errors import InputError
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Run, Status, override

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Stage:
    """One stage: a run function and its options, whose max_iterations counts within the stage."""

    run: Run
    options: Any


@dataclass(frozen=True, kw_only=True)
class HybridOptions:
    """stages in order, the whole list repeated up to `cycles` times until solved."""

    stages: tuple[Stage, ...] = ()
    cycles: int = 1

    def __post_init__(self) -> None:
        if self.cycles < 1:
            raise InputError(f"option cycles: expected an integer >= 1, got {self.cycles}")


def hybrid(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: HybridOptions) -> Iterate:
    """Run the stages one after the other until one solves the problem; the last stage's status is the hybrid's."""
    last = Iterate(r, Status.MAX_ITERATIONS)
    for _ in range(options.cycles):
        for stage in options.stages:
            limit = monitor.iterations + stage.options.max_iterations
            last = stage.run(problem, r, monitor, override(stage.options, {"max_iterations": limit}))
            if last.status in (Status.SOLVED, Status.TIME_LIMIT):
                return last
            r = last.r if monitor.best_r is None else monitor.best_r
    return Iterate(r, last.status)
