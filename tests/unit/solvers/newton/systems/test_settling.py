"""Patches solved between Newton's systems: whole steps that are checked by their own residuals, and Newton's method on a patch in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_array_equal

from fcsim.arrays import FloatArray
from fcsim.problem import Delassus, scaled_error
from fcsim.solvers.base import Monitor
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.spaces import LocalSpace
from fcsim.solvers.newton.systems import choice, condensed
from fcsim.solvers.newton.systems.two_level import _settling_kernels as kernels
from fcsim.solvers.newton.systems.two_level.joints import Joints
from fcsim.solvers.newton.systems.two_level.patches import EASED, EDGE, FALLS, ITERATIONS, LEAPS
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate, Rounds, SettlesJoints
from tests.unit.solvers.newton.systems.test_two_level import shares_and_rows, step_of, walls


def joints_of_a_wall() -> tuple[Joints, np.ndarray]:
    """The joints of 12 bricks, and W dense."""
    shares, rows, _ = shares_and_rows(step_of("3", "3.5"))
    found = shares.bodies()
    assert found is not None
    return Joints(rows, shares, *found), sp.bsr_array(rows.W).toarray()


def in_numpy(W: np.ndarray, u: np.ndarray, r: np.ndarray, mu: np.ndarray, rho: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """`settle_patch` by dense matrices."""
    n, d = r.shape

    def size(F: np.ndarray) -> float:
        return float(np.linalg.norm(weight[:, None] * F))

    F, A, B = alart_curnier(u, r, mu, rho)
    enough = FALLS * size(F)
    for _ in range(ITERATIONS):
        if size(F) <= enough:
            break
        J = np.einsum("aij,ajk->aik", A, W.reshape(n, d, n * d)).reshape(n, d, n, d)
        J[np.arange(n), :, np.arange(n), :] += B
        dr = np.linalg.solve(J.reshape(n * d, n * d), -F.ravel())
        for t in 0.5 ** np.arange(10):
            moved = u + t * (W @ dr).reshape(n, d), r + t * dr.reshape(n, d)
            if size(alart_curnier(*moved, mu, rho)[0]) <= (1 - 0.01 * t) * size(F):
                break
        else:
            break
        u, r = moved
        F, A, B = alart_curnier(u, r, mu, rho)
    return r


def test_a_patch_that_nothing_determines_stays_as_it_is() -> None:
    """W = 0 and contacts that stick: Newton's matrix is zero."""
    r, u = np.array([[1.0, 0.0, 0.0]]), np.array([[0.1, 0.0, 0.0]])
    found = kernels.settle_patch(np.zeros((3, 3)), u, r, np.ones(1), np.ones((1, 3)), np.ones(1), ITERATIONS, FALLS, LEAPS, EDGE, EASED)
    assert_array_equal(found, r)


def test_steps_arrive_and_no_settling_makes_the_error_larger(monkeypatch: pytest.MonkeyPatch) -> None:
    """A wall of 35 bricks, whose weight is laid on at once: each answer by W's own entries; the error before and after each settling."""
    monkeypatch.setattr(condensed, "TWO_LEVEL_FROM", 1)
    monkeypatch.setattr(choice, "TWO_LEVEL_FROM", 1)
    settle, errors = LocalSpace.settle, []

    def watched(space: LocalSpace, mu: FloatArray, rho: FloatArray, monitor: Monitor) -> FloatArray | None:
        before, r = monitor.error(space._r, space.u), space._r
        found = settle(space, mu, rho, monitor)
        if found is None:
            assert space._r is r
        else:
            errors.append((before, monitor.error(found, space._system.operator.affine(found, space._q))))
        return found

    monkeypatch.setattr(LocalSpace, "settle", watched)
    for step in walls(1e-6, courses="5", blocks="6.5", steps="4"):
        local = step.reduction.local
        assert scaled_error(local, step.result.r, floor=1e-3) <= 1e-6
    assert errors
    assert all(after < before for before, after in errors)


class Leads:
    """A two-level system of W = 1 whose patches lead `times` as far as the answer, r = (1, 0, 0)."""

    pays = True

    def __init__(self, times: float, most: int) -> None:
        self.times, self.rounds = times, Rounds(most, 0.1)

    def settled(self, at: ContactIterate, limit: float) -> tuple[FloatArray, FloatArray]:
        dr = self.times * (np.array([1.0, 0, 0]) - at.r.ravel())
        return dr, dr


def settled_from(begin: float, times: float, most: int) -> tuple[FloatArray | None, float]:
    """What `settle` returns from the error `begin` and leaves of it, to 1e-6."""
    system = SettlesJoints()
    system._two_level, system.operator = Leads(times, most), Delassus(np.eye(3))  # type: ignore[attr-defined]
    q, mu = np.array([-1.0, 0, 0]), np.array([0.5])
    space, monitor = LocalSpace(system, q, np.array([1 - begin, 0, 0])), Monitor(q, mu, 3, 1e-6)  # type: ignore[arg-type]
    return space.settle(mu, np.ones((1, 3)), monitor), monitor.error(space._r, space.u) / begin


@pytest.mark.parametrize(("times", "left"), [(1.5, 0.5), (1.9, 0.05), (2.2, 0.1), (4.5, 1.0)])
def test_a_round_that_goes_too_far_is_halved(times: float, left: float) -> None:
    """One that leaves half of the error is taken as it is; half of one that goes 4.5 times as far leaves more than there was."""
    found, part = settled_from(5e-3, times, 1)
    assert part == pytest.approx(left, rel=1e-6)
    assert (found is None) == (left == 1)


def test_near_the_tolerance_rounds_go_on_for_less() -> None:
    """Rounds that leave 0.8: a second one follows from 1.5 times the tolerance, none from far."""
    assert settled_from(5e-3, 0.2, 5)[1] == pytest.approx(0.8, rel=1e-6)
    assert settled_from(1.5e-6, 0.2, 5)[1] == pytest.approx(0.64, rel=1e-6)
