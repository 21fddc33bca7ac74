"""Supports that give way: reactions by statics, thrust by limit analysis."""

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.masonry import MasonryProblem, Movement, Stone, limit_problem, settle, support_forces
from fcsim.masonry.atlas.shapes import arch, cuboid

G = 9.81


def beam(dimension: int) -> MasonryProblem:
    """A beam of 4 m on three supports of 2 mm under it, at its ends and its middle: where on them it lies matters little."""
    places = [("left", 0.0), ("middle", 1.999), ("right", 3.998)]
    piers = [cuboid(name, (x, 0.0, -1.0), (x + 0.002, 0.4, 0.0), support=True) for name, x in places]
    return MasonryProblem("beam", dimension, (*piers, cuboid("beam", (0.0, 0.0, 0.0), (4.0, 0.4, 0.5))), 0.6)


WEIGHT = 4.0 * 0.4 * 0.5 * 2000.0 * G


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_beam_on_three_supports_is_determinate_when_one_settles(dimension: int) -> None:
    middle = settle(beam(dimension), [Movement("middle", (0.0, 0.0, -1e-3))], steps=5)
    for k in range(1, 6):  # the middle bears nothing, the others half each, and the beam stays where it is
        assert [float(middle.forces[name][k, -1]) for name in ("left", "middle", "right")] == pytest.approx(
            [WEIGHT / 2, 0.0, WEIGHT / 2], abs=5e-4 * WEIGHT
        )
    assert middle.opening[-1] == pytest.approx(1e-3, rel=1e-3) and not middle.falls
    # an end settles: the beam, whose centroid is over the middle, turns after it about the nearer edge of the middle
    end = settle(beam(dimension), [Movement("left", (0.0, 0.0, -1e-3))], steps=5)
    total = sum(end.forces[name][-1, -1] for name in ("left", "middle", "right"))
    assert total == pytest.approx(WEIGHT, rel=1e-4)


@pytest.mark.parametrize(("out", "which"), [(0.01, 0), (-0.01, 1)])
def test_an_arch_whose_supports_part_has_the_least_thrust_and_one_that_is_pressed_the_largest(out: float, which: int) -> None:
    problem = arch(12, 0.25, 0.8)
    names = [block.name for block in problem.blocks if block.support]
    bounds = {of.name: np.sort(np.abs([of.least[0], of.largest[0]])) for of in support_forces(limit_problem(problem))}
    seen = settle(problem, [Movement(names[0], (out, 0.0, 0.0))], steps=20)  # angle 0: it stands at x > 0
    thrust = seen.thrust(names[0])
    assert thrust[1] == pytest.approx(bounds[names[0]][which], rel=2e-3)
    assert seen.open_joints[1] >= 3
    weight = sum(block.surface.moments()[0] for block in problem.blocks if not block.support) * 2000.0 * G
    up = sum(force[:, -1] for force in seen.forces.values())
    np.testing.assert_allclose(up, weight, rtol=1e-3)


def test_a_block_on_a_support_that_turns_slides_at_the_angle_of_friction() -> None:
    """Statics holds up to tan(angle) = mu; then the block runs away. The last row is the last shape that stands: a step has the forces of
    where it begins, so that the row after it was given, too, and the fall one step late."""
    slab = cuboid("slab", (-2.0, 0.0, -0.5), (2.0, 1.0, 0.0), support=True)
    stone = cuboid("stone", (-0.5, 0.0, 0.0), (0.5, 1.0, 0.2))
    for dimension in (2, 3):
        problem = MasonryProblem("slope", dimension, (slab, stone), 0.3)
        seen = settle(problem, [Movement("slab", turn=(0.0, np.radians(25.0), 0.0))], steps=100)
        assert seen.falls
        step = 0.25
        angle = step * (len(seen.moved) - 1)
        borne = np.degrees(1e-3)  # out of balance by a thousandth of the weight is what falls
        assert np.degrees(np.arctan(0.3)) - step < angle <= np.degrees(np.arctan(0.3)) + borne
        force = seen.forces["slab"][-1]
        assert force[-1] == pytest.approx(0.2 * 2000.0 * G, rel=1e-3)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_lintel_falls_where_a_pier_has_gone_from_under_it(dimension: int) -> None:
    """It lies on 0.25 m of each pier and goes with one of them. Past its bearing it wedged between the piers as it fell, which counted as
    standing: with a step of 15 mm it stood at 300 mm, on the upright face of a pier."""
    piers = [cuboid(name, (x, 0.0, -1.0), (x + 0.3, 0.2, 0.0), support=True) for name, x in (("left", 0.0), ("right", 1.3))]
    problem = MasonryProblem("lintel", dimension, (*piers, cuboid("lintel", (0.05, 0.0, 0.0), (1.55, 0.2, 0.3))), 0.7)
    seen = settle(problem, [Movement("right", (0.3, 0.0, 0.0))], steps=21)
    step = 0.3 / 21
    assert seen.falls and 0.25 - step < seen.moved[-1] <= 0.25
    assert seen.forces["left"][-1, -1] + seen.forces["right"][-1, -1] == pytest.approx(1.5 * 0.2 * 0.3 * 2000.0 * G, rel=1e-3)
    assert abs(seen.forces["left"][-1, 0]) <= 0.7001 * seen.forces["left"][-1, -1]


