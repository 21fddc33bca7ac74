"""One-contact solvers: against Coulomb's law itself, against a NumPy twin of Newton, and each other's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.solvers.gauss_seidel._one_contact_kernels import _newton
from fcsim.solvers.gauss_seidel.one_contact import ONE_CONTACT
from fcsim.solvers.newton.formulations import alart_curnier, jean_moreau
from fcsim.solvers.scaling import RHO_RULES

ONE_VISIT = {"FP-DS-ONE", "PC-DIAG", "CYL"}
"""Solvers that make one projection a visit: their fixed point is the solution."""


def law_residual(r: np.ndarray, u: np.ndarray, mu: float) -> float:
    """How far (r, u) is from Coulomb's law, from its text: signs, cone, complementarity, direction of sliding."""
    r_T, u_T = np.linalg.norm(r[1:]), np.linalg.norm(u[1:])
    return max(-u[0], -r[0], r_T - mu * r[0], abs(u[0] * r[0]), np.linalg.norm(u_T * r[1:] + mu * r[0] * u[1:]))


def newton_twin(W: np.ndarray, q: np.ndarray, mu: float, rho: np.ndarray, r: np.ndarray, formulation: Any = alart_curnier) -> np.ndarray:
    for _ in range(50):
        F, A, B = (x[0] for x in formulation((W @ r + q)[None], r[None], np.array([mu]), rho[None]))
        if np.linalg.norm(F) <= 1e-13:
            return r
        r = r - np.linalg.solve(A @ W + B, F)
    raise AssertionError("the twin did not converge")


def one_contact(rng: np.random.Generator, largest_mu: float = 0.5) -> tuple[np.ndarray, np.ndarray, float]:
    X = 0.4 * rng.standard_normal((3, 3))
    W = X @ X.T + np.diag([1.0, 1.0, 1.5])
    mu = float(rng.choice([0.0, 0.1, 0.3, largest_mu]))
    return W, rng.standard_normal(3) * [2, *rng.choice([0.2, 2.0], 2)], mu


