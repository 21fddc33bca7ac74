"""Patches of joints solved between Newton's systems: which joints they have, beside sets in Python, and what their equations leave."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.solvers.newton._formulation_kernels import disk_equations
from fcsim.solvers.newton.formulations import alart_curnier
from fcsim.solvers.newton.systems.two_level import _held_kernels as held_kernels
from fcsim.solvers.newton.systems.two_level import _settling_kernels as kernels
from fcsim.solvers.newton.systems.two_level import patches
from fcsim.solvers.newton.systems.two_level.settling import ContactIterate
from tests.unit.solvers.newton.systems.test_settling import in_numpy, joints_of_a_wall


def beside_in_python(bodies: np.ndarray, most: int) -> list[set[int]]:
    """The joints (k, 2) that have a body in common, bodies of more than `most` left out."""
    of_body = {b: {k for k, pair in enumerate(bodies) if b in pair} for b in np.unique(bodies[bodies >= 0])}
    return [{j for b in pair if b >= 0 and len(of_body[b]) <= most for j in of_body[b]} - {k} for k, pair in enumerate(bodies)]


def test_joints_beside_are_those_of_the_same_bodies() -> None:
    """Pairs of bodies by chance, some with one body alone, and a body on which much lies."""
    pairs = np.random.default_rng(0).integers(0, 20, (40, 2))
    on_the_last = np.stack([np.arange(15), np.full(15, 20)], axis=1)
    bodies = np.concatenate([pairs[pairs[:, 0] != pairs[:, 1]], [[3, -1], [-1, 5]], on_the_last])
    begins, beside = patches.joints_beside(bodies, 21)
    for k, expected in enumerate(beside_in_python(bodies, patches.MANY)):
        assert_array_equal(beside[begins[k] : begins[k + 1]], sorted(expected))


def test_the_worst_joints_choose_first_and_none_is_in_two_patches() -> None:
    """A chain of joints, each beside the next: 5 takes 4 and 6, 6 is taken, 3 stands beside what is taken, 8 takes 7 and 9."""
    begins = np.array([0, 1, *range(3, 20, 2), 20])
    beside = np.concatenate([[k for k in (j - 1, j + 1) if 0 <= k < 11] for j in range(11)])
    cuts = np.arange(0, 44, 4)
    starts, which = kernels.choose_patches(np.array([5, 6, 3, 8, 1]), begins, beside, cuts, 12, 1e9)
    assert [set(which[i:j]) for i, j in itertools.pairwise(starts)] == [{4, 5, 6}, {7, 8, 9}, {0, 1, 2}]
    starts, which = kernels.choose_patches(np.array([5, 8]), begins, beside, cuts, 8, 1e9)  # as many contacts as a patch may have
    assert which.tolist() == [5, 4, 8, 7]
    starts, which = kernels.choose_patches(np.array([5, 8]), begins, beside, cuts, 12, 12.0)  # enough with the first
    assert which.tolist() == [5, 4, 6]


def test_the_equations_of_a_patch_hold_with_the_velocities_that_W_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    """And all reactions elsewhere stay as they are; nothing is found where no joint is above the limit; with W as it is Newton's answer."""
    joints, W = joints_of_a_wall()
    nc, rng = len(joints.order), np.random.default_rng(0)
    weight, rho = W.diagonal().reshape(nc, 3).mean(1), 1 / W.diagonal().reshape(nc, 3)
    mu, r, u = np.full(nc, 0.5), np.zeros((nc, 3)), np.zeros((nc, 3))
    r[:, 0] = rng.uniform(1.0, 2.0, nc)
    middle = joints.order[joints.cuts[2] : joints.cuts[3]]
    r[middle, 1:] += 0.6 * rng.standard_normal((len(middle), 2))  # beyond friction, which nothing but u = 0 holds
    before = np.linalg.norm(weight[middle, None] * alart_curnier(u[middle], r[middle], mu[middle], rho[middle])[0])
    assert patches.patched(joints, W, ContactIterate(u, r, mu, rho, weight), 1.01 * before) is None
    found = patches.patched(joints, W, ContactIterate(u, r, mu, rho, weight), 0.99 * before)
    assert found is not None
    begins, beside = joints.beside
    own = np.concatenate([joints.order[joints.cuts[k] : joints.cuts[k + 1]] for k in (2, *beside[begins[2] : begins[3]])])
    assert len(middle) < len(own) <= patches.PATCH_UP_TO
    others = np.setdiff1d(np.arange(nc), own)
    assert_array_equal(found[others], r[others])
    moved = u + (W @ (found - r).ravel()).reshape(-1, 3)
    after = np.linalg.norm(weight[own, None] * alart_curnier(moved[own], found[own], mu[own], rho[own])[0])
    assert after <= patches.FALLS * before
    dofs = (3 * own[:, None] + np.arange(3)).ravel()
    monkeypatch.setattr(patches, "EASED", 0.0)
    found = patches.patched(joints, W, ContactIterate(u, r, mu, rho, weight), 0.99 * before)
    assert found is not None
    twin = in_numpy(W[np.ix_(dofs, dofs)], u[own], r[own], mu[own], rho[own], weight[own])
    assert_allclose(found[own], twin, atol=1e-6 * np.abs(twin).max())


