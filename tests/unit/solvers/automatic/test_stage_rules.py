"""When the first stages enter, go alone, share and are left, rule by rule, each with a case on either side of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from fcsim.solvers.automatic import closed, first, methods, stages
from fcsim.solvers.automatic.race import LITTLE, Stage
from fcsim.solvers.base import Iterate, Status
from fcsim.solvers.turns import Turns, to_the_end
from tests.unit.solvers.automatic.states import (
    AFAR,
    EDGES_HELD,
    ENDED,
    FACES_HELD,
    INF,
    LOOSE,
    NEAR,
    STILL,
    Shown,
    newton,
    state,
)

pytestmark = pytest.mark.usefixtures("what_is_held_is_written_down")

JOINTS: dict[str, Any] = {"joints": object(), "in_velocities": False}
IN_MOTION: dict[str, Any] = {"in_velocities": False, "warm": True, "sparse": True}


def stage(name: str) -> Stage:
    """The stage of that name."""
    return next(stage for stage in stages.STAGES if stage.name == name)


def sweeping(needed: float, **changes: Any) -> Shown:
    """Sweeps that get on and need so much more."""
    return Shown(**{"iterations": 40, "spent": 40.0, "needed": needed, **changes})


@pytest.mark.parametrize(
    ("changes", "enters"),
    [
        ({"needed": 45.7}, False),  # ADMM's factor and 30 iterations cost 160, rates fall 3.5-fold
        ({"needed": 45.8}, True),
        ({"needed": INF, "best": NEAR}, False),
        ({"needed": INF, "splitting": 0}, False),
        ({"needed": INF, "in_velocities": True}, False),
        ({"needed": INF, "in_velocities": True, "without": ("proximal Newton",)}, True),
    ],
)
def test_admm_enters_where_sweeps_need_more(changes: dict[str, Any], enters: bool) -> None:
    changes = {"in_velocities": False, **changes}
    assert stage("splitting").enters(state(runners={"sweeps": sweeping(changes.pop("needed"))}, **changes)) is enters


@pytest.mark.parametrize(
    ("changes", "proximal", "enters"),
    [
        ({}, newton(iterations=19), False),
        ({}, newton(iterations=20), True),
        ({}, newton(iterations=5, result=ENDED), True),
        ({"holds": EDGES_HELD, "dimension": 2, "nc": 801}, newton(iterations=5, spent=159.0), False),
        ({"holds": EDGES_HELD, "dimension": 2, "nc": 801}, newton(iterations=5, spent=160.0), True),
        ({"holds": EDGES_HELD, "dimension": 2, "nc": 800}, newton(iterations=400, spent=900.0), False),  # in edges of few bodies
        ({"holds": EDGES_HELD, "dimension": 2, "nc": 800}, newton(iterations=5, result=ENDED), True),
        ({"holds": EDGES_HELD, "dimension": 2, "warm": True}, newton(iterations=5, spent=160.0), False),
        ({"holds": 1.0, "dimension": 2}, newton(iterations=5, spent=160.0), False),
        ({"regular": True}, newton(iterations=900), False),
        ({"regular": True}, newton(iterations=900, result=ENDED), True),
        ({"joints": object(), "holds": 1.1}, newton(iterations=5, spent=900.0), False),  # in joints of rigid bodies
        ({"joints": object(), "holds": 1.1}, newton(spent=299.0), False),  # 100 iterations of ADMM cost 300
        ({"joints": object(), "holds": 1.1}, newton(spent=300.0), True),
        ({"joints": object(), "holds": 1.1}, newton(iterations=5, spent=50.0, result=ENDED), True),
        ({"joints": object(), "holds": 1.0}, newton(iterations=5, spent=50.0), True),
        ({"joints": object(), "holds": 1.1, "warm": True}, newton(iterations=5, spent=50.0), False),
    ],
)
def test_admm_waits_for_proximal_newton_in_the_bodies_velocities(changes: dict[str, Any], proximal: Shown, enters: bool) -> None:
    race = state(runners={"sweeps": sweeping(50.0), "proximal Newton": proximal}, **changes)
    assert stage("splitting").enters(race) is enters


@pytest.mark.parametrize(
    ("changes", "is_first"),
    [
        ({"newton_price": 43.0}, True),  # 100 iterations of ADMM cost 300: 300 + 7 n < 14 n
        ({"newton_price": 42.0}, False),
        ({"newton_price": 43.0, "warm": True}, False),
        ({"newton_price": 43.0, "splitting": 0}, False),
        ({"newton_price": 43.0, "in_velocities": True}, True),
        ({"newton_price": 43.0, "joints": None}, False),
        ({"newton_price": 43.0, "keeps": True}, False),  # Newton's factors serve the next step
        ({"newton_price": 43.0, "keeps": True, "in_velocities": True}, True),
        ({"newton_price": 43.0, "shares": object(), "nc": 6666}, True),
        ({"newton_price": 43.0, "shares": object(), "nc": 6667}, False),  # its systems need no factor of W
    ],
)
def test_in_joints_admm_is_first_where_newton_is_dear(changes: dict[str, Any], is_first: bool) -> None:
    race = state(**{**JOINTS, **changes})
    assert first.splitting_first(race) is is_first
    if race.joints is not None and race.splitting:
        assert stage("splitting").enters(race) is is_first
        assert stage("sweeps").enters(race) is False
        assert stage("Newton").enters(race) is not is_first
        race.runners["splitting"] = Shown(result=ENDED)
        assert stage("Newton").enters(race) and stage("sweeps").enters(race) is not race.warm


@pytest.mark.parametrize(
    ("changes", "stays"),
    [
        ({"keeps": True}, True),
        ({"keeps": True, "in_velocities": True}, False),
        ({}, False),
        ({"shares": object(), "nc": 6667}, False),
    ],
)
def test_newton_keeps_its_systems_for_the_next_steps(changes: dict[str, Any], stays: bool) -> None:
    """Of bodies with many velocities; without a memory only in joints (above)."""
    assert closed.newton_stays(state(**{"in_velocities": False, **changes})) is stays


@pytest.mark.parametrize(
    ("changes", "is_first"),
    [
        ({"holds": 1.1}, True),
        ({"holds": 1.0}, False),
        ({"holds": 1.1, "in_velocities": False}, False),
        ({"holds": 1.1, "warm": True}, True),
        ({"holds": 1.1, "without": ("proximal Newton",)}, False),
        ({"holds": 1.1, "joints": None}, False),
        ({"holds": 1.4, "joints": None, "warm": True}, True),  # faces
        ({"holds": 1.4, "joints": None}, False),
        ({"holds": 1.4, "joints": None, "warm": True, "points": 2.0}, False),  # grains
        ({"holds": 0.7, "joints": None, "warm": True}, True),  # faces that slide and part
        ({"holds": 0.7, "joints": None, "warm": True, "regular": True}, False),  # with stiffness
        ({"holds": 0.7, "joints": None, "warm": True, "points": 2.0, "dimension": 2}, True),  # edges
        ({"holds": 0.7, "joints": None, "warm": True, "points": 1.0, "dimension": 2}, False),  # discs
        ({"holds": 0.7, "joints": None, "points": 2.0, "dimension": 2}, False),
    ],
)
def test_in_joints_proximal_newton_is_first_where_newton_s_matrix_is_singular(changes: dict[str, Any], is_first: bool) -> None:
    """Sweeps enter after the iterations that are its own, or where it has ended; Newton does not."""
    race = state(**{"joints": object(), **changes})
    assert first.proximal_first(race) is is_first
    if race.joints is not None and not race.without:
        assert stage("proximal Newton").enters(race) is is_first and (not is_first or not stage("sweeps").enters(race))
        assert stage("Newton").enters(race) is (race.holds <= 1)
        for shown, sweeps in ((Shown(iterations=19), False), (Shown(iterations=20), True), (Shown(iterations=3, result=ENDED), True)):
            race.runners["proximal Newton"] = shown
            assert not is_first or stage("sweeps").enters(race) is sweeps


def test_not_where_proximal_newton_in_velocities_costs_less_than_admm_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """20 of its iterations for 300."""
    monkeypatch.setattr(first, "NEWTON", first.NEWTON.__class__(far=20, near=0))
    assert first.splitting_first(state(joints=object(), newton_price=22.0, in_velocities=True))
    assert not first.splitting_first(state(joints=object(), newton_price=14.9, in_velocities=True))


@pytest.mark.parametrize(
    ("changes", "runner", "alone"),
    [
        ({}, Shown(iterations=29), True),
        ({}, Shown(iterations=30), False),
        ({}, Shown(iterations=59, tenfolds=1.0), True),
        ({}, Shown(iterations=60, tenfolds=1.9), False),
        ({}, Shown(iterations=14, fell=1.0), True),
        ({}, Shown(iterations=15, fell=1.0), False),
        (JOINTS, Shown(iterations=99, fell=1.0), True),
        (JOINTS, Shown(iterations=100, fell=1.0), False),
        ({}, Shown(iterations=240, slows=1.5, slowed_by=2.0), True),  # bodies come to rest
        ({}, Shown(iterations=241, slows=1.5, slowed_by=2.0), False),
        ({}, Shown(iterations=240, slows=1.4, slowed_by=2.0), False),
        (JOINTS, Shown(iterations=241, slows=1.5, slowed_by=2.0), True),
    ],
)
def test_admm_goes_on_alone(changes: dict[str, Any], runner: Any, alone: bool) -> None:
    race = state(runners={"splitting": runner}, **changes)
    assert stage("splitting").alone(race, runner) is alone
    assert stage("splitting").left(race, runner) is (race.joints is not None and not alone)


@pytest.mark.parametrize(("best", "own", "share"), [(NEAR, 11 * NEAR, LITTLE), (NEAR, 9 * NEAR, 1.0), (AFAR, 11 * AFAR, 1.0)])
def test_admm_far_behind_spends_little(best: float, own: float, share: float) -> None:
    assert stage("splitting").share(state(best=best, runners={"splitting": Shown(best=own)})) == share


@pytest.mark.parametrize(("changes", "options"), [({}, "SPLITTING"), (JOINTS, "SPLITTING_OF_JOINTS")])
def test_admm_s_rule_of_rho_follows_from_why_it_enters(changes: dict[str, Any], options: str, monkeypatch: pytest.MonkeyPatch) -> None:
    given = []
    monkeypatch.setattr(methods, "splitting", lambda race, monitor, chosen, *others: given.append(chosen))
    race = state(runners={"sweeps": STILL, "proximal Newton": newton()}, **{"holds": 0.95, **changes})
    stage("splitting").turns(race, None)  # type: ignore[arg-type]
    assert given == [getattr(methods, options)]


@pytest.mark.parametrize(
    ("changes", "needed", "enters"),
    [
        ({}, 200.1, True),  # twenty iterations at 10
        ({}, 200.0, False),
        ({"best": NEAR}, 70.1, True),
        ({"best": NEAR}, 70.0, False),
        ({"holds": 1.1}, INF, False),
        ({"holds": 1.0}, INF, True),
        ({"patience": 0}, INF, False),
        ({"warm": True}, 1.0, True),
        ({"warm": True, "holds": 1.1}, 1.0, False),
        ({"warm": True, "sparse": True, "newton_price": 20.0}, 1.0, True),  # a probe of sweeps costs 20
        ({"warm": True, "sparse": True, "newton_price": 20.1}, 1.0, False),
        ({"warm": True, "sparse": True, "newton_price": 20.1, "without": ("sweeps",)}, 1.0, True),
        ({**JOINTS}, 1.0, True),
    ],
)
def test_newton_enters(changes: dict[str, Any], needed: float, enters: bool) -> None:
    assert stage("Newton").enters(state(runners={"sweeps": sweeping(needed)}, **changes)) is enters


@pytest.mark.parametrize(
    ("changes", "over", "enters"),
    [
        ({}, (), True),
        ({"warm": True}, (), False),
        ({"warm": True, "points": 2.0}, ("Newton",), True),
        ({"warm": True, "points": 2.0, "holds": 1.1}, (), True),
        ({"warm": True, "holds": 1.1}, (), False),  # blocks: proximal Newton
        (JOINTS, (), False),
        (JOINTS, ("Newton",), True),
        ({**JOINTS, "warm": True}, ("Newton",), False),  # steps of elastic bricks: proximal Newton answers, or nobody
        ({**JOINTS, "warm": True}, ("Newton", "proximal Newton"), True),
    ],
)
def test_sweeps_enter(changes: dict[str, Any], over: tuple[str, ...], enters: bool) -> None:
    assert stage("sweeps").enters(state(runners={name: Shown(result=ENDED) for name in over}, **changes)) is enters


@pytest.mark.parametrize(
    ("changes", "newton_over", "sweeps", "enters"),
    [
        ({}, True, sweeping(600.1, spent=400.0), True),  # sixty iterations at 10
        ({}, True, sweeping(600.0, spent=400.0), False),
        ({}, False, sweeping(600.1, spent=400.0), False),
        ({"holds": 1.2}, False, sweeping(600.1, spent=400.0), True),
        ({"holds": 1.2}, False, sweeping(600.0, spent=400.0), False),
        ({}, True, sweeping(600.1, spent=399.0), False),  # in beds sweeps spend what 40 iterations cost before
        ({"holds": 1.2}, False, sweeping(600.1, spent=399.0), False),
        ({"holds": FACES_HELD}, False, sweeping(600.1, spent=40.0), True),
        ({"holds": EDGES_HELD, "dimension": 2}, False, sweeping(600.1, spent=40.0), True),
        ({"in_velocities": False}, True, sweeping(600.1, spent=40.0), True),
        ({"in_velocities": False, "dimension": 2}, True, sweeping(600.1, spent=600.0), True),  # of discs what 60 iterations cost
        ({"in_velocities": False, "dimension": 2}, True, sweeping(600.1, spent=599.0), False),
        ({"in_velocities": False, "dimension": 2, "warm": True}, True, sweeping(600.1, spent=599.0), True),
        ({"in_velocities": False, "single": True}, True, sweeping(600.1, spent=600.0), True),  # and of spheres
        ({"in_velocities": False, "single": True}, True, sweeping(600.1, spent=599.0), False),
        ({**IN_MOTION, "single": True}, True, sweeping(600.1, spent=400.0), True),  # in motion what 40 iterations cost
        ({**IN_MOTION, "single": True}, True, sweeping(600.1, spent=399.0), False),
        ({**IN_MOTION, "single": True}, True, sweeping(600.0, spent=400.0), False),
        ({**IN_MOTION, "single": False}, True, sweeping(600.1, spent=1.0), True),
        ({"dimension": 2}, True, sweeping(600.1, spent=400.0), True),  # in the bodies' velocities as grains in 3D
        ({"dimension": 2}, True, sweeping(600.1, spent=399.0), False),
        ({"regular": True}, True, sweeping(600.1, spent=40.0), True),
        ({"warm": True}, True, sweeping(1.0), True),
        ({"joints": object()}, True, sweeping(1.0), True),
        ({}, True, sweeping(1.0, result=ENDED), True),
        ({}, False, sweeping(1.0, result=ENDED), False),
        ({"holds": 1.2}, False, sweeping(1.0, result=ENDED), True),
    ],
)
def test_proximal_newton_enters(changes: dict[str, Any], newton_over: bool, sweeps: Shown, enters: bool) -> None:
    race = state(runners={"sweeps": sweeps, "Newton": Shown(result=ENDED if newton_over else None)}, **changes)
    assert stage("proximal Newton").enters(race) is enters


@pytest.mark.parametrize(
    ("changes", "spent", "enters"), [(IN_MOTION, 399.0, False), (IN_MOTION, 400.0, True), ({"in_velocities": False}, 399.0, True)]
)
def test_admm_waits_for_the_sweeps_of_beds_in_motion(changes: dict[str, Any], spent: float, enters: bool) -> None:
    race = state(runners={"sweeps": sweeping(1e3, spent=spent)}, **{"single": True, **changes})
    assert stage("splitting").enters(race) is enters


@pytest.mark.parametrize(("iterations", "alone"), [(19, True), (20, False)])
def test_proximal_newton_begins_alone(iterations: int, alone: bool) -> None:
    assert stage("proximal Newton").alone(state(), Shown(iterations=iterations)) is alone  # type: ignore[arg-type]


@pytest.mark.parametrize(("holds", "begun", "share"), [(FACES_HELD, True, 0.1), (FACES_HELD, False, 1.0), (1.2, True, 1.0)])
def test_sweeps_spend_a_tenth_beside_proximal_newton_where_faces_hold(holds: float, begun: bool, share: float) -> None:
    runners = {"sweeps": sweeping(5.0), **({"proximal Newton": newton()} if begun else {})}
    assert stage("sweeps").share(state(holds=holds, runners=runners)) == share


@pytest.mark.parametrize(
    ("changes", "begun", "sweeps", "left"),
    [
        ({}, True, LITTLE, True),
        ({}, False, 1.0, False),
        ({"holds": FACES_HELD}, True, 0.1, False),
        ({"holds": EDGES_HELD, "dimension": 2}, True, 0.1, False),
    ],
)
def test_beside_an_interior_point_in_beds_sweeps_spend_little_and_admm_that_creeps_is_left(
    changes: dict[str, Any], begun: bool, sweeps: float, left: bool
) -> None:
    creeps, falls = Shown(iterations=30, tenfolds=0.9), Shown(iterations=30, tenfolds=1.0)
    runners = {"sweeps": STILL, "proximal Newton": newton(), "splitting": creeps}
    for other in ("interior point", "paths"):
        begins = {other: Shown()} if begun else {}
        race = state(runners=runners | begins, **{"holds": 0.91, "best": NEAR, **changes})
        assert stage("sweeps").share(race) == sweeps
        assert stage("splitting").left(race, creeps) is left
        assert not stage("splitting").left(race, falls)


@pytest.mark.parametrize(
    ("changes", "share"), [({}, LITTLE), ({"warm": True}, 1.0), ({"joints": object()}, 1.0), ({"holds": FACES_HELD}, 1.0)]
)
def test_in_beds_two_share_alike_and_paths_and_least_squares_spend_little(changes: dict[str, Any], share: float) -> None:
    race = state(**changes)
    assert stage("paths").share(race) == stage("least squares").share(race) == share
    for name in ("proximal Newton", "interior point", "proximal Newton from zero"):
        assert stage(name).share(race) == 1.0


@pytest.mark.parametrize(("changes", "share"), [({}, 0.1), ({"in_velocities": False}, 1.0), ({"joints": object()}, 1.0)])
def test_sweeps_spend_a_tenth_beside_proximal_newton_where_joints_have_stiffness(changes: dict[str, Any], share: float) -> None:
    runners = {"sweeps": sweeping(5.0), "proximal Newton": newton()}
    assert stage("sweeps").share(state(holds=0.0, regular=True, runners=runners, **changes)) == share


@pytest.mark.parametrize(
    ("changes", "runners", "newton_enters", "sweeps_enter"),
    [
        ({}, {}, True, False),  # from zero too
        ({"warm": True, "sparse": True, "newton_price": 30.0}, {}, True, False),  # sweeps would be cheap
        ({}, {"Newton": Shown(result=ENDED)}, True, False),
        ({}, {"Newton": Shown(result=ENDED), "proximal Newton": newton()}, True, False),
        ({}, {"Newton": Shown(result=ENDED), "proximal Newton": newton(result=ENDED)}, True, True),
        ({"without": ("Newton", "proximal Newton")}, {}, True, True),
        ({"patience": 0}, {}, False, True),
        ({"regular": False}, {}, False, True),
        ({"in_velocities": False}, {}, False, True),
    ],
)
def test_where_joints_have_stiffness_sweeps_come_after_both_of_newtons_methods(
    changes: dict[str, Any], runners: dict[str, Shown], newton_enters: bool, sweeps_enter: bool
) -> None:
    race = state(runners=runners, **{"holds": 0.0, "regular": True, **changes})
    assert stages.newton_first(race) is newton_enters
    assert stage("sweeps").enters(race) is sweeps_enter


@pytest.mark.parametrize(("changes", "enters"), [({}, True), ({"regular": False}, False)])
def test_proximal_newton_follows_newton_from_zero_where_joints_have_stiffness(changes: dict[str, Any], enters: bool) -> None:
    race = state(runners={"Newton": Shown(result=ENDED)}, **{"holds": 0.0, "regular": True, **changes})
    assert stage("proximal Newton").enters(race) is enters


def test_where_joints_have_stiffness_no_proof_is_looked_for() -> None:
    runners = {"proximal Newton": newton(spent=900.0)}
    assert stage("proof").enters(state(runners=runners)) and not stage("proof").enters(state(runners=runners, regular=True))


def test_a_proof_goes_first_where_bodies_approach_though_no_reaction_moves_them() -> None:
    race = state(still=True, best=NEAR)
    assert stage("proof").enters(race) and stage("proof").alone(race, Shown())  # type: ignore[arg-type]


@pytest.mark.parametrize(("sweeps", "fell", "left"), [(999, 1.1, False), (1000, 1.1, True), (1000, 1.12, False)])
def test_sweeps_are_left_where_they_stand_still(sweeps: int, fell: float, left: bool) -> None:
    assert stage("sweeps").left(state(), Shown(iterations=sweeps, fell=fell)) is left  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("spent", "holds", "warm", "alone"),
    [(399.0, FACES_HELD, False, True), (400.0, FACES_HELD, False, False), (399.0, LOOSE, False, False), (400.0, LOOSE, True, True)],
)
def test_paths_of_blocks_go_alone_until_they_spent_twice_as_much_as_all_others(spent: float, holds: float, warm: bool, alone: bool) -> None:
    paths: Any = Shown(spent=spent)
    race = state(warm=warm, holds=holds, runners={"paths": paths, "sweeps": Shown(spent=200.0)})
    assert stage("paths").alone(race, paths) is alone


@pytest.mark.parametrize(
    ("best", "spent", "enters", "alone"),
    [
        (AFAR, 100.0, False, False),
        (AFAR, 100.1, True, False),
        (AFAR, 200.0, True, False),
        (AFAR, 200.1, True, True),
        (NEAR, 900.0, False, False),
    ],
)
def test_a_proof_costs_half_of_what_was_spent_when_it_enters(best: float, spent: float, enters: bool, alone: bool) -> None:
    race = state(best=best, runners={"proximal Newton": newton(spent=spent)})
    assert stage("proof").enters(race) is enters
    assert stage("proof").alone(race, Shown()) is alone  # type: ignore[arg-type]
    race.runners = {"sweeps": Shown(spent=spent)}
    assert not stage("proof").enters(race)


@pytest.mark.parametrize(
    ("spent", "running", "from_zero", "enters"),
    [(800.0, False, True, True), (799.0, False, True, False), (800.0, True, True, False), (800.0, False, False, False)],
)
def test_fischer_burmeister_enters_last(spent: float, running: bool, from_zero: bool, enters: bool) -> None:
    """Half of what was spent pays for forty iterations at 10."""
    runners = {"sweeps": Shown(spent=spent, result=None if running else ENDED)}
    if from_zero:
        runners["proximal Newton from zero"] = Shown(result=ENDED)
    assert stage("Fischer-Burmeister").enters(state(runners=runners)) is enters


@pytest.mark.parametrize(
    ("changes", "light", "metric"),
    [
        ({}, 1.0, "identity"),
        ({"in_velocities": False}, 1e3, "compliance"),
        ({"in_velocities": False}, 1.001e3, "identity"),
        ({"warm": True}, 1e6, "compliance"),
        ({"holds": FACES_HELD}, 1e6, "compliance"),
    ],
)
def test_from_zero_beds_have_the_other_metric_but_one_number_where_masses_are_unlike(
    changes: dict[str, Any], light: float, metric: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """light: the largest compliance over the least. Of nine beds of unlike masses in W (`mass-ratios:100`) one number solves seven from
    zero in a second each, compliances five."""
    given: list[tuple[Any, Any]] = []
    monkeypatch.setattr(methods, "proximal_turns", lambda problem, r, monitor, chosen: given.append((r, chosen)) or iter(()))
    race = state(best=1e-6, compliance=np.array([1.0, light]), **changes)
    methods.proximal_from_zero(race, None)  # type: ignore[arg-type]
    with pytest.raises(StopIteration):
        next(methods.proximal(race, None))  # type: ignore[arg-type]
    (start, options), (_, others) = given
    assert not np.any(start) and options.metric == metric
    if race.joints is None and not race.warm and race.holds == LOOSE:
        assert (others.metric != metric) or light > 1e3


@pytest.mark.parametrize(
    ("changes", "begins"), [({"holds": LOOSE}, 1), ({"holds": FACES_HELD}, 2), ({"holds": EDGES_HELD, "dimension": 2}, 2), (JOINTS, 2)]
)
def test_in_beds_proximal_newton_and_paths_go_on_where_another_is_ahead(changes: dict[str, Any], begins: int) -> None:
    """The other one's iterate is a hundred times as good; elsewhere both begin anew from that. In a bed with noise (`noise:300:5003`)
    proximal Newton arrives after 177 iterations from the sweeps' iterate, and had not after 936 where it began anew."""
    monitor, begun = SimpleNamespace(best=1e-4, taken_up=INF), []

    def begin() -> Turns:
        begun.append(monitor.taken_up)
        monitor.best = 1e-4 if len(begun) == 1 else 1e-6
        yield from (None, None)
        return Iterate(np.zeros(30), Status.SOLVED)

    run = methods._anew_where_overtaken(state(best=1e-6, **changes), monitor, begin)  # type: ignore[arg-type]
    assert to_the_end(run).status is Status.SOLVED
    assert begun == [INF, 1e-6][:begins]