def test_a_fall_that_statics_have_no_answer_to_is_a_fall() -> None:
    """An arch that slides as its springings part ended with a step that did not converge."""
    problem = arch(12, 0.2, 0.4)
    names = [block.name for block in problem.blocks if block.support]
    assert settle(problem, [Movement(names[0], (0.3, 0.0, 0.0))], steps=12).falls


def tower(dimension: int) -> MasonryProblem:
    base = cuboid("base", (0.0, 0.0, -0.2), (1.0, 1.0, 0.0), support=True)
    drums = [cuboid(f"{k}", (0.0, 0.0, 0.4 * k), (1.0, 1.0, 0.4 * k + 0.4)) for k in range(4)]
    return MasonryProblem("tower", dimension, (base, *drums), 0.6)


@pytest.mark.parametrize(("dimension", "steps"), [(2, 1), (3, 2)])
def test_a_tower_that_leans_little_stands_by_steps_of_any_size(dimension: int, steps: int) -> None:
    """Turned by 10 degrees, less than friction, atan 0.6, and its height, atan 1 / 1.6, bear. It "fell" at once: what closed the joints
    that a step leaves open by the square of its turn was taken for a fall."""
    seen = settle(tower(dimension), [Movement("base", turn=(0.0, np.radians(10.0), 0.0))], steps=steps)
    assert not seen.falls and len(seen.moved) == steps + 1


def test_a_tower_slides_at_the_angle_of_friction_by_large_steps() -> None:
    """By 3.8 degrees a step. It "fell" in the first one."""
    turn, steps = 0.8, 12
    seen = settle(tower(2), [Movement("base", turn=(0.0, turn, 0.0))], steps=steps)
    assert seen.falls and len(seen.moved) - 1 == np.floor(np.arctan(0.6) / turn * steps)


def test_an_arch_stands_as_its_springings_part_by_one_step_as_by_many() -> None:
    """Whose 5 cm are far from the way at which hinges fall, some 37 cm by small steps: in one step it "fell"."""
    problem = arch(12, 0.25, 0.8)
    name = next(block.name for block in problem.blocks if block.support)
    for steps in (1, 5):
        assert not settle(problem, [Movement(name, (0.05, 0.0, 0.0))], steps=steps).falls


def test_a_beam_that_balances_on_its_middle_stands_as_an_end_goes() -> None:
    """By a lever of 1 mm: statics know its forces to some ten-thousandths of its weight. It "fell" in the fifth of 30 steps."""
    seen = settle(beam(2), [Movement("left", (0.0, 0.0, -1e-3))], steps=30)
    assert not seen.falls and seen.opening[-1] == pytest.approx(1e-3, rel=1e-3)


