"""The rho rules against their definitions by eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.solvers.scaling import RHO_RULES, adapt_rho


def blocks(d: int, count: int = 5) -> np.ndarray:
    X = np.random.default_rng(d).standard_normal((count, d, d))
    return X @ X.transpose(0, 2, 1) + 0.1 * np.eye(d)


@pytest.mark.parametrize("d", [2, 3])
def test_definitions(d: int) -> None:
    W = blocks(d)
    for a, W_aa in enumerate(W):
        tangential = np.linalg.eigvals(W_aa[1:, 1:]).real
        rho = {name: rule(W)[a] for name, rule in RHO_RULES.items()}
        assert_allclose(rho["constant"], np.ones(d))
        assert_allclose(rho["spectral norm"], np.full(d, 1 / np.linalg.eigvals(W_aa).real.max()))
        assert_allclose(rho["split spectral norm"], [1 / W_aa[0, 0]] + [1 / tangential.max()] * (d - 1))
        expected = max(tangential.min() / tangential.max(), 1e-3) / tangential.max()
        assert_allclose(rho["split spectral norm with condition number"], [1 / W_aa[0, 0]] + [expected] * (d - 1))


@pytest.mark.parametrize("name", RHO_RULES)
def test_every_rho_is_positive_and_finite(name: str) -> None:
    """Also where a contact has no compliance of its own, or none along a direction."""
    W = np.concatenate([blocks(3), np.zeros((1, 3, 3)), np.diag([1.0, 0, 0])[None], np.diag([0.0, 1, 0])[None]])
    for given in (W, W[5:6]):
        rho = RHO_RULES[name](given)
        assert rho.shape == given.shape[:2]
        assert np.all(rho > 0) and np.all(np.isfinite(rho))


@pytest.mark.parametrize("name", [name for name in RHO_RULES if name != "constant"])
def test_rho_follows_the_units_of_W(name: str) -> None:
    W = blocks(3)
    assert_allclose(RHO_RULES[name](1e6 * W), 1e-6 * RHO_RULES[name](W))


def test_adaptive_rho_finds_the_compliance_that_steps_show() -> None:
    """Steps with ||du|| = k ||dr||: rho k settles between 0.3 and 0.9, N and T apart, and stays within a factor of 100."""
    first = np.full((4, 3), 2.0)
    k_N, k_T = np.array([0.01, 1.0, 30.0, 1e6]), np.array([5.0, 0.2, 0.7, 1e-9])
    rng = np.random.default_rng(0)
    rho = first
    for _ in range(40):
        dr = rng.standard_normal((4, 3))
        turned = np.column_stack([dr[:, 0], -dr[:, 2], dr[:, 1]])
        rho = adapt_rho(rho, first, turned * np.column_stack([k_N, k_T, k_T]), dr)
    assert np.all(((rho[:, 0] * k_N)[:3] >= 0.3) & ((rho[:, 0] * k_N)[:3] <= 0.9))
    assert np.all(((rho[:, 1] * k_T)[:3] >= 0.3) & ((rho[:, 1] * k_T)[:3] <= 0.9))
    assert_allclose(rho[3], [0.02, 200, 200])
    assert_allclose(rho[:, 1], rho[:, 2])
    assert_allclose(adapt_rho(rho, first, np.zeros((4, 3)), np.zeros((4, 3))), rho)  # nothing moved, nothing learnt
