"""That ranks which share a simulation have not drifted apart."""

from __future__ import annotations

from fcsim.ranks import world
from fcsim.timestep.step import Step


def same_on_all_ranks(step: Step) -> Step:
    """The step; `Drifted` where ranks that share it have not posed the same problem, or not found the same state and reactions, bit by
    bit."""
    if (ranks := world()) is not None:
        state, result, posed = step.state, step.result, step.problem
        how = repr((result.status.name, step.substeps, state.t)).encode()
        ranks.same(f"step {step.number}", (posed.f, posed.w, posed.mu, state.x, state.v, result.r, how))
    return step
