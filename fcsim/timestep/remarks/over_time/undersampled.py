"""What is said of loads and motions that go up and down within a step, of which the steps see little or nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from fcsim.assembly.loads import factor_at
from fcsim.assembly.model import Model
from fcsim.assembly.supports import DrivenRotation
from fcsim.timestep.scheme import Scheme

LOOKED_AT, PLACES = 24, 8
"""Steps that are looked at, spread over the run, and places in each."""
OFF = 0.25
"""Of the range of a function over the run: how far it is, within a step, from the straight line between the step's ends. A sine of four
steps a period is off by 0.11, one of two and a half by 0.25."""
MOST = 0.5
"""Of the steps: a load that is switched on, or a pulse, is off in few."""
FEWEST = 4
"""Steps of a run that can tell what goes up and down from what grows."""


def undersampled(model: Model, scheme: Scheme, begin: float, steps: int) -> Iterator[str]:
    """The first load or motion, in dynamics, whose period is about two steps or less: at the steps it is another function, or none."""
    if not scheme.timing.moving or steps < FEWEST:
        return
    first = np.unique(np.linspace(0, steps - 1, min(steps, LOOKED_AT)).astype(int))
    share = np.linspace(0.0, 1.0, PLACES + 1)
    times = begin + scheme.h * (first[:, None] + share)
    for what, function in functions_of_time(model):
        values = np.array([np.asarray(function(float(t)), dtype=np.float64).ravel() for t in times.ravel()]).reshape(*times.shape, -1)
        extent = np.ptp(values, axis=(0, 1)).max()
        straight = values[:, :1] + share[:, None] * (values[:, -1:] - values[:, :1])
        off = np.abs(values - straight).max(axis=(1, 2))
        if extent > 0 and np.count_nonzero(off > OFF * extent) > MOST * len(first):
            yield (
                f"{what} goes up and down within steps of h = {scheme.h:g}, which see little of it: choose h below a tenth of its period, "
                "or give what it is on average"
            )
            return


def functions_of_time(model: Model) -> Iterator[tuple[str, Callable[[float], ArrayLike]]]:
    """Gravity, the loads' factors (each once) and the motions of supports, each with a name for it."""
    if model.gravity is not None:
        yield "gravity", model.gravity_at
    for load in {id(load.factor): load for load in reversed(model.loads)}.values():
        yield f"the {type(load).__name__} on body {load.body!r}", partial(factor_at, load)
    for support in model.supports:
        if isinstance(support, DrivenRotation):
            yield f"the driven rotation of body {support.body!r}", support.turned
        elif support.displacement is not None:
            yield f"the support of body {support.body!r}", support.way
        elif callable(support.velocity):
            yield f"the support of body {support.body!r}", support.speed
