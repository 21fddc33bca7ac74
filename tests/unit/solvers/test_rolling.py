"""Problems with rolling friction: closed forms of a body on an incline, one answer of all methods, units, refusals."""

import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.errors import InputError
from fcsim.problem import GlobalProblem
from fcsim.problem.rolling import GlobalRollingProblem
from fcsim.solvers import SOLVERS, Status, solve
from fcsim.solvers.base import Iterate

METHODS = [name for name, method in SOLVERS.items() if 5 in method.dimensions]
g, h = 9.81, 1e-3


def on_incline(angle: float, mu: float, mu_r: float, radius: float, inertia: float, mass: float = 2.0, spin: float = 0.0) -> Any:
    """A round body at rest on an incline: v = (along, across, up, omega), J = inertia m R^2; a spin about the rolling axis is given."""
    J = inertia * mass * radius**2
    M = np.diag([mass] * 3 + [J] * 3)
    # u_N = v_z; u_T = v + omega x (-R n); rolling velocity omega_x, omega_y
    H = np.zeros((6, 5))
    H[2, 0] = H[0, 1] = H[1, 2] = H[3, 3] = H[4, 4] = 1.0
    H[4, 1], H[3, 2] = -radius, radius
    f = h * mass * g * np.array([np.sin(angle), 0, -np.cos(angle), 0, 0, 0])
    f[4] += J * spin
    f[0] += mass * radius * spin
    return GlobalRollingProblem(M, H, f, np.zeros(5), np.array([mu]), np.array([mu_r]))


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("inertia", [0.4, 0.5], ids=["sphere", "cylinder"])
@pytest.mark.parametrize("share", [0.2, 0.999, 1.001, 2.0])
@pytest.mark.parametrize("radius", [1e-4, 0.3, 50.0])
def test_it_rests_iff_tan_alpha_is_at_most_mu_r_over_R(name: str, inertia: float, share: float, radius: float) -> None:
    """Else it rolls with a = g (sin alpha - mu_r / R cos alpha) / (1 + J / (m R^2)): moments about the point of contact."""
    arm = 0.1
    angle = np.arctan(share * arm)
    result = solve(on_incline(angle, 0.8, arm * radius, radius, inertia), name, tol=1e-12)
    assert result.solved and result.v is not None
    acceleration = max(0.0, g * (np.sin(angle) - arm * np.cos(angle)) / (1 + inertia))
    assert_allclose(result.v[0] / h, acceleration, atol=1e-8 * g)
    assert_allclose(result.v[4] * radius, result.v[0], atol=1e-10 * g * h)  # it rolls without sliding
    assert_allclose(result.r[0] / (2.0 * g * h * np.cos(angle)), 1.0, rtol=1e-9)


@pytest.mark.parametrize("name", METHODS)
def test_it_slides_where_friction_is_too_small_to_turn_it(name: str) -> None:
    """mu < mu_r / R: it slides without rolling, a = g (sin alpha - mu cos alpha)."""
    angle, mu = 0.5, 0.1
    result = solve(on_incline(angle, mu, 0.06, 0.3, 0.4), name, tol=1e-12)
    assert result.solved and result.v is not None
    assert_allclose(result.v[:1] / h, g * (np.sin(angle) - mu * np.cos(angle)), rtol=1e-8)
    assert_allclose(result.v[4], 0, atol=1e-12)


def random(seed: int, nc: int = 6, mu: float = 0.4, mu_r: float = 0.2, constrained: bool = False) -> GlobalRollingProblem:
    rng = np.random.default_rng(seed)
    n = 5 * nc + 4
    A = rng.standard_normal((n, n))
    G, b = (rng.standard_normal((n, 2)), rng.standard_normal(2)) if constrained else (None, None)
    H, f, w = rng.standard_normal((n, 5 * nc)), rng.standard_normal(n), rng.standard_normal(5 * nc)
    w[::5] -= 2.0  # most contacts press
    return GlobalRollingProblem(A @ A.T / n + np.eye(n), H, f, w, np.full(nc, mu), np.full(nc, mu_r), G, b)


