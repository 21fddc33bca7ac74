"""A structure without friction bears no push: the multiplier is 0. What no load pushes has no mechanism."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fcsim.masonry import Block, MasonryProblem, analyse, pushed
from fcsim.masonry.remarks import remarks
from fcsim.mesh.solids.closed_surface import closed_surface

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], dtype=float)
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def test_without_friction_the_multiplier_is_none_and_not_minus_none() -> None:
    """It was printed as -0, its angle as -0.000."""
    floor = Block(closed_surface("floor", CORNERS * (6, 1, 0.5) - (2, 0, 0.5), FACES), support=True)
    stone = Block(closed_surface("stone", CORNERS * (0.9, 1, 1), FACES), density=2000.0)
    found = analyse(pushed(MasonryProblem("smooth", 2, (floor, stone), mu=0.0), (1.0, 0.0, 0.0)))
    for limit in (found.associative, found.coulomb):
        assert limit.multiplier == 0.0 and math.copysign(1.0, limit.multiplier) > 0


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_stands_and_is_not_pushed_has_no_mechanism(dimension: int) -> None:
    """Joints that bear 3 kN were said to be open, since interior points leave a dual of 1e-9, in the units of its largest velocity."""
    floor = Block(closed_surface("floor", CORNERS * (6, 1, 0.5) - (2, 0, 0.5), FACES), support=True)
    lower = Block(closed_surface("lower", CORNERS * (1, 0.3, 0.3), FACES), density=2000.0)
    upper = Block(closed_surface("upper", CORNERS * (0.9, 0.3, 0.3) + (0.2, 0, 0.3), FACES), density=2000.0)
    found = analyse(MasonryProblem("stack", dimension, (floor, lower, upper), mu=0.5))
    assert found.associative.outcome == found.lowest.outcome == "unbounded" and not found.lowest.v.any()
    assert [(joint.between, joint.state) for joint in found.joints] == [(("floor", "lower"), "closed"), (("lower", "upper"), "closed")]
    weights = [0.3 * 0.3 * 2000.0 * 9.81 * length for length in (1.9, 0.9)]
    assert [joint.normal_force for joint in found.joints] == pytest.approx(weights, rel=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_no_load_ends_has_the_forces_of_the_loads_that_stay(dimension: int) -> None:
    """A stone pressed on its floor: forces of joints were those of a million times the load, without a word."""
    floor = Block(closed_surface("floor", CORNERS * (6, 1, 0.5) - (2, 0, 0.5), FACES), support=True)
    stone = Block(closed_surface("stone", CORNERS * (0.5, 0.3, 0.3), FACES), density=2000.0)
    found = analyse(pushed(MasonryProblem("pressed", dimension, (floor, stone), mu=0.5), (0.0, 0.0, -1.0)))
    assert found.lowest.outcome == "unbounded" and found.lowest.multiplier == math.inf
    assert found.joints[0].normal_force == pytest.approx(0.5 * 0.3 * 0.3 * 2000.0 * 9.81, rel=1e-6)
    assert any("forces of joints are some that bear the loads that stay" in said for said in remarks(found, None))


@pytest.mark.parametrize(("way", "said"), [((0.0, 0.0, 1.0), True), ((1.0, 0.0, 0.0), False)])
def test_what_is_lifted_by_its_own_weight_has_many_mechanisms(way: tuple[float, float, float], said: bool) -> None:
    """Stones that lift were said to slide and to stay closed, by chance of the program, without a word."""
    floor = Block(closed_surface("floor", CORNERS * (6, 1, 0.5) - (2, 0, 0.5), FACES), support=True)
    lower = Block(closed_surface("lower", CORNERS * (1, 0.3, 0.3), FACES), density=2000.0)
    upper = Block(closed_surface("upper", CORNERS * (0.9, 0.3, 0.3) + (0.1, 0, 0.3), FACES), density=2000.0)
    found = analyse(pushed(MasonryProblem("lifted", 2, (floor, lower, upper), mu=0.5), way))
    if said:
        assert found.associative.multiplier == pytest.approx(1.0, abs=1e-9)
    assert any("the one shown is one choice of many" in remark for remark in remarks(found, None)) == said
