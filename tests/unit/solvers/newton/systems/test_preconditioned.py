"""Newton's linear system by GMRES with W's factor and the stiffness of the joints: the step, what is kept, and where it gives up."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg as sla
import scipy.sparse as sp
from numpy.testing import assert_allclose

from fcsim import SolverSettings
from fcsim.linear.joints import BlockRows
from fcsim.problem import Delassus
from fcsim.running.case import load_case
from fcsim.running.parameters import parse_parameters
from fcsim.solvers.newton.systems import condensed, preconditioned
from fcsim.solvers.newton.systems.condensed import CondensedSystem
from fcsim.solvers.newton.systems.preconditioned import ACCURACY, SAFETY, StiffnessBlocks, stiffness_blocks, system_of_joints
from tests.unit.linear.test_fronts import linearisation, wall

CASE = Path(__file__).resolve().parents[5] / "cases" / "masonry_wall"


def matrix(W: sp.bsr_array, A: np.ndarray, B: np.ndarray) -> np.ndarray:
    return sla.block_diag(*A) @ W.toarray() + sla.block_diag(*B)


@pytest.mark.parametrize("open_share", [0.0, 0.3])
@pytest.mark.parametrize("d", [2, 3])
def test_the_step_has_the_defect_asked_for(d: int, open_share: float) -> None:
    rng = np.random.default_rng(0)
    W, joint = wall(4, 5, 7, d, 1)
    A, B = linearisation(len(joint), d, rng, open_share)
    B *= 0.2
    rhs = rng.standard_normal((len(joint), d))
    found = system_of_joints(BlockRows(W, d)).solve(A, B, rhs)
    assert found is not None
    dr, Wdr = found
    assert np.linalg.norm(matrix(W, A, B) @ dr - rhs.ravel()) <= 1.001 * ACCURACY * np.linalg.norm(rhs)
    assert_allclose(Wdr, W @ dr, atol=1e-10 * np.abs(Wdr).max())


def test_near_the_solution_less_is_asked_for() -> None:
    """A share of what Newton's residual has still to fall, by as many iterations fewer."""
    rng, d = np.random.default_rng(0), 3
    W, joint = wall(4, 5, 7, d, 1)
    A, B = linearisation(len(joint), d, rng, 0.3)
    B, rhs = 0.2 * B, rng.standard_normal((len(joint), d))
    system, products = system_of_joints(BlockRows(W, d)), []
    inner = system._product
    system._product = lambda x: products.append(0) or inner(x)  # type: ignore[func-returns-value,method-assign]
    counts = []
    for needed in (0.0, 0.1):
        products.clear()
        found = system.solve(A, B, rhs, needed)
        assert found is not None
        counts.append(len(products))
    assert np.linalg.norm(matrix(W, A, B) @ found[0] - rhs.ravel()) <= 1.001 * SAFETY * 0.1 * np.linalg.norm(rhs)
    assert counts[1] < counts[0]


def test_where_all_stick_one_iteration_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Then (A + B Z)^-1 = A^-1, and the preconditioner is the inverse but for single precision and the shift."""
    monkeypatch.setattr(preconditioned, "ITERATIONS", 1)
    monkeypatch.setattr(preconditioned, "ENOUGH", 0.0)
    W, joint = wall(4, 5, 7, 3, 1)
    A, B = linearisation(len(joint), 3, np.random.default_rng(0), 0.0)
    assert system_of_joints(BlockRows(W, 3)).solve(A, 0 * B, np.ones((len(joint), 3))) is not None


def test_blocks_serve_the_next_W_and_are_made_anew_where_they_no_longer_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preconditioned, "ITERATIONS", 12)
    monkeypatch.setattr(preconditioned, "ENOUGH", 0.0)
    rng = np.random.default_rng(3)
    W, joint = wall(4, 5, 7, 3, 1)
    A, B = linearisation(len(joint), 3, rng, 0.0)
    B, rhs = 0.02 * B, rng.standard_normal((len(joint), 3))
    first = system_of_joints(BlockRows(W, 3))
    assert first.solve(A, B, rhs) is not None
    near = system_of_joints(BlockRows(sp.bsr_array(1.001 * W), 3), first.blocks)
    assert near.solve(A, B, rhs) is not None
    assert near.blocks is first.blocks
    other = wall(4, 5, 7, 3, 2)[0]
    far = system_of_joints(BlockRows(other, 3), first.blocks)
    found = far.solve(A, B, rhs)
    assert found is not None
    assert far.blocks is not first.blocks
    assert np.linalg.norm(matrix(other, A, B) @ found[0] - rhs.ravel()) <= 1.001 * ACCURACY * np.linalg.norm(rhs)


def test_an_indefinite_W_is_left_to_others() -> None:
    W, joint = wall(3, 3, 8, 3, 3)
    rows = BlockRows(sp.bsr_array(W - 50 * sp.eye_array(W.shape[0]), blocksize=(3, 3)), 3)
    A, B = linearisation(len(joint), 3, np.random.default_rng(0), 0.0)
    system = system_of_joints(rows)
    assert system.solve(A, B, np.ones((len(joint), 3))) is None
    assert not system.pays
    assert system.blocks is None


def test_it_takes_over_where_the_border_would_be_too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(condensed, "BORDER_UP_TO", 0)
    rng = np.random.default_rng(0)
    W, joint = wall(6, 6, 8, 3, 0)
    A, B = linearisation(len(joint), 3, rng, 0.0)
    B, rhs = 0.2 * B, rng.standard_normal((len(joint), 3))
    system = CondensedSystem(Delassus(W, 3))
    dr, _ = system.solve(A, B, rhs)
    assert np.linalg.norm(matrix(W, A, B) @ dr - rhs.ravel()) <= 1.001 * ACCURACY * np.linalg.norm(rhs)
    kept = system.left(np.arange(len(joint)))
    assert kept is not None
    assert kept.blocks is not None
    assert kept.condensation is None
    following = CondensedSystem(Delassus(sp.bsr_array(1.001 * W), 3), kept)
    following.solve(A, B, rhs)
    assert following.left(np.arange(len(joint))).blocks is kept.blocks  # type: ignore[union-attr]


def test_steps_of_a_wall_are_those_with_a_border(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reactions of deformable blocks are unique: two ways to solve Newton's systems meet in them. What carries the wall is its weight."""
    script = load_case(CASE)
    given = {"steps": "5", "gravity_last": "2"}
    reactions, made = [], []

    def counted(rows: BlockRows) -> StiffnessBlocks | None:
        made.append(limit)
        return stiffness_blocks(rows)

    monkeypatch.setattr(preconditioned, "stiffness_blocks", counted)
    for limit in (2e9, 0.0):
        monkeypatch.setattr(condensed, "BORDER_UP_TO", limit)
        case = script.build(parse_parameters(script, given))
        steps = list(replace(case.simulation, solver=SolverSettings(name="NSN-AC", tol=1e-9, fallback=())))
        sensor = {s.column: s.measure for s in case.sensors}
        supports = [sensor["bottom_Rz"](step) - sensor["inertia_z"](step) for step in steps[2:]]
        assert_allclose(supports, supports[0], rtol=1e-8)
        reactions.append(steps[-1].result.r)
    assert made == [0.0]  # one factor for all steps
    assert np.linalg.norm(reactions[1] - reactions[0]) <= 1e-4 * np.linalg.norm(reactions[0])