@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_all_methods_find_one_answer_and_it_keeps_the_law(seed: int, constrained: bool) -> None:
    p = random(seed, constrained=constrained)
    answers = [solve(p, name, tol=1e-11) for name in ("auto", *METHODS)]
    for answer in answers:
        assert answer.solved
        r, u, v = answer.r.reshape(-1, 5), answer.u.reshape(-1, 5), answer.v
        assert v is not None
        moved = p.M @ v - p.H @ answer.r - p.f - (p.G @ answer.multiplier if p.G is not None else 0)
        assert_allclose(moved, 0, atol=1e-10)
        assert_allclose(answer.u, p.H.T @ v + p.w, atol=1e-10)
        assert np.count_nonzero(r[:, 0] > 0.01) >= 3
        sliding, turning = np.hypot(u[:, 1], u[:, 2]), np.hypot(u[:, 3], u[:, 4])
        assert np.all(u[:, 0] > -1e-9) and np.all(np.abs(r[:, 0] * u[:, 0]) < 1e-9)
        # what slides or turns under pressure is held back with all that friction has, against its motion: maximum dissipation
        assert_allclose(np.einsum("ai,ai->a", r[:, 1:3], u[:, 1:3]), -p.mu * r[:, 0] * sliding, atol=1e-9)
        assert_allclose(np.einsum("ai,ai->a", r[:, 3:], u[:, 3:]), -p.mu_r * r[:, 0] * turning, atol=1e-9)
        assert_allclose(answer.u, answers[0].u, atol=1e-8)


def spinning(seed: int, nc: int = 6, **coefficients: float) -> GlobalRollingProblem:
    """A problem of six unknowns a contact."""
    rng, n = np.random.default_rng(seed), 6 * nc + 4
    A, w = rng.standard_normal((n, n)), rng.standard_normal(6 * nc)
    w[::6] -= 2.0
    mu, mu_r, mu_s = (np.full(nc, coefficients.get(name, 0.3)) for name in ("mu", "mu_r", "mu_s"))
    return GlobalRollingProblem(A @ A.T / n + np.eye(n), rng.standard_normal((n, 6 * nc)), rng.standard_normal(n), w, mu, mu_r, mu_s=mu_s)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(("mass", "length"), [(1.0, 1.0), (1e-9, 1e3)])
def test_with_spinning_all_methods_find_what_dissipates_most_in_any_units(name: str, mass: float, length: float) -> None:
    p = spinning(2)
    row = np.tile([1.0, 1.0, 1.0, *[1 / length] * 3], p.nc)
    given = replace(p, M=p.M * mass, H=p.H * row, f=p.f * mass * length, w=p.w * row * length, mu_r=p.mu_r * length, mu_s=p.mu_s * length)
    answer = solve(given, name, tol=1e-11)
    assert answer.solved and answer.checks.cone < 1e-9 and answer.checks.dual_cone < 1e-9
    r, u = answer.r.reshape(-1, 6), answer.u.reshape(-1, 6)
    unit = mass * length**2
    slides, turns = np.hypot(u[:, 1], u[:, 2]), np.hypot(u[:, 3], u[:, 4])
    assert np.count_nonzero(r[:, 0] > 0) >= 3 and np.any(np.abs(u[:, 5]) > 1e-3)
    assert_allclose(np.einsum("ai,ai->a", r[:, 1:3], u[:, 1:3]), -given.mu * r[:, 0] * slides, atol=1e-8 * unit)
    assert_allclose(np.einsum("ai,ai->a", r[:, 3:5], u[:, 3:5]), -given.mu_r * r[:, 0] * turns, atol=1e-8 * unit)
    assert_allclose(r[:, 5] * u[:, 5], -given.mu_s * r[:, 0] * np.abs(u[:, 5]), atol=1e-8 * unit)
    assert_allclose(answer.v, solve(p, "auto", tol=1e-11).v * length, atol=1e-7 * length)


def test_without_resistance_to_spinning_the_sixth_unknown_is_nothing() -> None:
    p = spinning(3, mu_s=0.0)
    five = np.arange(6 * p.nc).reshape(-1, 6)[:, :5].ravel()
    plain = GlobalRollingProblem(p.M, p.H[:, five], p.f, p.w[five], p.mu, p.mu_r)
    one, other = solve(p, "auto", tol=1e-11), solve(plain, "auto", tol=1e-11)
    assert one.solved and other.solved
    assert_allclose(one.r[five], other.r, atol=1e-8)
    assert_allclose(one.r[5::6], 0, atol=1e-14)


def test_what_spinning_friction_asks_of_a_problem() -> None:
    p = spinning(0)
    for changes, message in (
        ({"mu_s": np.full(p.nc, -1.0)}, "mu_s: expected coefficients >= 0, got -1.0 at contact 0"),
        ({"mu_s": np.ones(2)}, "mu_s: expected 6 coefficients for 36 contact unknowns, got 2"),
        ({"mu_s": None}, "dimension: expected 5 with rolling friction, 6 with spinning friction, mu_s, too, got 6"),
    ):
        with pytest.raises(InputError, match=message):
            replace(p, **changes)


