"""`auto` as data: its stages, their conditions, the storage it gives W."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.bench.families import problems
from fcsim.errors import InputError
from fcsim.problem import Delassus, LocalProblem
from fcsim.problem.judge import natural_map_residual
from fcsim.problem.reduction import reduce
from fcsim.solvers import solve
from fcsim.solvers.automatic import admm, closed, stages
from fcsim.solvers.automatic.costs import Prices
from fcsim.solvers.automatic.expected import EDGES, FACES, LOOSE, PROXIMAL_ALONE, Expected, proximal_newton
from fcsim.solvers.automatic.race import Race, Runner, ShareOfMonitor, Stage, run
from fcsim.solvers.automatic.stages import STAGES, AutomaticOptions
from fcsim.solvers.base import Iterate, Monitor
from fcsim.solvers.turns import Turns


def local(family: str, size: int, seed: int) -> LocalProblem:
    """A problem of a family in local form, made anew."""
    made = problems(family, size, seed)
    return made if isinstance(made, LocalProblem) else reduce(made).local


def chain(nc: int, d: int) -> np.ndarray:
    """A compliance that couples neighbours only."""
    rng = np.random.default_rng(nc)
    H = rng.standard_normal((nc, d, d)) + 2 * np.eye(d)
    W = np.zeros((nc, d, nc, d))
    for a in range(nc):
        W[a, :, a] = H[a] @ H[a].T + 3 * np.eye(d)
        if a:
            W[a, :, a - 1] = 0.3 * H[a]
            W[a - 1, :, a] = 0.3 * H[a].T
    return W.reshape(nc * d, nc * d)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", [np.asarray, sp.csr_array, sp.csc_array, sp.coo_array, sp.bsr_array])
def test_a_large_sparse_matrix_is_stored_by_sorted_block_rows(kind: type, d: int) -> None:
    nc = 120
    W = chain(nc, d)
    given = kind(W)
    fitting = LocalProblem(given, np.ones(nc * d), np.ones(nc), dimension=d).stored().W
    assert fitting.format == "bsr" and fitting.blocksize == (d, d)
    assert_array_equal(fitting.toarray(), W)
    for a in range(nc):
        assert np.all(np.diff(fitting.indices[fitting.indptr[a] : fitting.indptr[a + 1]]) > 0)
    if kind is not np.asarray:
        assert given.format == kind.__name__[:3]
        assert_array_equal(given.toarray(), W)


@pytest.mark.parametrize("kind", [np.asarray, sp.csr_array, sp.bsr_array])
def test_a_small_matrix_is_dense(kind: type) -> None:
    W = chain(10, 3)
    fitting = LocalProblem(kind(W), np.ones(30), np.ones(10)).stored().W
    assert isinstance(fitting, np.ndarray)
    assert_array_equal(fitting, W)


@pytest.mark.parametrize("storage", [np.asarray, sp.csc_array])
@pytest.mark.parametrize("nc", [8, 120])
def test_storage_does_not_change_the_answer(nc: int, storage: type) -> None:
    W = chain(nc, 3)
    q = np.random.default_rng(0).standard_normal(3 * nc)
    result = solve(LocalProblem(storage(W), q, np.full(nc, 0.4)), "auto", tol=1e-10)
    reference = solve(LocalProblem(W, q, np.full(nc, 0.4)), "NSGS-AC", tol=1e-12)
    assert result.solved and reference.solved
    assert np.linalg.norm(result.r - reference.r) <= 1e-8 * np.linalg.norm(reference.r)


def random_chain(nc: int, mu: float) -> LocalProblem:
    return LocalProblem(chain(nc, 3), np.random.default_rng(0).standard_normal(3 * nc), np.full(nc, mu))


@pytest.mark.parametrize("name", [stage.name for stage in STAGES])
def test_any_stage_can_be_left_out_and_the_answer_is_the_same(name: str) -> None:
    problem = random_chain(40, 0.4)
    reference = solve(problem, "NSGS-AC", tol=1e-12)
    result = solve(problem, "auto", tol=1e-10, without=(name,))
    assert result.solved and reference.solved
    assert np.linalg.norm(result.r - reference.r) <= 1e-7 * np.linalg.norm(reference.r)


def test_no_stage_at_all_is_no_answer() -> None:
    result = solve(random_chain(40, 0.4), "auto", without=tuple(stage.name for stage in STAGES))
    assert not result.solved and result.error > 1e-3


def test_an_unknown_stage_is_named() -> None:
    with pytest.raises(InputError, match=r"option without: expected names of sweeps, .*, got 'swepes'"):
        solve(random_chain(5, 0.4), "auto", without=("swepes",))


def test_stages_say_what_they_are_and_have_names_of_their_own() -> None:
    assert len({stage.name for stage in STAGES}) == len(STAGES)
    assert all(stage.about.endswith(".") for stage in STAGES)


def test_from_a_warm_start_cheap_sweeps_come_before_the_elimination_of_a_sparse_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pile of a thousand boxes took 5 s a step for one LU of its 62 000 rows, where 40 sweeps of 10 ms are enough."""
    W, nc = sp.bsr_array(chain(400, 3), blocksize=(3, 3)), 400
    q = np.random.default_rng(1).standard_normal(3 * nc)
    start = solve(LocalProblem(W, q, np.full(nc, 0.4)), "auto", tol=1e-10)

    def refused(*_: object) -> None:
        raise AssertionError("Newton began")

    watched = [replace(stage, turns=refused) if stage.name == "Newton" else stage for stage in STAGES]
    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(watched))
    nearby = LocalProblem(W, q * (1 + 1e-4 * np.cos(np.arange(3 * nc))), np.full(nc, 0.4))
    assert solve(nearby, "auto", r=start.r, tol=1e-10).solved


