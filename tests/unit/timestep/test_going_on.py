"""Runs that go on from any of their steps have the bits of the whole run: links, smooth contact in statics, steps that were cut."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import fcsim
from tests.analytic.test_linkage import Nothing
from tests.unit.timestep.test_links_alone import LINKED, thrown
from tests.unit.timestep.test_lost_contacts import drawn


def linked(name: str, theta: float) -> fcsim.Simulation:
    bodies, links = LINKED[name]
    model = fcsim.build_model(bodies)
    begun = fcsim.State(0.0, np.zeros(model.n_dofs), thrown(model))
    linkage = fcsim.Linkage(model, links)
    return fcsim.Simulation(model, Nothing(model), fcsim.Theta(4e-3, theta=theta), 4, initial=begun, linkage=linkage, witness=None, keep=3)


RUNS: dict[str, Callable[[], Any]] = {
    "hinge": lambda: linked("hinge of deformable bodies", 0.5),
    "hinge of rubber": lambda: linked("hinge of rubber", 0.5),
    "rod, theta 1": lambda: linked("rod of a rigid and a deformable body", 1.0),
    "smooth contact": lambda: drawn(0.2, 4, h=0.5),
    "smooth contact, steps of three facets": lambda: drawn(0.5, 4),
}


SLOW = "smooth contact, steps of three facets"


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] if name == SLOW else []) for name in RUNS])
def test_going_on_gives_the_same_bits(name: str) -> None:
    """From every step, with its anchor; fresh simulations know nothing of the whole run."""
    whole = list(RUNS[name]())
    assert any(step.substeps > 1 for step in whole[:-1]) == ("three facets" in name)
    for step in whole[:-1]:
        rest = list(RUNS[name]().run(step.moment, step.anchor))
        assert [one.number for one in rest] == [one.number for one in whole[step.number :]]
        for again, one in zip(rest, whole[step.number :], strict=True):
            assert np.array_equal(again.state.x, one.state.x) and np.array_equal(again.state.v, one.state.v)
            assert np.array_equal(again.result.r, one.result.r) and again.substeps == one.substeps
