"""`auto` from a start near the answer between rigid blocks, and in steps of few contacts of rigid bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.bench.families import problems
from fcsim.problem import GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import Memory, solve
from fcsim.solvers.automatic import stages
from fcsim.timestep.chain import NOBODY, Attempt, Chain, SolverSettings

Measure = Callable[[LocalProblem, np.ndarray], float]


def _reduced(family: str, size: int) -> LocalProblem:
    given = problems(family, size, 0)
    assert isinstance(given, GlobalProblem)
    return reduce(given).local


@pytest.mark.parametrize("family", ["towers", "walls-2D"])
def test_from_a_near_start_proximal_newton_begins_and_w_is_not_made_ready_for_others(
    family: str, monkeypatch: pytest.MonkeyPatch, error_of: Measure
) -> None:
    local = _reduced(family, 200)
    answer = solve(local, "PPA-NSN-AC", tol=1e-10)
    near = answer.r * (1 + 1e-3 * np.sin(np.arange(local.m)))
    assert answer.solved and error_of(local, near) > 1e-6
    monkeypatch.setattr(LocalProblem, "stored", lambda self: pytest.fail("W is stored anew"))
    monkeypatch.setattr(stages.methods, "sweeps", lambda *_: pytest.fail("sweeps begin"))
    for start in (near, answer.r):  # an answer takes no iteration
        found = solve(local, "auto", start, memory=Memory.of(np.arange(local.nc)))
        assert found.solved and error_of(local, found.r) <= 1.001e-8 and found.iterations <= (0 if start is answer.r else 30)


@pytest.mark.parametrize("family", ["towers", "walls-2D"])
def test_a_start_that_is_far_too_large_begins_by_the_multiple_that_fits(family: str, error_of: Measure) -> None:
    """Where bodies come to rest u = 0, and r times c answers q times c: the multiple of least energy of 20 r is r."""
    made = _reduced(family, 200)
    resting = solve(made, "PPA-NSN-AC", tol=1e-10).r
    local = replace(made, q=-(made.delassus @ resting))
    assert error_of(local, resting) <= 1e-10 and error_of(local, 20 * resting) > 1
    found = solve(local, "auto", 20 * resting, tol=1e-8)
    assert found.solved and found.iterations == 0 and error_of(local, found.r) <= 1e-8
    kept = solve(local, "auto", 2 * resting, tol=1e-8)  # a half of it would fit: not far too large
    assert kept.solved and kept.history[0][2] == pytest.approx(error_of(local, 2 * resting)) and kept.iterations > 0


def test_a_start_that_pushes_the_wrong_way_begins_as_it_is(error_of: Measure) -> None:
    made = _reduced("towers", 200)
    start = solve(made, "PPA-NSN-AC", tol=1e-10).r
    few = np.arange(made.m) < made.m // 4
    away = replace(made, q=np.where(few, made.q, -made.q))  # most blocks part
    assert start @ away.q > 0
    found = solve(away, "auto", start, tol=1e-8)
    assert found.solved and found.history[0][2] == pytest.approx(error_of(away, start))


@pytest.mark.parametrize("family", ["towers", "walls-2D"])
def test_from_a_near_start_newton_alone_begins_where_joints_have_stiffness(
    family: str, monkeypatch: pytest.MonkeyPatch, error_of: Measure
) -> None:
    rigid = _reduced(family, 200)
    assert rigid.motion is not None
    own = np.full(rigid.m, 0.05 * float(np.mean(rigid.delassus.diagonal)))
    W = sp.bsr_array(sp.csr_array(rigid.W) + sp.diags_array(own), blocksize=(rigid.dimension, rigid.dimension))
    local = LocalProblem(W, rigid.q, rigid.mu, dimension=rigid.dimension, motion=replace(rigid.motion, W=W, own=own))
    answer = solve(local, "PPA-NSN-AC", tol=1e-10)
    near = answer.r * (1 + 1e-4 * np.sin(np.arange(local.m)))
    assert answer.solved and error_of(local, near) > 1e-7
    monkeypatch.setattr(LocalProblem, "stored", lambda self: pytest.fail("W is stored anew"))
    monkeypatch.setattr(stages.methods, "proximal", lambda *_: pytest.fail("proximal Newton begins"))
    found = solve(local, "auto", near)
    assert found.solved and error_of(local, found.r) <= 1.001e-8 and 0 < found.iterations <= 12
    assert "entries" not in local.delassus.__dict__  # counted where they are asked for


def test_few_contacts_of_rigid_bodies_pass_the_compiled_front_door_in_steps_too(monkeypatch: pytest.MonkeyPatch, error_of: Measure) -> None:
    given = problems("spheres", 40, 0)
    assert isinstance(given, GlobalProblem)
    reduction, tried = reduce(given), list[Attempt]()
    memory = Memory.of(np.arange(given.nc))
    monkeypatch.setattr(stages, "Race", lambda *_: pytest.fail("a race begins"))
    arguments = reduction, np.zeros(given.m), 1e-8, memory, NOBODY
    result, kept = Chain(SolverSettings(), 1.0, tried, serves=False).solve(*arguments)
    assert result is not None and error_of(reduction.local, result.r) <= 1.001e-8
    assert kept is memory and tried[0].status == "solved"
    with pytest.raises(pytest.fail.Exception, match="a race begins"):
        Chain(SolverSettings(), 1.0, tried).solve(*arguments)


@pytest.mark.parametrize("across", [3, 4, 5])
def test_few_contacts_of_elastic_bodies_are_newton_s_from_zero_in_steps(
    across: int, monkeypatch: pytest.MonkeyPatch, error_of: Measure
) -> None:
    """Points of a grid on a half-space, whose compliance falls as one over the distance (Boussinesq), pressed and pushed."""
    points = np.stack(np.meshgrid(np.arange(across), np.arange(across)), axis=-1).reshape(-1, 2).astype(float)
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    W = np.kron(1 / (0.3 + distance), np.eye(3))
    q = np.column_stack((np.full(len(points), -1.0), np.full(len(points), 0.3), 0.1 * points[:, 0]))
    local = LocalProblem(W, q.ravel(), np.full(len(points), 0.5))
    monkeypatch.setattr(stages.methods, "sweeps", lambda *_: pytest.fail("sweeps begin"))
    found = solve(local, "auto", memory=Memory.of(np.arange(local.nc)))
    assert found.solved and error_of(local, found.r) <= 1.001e-8
    assert found.iterations <= 1 + solve(local, "NSN-AC").iterations