def test_newton_is_left_out_where_its_matrix_is_sure_to_be_singular(monkeypatch: pytest.MonkeyPatch) -> None:
    """Blocks that rest on four points a face, from their own reactions: more velocities are held than the bodies have."""

    def refused(*_: object) -> None:
        raise AssertionError("Newton began")

    watched = [replace(stage, turns=refused) if stage.name == "Newton" else stage for stage in STAGES]
    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(watched))
    wall = problems("walls", 600, 0)
    local = wall if isinstance(wall, LocalProblem) else reduce(wall).local
    start = solve(local, "PROX-NEWTON", tol=1e-10)
    nearby = replace(local, q=local.q * (1 + 1e-3 * np.cos(np.arange(local.m))))
    assert solve(nearby, "auto", r=start.r, tol=1e-9).solved
    assert solve(nearby, "auto", tol=1e-9).solved


def test_admm_goes_on_alone_where_bodies_come_to_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """An arch that stands: ADMM's velocities fall while its error stays above 1e-3, and then it is there, before the others spend as much
    as they do where nothing is seen of that."""
    p = reduce(problems("arches", 1000, 42)).local
    seeing = solve(p, "auto", without=("interior point",))
    assert seeing.solved and np.linalg.norm(seeing.u) < 1e-6 * np.linalg.norm(p.q)
    monkeypatch.setattr(admm, "TO_REST", np.inf)
    blind = solve(p, "auto", without=("interior point",))
    assert blind.solved and seeing.iterations < blind.iterations


def test_sweeps_of_few_contacts_are_nncg_in_one_go() -> None:
    """Their direction goes on from turn to turn: as many sweeps as NNCG needs whose error is looked at as often, up to a turn."""
    p = local("spheres", 300, 201)
    kept = solve(p, "auto", without=tuple(stage.name for stage in STAGES if stage.name != "sweeps"), tol=1e-9)
    alone = solve(p, "NNCG", tol=1e-9, error_evaluation="full", error_frequency=1)
    assert kept.solved and alone.solved
    assert alone.iterations <= kept.iterations <= alone.iterations + 20 + alone.iterations // 12
    assert_allclose(kept.u, alone.u, rtol=0, atol=1e-6 * np.abs(p.q).max())


@pytest.mark.parametrize("family", ["disks", "spheres"])
def test_nothing_is_set_up_while_sweeps_arrive(family: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stages that are not entered count no elimination: problems of 250 contacts that some hundred sweeps solve."""

    def refused(*_: object) -> None:
        raise AssertionError("an elimination was counted")

    monkeypatch.setattr(Delassus, "analysis", property(refused))
    result = solve(local(family, 300, 7), "auto", tol=1e-4)
    assert result.solved and result.iterations > 20


def test_proximal_newton_in_velocities_comes_before_admm(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall of 270 contacts and 27 bodies: where both are asked for, Newton in 162 velocities shows first what it does."""
    entered = []

    def noted(stage: Stage) -> Stage:
        def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
            entered.append(stage.name)
            return stage.turns(race, monitor)

        return replace(stage, turns=turns)

    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(noted(stage) for stage in STAGES))
    result = solve(local("walls", 300, 201), "auto")
    assert result.solved
    assert entered[:2] == ["sweeps", "proximal Newton"]


BODIES = (("walls", FACES), ("towers", FACES), ("boxes", FACES), ("walls-2D", EDGES), ("spheres", LOOSE), ("disks", LOOSE))


