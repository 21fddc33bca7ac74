"""Derivatives of solutions against differences of solutions, adjoints, units, and what has no derivative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from fcsim.errors import InputError
from fcsim.problem import OPEN, SLIP, STICK, GlobalProblem, LocalProblem
from fcsim.problem.reduction import reduce
from fcsim.solvers import Result, solve
from fcsim.solvers.derivative import GlobalDerivative, LocalDerivative, OuterProduct, contacts, derivative

STEP = 1e-6


def bodies(d: int, seed: int, *, nc: int = 8, ratio: float = 0.0, constrained: bool = False) -> GlobalProblem:
    """Contacts between masses from 1 to 10^ratio kg, coupled by a symmetric M; some open, some stick, some slide."""
    random = np.random.default_rng(seed)
    n = d * nc + 4
    A = random.standard_normal((n, n)) / np.sqrt(n)
    root = np.sqrt(10 ** (ratio * random.random(n)))
    M = root[:, None] * (A @ A.T + np.eye(n)) * root
    H = random.standard_normal((n, d * nc)) * (random.random((n, d * nc)) < 0.5) * root[:, None]
    f = root * random.standard_normal(n)
    w = 0.3 * random.standard_normal(d * nc)
    G, b = (sp.csr_array(root[:, None] * random.standard_normal((n, 2))), np.zeros(2)) if constrained else (None, None)
    return GlobalProblem(M, sp.csr_array(H), f, w, random.uniform(0.1, 0.9, nc), G, b, dimension=d)


def solved(problem: GlobalProblem | LocalProblem) -> Result:
    result = solve(problem, "auto", tol=1e-12)
    assert result.solved
    return result


def of_bodies(problem: GlobalProblem, result: Result | None = None) -> GlobalDerivative:
    found = (result or solved(problem)).derivative(problem)
    assert isinstance(found, GlobalDerivative)
    return found


def of_contacts(problem: LocalProblem) -> LocalDerivative:
    found = solved(problem).derivative(problem)
    assert isinstance(found, LocalDerivative)
    return found


def close(found: np.ndarray | None, expected: np.ndarray | None) -> bool:
    assert found is not None and expected is not None
    return bool(np.linalg.norm(found - expected) <= 1e-5 * np.linalg.norm(expected))


@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_changes_are_the_differences_of_solutions(d: int, constrained: bool) -> None:
    seen: set[int] = set()
    for seed in range(4):
        p, random = bodies(d, seed, constrained=constrained), np.random.default_rng(100 + seed)
        assert isinstance(p.M, np.ndarray)
        found = of_bodies(p)
        seen |= set(found.contacts.status.tolist())
        A = random.standard_normal(p.M.shape)
        direction = {"M": A + A.T, "f": random.standard_normal(p.n), "w": random.standard_normal(p.m), "mu": random.standard_normal(p.nc)}
        for name, change in direction.items():
            ends = [solved(replace(p, **{name: getattr(p, name) + t * change})) for t in (STEP, -STEP)]
            got = found.forward(**{name: change})
            for part in ("r", "u", "v"):
                assert close(getattr(got, part), (getattr(ends[0], part) - getattr(ends[1], part)) / (2 * STEP)), (seed, name, part)
    assert seen == {OPEN, STICK, SLIP}


@pytest.mark.parametrize("stored", [np.asarray, sp.csr_array])
def test_changes_of_a_local_problem_with_an_unsymmetric_operator(stored: type) -> None:
    p = reduce(bodies(3, 7)).local
    random = np.random.default_rng(0)
    W = np.asarray(p.W) + 0.02 * random.standard_normal((p.m, p.m))
    p, dW, dq = LocalProblem(stored(W), p.q, p.mu), random.standard_normal((p.m, p.m)), random.standard_normal(p.m)
    ends = [solved(replace(p, W=stored(W + t * dW), q=p.q + t * dq)) for t in (STEP, -STEP)]
    got = of_contacts(p).forward(W=dW, q=dq)
    assert close(got.r, (ends[0].r - ends[1].r) / (2 * STEP))
    assert close(got.u, (ends[0].u - ends[1].u) / (2 * STEP))
    onto_r, onto_u = random.standard_normal((2, p.m))
    back = of_contacts(p).backward(r=onto_r, u=onto_u)
    assert back.W.dot(dW) + back.q @ dq == pytest.approx(onto_r @ got.r + onto_u @ got.u, rel=1e-9)


@pytest.mark.parametrize("d", [2, 3])
def test_backward_is_the_adjoint_of_forward(d: int) -> None:
    p, random = bodies(d, 3), np.random.default_rng(1)
    found = of_bodies(p)
    onto = {"r": random.standard_normal(p.m), "u": random.standard_normal(p.m), "v": random.standard_normal(p.n)}
    gradient = found.backward(**onto)
    dM, df, dw, dmu = random.standard_normal((p.n, p.n)), *(random.standard_normal(k) for k in (p.n, p.m, p.nc))
    change = found.forward(M=dM, f=df, w=dw, mu=dmu)
    whole = sum(float(onto[part] @ getattr(change, part)) for part in onto)
    assert gradient.M.dot(dM) + gradient.f @ df + gradient.w @ dw + gradient.mu @ dmu == pytest.approx(whole, rel=1e-9)


def test_many_closed_contacts_are_factored_sparse(monkeypatch: pytest.MonkeyPatch) -> None:
    p, random = bodies(3, 3), np.random.default_rng(1)
    onto, change = random.standard_normal(p.n), random.standard_normal(p.nc)
    dense = of_bodies(p)
    monkeypatch.setattr(contacts, "DENSE_UP_TO", 0)
    sparse = of_bodies(p)
    assert close(sparse.forward(mu=change).v, dense.forward(mu=change).v)
    assert close(sparse.backward(v=onto).f, dense.backward(v=onto).f)


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_the_unit_of_mass_does_not_matter(unit: float) -> None:
    p = bodies(3, 2)
    changes = [of_bodies(q).forward(mu=np.ones(p.nc)) for q in (p, replace(p, M=p.M * unit, f=p.f * unit))]
    assert changes[1].v is not None and close(changes[1].v, changes[0].v)
    assert close(changes[1].r, unit * changes[0].r)


@pytest.mark.parametrize("seed", range(3))
def test_masses_a_hundred_million_apart(seed: int) -> None:
    p = bodies(3, seed, ratio=8.0)
    change = np.random.default_rng(5).standard_normal(p.nc)
    got = of_bodies(p).forward(mu=change)
    ends = [solved(replace(p, mu=p.mu + t * change)) for t in (STEP, -STEP)]
    assert close(got.u, (ends[0].u - ends[1].u) / (2 * STEP))


def test_a_block_on_a_slope() -> None:
    """v = h g (sin a - mu cos a) down the slope, r_N = m g h cos a: their derivatives by hand."""
    m, h, g, a, mu = 2.0, 1e-2, 9.81, 0.7, 0.3
    f = m * h * g * np.array([-np.cos(a), np.sin(a), 0.0])
    found = of_bodies(GlobalProblem(m * np.eye(3), np.eye(3), f, np.zeros(3), np.array([mu])))
    by_friction = found.forward(mu=np.ones(1))
    assert by_friction.v == pytest.approx([0, -h * g * np.cos(a), 0], abs=1e-12)
    assert by_friction.r == pytest.approx([0, -m * h * g * np.cos(a), 0], abs=1e-12)
    by_slope = found.forward(f=m * h * g * np.array([np.sin(a), np.cos(a), 0.0]))
    assert by_slope.v == pytest.approx([0, h * g * (np.cos(a) + mu * np.sin(a)), 0], abs=1e-12)
    by_mass = found.forward(M=np.eye(3), f=f / m)  # a heavier block moves alike, and presses more
    assert by_mass.v == pytest.approx(np.zeros(3), abs=1e-12)
    assert by_mass.r == pytest.approx([h * g * np.cos(a), -mu * h * g * np.cos(a), 0], abs=1e-12)
    sideways = found.forward(f=np.array([0.0, 0.0, 1.0]))  # friction turns with the velocity: 1 / (m + mu r_N / speed)
    speed, normal = h * g * (np.sin(a) - mu * np.cos(a)), m * h * g * np.cos(a)
    assert sideways.v == pytest.approx([0, 0, 1 / (m + mu * normal / speed)], abs=1e-12)


def test_contacts_without_friction() -> None:
    p = GlobalProblem(np.eye(3), np.eye(3), np.array([-1.0, 0.0, 0.0]), np.zeros(3), np.zeros(1))
    found = of_bodies(p)
    assert found.forward(f=np.array([0.0, 1.0, 2.0])).v == pytest.approx([0, 1, 2])
    with pytest.raises(InputError, match="without friction that do not move"):
        found.forward(mu=np.ones(1))
    assert np.isnan(found.backward(v=np.array([0.0, 1.0, 0.0])).mu).all()
    moving = of_bodies(replace(p, f=np.array([-1.0, 2.0, 0.0])))
    assert moving.forward(mu=np.ones(1)).v == pytest.approx([0, -1, 0])


def test_no_contacts_and_open_ones() -> None:
    p = GlobalProblem(np.eye(3), np.eye(3), np.array([1.0, 0.5, 0.0]), np.zeros(3), np.array([0.5]))
    change = of_bodies(p).forward(f=np.array([1.0, 2.0, 3.0]), mu=np.ones(1))
    assert not change.r.any() and change.u == pytest.approx([1, 2, 3])
    none = GlobalProblem(np.eye(3), np.zeros((3, 0)), np.ones(3), np.zeros(0), np.zeros(0))
    assert of_bodies(none).forward(f=np.ones(3)).v == pytest.approx(np.ones(3))


@pytest.mark.parametrize(
    ("q", "what"),
    [
        ([0.0, 1.0, 0.0], "touch without a reaction"),
        ([-1.0, 0.5, 0.0], "about to slide"),
    ],
)
def test_borders_are_refused(q: list[float], what: str) -> None:
    p = LocalProblem(np.eye(3), np.array(q), np.array([0.5]))
    with pytest.raises(InputError, match=what):
        solved(p).derivative(p)


def test_reactions_that_are_not_unique_are_refused() -> None:
    H = np.zeros((3, 6))
    H[:, :3] = H[:, 3:] = np.eye(3)  # one body held by twice the same contact
    p = GlobalProblem(np.eye(3), H, np.array([-1.0, 0.1, 0.0]), np.zeros(6), np.full(2, 0.5))
    shared = np.tile([0.5, -0.05, 0.0], 2)
    with pytest.raises(InputError, match="unique"):
        derivative(p, shared)


def test_what_is_no_solution_is_refused() -> None:
    p = bodies(3, 2)
    result = solved(p)
    with pytest.raises(InputError, match="expected a solution"):
        result.derivative(replace(p, f=2 * p.f))
    with pytest.raises(InputError, match="is this the problem"):
        result.derivative(bodies(3, 2, nc=5))
    with pytest.raises(InputError, match="margin"):
        result.derivative(p, margin=2.0)
    mixed = LocalProblem(np.eye(3), np.ones(3), np.ones(1), np.zeros((3, 1)), np.eye(1), np.zeros(1))
    with pytest.raises(InputError, match="mixed"):
        solve(mixed, "auto").derivative(mixed)


@pytest.mark.parametrize(
    ("name", "change"), [("f", np.ones(3)), ("w", "text"), ("mu", np.full(8, np.nan)), ("M", np.eye(2)), ("f", [[1.0], [2.0, 3.0]])]
)
def test_directions_of_another_shape_are_refused(name: str, change: object) -> None:
    found = of_bodies(bodies(3, 2))
    with pytest.raises(InputError, match=f"^{name}: expected"):
        found.forward(**{name: change})  # type: ignore[arg-type]


@pytest.mark.parametrize(("value", "what"), [(1j, "real numbers|numbers of shape"), (np.nan, "finite numbers")])
def test_changes_without_real_numbers_are_refused(value: complex, what: str) -> None:
    """The imaginary part was dropped, NaN of a matrix went on into the answer."""
    p = bodies(3, 2)
    found = of_bodies(p)
    gradient = found.backward(r=np.ones(p.m))
    for change in (
        lambda: found.forward(f=np.full(p.n, value)),
        lambda: found.forward(M=np.full((p.n, p.n), value)),
        lambda: found.contacts.forward(W=sp.csr_array(np.full((p.m, p.m), value))),
        lambda: found.backward(r=np.full(p.m, value)),
        lambda: gradient.M.dot(np.full((p.n, p.n), value)),
    ):
        with pytest.raises(InputError, match=what):
            change()
    with pytest.raises(InputError, match="direction: expected a change of shape"):
        gradient.M.dot(np.eye(3))


def test_gradients_of_an_unsymmetric_mass_are_refused() -> None:
    p = bodies(3, 2)
    skew = 0.1 * np.triu(np.ones((p.n, p.n)), 1)
    p = replace(p, M=p.M + skew - skew.T)
    found = of_bodies(p)
    assert found.forward(f=np.ones(p.n)).v is not None
    with pytest.raises(InputError, match="symmetric"):
        found.backward(r=np.ones(p.m))


def test_an_outer_product_is_its_matrix() -> None:
    random = np.random.default_rng(0)
    product, matrix = OuterProduct(random.standard_normal(3), random.standard_normal(4)), random.standard_normal((3, 4))
    assert product.dot(matrix) == pytest.approx(float(np.sum(product.array() * matrix)))
    assert product.dot(sp.csr_array(matrix)) == pytest.approx(product.dot(matrix))
