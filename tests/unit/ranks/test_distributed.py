"""W shared by ranks is the W of one process, and so are the answers found with it, within the tolerance."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from fcsim.problem import contact_status, scaled_error
from fcsim.problem.problem import LocalProblem
from fcsim.timestep.step import Step
from tests.unit.ranks.conftest import OnRanks
from tests.unit.ranks.walls import METHODS, RHO, TOLERANCE, digest, simulation

PROGRAM = Path(__file__).with_name("walls.py")
RANKS = (2, pytest.param(3, marks=pytest.mark.slow))
STEPS = 3


@cache
def alone(name: str) -> list[Step]:
    return [step for step in simulation(name, STEPS)[0] if step.number > 1]


@pytest.mark.parametrize("ranks", RANKS)
def test_W_over_ranks_is_that_of_one_process(on_ranks: OnRanks, ranks: int) -> None:
    W = alone("ADMM")[0].reduction.local.W
    assert isinstance(W, sp.bsr_array)
    x = np.random.default_rng(1).standard_normal(W.shape[0])
    nc = W.shape[0] // 3
    for answer in on_ranks("walls", ranks):
        seen = answer["ADMM"][0]
        assert seen["distributed"] and seen["refused"] and seen["whole"] == digest(W.toarray())
        assert np.allclose(seen["product"], W @ x, rtol=0, atol=1e-13 * np.linalg.norm(W @ x))
        blocks = W.toarray().reshape(nc, 3, nc, 3)[np.arange(nc), :, np.arange(nc)]
        assert np.allclose(np.reshape(seen["diagonal"], blocks.shape), blocks, rtol=1e-13, atol=1e-13 * np.abs(blocks).max())
        rho = RHO * alone("ADMM")[0].reduction.local.delassus.norm
        solution = spsolve(sp.csc_array(W + rho * sp.eye_array(W.shape[0])), x)
        assert np.linalg.norm(seen["solved"] - solution) <= 1e-9 * np.linalg.norm(solution)


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", METHODS)
def test_the_answers_are_those_of_one_process(on_ranks: OnRanks, name: str, ranks: int) -> None:
    answers = on_ranks("walls", ranks)
    for k, step in enumerate(alone(name)):
        steps = [answer[name][k] for answer in answers]
        assert len({seen["digest"] for seen in steps}) == 1  # every rank goes on with the same bits
        seen, local = steps[0], step.reduction.local
        assert seen["contacts"] == step.contacts.identity.tolist()
        assert seen["methods"] == [attempt.solver for attempt in step.attempts]
        r = np.array(seen["r"])
        own = LocalProblem(local.W, local.q, local.mu) if k == 0 else None  # the first problem is the same; later ones begin elsewhere
        if own is not None:
            assert scaled_error(own, r, floor=1e-3) <= 1.01 * TOLERANCE
            z = (r - step.result.r) @ (local.W @ (r - step.result.r))
            assert z <= 1e-5 * (step.result.r @ (local.W @ step.result.r))
        ours, theirs = (contact_status(x, local.mu, tolerance=1e-3) for x in (step.result.r, r))
        assert np.count_nonzero(ours != theirs) <= 0.01 * len(ours)


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", ["NSN-AC", "auto"])
def test_newton_over_ranks_needs_no_other_method(on_ranks: OnRanks, name: str, ranks: int) -> None:
    """Reactions of deformable bricks are unique: those of all of W, of W over ranks and of one process are the same."""
    answers, one = on_ranks("walls", ranks), alone(name)
    for k, step in enumerate(one):
        seen = answers[0][name][k]
        assert seen["distributed"] and seen["methods"] == [name] and seen["error"] <= TOLERANCE
        for r in (seen["r"], answers[0]["NSN-AC with all of W"][k]["r"]):
            difference = np.array(r) - step.result.r
            assert difference @ (step.reduction.local.W @ difference) <= 1e-9 * (step.result.r @ (step.reduction.local.W @ step.result.r))


@pytest.mark.parametrize("ranks", RANKS)
@pytest.mark.parametrize("name", ["ADMM", "NSN-AC"])
def test_the_wall_stands_on_its_weight(on_ranks: OnRanks, name: str, ranks: int) -> None:
    model = alone("ADMM")[0].reduction.factor.factor.model  # type: ignore[attr-defined]
    bricks = sum(np.prod(np.ptp(body.part.points, axis=0)) * body.part.material.density for body in model.deformable)
    weight = 9.81 * bricks + 30_000.0
    for seen in on_ranks("walls", ranks)[0][name][1:]:  # the whole weight acts from the step's beginning on
        assert seen["bottom_Rz"] - seen["inertia_z"] == pytest.approx(weight, rel=1e-9)
