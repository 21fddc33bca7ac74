"""Stones that friction holds by wedging alone are named, beside what becomes of them in simulation from rest."""

from __future__ import annotations

import pytest

from fcsim.masonry import Acceleration, MasonryProblem, PointForce, analyse, trial
from fcsim.masonry.atlas.shapes import arch, cuboid
from fcsim.masonry.remarks import remarks

G = 9.81
WALLS = [cuboid(name, (x, 0.0, 0.0), (x + 1.0, 0.4, 0.5), support=True) for name, x in (("left", -1.0), ("right", 0.4))]
STONE, ON_TOP = cuboid("stone", (0.0, 0.0, 0.0), (0.4, 0.4, 0.5)), cuboid("on top", (0.1, 0.0, 0.5), (0.3, 0.4, 0.7))


def said(problem: MasonryProblem) -> list[str]:
    found = analyse(problem)
    assert found.associative.outcome == "unbounded"
    return [remark for remark in remarks(found, None) if "wedged" in remark]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_stone_between_two_walls_and_what_lies_on_it_are_named_and_fall(dimension: int) -> None:
    """h = g t^2 / 2, as if no wall were there; limit analysis has it borne at every multiplier."""
    problem = MasonryProblem("chimney", dimension, (*WALLS, STONE, ON_TOP), 0.9)
    assert len(said(problem)) == 1 and "nothing bears 'stone', 'on top' from below" in said(problem)[0]
    seen = trial(problem, 0.0, duration=0.3)
    assert seen.falls and seen.displacement == pytest.approx(0.5 * G * seen.t**2, rel=0.2)


def test_what_is_pressed_or_leans_stands_and_is_not_named() -> None:
    """A stone that a force of twice the weight over the friction presses to a wall; an arch."""
    weight = 0.4 * 0.4 * 0.5 * 2000.0 * G
    pressed = MasonryProblem(
        "pressed", 2, (WALLS[0], STONE), 0.9, (Acceleration((0.0, 0.0, -G)), PointForce("stone", (-2 * weight / 0.9, 0.0, 0.0)))
    )
    voussoirs = arch(7, 0.3, 0.8)
    for problem in (pressed, voussoirs):
        assert said(problem) == []
        assert not trial(problem, 0.0, duration=0.2).falls


def test_others_that_stand_without_them_do_not_hide_them() -> None:
    far = [cuboid("floor", (4.0, 0.0, -0.5), (6.0, 0.4, 0.0), support=True), cuboid("apart", (4.5, 0.0, 0.0), (5.0, 0.4, 0.5))]
    assert "bears 'stone' from below" in said(MasonryProblem("two", 2, (*WALLS, STONE, *far), 0.9))[0]