@pytest.mark.parametrize(
    ("changes", "options"),
    [
        ({"holds": LOOSE}, "PROXIMAL_LOOSE"),
        ({"holds": LOOSE, "in_velocities": False}, "PROXIMAL_BY_ONE_NUMBER"),
        ({"holds": LOOSE, "warm": True}, "PROXIMAL_NEWTON"),
        ({"holds": FACES_HELD}, "PROXIMAL_OF_FACES_LOOSE"),
        ({"holds": FACES_HELD, "tol": 1e-4}, "PROXIMAL_OF_FACES"),
        ({"holds": FACES_HELD, "warm": True}, "PROXIMAL_NEWTON"),
        ({"holds": FACES_HELD, "in_velocities": False, "warm": True}, "PROXIMAL_NEWTON"),
        ({"holds": EDGES_HELD, "dimension": 2}, "PROXIMAL_OF_EDGES_FIRST"),
        ({"holds": EDGES_HELD, "dimension": 2, "warm": True}, "PROXIMAL_OF_EDGES"),
        ({"holds": EDGES_HELD, "dimension": 2, "in_velocities": False}, "PROXIMAL_OF_EDGES"),
        ({"holds": 0.0, "regular": True}, "PROXIMAL_LOOSE"),
        (JOINTS, "PROXIMAL_OF_JOINTS"),
        ({**JOINTS, "warm": True}, "PROXIMAL_OF_JOINTS"),
        ({**JOINTS, "in_velocities": True}, "PROXIMAL_NEWTON"),
    ],
)
def test_proximal_newton_s_options_follow_from_how_bodies_touch(
    changes: dict[str, Any], options: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its first alpha is a tenth of the error's root at the most, in the bodies' velocities and in joints."""
    given: list[Any] = []
    monkeypatch.setattr(methods, "proximal_turns", lambda problem, r, monitor, chosen: given.append(chosen) or iter(()))
    race = state(**{"best": 1e-6, **changes})
    with pytest.raises(StopIteration):
        next(stage("proximal Newton").turns(race, None))  # type: ignore[arg-type]
    usual = getattr(methods, options)
    assert given[0].alpha == pytest.approx(1e-4 if race.in_velocities or options == "PROXIMAL_OF_JOINTS" else usual.alpha)
    assert given == [replace(usual, alpha=given[0].alpha, max_iterations=race.options.max_iterations)]


@pytest.mark.parametrize(("warm", "falls", "newton_along"), [(False, 10.0, 10), (True, 2.0, 0)])
def test_paths_fall_slowly_from_a_warm_start(warm: bool, falls: float, newton_along: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of blocks in motion, after a path and where one was lost, without Newton's iterations after one; problems from zero by the
    options of the table."""
    asked: list[Any] = []

    def path_turns(problem: Any, r: Any, monitor: Any, options: Any) -> Any:
        asked.append(options)
        return iter((None,))

    monkeypatch.setattr(methods, "path_turns", path_turns)
    race = SimpleNamespace(warm=warm, problem=None, best_r=lambda: None, options=SimpleNamespace(max_iterations=77))
    next(methods.paths(race, SimpleNamespace(iterations=0)))  # type: ignore[arg-type]
    chosen = asked[0]
    assert (chosen.along, chosen.regained, chosen.newton_along, chosen.max_iterations) == (falls, falls, newton_along, 77)


@pytest.mark.parametrize(
    ("changes", "is_first"),
    [
        ({}, True),
        ({"warm": True}, True),
        ({"keeps": False}, False),  # no step
        ({"sparse": True}, False),
        ({"motion": SimpleNamespace(own=None, regular=False)}, False),  # rigid bodies
        ({"patience": 0}, False),
    ],
)
def test_in_steps_of_elastic_bodies_with_few_contacts_newton_is_first_from_zero_as_well(changes: dict[str, Any], is_first: bool) -> None:
    race = state(**{"holds": 0.0, "in_velocities": False, "keeps": True, **changes})
    assert stages.newton_first(race) is is_first
    assert stage("sweeps").enters(race) is not is_first
    race.runners["Newton"] = Shown(result=ENDED)
    assert stage("sweeps").enters(race)