@pytest.mark.parametrize(("family", "expected"), BODIES)
def test_what_proximal_newton_is_expected_to_need_follows_from_what_contacts_hold(family: str, expected: Expected) -> None:
    """Four points a face and two an edge hold more than the bodies' velocities, grains that touch in one point each do not."""
    p = local(family, 300, 7).stored()
    answer = solve(p, "auto", tol=1e-4)
    monitor = Monitor(p.q, p.mu, p.dimension, 1e-8)
    prices = Prices(p, p.delassus.entries, None)
    race = Race(p, p, monitor, AutomaticOptions(), prices, False, None, answer.r)
    assert answer.solved and proximal_newton(race) == expected


@pytest.mark.parametrize(("family", "seed", "follows"), [("frictions", 622, False), ("arches", 503, True)])
def test_from_zero_paths_are_for_edges_and_faces_and_no_dearer_than_all_others(
    family: str, seed: int, follows: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bed of large friction holds more than its bodies' velocities, too, but paths have thousands of pieces there. A path that is under
    way when paths have spent as much as all others is followed to its end."""
    spent: dict[str, float] = {}

    def noted(race: Race, entering: Sequence[Stage], ends: Callable[[Race], bool]) -> Iterate:
        iterate = run(race, entering, ends)
        spent.update((name, runner.spent) for name, runner in race.runners.items())
        return iterate

    monkeypatch.setattr(stages, "run_with_pauses", noted)
    assert solve(local(family, 300, seed), "auto", tol=1e-4, without=("interior point",)).solved
    assert "proximal Newton" in spent and ("paths" in spent) == follows
    if follows:
        paths = spent.pop("paths")
        assert paths <= 1.5 * sum(spent.values())


@pytest.mark.parametrize(("family", "size", "seed", "least"), [("walls", 600, 21, 0.5), ("arches", 300, 503, 1.0)])
def test_from_zero_paths_begin_once_others_have_spent_what_paths_mostly_take(
    family: str, size: int, seed: int, least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A piece a contact in edges, half of one in faces, and the slice in which that was spent."""
    begun = []

    def noted(stage: Stage) -> Stage:
        def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
            if stage.name == "paths":
                begun.append(race.spent() / (race.problem.nc * race.prices.piece))
            return stage.turns(race, monitor)

        return replace(stage, turns=turns)

    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(noted(stage) for stage in STAGES))
    assert solve(local(family, size, seed), "auto", tol=1e-4, without=("interior point",)).solved
    (pieces,) = begun
    assert least <= pieces < 1.9 * least