@pytest.mark.parametrize("name", METHODS)
def test_without_resistance_to_rolling_it_is_coulombs_problem(name: str) -> None:
    p = random(4, mu_r=0.0)
    forces = np.arange(5 * p.nc).reshape(-1, 5)[:, :3].ravel()
    plain = solve(GlobalProblem(p.M, p.H[:, forces], p.f, p.w[forces], p.mu), "NSN-AC", tol=1e-11)
    result = solve(p, name, tol=1e-11)
    assert result.solved and plain.solved
    assert_allclose(result.r[forces], plain.r, atol=1e-8)
    assert_allclose(np.delete(result.r, forces), 0, atol=1e-14)


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize(("mass", "length", "time"), [(1e-9, 1.0, 1.0), (1e6, 1.0, 1.0), (1.0, 1e3, 1.0), (1e3, 1e-3, 1e3)])
def test_the_verdict_does_not_depend_on_the_units(name: str, mass: float, length: float, time: float) -> None:
    """In other units, numbers are: M of forces mass, of moments mass length^2; H carries lengths in the moments' rows."""
    p = random(7)
    row = np.tile([1.0, 1.0, 1.0, 1 / length, 1 / length], p.nc)  # of u: velocities length / time, turning 1 / time
    impulse, velocity = mass * length / time, length / time
    other = GlobalRollingProblem(
        *(p.M * mass, p.H * row, p.f * impulse, p.w * row * velocity, p.mu, p.mu_r * length),
    )
    one, two = solve(p, name, tol=1e-9), solve(other, name, tol=1e-9)
    assert one.solved and two.solved
    assert_allclose(two.scaled_error, one.scaled_error, rtol=0.5, atol=1e-11)
    assert_allclose(two.v / velocity, one.v, atol=1e-7)


@pytest.mark.parametrize("name", METHODS)
def test_why_it_stopped(name: str) -> None:
    p = random(1)
    for limit in (0, 1, 2):
        result = solve(p, name, tol=1e-14, max_iterations=limit)
        assert result.status is Status.MAX_ITERATIONS and result.iterations == limit
        assert result.error == pytest.approx(min(row[2] for row in result.history))
    assert solve(p, name, tol=1e-14, time_limit=0.0).status is Status.TIME_LIMIT


@pytest.mark.parametrize("name", METHODS)
def test_contacts_of_held_bodies_and_none_at_all(name: str) -> None:
    p = random(2)
    H = p.H.copy()
    H[:, :5] = 0  # the first contact's bodies are held
    w = p.w.copy()
    w[:5] = [0.5, 0, 0, 0, 0]  # and apart
    result = solve(replace(p, H=H, w=w), name, tol=1e-9)
    assert result.solved
    assert_allclose(result.r[:5], 0, atol=1e-12)
    w[0] = -0.5  # they are pushed into each other: there is no answer
    assert not solve(replace(p, H=H, w=w), name, tol=1e-9, max_iterations=200).solved
    empty = GlobalRollingProblem(p.M, np.zeros((p.n, 0)), p.f, np.zeros(0), np.zeros(0), np.zeros(0))
    assert solve(empty, name).solved