@pytest.mark.parametrize("d", [2, 3])
def test_a_step_without_the_held_contacts_is_that_of_the_whole_system(d: int) -> None:
    """Contacts that stick, slide and are open, with any rho, against the dense matrix; also where all stick and where none does."""
    rng = np.random.default_rng(d)
    n = 40
    H = rng.standard_normal((n * d + 5, n * d))
    W, rho, mu = H.T @ H, rng.uniform(0.5, 2.0, (n, d)), np.full(n, 0.5)
    r, u = np.zeros((n, d)), rng.standard_normal((n, d))
    r[:, 0] = 5.0
    u[:15] = 0.05 * rng.standard_normal((15, d))
    r[30:] = -5.0
    for which in (np.arange(n), np.arange(15), np.arange(30, n)):
        dofs = (d * which[:, None] + np.arange(d)).ravel()
        W_own, m = W[np.ix_(dofs, dofs)], len(which)
        F, A, B = disk_equations(u[which], r[which], mu[which], rho[which], False)
        free = np.zeros(m, dtype=bool)
        held_kernels.may_slide(u[which], r[which], mu[which], rho[which], B, patches.EDGE, free)
        assert np.all(free[which >= 30]) and not np.any(free[which < 15])
        held, others = np.flatnonzero(~free), np.flatnonzero(free)
        assert not held_kernels.slides(B, held)
        assert held_kernels.slides(B, np.arange(m)) == np.any(which >= 30)
        step = held_kernels.newton_step(F, A, B, held, others, *held_kernels.without_held(W_own, held, others, d, 0.0))
        J = np.einsum("aij,ajk->aik", A, W_own.reshape(m, d, m * d)).reshape(m, d, m, d)
        J[np.arange(m), :, np.arange(m), :] += B
        expected = np.linalg.solve(J.reshape(m * d, m * d), -F.ravel())
        assert_allclose(step, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_whole_steps_lead_on_where_no_part_of_one_does_and_never_to_worse() -> None:
    """Four contacts whose W couples them by more than their own compliance, from 200 starts by chance: ||F|| of the answer is that of the
    start at most, and with whole steps more of them arrive."""
    arrived = []
    for leaps in (0, patches.LEAPS):
        rng, count = np.random.default_rng(0), 0
        for _ in range(200):
            H = rng.standard_normal((6, 12))
            W, mu, rho, weight = H.T @ H + 1e-3 * np.eye(12), np.full(4, 0.8), np.full((4, 3), 0.3), np.ones(4)
            u, r = rng.standard_normal((2, 4, 3))
            before = np.linalg.norm(alart_curnier(u, r, mu, rho)[0])
            found = kernels.settle_patch(W, u, r, mu, rho, weight, patches.ITERATIONS, patches.FALLS, leaps, patches.EDGE, patches.EASED)
            after = np.linalg.norm(alart_curnier(u + (W @ (found - r).ravel()).reshape(4, 3), found, mu, rho)[0])
            assert after <= before * (1 + 1e-9)
            count += bool(after <= patches.FALLS * before * (1 + 1e-6))
        arrived.append(count)
    assert arrived[1] > arrived[0] + 10  # 180 and 158