@pytest.mark.parametrize(("family", "size", "seed", "gain"), [("frictions", 300, 2, 3.0), ("walls-2D", 600, 954, 1.2)])
def test_an_interior_point_arrives_where_proximal_newton_takes_long(
    family: str, size: int, seed: int, gain: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bed with friction up to 5 and a wall in 2D: by counted costs `auto` spends less, in the wall without a path to follow."""
    spent: list[dict[str, float]] = []

    def noted(race: Race, entering: Sequence[Stage], ends: Callable[[Race], bool]) -> Iterate:
        iterate = run(race, entering, ends)
        spent.append({name: runner.spent for name, runner in race.runners.items()})
        return iterate

    monkeypatch.setattr(stages, "run_with_pauses", noted)
    p = local(family, size, seed)
    result = solve(p, "auto")
    assert result.solved and natural_map_residual(result.r, p.W @ result.r + p.q, p.mu, p.dimension) <= 1e-8 * np.linalg.norm(p.q)
    assert solve(p, "auto", without=("interior point",)).solved
    with_it, without_it = spent
    assert with_it["interior point"] > 0 and ("paths" in with_it) == (family == "frictions")
    assert sum(without_it.values()) > gain * sum(with_it.values())


def test_sweeps_go_on_before_proximal_newton_in_a_bed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Large friction: from further on proximal Newton takes fewer iterations."""
    spent = []

    def noted(race: Race, entering: Sequence[Stage], ends: Callable[[Race], bool]) -> Iterate:
        iterate = run(race, entering, ends)
        spent.append(race.spent())
        return iterate

    monkeypatch.setattr(stages, "run_with_pauses", noted)
    p = local("frictions", 300, 6003)
    assert solve(p, "auto", tol=1e-8).solved
    monkeypatch.setattr("fcsim.solvers.automatic.expected.LED", 20)
    assert solve(p, "auto", tol=1e-8).solved
    late, soon = spent
    assert soon > 2 * late


def test_the_error_of_long_sweeps_is_looked_at_often() -> None:
    """It swings from sweep to sweep: NNCG by name, looked at each 100, is no earlier. Looks grow from 20 sweeps to 40."""
    problem = local("frictions", 600, 732)
    others = tuple(stage.name for stage in STAGES if stage.name != "sweeps")
    result = solve(problem, "auto", tol=1e-4, without=others)
    steps = np.diff([iterations for iterations, _, _ in result.history])
    assert result.solved and steps.max() == 40
    assert result.iterations <= solve(problem, "NNCG", tol=1e-4).iterations + 40


@pytest.mark.parametrize(("friction", "velocities"), [(2.0, 3), (0.5, 1)])
def test_at_rest_those_contacts_hold_that_are_about_to_close(friction: float, velocities: int) -> None:
    """One of two contacts comes nearer, and sideways as fast: it sticks where friction is more than that, and holds all of its velocity."""
    q, mu = np.array([-1.0, 0.6, 0.8, 1.0, 0.0, 0.0]), np.full(2, friction)
    motion = SimpleNamespace(own=None, M=np.eye(6))
    problem = SimpleNamespace(q=q, mu=mu, dimension=3, delassus=SimpleNamespace(motion=motion))
    race: Any = SimpleNamespace(problem=problem, best_r=lambda: np.zeros(6), held=None)
    assert closed.held(race) == pytest.approx(velocities / 6)
    race.best_r = lambda: np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert closed.held(race) == pytest.approx(3 / 6)  # else those whose reaction is not zero


def test_contacts_that_sweeps_do_not_solve_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Painlevé's rods: a contact alone has no solution, and takes all of its iterations in each sweep; a pile's contacts have one."""
    spent: dict[str, Runner] = {}

    def noted(stage: Stage) -> Stage:
        return replace(stage, enters=lambda race: stage.enters(race) and spent.update(race.runners) is None)

    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(noted(stage) for stage in STAGES))
    for family, size, counted in (("rods", 300, True), ("rocks", 300, False)):
        solve(local(family, size, 1), "auto", tol=1e-8)
        sweeping = spent["sweeps"]
        assert (sweeping.monitor.beside > 10 * sweeping.monitor.iterations * sweeping.price) is counted
        assert counted or sweeping.monitor.beside < 0.1 * sweeping.spent


def test_no_admm_in_joints_of_nearly_rigid_bodies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Boxes on faces with a little compliance of their own: proximal Newton in their velocities takes a third of ADMM's time."""
    begun: list[str] = []

    def noted(race: Race, entering: Sequence[Stage], ends: Callable[[Race], bool]) -> Iterate:
        iterate = run(race, entering, ends)
        assert race.joints is not None and race.prices.in_velocities
        begun.extend(race.runners)
        return iterate

    monkeypatch.setattr(stages, "run_with_pauses", noted)
    assert solve(local("near-singular", 2000, 731), "auto", tol=1e-4).solved
    assert "proximal Newton" in begun and "splitting" not in begun


def test_admm_waits_for_what_its_first_iterations_cost_where_bodies_may_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    """An arch of 1006 contacts that stands: proximal Newton does not take all of the twenty iterations that are its own elsewhere."""
    spent = []

    def noted(stage: Stage) -> Stage:
        def turns(race: Race, monitor: ShareOfMonitor) -> Turns:
            if stage.name == "splitting":
                newton = race.runners["proximal Newton"]
                spent.append((newton.monitor.iterations, newton.spent / race.prices.splitting(race.options.splitting)))
            return stage.turns(race, monitor)

        return replace(stage, turns=turns)

    monkeypatch.setattr("fcsim.solvers.automatic.stages.STAGES", tuple(noted(stage) for stage in STAGES))
    assert solve(local("arches", 1000, 42), "auto").solved
    (iterations, share), *others = spent
    assert not others and share >= 1 and iterations < PROXIMAL_ALONE


@pytest.mark.slow
def test_a_bed_of_rocks_in_which_proximal_newton_was_stuck_is_solved() -> None:
    """Rocks whose best iterate stayed at 7e-7 for 70 000 iterations; proximal Newton from elsewhere, or a path of some pieces, leads on."""
    p = local("rocks", 600, 1042)
    result = solve(p, "auto", tol=1e-8, max_iterations=9_000)
    assert result.solved and result.error <= 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("size", [300, 600])
def test_a_bed_of_grains_with_large_friction_is_solved_from_zero(size: int) -> None:
    """Beds of friction up to 5 that were left at 3e-8 and 3e-7."""
    problem = problems("frictions", size, 832)
    result = solve(problem, "auto", tol=1e-8)
    assert result.status.solved and result.error <= 1e-8