def test_an_elastic_beam_on_three_supports_gives_their_middle_less_as_it_settles() -> None:
    """Two spans l under w: the middle bears 5 w l / 4 - 6 E I s / l^3 when it has settled by s (S. Timoshenko, "Strength of
    Materials", 1930, the theorem of three moments); with little friction, which holds the beam's lower face."""
    E, depth, breadth, l = 1e9, 0.2, 0.4, 1.998  # between the edges of the supports
    piers = [block for block in beam(2).blocks if block.support]
    slender = MasonryProblem("slender", 2, (*piers, cuboid("beam", (0.0, 0.0, 0.0), (4.0, breadth, depth))), 0.01)
    seen = settle(slender, [Movement("middle", (0.0, 0.0, -8e-3))], steps=2, blocks="deformable", stone=Stone(E, 0.0, cells=0.25))
    w, EI = 2000.0 * G * breadth * depth, E * breadth * depth**3 / 12
    middle = seen.forces["middle"][:, -1]
    assert middle[0] == pytest.approx(1.25 * w * l, rel=0.02)
    slope = (middle[0] - middle[1:]) / seen.moved[1:]
    assert slope == pytest.approx(6 * EI / l**3, rel=0.04)  # by cells of a quarter of the depth
    total = sum(force[:, -1] for force in seen.forces.values())
    assert total == pytest.approx(np.full(3, 4.0 * w), rel=1e-5)


@pytest.mark.parametrize(("out", "which"), [(0.01, 0), (-0.01, 1)])
def test_an_arch_of_stiff_voussoirs_has_the_thrust_of_rigid_ones(out: float, which: int) -> None:
    problem = arch(12, 0.25, 0.8)
    names = [block.name for block in problem.blocks if block.support]
    bounds = {of.name: np.sort(np.abs([of.least[0], of.largest[0]])) for of in support_forces(limit_problem(problem))}
    seen = settle(problem, [Movement(names[0], (out, 0.0, 0.0))], steps=4, blocks="deformable", stone=Stone(E=1e10, cells=1.0))
    thrust = seen.thrust(names[0])
    assert thrust[1:] == pytest.approx(np.full(4, bounds[names[0]][which]), rel=1e-4)
    assert not seen.falls and not seen.turned


def test_elastic_blocks_end_where_they_turn_and_slide_before() -> None:
    """Statics of small turns: a stone slides at the angle of friction below a degree; a steeper way ends at a degree, and says so."""
    slab = cuboid("slab", (-2.0, 0.0, -0.5), (2.0, 1.0, 0.0), support=True)
    stone = cuboid("stone", (-0.5, 0.0, 0.0), (0.5, 1.0, 0.2))
    for mu, falls in ((0.01, True), (0.3, False)):
        seen = settle(
            MasonryProblem("slope", 2, (slab, stone), mu),
            [Movement("slab", turn=(0.0, np.radians(2.0), 0.0))],
            steps=40,
            blocks="deformable",
            stone=Stone(E=1e9, cells=1.0),
        )
        assert (seen.falls, seen.turned) == (falls, not falls)
        angle = np.degrees(np.arctan(0.01)) if falls else 1.0
        assert 0.05 * (len(seen.moved) - 1) == pytest.approx(angle, abs=0.1)


def test_mistakes_are_named() -> None:
    problem = beam(2)
    for movements, word in (
        ([], "support"),
        ([Movement("beam", (0.0, 0.0, 1.0))], "beam"),
        ([Movement("left")], "displacement"),
        ([Movement("left", (0.0, 1.0, 0.0))], "plane"),
        ([Movement("left", (0.0, 0.0, 1.0)), Movement("left", (1.0, 0.0, 0.0))], "one movement"),
    ):
        with pytest.raises(InputError, match=word):
            settle(problem, movements)


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_only_wedging_would_hold_falls_before_a_support_moves(dimension: int) -> None:
    """A stone between two walls that nothing presses: friction as large as one likes bears it in limit analysis, and no friction in the
    step from rest, where r = 0 solves Coulomb's law (u_N = 0, u_T along the joints). It was a first row of a stone that lay 100 m below."""
    walls = [cuboid(name, (x, 0.0, 0.0), (x + 1.0, 0.4, 0.5), support=True) for name, x in (("left", -1.0), ("right", 0.4))]
    problem = MasonryProblem("chimney", dimension, (*walls, cuboid("stone", (0.0, 0.0, 0.0), (0.4, 0.4, 0.5))), 0.9)
    with pytest.raises(InputError, match=r"'stone' falls: .* nothing presses its joints together"):
        settle(problem, [Movement("right", (0.01, 0.0, 0.0))])
