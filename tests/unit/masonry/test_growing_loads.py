"""Loads that grow with the multiplier: moments alone, beside statics; loads that act on supports, or none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.masonry import (
    Acceleration,
    Block,
    MasonryProblem,
    PointForce,
    analyse,
    associative_limit,
    bracket,
    coulomb_limit,
    limit_problem,
    pushed,
)
from fcsim.masonry.limit_analysis.programs import Answer, Program
from fcsim.masonry.remarks import remarks
from fcsim.mesh.solids.closed_surface import ClosedSurface, closed_surface

CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], dtype=float)
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
WEIGHT = 2000.0 * 0.3 * 0.5 * 1.0 * 9.81  # [N]


def stone_on_floor(*loads: PointForce) -> MasonryProblem:
    def box(name: str, low: tuple[float, float, float], size: tuple[float, float, float]):  # type: ignore[no-untyped-def]
        return closed_surface(name, (np.array(low) + CORNERS * size).tolist(), FACES)

    floor = Block(box("floor", (-2, -2, -1), (4, 4, 1)), support=True)
    stone = Block(box("stone", (-0.15, -0.25, 0), (0.3, 0.5, 1.0)), density=2000.0)
    return MasonryProblem("stone", 3, (floor, stone), mu=0.6, loads=(Acceleration((0.0, 0.0, -9.81)), *loads))


@pytest.mark.parametrize(
    ("moment", "borne"),
    [
        ((0.0, 100.0, 0.0), WEIGHT * 0.15 / 100),  # turns about the edge at x = 0.15
        ((-100.0, 0.0, 0.0), WEIGHT * 0.25 / 100),
        ((0.0, 0.0, 100.0), 0.6 * WEIGHT * np.hypot(0.15, 0.25) / 100),  # twists on its four corners
    ],
)
def test_a_moment_alone(moment: tuple[float, float, float], borne: float) -> None:
    """Limit analysis and the simulation, which had no acceleration to find its times from."""
    problem = stone_on_floor(PointForce("stone", (0.0, 0.0, 0.0), scaled=True, moment=moment))
    found = analyse(problem)
    assert found.associative.multiplier == pytest.approx(borne, rel=1e-5)
    seen = bracket(problem, 0.98 * borne, 1.02 * borne, resolution=0.02)
    assert 0.97 * borne < seen.fall[0] < seen.fall[1] < 1.03 * borne


def test_loads_on_supports_alone_grow_upon_nothing() -> None:
    problem = stone_on_floor(PointForce("floor", (1000.0, 0.0, 0.0), scaled=True))
    assert any("no load grows upon a free block" in said for said in remarks(analyse(problem), None))
    with pytest.raises(InputError, match="expected a load that grows on a free block"):
        bracket(problem, 1.0, 2.0)


def test_no_load_that_grows_is_said() -> None:
    (said,) = remarks(analyse(stone_on_floor()), None)
    assert "no load grows upon a free block" in said


def test_friction_of_pairs_that_do_not_touch_is_said() -> None:
    stone = stone_on_floor()
    above = Block(closed_surface("above", (np.array((-0.15, -0.25, 2.0)) + CORNERS * (0.3, 0.5, 1.0)).tolist(), FACES), support=True)
    far = replace(stone, blocks=(*stone.blocks, above), between={("above", "stone"): 0.1, ("floor", "stone"): 0.3})
    found = analyse(pushed(far, (1.0, 0.0, 0.0)))
    (said,) = (words for words in remarks(found, None) if "mu_between" in words)
    assert said == "mu_between of 'above' and 'stone': they do not touch, and it counts nowhere"


def test_gravity_in_other_units_is_said() -> None:
    """Of a stone in mm, t and s a push by its weight at 9.81 has a multiplier a thousand times too large."""
    stone = replace(stone_on_floor(), loads=(Acceleration((0.0, 0.0, -9810.0)),))
    found = analyse(pushed(stone, (1.0, 0.0, 0.0)))
    assert found.associative.multiplier == pytest.approx(300.0)
    assert any("is 9810 m/s^2, far from 9.81" in said for said in remarks(found, None))


def test_lengths_of_another_unit_and_an_angle_of_friction_are_said() -> None:
    """A stone of 1 m in cm, whose multiplier b / h = 0.3 gives nothing away; 35 degrees of friction, whose coefficient is tan 35."""
    stone = stone_on_floor()
    blocks = tuple(replace(block, surface=replace(block.surface, points=100.0 * block.surface.points)) for block in stone.blocks)
    found = analyse(pushed(replace(stone, blocks=blocks, mu=35.0), (1.0, 0.0, 0.0)))
    assert found.associative.multiplier == pytest.approx(0.3)
    large, steep = remarks(found, None)
    assert large.startswith("blocks are 100 m large in the median: are lengths in mm or cm?")
    assert steep == "mu 35 is that of no stone: if it is the angle of friction in degrees, mu is 0.7002"


def prism(name: str, section: list[tuple[float, float]], support: bool = False) -> Block:
    """Of 1 m along y, above a convex section in x and z, counter-clockwise as seen from -y."""
    n = len(section)
    points = [(x, y, z) for y in (0.0, 1.0) for x, z in section]
    sides = [(k, (k + 1) % n, n + (k + 1) % n, n + k) for k in range(n)]
    return Block(closed_surface(name, points, [tuple(reversed(range(n))), tuple(range(n, 2 * n)), *sides]), density=2000.0, support=support)


@pytest.mark.parametrize("slope", [0.0, -0.5])
def test_what_edges_bear_across_a_joint_is_told_from_what_joints_do(slope: float) -> None:
    """Stones meet along an edge: a below b, and their mirror images c below d, on bed joints that fall towards that edge from both sides.
    Across it b then touches c, and d a; without a slope nobody does."""
    h = 1.0 + slope
    below = [(-1.0, 0.0), (0.0, 0.0), (0.0, h), (-1.0, 1.0)]
    above = [(-1.0, 1.0), (0.0, h), (0.0, 3.0), (-1.0, 3.0)]
    mirrored = [[(-x, z) for x, z in reversed(section)] for section in (below, above)]
    floor = prism("floor", [(-3.0, -1.0), (3.0, -1.0), (3.0, 0.0), (-3.0, 0.0)], support=True)
    stones = [prism(name, section) for name, section in zip("abcd", (below, above, *mirrored), strict=True)]
    problem = MasonryProblem("four stones", 3, (floor, *stones), mu=0.6, loads=(Acceleration((0.0, 0.0, -9.81)),))
    found = analyse(pushed(problem, (1.0, 0.0, 0.0)))
    bodies = np.sort(found.limit.contacts.bodies, axis=1)
    across = (bodies.sum(axis=1) == 5) & (bodies[:, 0] > 0)  # a with d, b with c
    said = [words for words in remarks(found, None) if "along an edge or at a corner alone" in words]
    if slope == 0:
        assert not across.any() and not said
        return
    joints = np.flatnonzero(~across)
    alone = replace(
        found.limit, contacts=found.limit.contacts.take(joints), H=found.limit.H[:, (joints[:, None] * 3 + np.arange(3)).ravel()]
    )
    multiplier = associative_limit(alone).multiplier
    assert across.any() and multiplier < 0.9 * found.associative.multiplier
    assert said == [
        "'a' and 'd' and 1 other pair of blocks meet along an edge or at a corner alone, and limit analysis counts what they bear there: "
        f"with joints alone the associative multiplier is {multiplier:.6g}"
    ]


def test_what_falls_under_the_loads_that_stay_is_not_said_to_stand_at_none() -> None:
    """A stone between two upright walls that do not press it: each trial falls, that without a multiplier too."""
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]

    def prism(name: str, x: float, width: float) -> ClosedSurface:
        points = [(x + width * a, y, b) for y in (0.0, 1.0) for a, b in corners]
        sides = [((k + 1) % 4, k, 4 + k, 4 + (k + 1) % 4) for k in range(4)]
        return closed_surface(name, points, [(0, 1, 2, 3), (7, 6, 5, 4), *sides])

    walls = (Block(prism("left", -1.0, 1.0), support=True), Block(prism("right", 0.5, 1.0), support=True))
    loads = (Acceleration((0.0, 0.0, -9.81)), Acceleration((0.0, 0.0, -9.81), scaled=True))
    problem = MasonryProblem("wedged", 2, (*walls, Block(prism("stone", 0.0, 0.5), density=2000.0)), mu=0.6, loads=loads)
    seen = bracket(problem, 0.01, 0.1, resolution=0.1)
    assert seen.motion == seen.fall == (0.0, 0.0)


def test_an_undecided_limit_is_not_above_the_associative_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tresca's program may allow more than Coulomb's cones before it allows nothing at all."""
    problem = limit_problem(pushed(stone_on_floor(), (1.0, 0.0, 0.0)))
    upper = associative_limit(problem)
    answers = iter([Answer(2 * upper.multiplier, upper.r, np.zeros(len(problem.free)))])
    monkeypatch.setattr(Program, "solve", lambda self, *, given=None, **_: next(answers, None) if given is not None else None)
    found = coulomb_limit(problem, upper)
    assert found.outcome == "undecided" and found.multiplier == upper.multiplier


def test_where_limit_analysis_ends_without_an_answer_simulation_is_named() -> None:
    """The outcome is set by hand: which structures end so depends on digits of the programs."""
    found = analyse(pushed(stone_on_floor(), (1.0, 0.0, 0.0)))
    assert not remarks(found, None)
    open_end = replace(found, coulomb=replace(found.coulomb, outcome="undecided"))
    (said,) = remarks(open_end, None)
    assert "did not converge" in said and "fcsim push or tilt" in said and f"{found.associative.multiplier:.6g}" in said
