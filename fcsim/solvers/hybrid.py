"""Methods chained as stages: each goes on from the best iterate so far, with the caller's own tolerance."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain, repeat

from fcsim.arrays import FloatArray
from fcsim.errors import InputError
from fcsim.linear.factors import SingularMatrix
from fcsim.problem import LocalProblem
from fcsim.solvers.base import Iterate, Monitor, Options, Run, Status, override


@dataclass(frozen=True)
class Stage:
    """One stage: a run function and its options, whose max_iterations counts within the stage."""

    run: Run
    options: Options


@dataclass(frozen=True, kw_only=True)
class HybridOptions(Options):
    """max_iterations: of all stages together; first: stages run once; stages: run in order after them, the whole list up to `cycles` times
    until solved.

    Siconos' strategies for NSN_AC as data: VI_EG_NSN is (extragradient, Newton) once; PLI_NSN_LOOP is (projections with local
    iterations, Newton) in cycles; NSN_AND_PLI_NSN_LOOP has Newton as `first` before the same cycles.
    """

    max_iterations: int = 1_000_000
    first: tuple[Stage, ...] = ()
    stages: tuple[Stage, ...] = ()
    cycles: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        for stage in (*self.first, *self.stages):
            if not isinstance(stage, Stage):
                raise InputError(f"options first, stages: expected tuples of Stage, got a {type(stage).__name__} in one")
        self.integers_from(cycles=1)


def hybrid(problem: LocalProblem, r: FloatArray, monitor: Monitor, options: HybridOptions) -> Iterate:
    """Run the stages one after the other until one solves the problem; the last stage's status is the hybrid's.

    A cycle that leaves the best iterate where it was would only be repeated by the next: it is the last.
    """
    last = Iterate(r, Status.MAX_ITERATIONS)
    for cycle, stages in enumerate(chain((options.first,), repeat(options.stages, options.cycles))):
        before = monitor.best
        for stage in stages:
            if monitor.iterations >= options.max_iterations and monitor.history:
                return Iterate(r, Status.MAX_ITERATIONS)
            limit = min(monitor.iterations + stage.options.max_iterations, options.max_iterations)
            last = _stage(stage, problem, r, monitor, limit)
            if last.status in (Status.SOLVED, Status.TIME_LIMIT):
                return last
            r = last.r if monitor.best_r is None else monitor.best_r
        if cycle > 0 and monitor.best >= before:
            break
    return Iterate(r, last.status)


def _stage(stage: Stage, problem: LocalProblem, r: FloatArray, monitor: Monitor, limit: int) -> Iterate:
    """Run one stage up to `limit` iterations of the monitor; a factorisation that fails in it ends the stage, not the hybrid."""
    try:
        return stage.run(problem, r, monitor, override(stage.options, {"max_iterations": limit}))
    except SingularMatrix as singular:
        return Iterate(r, Status.SINGULAR, str(singular))
