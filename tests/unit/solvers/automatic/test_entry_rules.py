"""When later stages enter and what is expected of methods, rule by rule, each with a case on either side of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fcsim.bench.families import problems
from fcsim.problem import GlobalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers.automatic import admm, closed, expected, later, stages
from tests.unit.solvers.automatic.states import AFAR, EDGES_HELD, ENDED, FACES_HELD, INF, LOOSE, NEAR, STILL, Shown, newton, state

pytestmark = pytest.mark.usefixtures("what_is_held_is_written_down")


@pytest.mark.parametrize(
    ("changes", "proximal", "others", "due"),
    [
        ({}, newton(), 0.0, True),
        ({}, None, 900.0, False),
        ({"in_velocities": False}, newton(), 0.0, False),
        ({"best": AFAR}, newton(), 0.0, False),
        ({"best": AFAR, "without": ("proof",)}, newton(), 0.0, True),
        ({"holds": 1.2}, newton(), 0.0, True),  # beds, from zero
        ({"holds": FACES_HELD, "points": 2.9}, newton(), 0.0, True),
        ({"holds": LOOSE}, newton(iterations=60), 0.0, True),
        ({"holds": LOOSE}, newton(iterations=59), 0.0, False),
        ({"holds": LOOSE}, newton(iterations=69, tenfolds=5.0), 0.0, False),
        ({"holds": LOOSE}, newton(iterations=70, tenfolds=5.0), 0.0, True),
        ({"holds": LOOSE}, newton(iterations=3, result=ENDED), 0.0, True),
        ({"holds": LOOSE, "best": AFAR}, newton(iterations=250, fell=1.1), 0.0, False),
        ({"in_velocities": False}, newton(iterations=60, fell=1.1), 0.0, True),  # in W of few contacts, whatever they hold
        ({"in_velocities": False}, newton(iterations=59, fell=1.1), 0.0, False),
        ({"in_velocities": False}, newton(iterations=60, fell=1.12), 0.0, False),
        ({"in_velocities": False}, newton(iterations=3, result=ENDED), 0.0, True),
        ({"in_velocities": False, "nc": 33}, newton(iterations=60, fell=1.1), 0.0, True),
        ({"in_velocities": False, "nc": 34}, newton(iterations=60, fell=1.1), 0.0, False),
        ({"in_velocities": False, "warm": True}, newton(iterations=60, fell=1.1), 0.0, False),
        ({"in_velocities": False, "joints": object()}, newton(iterations=60, fell=1.1), 0.0, False),
        ({"holds": 1.2, "warm": True}, newton(), 0.0, True),
        ({"holds": 0.9, "warm": True}, newton(), 0.0, False),
        ({}, newton(iterations=59, spent=500.0, needed=499.0), 0.0, False),
        ({}, newton(iterations=60, spent=500.0, needed=499.0), 0.0, True),
        ({}, newton(iterations=30, spent=500.0, needed=501.0), 0.0, True),
        ({}, newton(iterations=29, spent=500.0, needed=501.0), 0.0, False),
        ({}, newton(iterations=3, result=ENDED), 0.0, True),
        ({}, newton(iterations=69, tenfolds=5.0), 0.0, False),  # in its own iterations
        ({}, newton(iterations=70, tenfolds=5.0), 0.0, True),
        ({}, newton(iterations=69, tenfolds=5.0, result=ENDED), 0.0, True),
        ({"warm": True}, newton(iterations=69, tenfolds=5.0), 0.0, True),
        ({"best": NEAR}, newton(best=10.1 * NEAR), 0.0, False),  # it will begin anew from an iterate that is well ahead
        ({"best": NEAR}, newton(best=9.9 * NEAR), 0.0, True),
        ({"best": NEAR}, newton(best=10.1 * NEAR, result=ENDED), 0.0, True),
        ({"best": NEAR, "warm": True}, newton(best=10.1 * NEAR), 0.0, True),
        ({"nc": 100}, newton(spent=150.0), 49.0, False),  # half a piece a contact in faces: 200
        ({"nc": 100}, newton(spent=150.0), 50.0, True),
        ({"nc": 100, "warm": True}, newton(spent=150.0), 49.0, True),
        ({"nc": 100, "dimension": 2}, newton(spent=350.0), 49.0, False),  # a piece a contact in edges: 400
        ({"nc": 100, "dimension": 2}, newton(spent=350.0), 50.0, True),
    ],
)
def test_paths_enter(changes: dict[str, Any], proximal: Shown | None, others: float, due: bool) -> None:
    runners = {"sweeps": Shown(spent=others), "interior point": Shown(result=ENDED)}
    runners |= {} if proximal is None else {"proximal Newton": proximal}
    assert later.enter_paths(state(runners=runners, **{"best": NEAR, "holds": FACES_HELD, **changes})) is due


@pytest.mark.parametrize(
    ("changes", "proximal", "due"),
    [
        ({}, newton(iterations=20), True),  # in beds of grains beside proximal Newton, once that has to share
        ({}, newton(iterations=19), False),
        ({}, newton(spent=301.0, tenfolds=6.0), False),
        ({}, newton(spent=1.0, iterations=19, result=ENDED), True),
        ({}, None, False),
        ({"warm": True}, newton(spent=301.0), False),
        ({"joints": object()}, newton(spent=301.0), False),
        ({"best": AFAR}, newton(spent=301.0), False),
        ({"best": AFAR, "without": ("proof",)}, newton(spent=301.0), True),
        ({"in_velocities": False}, newton(spent=301.0), True),
        ({"tol": 0.34 * NEAR}, newton(spent=301.0), False),  # within three times the tolerance
        ({"tol": 0.33 * NEAR}, newton(spent=301.0), True),
        ({"tol": 0.34 * NEAR}, newton(spent=301.0, iterations=250, fell=1.1), True),  # where proximal Newton stands still
        ({"tol": 0.34 * NEAR}, newton(spent=301.0, iterations=249, fell=1.1), False),
        ({"tol": 0.34 * NEAR}, newton(spent=301.0, iterations=250, fell=1.12), False),
        ({"tol": 0.34 * NEAR}, newton(spent=301.0, result=ENDED), True),
        ({"holds": FACES_HELD, "best": 1.1e-4}, newton(needed=151.0), True),  # ten of its iterations in blocks
        ({"holds": FACES_HELD, "best": 1.1e-4}, newton(needed=150.0), False),
        ({"holds": FACES_HELD, "best": 1e-4}, newton(needed=151.0), False),
        ({"holds": FACES_HELD, "best": 1e-4}, newton(needed=151.0, result=ENDED), True),
        ({"holds": EDGES_HELD, "dimension": 2, "best": 1.1e-4}, newton(needed=151.0), True),
    ],
)
def test_an_interior_point_enters(changes: dict[str, Any], proximal: Shown | None, due: bool) -> None:
    runners = {"sweeps": Shown(), **({} if proximal is None else {"proximal Newton": proximal})}
    assert later.enter_interior(state(runners=runners, **{"best": NEAR, **changes})) is due


def falling(iterations: int, last_third: float, tenfolds: float) -> list[float]:
    """Roots of tau along a path: down by so many powers of ten in all, by that factor in the last third."""
    third = iterations - 2 * iterations // 3
    before = 10.0**-tenfolds * last_third
    roots = [*np.geomspace(1.0, before, iterations - third), *np.geomspace(before, 10.0**-tenfolds, third + 1)[1:]]
    return [float(root) for root in roots]


@pytest.mark.parametrize(
    ("changes", "interior", "opens"),
    [
        ({}, None, True),
        ({}, Shown(iterations=30, paths=[falling(30, 1.41, 1.6)]), True),
        ({}, Shown(iterations=30, paths=[[1.0] * 30]), False),
        ({}, Shown(iterations=30, paths=[falling(30, 1.41, 1.6)], result=ENDED), False),
        ({}, Shown(iterations=31, paths=[[1.0] * 30, [1.0]]), False),
        ({"dimension": 3}, None, False),
        ({"single": False}, None, False),
        ({"in_velocities": True}, None, False),
        ({"warm": True}, None, False),
        ({"joints": object()}, None, False),
        ({"best": AFAR}, None, False),
        ({"without": ("interior point",)}, None, False),
    ],
)
def test_an_interior_point_goes_before_proximal_newton_in_beds_of_discs(
    changes: dict[str, Any], interior: Shown | None, opens: bool
) -> None:
    runners = {"sweeps": Shown(spent=900.0, iterations=900, needed=1e9), "Newton": Shown(result=ENDED)}
    runners |= {} if interior is None else {"interior point": interior}
    race = state(runners=runners, **{"best": NEAR, "dimension": 2, "single": True, "in_velocities": False, **changes})
    assert later.interior_opens(race) is opens
    assert interior is None or later.interior_alone(race, interior) is opens  # type: ignore[arg-type]
    assert later.enter_interior(race) is opens
    assert stages._enter_proximal(race) is not opens


@pytest.mark.parametrize(
    ("changes", "left", "enters"),
    [
        ({}, 226.0, True),  # what sweeps still cost, beyond 15 of its iterations
        ({}, 225.0, False),
        ({"best": AFAR, "dimension": 2, "in_velocities": False}, 226.0, True),
        ({"small": False}, 226.0, False),
        ({"warm": True}, 226.0, False),
        ({"joints": object()}, 226.0, False),
        ({"without": ("interior point",)}, 226.0, False),
    ],
)
def test_an_interior_point_goes_before_proximal_newton_in_small_beds(changes: dict[str, Any], left: float, enters: bool) -> None:
    race = state(runners={"sweeps": Shown(iterations=60, spent=60.0, needed=left)}, **{"best": NEAR, "small": True, **changes})
    assert later.enter_interior(race) is enters


@pytest.mark.parametrize("holds", [LOOSE, FACES_HELD])
def test_an_interior_point_in_a_small_bed_is_alone_on_its_first_path(holds: float) -> None:
    first, second = Shown(iterations=30, paths=[falling(30, 1.41, 1.6)]), Shown(iterations=31, paths=[[1.0] * 30, [1.0]])
    for interior, alone in ((first, True), (second, False)):
        race = state(runners={"sweeps": Shown(), "interior point": interior}, best=NEAR, small=True, holds=holds)
        assert later.interior_alone(race, interior) is alone  # type: ignore[arg-type]
        assert later.interior_opens(race) is alone


UNLIKE = np.array([1.0, 1001.0])
"""Compliances of contacts between bodies of unlike masses."""


@pytest.mark.parametrize(
    ("changes", "sweeps", "interior", "proximal"),
    [
        ({}, False, True, False),
        ({"passed": False}, True, False, False),
        ({"compliance": UNLIKE}, True, False, False),
        ({"small": False}, False, False, True),  # blocks, in their velocities
        ({"small": False, "in_velocities": False}, True, False, False),
        ({"small": False, "regular": True, "motion": object()}, False, False, False),  # joints with stiffness: Newton
        ({"small": False, "warm": True, "points": 2.9}, False, False, False),
    ],
)
def test_what_the_front_door_leaves_begins_without_sweeps(changes: dict[str, Any], sweeps: bool, interior: bool, proximal: bool) -> None:
    race = state(**{"best": NEAR, "small": True, "passed": True, **changes})
    assert stages._enter_sweeps(race) is sweeps
    assert later.enter_interior(race) is interior
    assert stages._enter_proximal(race) is proximal


@pytest.mark.parametrize(
    ("changes", "proximal", "zero", "interior"),
    [
        ({}, newton(iterations=20), True, False),
        ({}, newton(iterations=19), False, False),
        ({"best": AFAR}, newton(iterations=20), False, False),  # a proof goes first
        ({"best": AFAR, "without": ("proof",)}, newton(iterations=20), True, False),
        ({"tol": 0.34 * NEAR}, newton(iterations=20), False, False),  # within three times the tolerance
        ({"without": ("proximal Newton from zero",)}, newton(iterations=20), True, True),  # the race has no such stage then
        ({"compliance": np.array([1.0, 1000.0])}, newton(iterations=20), False, True),
        ({"small": True}, newton(iterations=20), False, True),
        ({"holds": FACES_HELD, "best": 1.1e-4}, newton(iterations=20), False, True),
        ({"warm": True}, newton(iterations=20), False, False),
    ],
)
def test_of_unlike_masses_proximal_newton_from_zero_takes_the_interior_points_place(
    changes: dict[str, Any], proximal: Shown, zero: bool, interior: bool
) -> None:
    race = state(runners={"sweeps": Shown(), "proximal Newton": proximal}, **{"best": NEAR, "compliance": UNLIKE, **changes})
    assert later.enter_from_zero(race) is zero
    assert later.enter_interior(race) is interior


FORTH, BACK = falling(30, 1.41, 1.0), falling(30, 1.39, 1.0)


@pytest.mark.parametrize(
    ("paths", "leads"),
    [
        ([], True),
        ([[]], True),
        ([[1.0] * 19], True),  # in its own iterations
        ([[1.0] * 20], False),
        ([falling(20, 1.39, 0.5)], False),
        ([falling(20, 1.41, 0.5)], True),
        ([falling(60, 1.41, 2.01)], True),  # twenty for each tenfold
        ([falling(61, 1.41, 2.01)], False),
        ([FORTH, []], False),  # a path has ended: the next one begins when it is its turn
        ([BACK, [1.0]], True),
        ([BACK, [1.0] * 19], True),
        ([FORTH, [1.0] * 20], False),
        ([BACK, FORTH], True),
        ([FORTH, BACK], False),
    ],
)
def test_an_interior_point_is_on_a_path_that_leads_on(paths: list[list[float]], leads: bool) -> None:
    assert later.on_a_path(Shown(paths=paths)) is leads  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "paths", "alone"),
    [
        ({}, [FORTH], False),  # in beds proximal Newton shares
        ({"holds": FACES_HELD, "best": 1.1e-4}, [FORTH], True),
        ({"holds": FACES_HELD, "best": 1e-4}, [FORTH], False),  # what is left sweeps and proximal Newton do in less
        ({"holds": EDGES_HELD, "dimension": 2, "best": 1e-4}, [FORTH], False),
        ({"holds": FACES_HELD, "best": 1.1e-4}, [BACK, []], False),
    ],
)
def test_an_interior_point_is_alone(changes: dict[str, Any], paths: list[list[float]], alone: bool) -> None:
    assert later.interior_alone(state(**changes), Shown(paths=paths)) is alone  # type: ignore[arg-type]


PATH = Shown(iterations=30, paths=[FORTH])


@pytest.mark.parametrize(
    ("changes", "interior", "first"),
    [
        ({"best": 1.1e-4}, None, True),
        ({"best": 1e-4}, None, False),
        ({"best": 1e-6}, PATH, True),
        ({}, Shown(iterations=30, paths=[BACK]), False),
        ({}, Shown(iterations=30, paths=[FORTH], result=ENDED), False),
        ({"warm": True}, PATH, False),
        ({"joints": object()}, PATH, False),
        ({"without": ("interior point",)}, None, False),
    ],
)
def test_an_interior_point_in_blocks_goes_before_paths_and_admm(changes: dict[str, Any], interior: Shown | None, first: bool) -> None:
    runners = {"sweeps": Shown(spent=900.0, iterations=900, needed=1e9), "proximal Newton": newton(spent=900.0)}
    runners |= {} if interior is None else {"interior point": interior}
    race = state(runners=runners, holds=FACES_HELD, **changes)
    assert later.interior_is_first(race) is first
    race.without = (*race.without, "proof")
    assert later.enter_paths(race) is not first
    if race.best > 1e-3 and race.joints is None:
        assert admm.enters(race) is not first


@pytest.mark.parametrize(
    ("best", "proximal", "due"),
    [
        (NEAR, newton(iterations=101, spent=100.0, fell=1.1), True),
        (AFAR, newton(iterations=101, spent=100.0, fell=1.1), False),
        (NEAR, newton(iterations=100, spent=100.0, fell=1.1), False),
        (NEAR, newton(iterations=101, spent=100.0, fell=1.12), False),
        (NEAR, newton(iterations=101, spent=99.0, fell=1.1), False),
        (NEAR, newton(iterations=5, spent=1.0, result=ENDED), True),
        (NEAR, None, False),
    ],
)
def test_least_squares_enter(best: float, proximal: Shown | None, due: bool) -> None:
    if proximal is not None and proximal.result is None:  # where W is exact it waits for three times as much
        for exact in ({"motion": object()}, {"single": True}):
            waiting = state(best=best, runners={"proximal Newton": replace(proximal, spent=299.0)}, **exact)
            assert not later.enter_least_squares(waiting)
            waiting.runners["proximal Newton"].spent += proximal.spent - 99.0
            assert later.enter_least_squares(waiting) is due
    assert later.enter_least_squares(state(best=best, runners={} if proximal is None else {"proximal Newton": proximal})) is due


@pytest.mark.parametrize(
    ("best", "ended", "running", "due"),
    [(1e-5, 1.1e-5, False, True), (1e-5, 1e-5, False, False), (1e-5, 1.1e-5, True, False), (1e-5, None, False, False)],
)
def test_least_squares_enter_again_where_another_came_nearer(best: float, ended: float | None, running: bool, due: bool) -> None:
    runners = {} if ended is None else {"least squares": Shown(best=ended, result=ENDED)}
    if running:
        runners["sweeps"] = Shown()
    assert later.enter_least_squares_again(state(best=best, runners=runners)) is due


@pytest.mark.parametrize(
    ("changes", "proximal", "sweeping", "due"),
    [
        ({}, newton(iterations=250, fell=1.1), True, True),
        ({}, newton(iterations=249, fell=1.1), True, False),
        ({}, newton(iterations=250, fell=1.12), True, False),
        ({}, newton(iterations=3, result=ENDED), True, True),
        ({"warm": True}, newton(iterations=250, fell=1.1), False, False),
        ({"warm": True}, newton(iterations=3, result=ENDED), False, True),
        ({"warm": True}, newton(iterations=3, result=ENDED), True, False),
        ({"without": ("interior point",)}, newton(iterations=20), True, True),  # in beds in the place of an interior point that has ended
        ({"without": ("interior point",)}, newton(iterations=19), True, False),
        ({"without": ("interior point",), "joints": object()}, newton(iterations=20), True, False),
        ({"without": ("interior point",), "holds": FACES_HELD}, newton(iterations=20), True, False),
        ({}, None, False, False),
        ({"without": ("proximal Newton",)}, None, False, True),
        ({"without": ("proximal Newton",)}, None, True, False),
    ],
)
def test_proximal_newton_from_zero_enters(changes: dict[str, Any], proximal: Shown | None, sweeping: bool, due: bool) -> None:
    runners = {"sweeps": Shown(result=None if sweeping else ENDED), **({} if proximal is None else {"proximal Newton": proximal})}
    assert later.enter_from_zero(state(runners=runners, **changes)) is due


@pytest.mark.parametrize(
    ("holds", "points", "dimension", "are_faces"),
    [(1.31, 3.0, 3, True), (1.3, 3.0, 3, False), (1.31, 2.9, 3, False), (1.31, 3.0, 2, False)],
)
def test_faces_hold_more_than_the_bodies_velocities_in_three_points_a_pair(
    holds: float, points: float, dimension: int, are_faces: bool
) -> None:
    assert closed.faces(state(holds=holds, points=points, dimension=dimension)) is are_faces


@pytest.mark.parametrize(("family", "points"), [("walls", 4.0), ("boxes", 4.0), ("arches", 2.0)])
def test_points_a_pair_of_blocks_are_the_corners_of_their_faces(family: str, points: float) -> None:
    problem = reduce(problems(family, 300, 7)).local  # type: ignore[arg-type]
    race: Any = SimpleNamespace(problem=problem, points=None)
    assert closed.points_a_pair(race) == race.points == pytest.approx(points, rel=0.02)


@pytest.mark.parametrize(("family", "single"), [("spheres", True), ("disks", True), ("noise", False)])
def test_grains_touch_in_single_points_where_each_contact_has_a_pattern_of_its_own(family: str, single: bool) -> None:
    problem = problems(family, 300, 7)  # noise: rocks, with two to three contacts a pair
    local = (reduce(problem).local if isinstance(problem, GlobalProblem) else problem).stored()  # type: ignore[union-attr]
    race: Any = SimpleNamespace(problem=local, single=None)
    assert closed.in_single_points(race) is race.single is single


def test_what_sweeps_still_cost() -> None:
    assert expected.swept(state()) == 0
    assert expected.swept(state(runners={"sweeps": Shown(needed=5.0)})) == 0  # none was done
    assert expected.swept(state(runners={"sweeps": Shown(iterations=20, spent=20.0, fell=1.0, needed=5.0)})) == 5
    assert expected.swept(state(runners={"sweeps": STILL})) == INF
    assert expected.swept(state(without=("sweeps",))) == INF


@pytest.mark.parametrize(("iterations", "tenfolds", "own"), [(19, 0, True), (20, 0, False), (39, 2, True), (40, 2, False)])
def test_proximal_newton_s_own_iterations(iterations: int, tenfolds: float, own: bool) -> None:
    assert expected.at_first(Shown(iterations=iterations, tenfolds=tenfolds)) is own  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("holds", "dimension", "iterations"),
    [(LOOSE, 3, (60, 30)), (1.2, 3, (60, 30)), (FACES_HELD, 3, (8, 4)), (LOOSE, 2, (60, 30)), (EDGES_HELD, 2, (20, 10))],
)
@pytest.mark.parametrize("in_velocities", [True, False])
def test_proximal_newton_is_asked_where_sweeps_cost_more(
    holds: float, dimension: int, iterations: tuple[int, int], in_velocities: bool
) -> None:
    for best, many in zip((AFAR, NEAR), iterations, strict=True):
        race = state(holds=holds, dimension=dimension, best=best, in_velocities=in_velocities)
        assert not expected.dearer_than_proximal(race, 10.0 * many)
        assert expected.dearer_than_proximal(race, 10.0 * many + 1e-9)


@pytest.mark.parametrize(
    ("changes", "spent", "needed", "alone"),
    [
        ({}, 99.0, INF, True),  # ten iterations of Newton's
        ({}, 100.0, INF, False),
        ({}, 100.0, 499.0, True),  # sixty in all
        ({}, 100.0, 500.0, False),
        ({"holds": FACES_HELD}, 19.0, INF, True),
        ({"holds": FACES_HELD}, 20.0, INF, False),
        ({"holds": FACES_HELD}, 20.0, 59.0, True),
        ({"warm": True}, 99.0, INF, False),
        ({"warm": True, "sparse": True}, 99.0, INF, False),
        ({"warm": True, "sparse": True, "in_velocities": False}, 99.0, INF, True),  # beds in motion
        ({"warm": True, "in_velocities": False}, 99.0, INF, False),
        ({"warm": True, "sparse": True, "in_velocities": False, "joints": object()}, 99.0, INF, False),
        ({"joints": object()}, 99.0, INF, False),
        ({"nc": 20_001}, 99.0, INF, False),
    ],
)
def test_sweeps_go_on_before_anyone_is_asked(changes: dict[str, Any], spent: float, needed: float, alone: bool) -> None:
    sweeps = Shown(iterations=int(spent), spent=spent, needed=needed)
    race = state(runners={"sweeps": sweeps}, **changes)
    assert expected.opening(race, sweeps) is alone  # type: ignore[arg-type]
    race.runners["Newton"] = Shown()
    assert not expected.opening(race, sweeps)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "begun", "spent", "ended"),
    [
        ({}, True, 150_000.0, False),  # 15 000 iterations of proximal Newton at 10 each
        ({}, True, 150_001.0, True),
        ({}, False, 900_000.0, False),
        ({"holds": 1.2}, True, 900_000.0, False),  # grains, from zero
        ({"holds": FACES_HELD, "points": 2.9}, True, 900_000.0, False),
        ({"holds": 1.2, "warm": True}, True, 150_001.0, True),
        ({"holds": EDGES_HELD, "dimension": 2}, True, 150_001.0, True),
    ],
)
def test_blocks_are_given_up_after_what_fifteen_thousand_iterations_cost(
    changes: dict[str, Any], begun: bool, spent: float, ended: bool
) -> None:
    race = state(runners={"paths" if begun else "proximal Newton": Shown(spent=spent)}, **{"holds": FACES_HELD, **changes})
    assert later.exhausted(race) is ended


@pytest.mark.parametrize(("warm", "alone"), [(True, True), (False, False)])
def test_eliminations_count_before_others_are_asked_from_a_warm_start(warm: bool, alone: bool) -> None:
    """An iteration of Newton's method that costs 10 without its elimination and 30 with it."""
    sweeps = Shown(iterations=299, spent=299.0)
    race = state(runners={"sweeps": sweeps}, warm=warm, sparse=True, in_velocities=False, elimination=20.0)
    assert expected.opening(race, sweeps) is alone  # type: ignore[arg-type]
    sweeps.spent = 300.0
    assert not expected.opening(race, sweeps)  # type: ignore[arg-type]