def rows_of(W: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """W as sweeps hand it on: of arrays each solver would be compiled once more."""
    return tuple(map(tuple, W.tolist()))


def solve(
    name: str, W: np.ndarray, q: np.ndarray, mu: float, r: np.ndarray, tol: float = 1e-13, cap: int = 5000
) -> tuple[np.ndarray, bool]:
    solver = ONE_CONTACT[name]
    rho, rows = RHO_RULES[solver.rho](W[None])[0], rows_of(W)
    for _ in range(cap if name in ONE_VISIT else 1):
        before = r
        *r, solved = solver.kernel(rows, *q, mu, rho[0], rho[1], *r, tol, cap)
        if np.linalg.norm(np.subtract(r, before)) <= tol:
            break
    return np.array(r), solved


@pytest.mark.parametrize("warm", [False, True])
@pytest.mark.parametrize("name", ONE_CONTACT)
def test_law_on_one_contact(name: str, warm: bool) -> None:
    rng, zones = np.random.default_rng(0), {"open": 0, "stick": 0, "slip": 0}
    for _ in range(150):
        W, q, mu = one_contact(rng)
        start = rng.standard_normal(3) if warm else np.zeros(3)
        r, solved = solve(name, W, q, mu, start)
        assert solved
        u = W @ r + q
        assert law_residual(r, u, mu) < 1e-11
        zones["open" if r[0] == 0 else "stick" if np.linalg.norm(u) < 1e-10 else "slip"] += 1
        assert (r[0] > 0) == (q[0] < 0)
    assert min(zones.values()) > 8


@pytest.mark.parametrize("name", ONE_CONTACT)
def test_units_of_one_contact(name: str) -> None:
    """Lighter, or in millimetres: the same reaction in its unit, with the tolerance in that unit."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        W, q, mu = one_contact(rng)
        r, _ = solve(name, W, q, mu, np.zeros(3))
        scaled, solved = solve(name, 1e6 * W, 1e3 * q, mu, np.zeros(3), tol=1e-16)
        assert solved
        assert_allclose(scaled, 1e-3 * r, atol=1e-14)


@pytest.mark.parametrize("name", ONE_CONTACT)
def test_unsymmetric_contact_with_large_friction(name: str) -> None:
    """A contact whose W has a skew part and strong coupling of normal and tangent, mu = 0.9: solved, or said not to be."""
    rng, solved_ones = np.random.default_rng(2), 0
    for _ in range(100):
        W, q, _ = one_contact(rng)
        W = W + 0.3 * np.array([[0, 1, -1], [-1, 0, 0.5], [1, -0.5, 0]])
        r, solved = solve(name, W, q, 0.9, np.zeros(3), cap=20_000)
        solved_ones += solved
        assert not solved or name in ONE_VISIT or law_residual(r, W @ r + q, 0.9) < 1e-10
    assert solved_ones >= 97


@pytest.mark.parametrize("formulation, flag", [(alart_curnier, False), (jean_moreau, True)])
def test_newton_makes_the_twin_s_steps(formulation: Any, flag: bool) -> None:
    """After each number of iterations the kernel is where the NumPy iteration with `formulations` is."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        W, q, mu = one_contact(rng)
        rho = RHO_RULES["split spectral norm"](W[None])[0]
        start = np.abs(rng.standard_normal(3)) * [1, mu, mu] * 0.5
        r = start
        for iterations in range(1, 4):
            F, A, B = (x[0] for x in formulation((W @ r + q)[None], r[None], np.array([mu]), rho[None]))
            r = r - np.linalg.solve(A @ W + B, F)
            *own, solved = _newton(flag, False, rows_of(W), *q, mu, rho[0], rho[1], *start, 0.0, iterations - 1)
            if r[0] > 0 and not solved:  # AC leaves an open contact at once
                assert_allclose(own, r, atol=1e-12)


def test_line_search_makes_the_equations_fall() -> None:
    """On badly conditioned contacts ||F|| rises now and then along full steps, hardly ever along damped ones."""
    rng, risen = np.random.default_rng(4), {False: 0, True: 0}
    for _ in range(200):
        X = rng.standard_normal((3, 3))
        W, q, mu, start = X @ X.T + 0.1 * np.eye(3), rng.standard_normal(3) - [1, 0, 0], 0.8, np.array([1.0, 0.2, -0.3])
        rho = RHO_RULES["split spectral norm"](W[None])[0]
        for damped in (False, True):
            sizes = [np.linalg.norm(jean_moreau((W @ start + q)[None], start[None], np.array([mu]), rho[None])[0])]
            for iterations in range(8):
                *r, _ = _newton(True, damped, rows_of(W), *q, mu, rho[0], rho[1], *start, 0.0, iterations)
                sizes.append(np.linalg.norm(jean_moreau((W @ r + q)[None], np.array(r)[None], np.array([mu]), rho[None])[0]))
            risen[damped] += bool(np.any(np.diff(sizes) > 1e-12))
    assert risen[True] <= 2 and risen[False] >= 10 * (1 + risen[True])


@pytest.mark.parametrize("name", ["AC", "JM", "AC-GP", "AC-GP-HYBRID", "FP-DS", "FP-VI-UPK", "CYL-LOCAL"])
def test_unfinished_local_iteration_is_told(name: str) -> None:
    kernel = ONE_CONTACT[name].kernel
    if name in ("FP-DS", "FP-VI-UPK", "CYL-LOCAL"):
        assert not kernel(rows_of(np.eye(3)), -1.0, 5.0, 0.0, 0.5, 0.01, 0.01, 0.0, 0.0, 0.0, 1e-14, 2)[3]
    held = rows_of(np.zeros((3, 3)))  # on both sides, and pushed
    assert not kernel(held, -1.0, 0.0, 0.0, 0.5, 1.0, 1.0, 0.0, 0.0, 0.0, 1e-14, 20)[3]


def test_exact_solution_of_a_block_on_a_slope() -> None:
    """Statics of a point mass: it slides at angles above atan(mu) only, friction then mu N against the motion."""
    mass, g, mu, direction = 2.0, 9.81, 0.4, np.array([0.6, 0.8])
    for angle in (0.2, np.arctan(0.3999), np.arctan(0.4001), 0.9):
        free = g * np.r_[-np.cos(angle), np.sin(angle) * direction]
        r, solved = solve("EXACT", np.eye(3) / mass, free, mu, np.zeros(3))
        weight = mass * g
        friction = min(weight * np.sin(angle), mu * weight * np.cos(angle))
        assert solved
        assert_allclose(r, np.r_[weight * np.cos(angle), -friction * direction], rtol=1e-13)


@pytest.mark.parametrize("sweep", ["sweep", "sweep_conjugate", "sweep_velocities"])
def test_a_solver_that_is_not_compiled_is_named_too(sweep: str) -> None:
    """NUMBA_DISABLE_JIT=1 leaves Python's functions as they are, and every sweep ended in an AttributeError."""
    plain = replace(ONE_CONTACT["AC"], kernel=ONE_CONTACT["AC"].kernel.py_func)
    assert getattr(plain, sweep).py_func.__name__ == getattr(ONE_CONTACT["AC"], sweep).py_func.__name__