@pytest.mark.parametrize("name", METHODS)
def test_below_round_off_and_beyond_the_largest_number_nothing_is_solved(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(time, "perf_counter", time.thread_time)  # five seconds of the processor: what else it does changes nothing
    p = random(3)
    result = solve(p, name, tol=1e-300, time_limit=5.0)
    assert result.solved == (result.error <= 1e-300) and result.error < 1e-13
    huge = replace(p, H=p.H * 1e200, w=p.w * 1e100)
    result = solve(huge, name, time_limit=5.0)
    assert not result.solved or result.error <= 1e-8


def test_refusals() -> None:
    p = random(0)
    with pytest.raises(InputError, match=r"'NSN-AC': has no cone of rolling friction"):
        solve(p, "NSN-AC")
    plain = GlobalProblem(np.eye(3), np.eye(3), np.ones(3), np.zeros(3), np.ones(1))
    with pytest.raises(InputError, match="works in problems with rolling friction, the problem has 3D"):
        solve(plain, "ROLLING-NSGS")
    with pytest.raises(InputError, match="r: expected a starting point of 30 finite numbers"):
        solve(p, "auto", np.zeros(3))
    with pytest.raises(InputError, match="tol"):
        solve(p, "auto", tol=0.0)
    with pytest.raises(InputError, match="local_iterations"):
        solve(p, "auto", local_iterations=0)
    for option, value in (("linear", "kkt"), ("rescaling", "contacts"), ("symmetry", "symmetrise")):
        with pytest.raises(InputError, match=f"option {option}: expected .* with rolling friction, got '{value}'"):
            solve(p, "ROLLING-ADMM", **{option: value})


def test_what_a_method_returns(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of problems of Coulomb's cone: what is no iterate of the problem is refused by name."""

    def two_numbers(*_: object) -> Iterate:
        return Iterate(np.ones(2), Status.SOLVED)

    monkeypatch.setitem(SOLVERS, "ROLLING-MINE", replace(SOLVERS["ROLLING-NSGS"], run=two_numbers))
    with pytest.raises(InputError, match=r"two_numbers: expected a method to return Iterate.* shape \(5,\), got r of shape \(2,\)"):
        solve(on_incline(0.2, 0.5, 0.1, 0.3, 0.4), "ROLLING-MINE")


def stack(mu: float, arm: float, heaviest: float, spheres: int = 4, seed: int = 0) -> tuple[GlobalRollingProblem, Any]:
    """Spheres on each other, tilted, that move and spin at first; rolling resistance arm R, masses up to `heaviest` times the lightest.

    Also M's diagonal, for a residual of one's own.
    """
    rng = np.random.default_rng(seed)
    radius = rng.uniform(0.05, 0.1, spheres)
    mass = 1000 * radius**3 * heaviest ** (rng.permutation(spheres) / (spheres - 1))
    M, f, H = np.zeros(6 * spheres), np.zeros(6 * spheres), np.zeros((6 * spheres, 5 * spheres))
    contacts = []
    for i in range(spheres):
        N = np.array([0.0, 0.0, 1.0]) + (0.3 * rng.standard_normal(3) if i else 0.0)
        N /= np.linalg.norm(N)
        T1 = np.cross(N, [1.0, 0.0, 0.0])
        T1 /= np.linalg.norm(T1)
        frame = np.array([N, T1, np.cross(N, T1)])
        M[6 * i : 6 * i + 6] = [mass[i]] * 3 + [0.4 * mass[i] * radius[i] ** 2] * 3
        f[6 * i : 6 * i + 6] = M[6 * i : 6 * i + 6] * np.r_[0.3 * rng.standard_normal(3), 3 * rng.standard_normal(3)]
        f[6 * i : 6 * i + 3] += 1e-2 * g * mass[i] * np.array([0.3, 0.0, -1.0])
        for body, sign, lever in ((i, 1.0, -radius[i]), (i - 1, -1.0, radius[i - 1])):
            if body < 0:
                continue
            for k in range(3):
                H[6 * body : 6 * body + 3, 5 * i + k] = sign * frame[k]
                H[6 * body + 3 : 6 * body + 6, 5 * i + k] = sign * np.cross(lever * N, frame[k])
            H[6 * body + 3 : 6 * body + 6, 5 * i + 3] = sign * frame[1]
            H[6 * body + 3 : 6 * body + 6, 5 * i + 4] = sign * frame[2]
        contacts.append(min(radius[i], radius[max(i - 1, 0)]))
    mu_r = arm * np.array(contacts)
    return GlobalRollingProblem(np.diag(M), H, f, np.zeros(5 * spheres), np.full(spheres, mu), mu_r), M


@pytest.mark.parametrize("heaviest", [1.0, 1e3, 1e6])
@pytest.mark.parametrize(("mu", "arm"), [(0.1, 1e-3), (5.0, 0.5), (5.0, 1e-3), (0.3, 0.5)])
@pytest.mark.parametrize("spheres", [2, 4, 6])
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_auto_solves_stacks_of_spheres_whose_law_holds_in_long_doubles(
    mu: float, arm: float, heaviest: float, spheres: int, unit: float
) -> None:
    """Each contact's law is measured on u = H^T M^-1 (H r + f) in long doubles, relative to its own speeds and reactions."""
    p, M = stack(mu, arm, heaviest, spheres)
    result = solve(replace(p, M=p.M * unit, f=p.f * unit), "auto", tol=1e-10)
    assert result.solved and result.iterations < 10_000
    long = np.longdouble
    r, H = result.r.astype(long) / long(unit), p.H.astype(long)
    u = (H.T @ ((H @ r + p.f.astype(long)) / M.astype(long))).reshape(-1, 5)
    r = r.reshape(-1, 5)
    fall = (H.T @ (p.f.astype(long) / M.astype(long))).reshape(-1, 5)
    speed = np.max(np.abs(fall[:, :3]))
    assert np.all(u[:, 0] > -1e-7 * speed)
    assert np.all(r[:, 0] >= 0) and np.any(r[:, 0] > 0)
    pressed = r[:, 0] > 0
    assert np.all(u[pressed, 0] < 1e-7 * speed)
    for begin, coefficient, turn in ((1, p.mu, 1.0), (3, p.mu_r, 0.05)):
        held, moved = r[:, begin : begin + 2], u[:, begin : begin + 2]
        limit, length = coefficient * r[:, 0], np.hypot(moved[:, 0], moved[:, 1])
        assert np.all(np.hypot(held[:, 0], held[:, 1]) <= limit * (1 + 1e-9) + 1e-30)
        lost = limit * length + np.einsum("ai,ai->a", held, moved)  # 0 where the part dissipates most
        assert np.all(lost[pressed] <= 1e-6 * (limit * speed / turn)[pressed] + 1e-30)
