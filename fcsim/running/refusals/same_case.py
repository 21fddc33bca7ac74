"""That all ranks have built the same case, and what they have exchanged in its run."""

from __future__ import annotations

import numpy as np

from fcsim.brief import of_any_process
from fcsim.ranks import world
from fcsim.records import json_text
from fcsim.running.case import Case
from fcsim.running.description import Description, RankWork
from fcsim.timestep.state import at_rest


def same_case(case: Case, description: Description) -> None:
    """`Drifted` (of `fcsim.ranks`) where ranks that share a run have not built the same: other numbers of the model, its beginning, its
    loads at that time, its sensors, its description."""
    ranks = world()
    if ranks is None:
        return
    simulation = case.simulation
    model, initial = simulation.model, simulation.initial or at_rest(simulation.model, h=simulation.scheme.h)
    ranks.same("the case as it is described", (json_text(description).encode(),))
    texts = [repr([sensor.column for sensor in case.sensors]), repr(simulation.scheme), repr(simulation.solver)]
    numbers = [model.reference, model.driven_dofs, initial.x, initial.v, model.load(initial.t)]
    ranks.same("the case's numbers", [of_any_process(text).encode() for text in texts] + [np.ascontiguousarray(array) for array in numbers])


def shared_work() -> tuple[RankWork, ...]:
    """What each rank has sent so far; () where there is one process."""
    ranks = world()
    if ranks is None:
        return ()
    return tuple(RankWork(exchanges, messages, count) for exchanges, messages, count in ranks.work().tolist())
