"""The tangent of contact by differences: rules whose normals are interpolated or averaged converge quadratically, too."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.skin.boundary import joined_by_facets
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.part import Body
from fcsim.problem.reduction import BlockFactor
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.contact_tangent.slopes import contact_slopes

SMOOTH: dict[str, Any] = {"normals": "smooth"}
MORTAR: dict[str, Any] = {"candidates": "mortar"}
EVERYTHING: dict[str, Any] = {"everything": True}


def drawn(
    mu: float, rule: dict[str, Any], steps: int, *, unit: float = 1.0, E: float = 1e6, slide: float = 0.2, tol: float = 1e-12
) -> list[Step]:
    """A punch pressed by a fifth into a bed of facets twice as long as its own, then drawn along it."""
    bed = rectangle("bed", (4 * unit, unit), (4, 2), neo_hooke(E, 0.3, 1.0))
    punch = rectangle("punch", (0.5 * unit, 0.5 * unit), (3, 3), neo_hooke(3 * E, 0.3, 1.0))
    supports = [
        Support("bed", ("x", "y"), "y-"),
        Support("punch", ("y",), "y+", velocity=lambda t: -0.2 * unit if t < 1 else 0.0),
        Support("punch", ("x",), "y+", velocity=lambda t: slide * unit if t > 1 else 0.0),
    ]
    model = build_model([Body("bed", bed), Body("punch", punch, translation=(0.6 * unit, unit))], supports=supports)
    detection: Any
    if "everything" in rule:
        detection = Everything(model, mu=mu, alert=0.05 * unit)
    else:
        surfaces = (contact_surface(model, [of]) for of in (("punch", "y-"), ("bed", "y+")))
        detection = Detector([SurfacePair(*surfaces, mu, 0.05 * unit, **rule)], model.n_nodes)
    anywhere = Limits(rotation=np.inf, strain=np.inf)
    return list(Simulation(model, detection, QuasiStatic(0.5), steps, SolverSettings(tol=tol), limits=anywhere, witness=None))


def orders(step: Step) -> list[float]:
    """Of convergence at each iteration whose residuals are below 10 % and above round-off."""
    r = [problem.residual for problem in step.linearised]
    return [np.log(r[k + 1] / r[k]) / np.log(r[k] / r[k - 1]) for k in range(1, len(r) - 1) if r[k - 1] < 1e-1 and r[k + 1] > 1e-12]


@pytest.mark.parametrize(
    ("mu", "rule", "unit", "E"),
    [
        (0.0, SMOOTH, 1.0, 1e6),
        pytest.param(0.0, SMOOTH, 1e3, 1.0, marks=pytest.mark.slow),
        pytest.param(0.3, SMOOTH, 1.0, 1e6, marks=pytest.mark.slow),
        (0.0, MORTAR, 1.0, 1e6),
        pytest.param(0.0, MORTAR, 1e-3, 1e9, marks=pytest.mark.slow),
        (0.3, MORTAR, 1.0, 1e6),
        (0.0, EVERYTHING, 1.0, 1e6),
    ],
)
def test_every_rule_converges_quadratically(mu: float, rule: dict[str, Any], unit: float, E: float) -> None:
    """With the contacts' stiffness by formulas alone the first steps of these take 15 to 40 iterations, and mortar none that converges."""
    steps = drawn(mu, rule, 4, unit=unit, E=E, slide=0.1 if mu else 0.2)
    assert all(step.substeps == 1 and len(step.linearised) <= 7 for step in steps)
    assert all(step.linearised[-1].residual < 1e-9 for step in steps)
    assert np.median([order for step in steps for order in orders(step)]) > 1.4
    for step in steps:  # the answer is that of the problem as it stands
        p, r, v = step.problem, step.result.r, step.result.v
        assert_allclose(p.M @ v, p.H @ r + p.f, atol=1e-9 * abs(p.H @ r).max())
        assert_allclose(p.H.T @ v + p.w, step.result.u, atol=1e-9 * abs(step.result.u).max() + 1e-15 * unit)
        assert_allclose(v, step.state.x[step.model.free_dofs] - step.previous.x[step.model.free_dofs], atol=1e-6 * abs(v).max())


def test_a_tolerance_of_the_solver_that_is_too_large_for_newtons_is_not_taken() -> None:
    """With problems solved to 1e-4 these steps would take 35 iterations, and leave 3e-6 of penetration."""
    for step in drawn(0.0, MORTAR, 4, tol=1e-4):
        assert len(step.linearised) <= 7
        assert step.penetration < 1e-8


@pytest.mark.parametrize("rule", [SMOOTH, MORTAR])
def test_the_problem_is_the_one_that_its_own_matrix_says(rule: dict[str, Any]) -> None:
    for step in drawn(0.3, rule, 3)[1:]:
        p, rng = step.problem, np.random.default_rng(1)
        whole, x = BlockFactor(p.M), rng.normal(size=p.M.shape[0])
        assert_allclose(step.reduction.factor.solve(x), whole.solve(x), atol=1e-9 * abs(whole.solve(x)).max())
        W = p.H.T @ np.array([whole.solve(column) for column in p.H.toarray().T]).T
        own = step.reduction.local.W
        own = own if isinstance(own, np.ndarray) else own.toarray()
        assert_allclose(own, W, atol=1e-9 * abs(W).max())


@pytest.mark.parametrize(
    ("dimension", "rule", "graded"),
    [
        (2, SMOOTH, 0.0),
        (2, MORTAR, 0.0),
        (3, SMOOTH, 0.0),
        (3, MORTAR, 0.0),
        (2, SMOOTH, 1.5),
        (2, SMOOTH, -0.45),
        (2, MORTAR, 1.5),
        (3, SMOOTH, 1.5),
    ],
)
def test_slopes_are_those_of_forces_and_gaps(dimension: int, rule: dict[str, Any], graded: float) -> None:
    """Moved all together in a direction, nodes change forces and gaps as coloured differences say, where facets grow along the surface by
    the strain `graded` x, too: the far end of a long facet beside a short one turns the normal at their common node."""
    rng, soft = np.random.default_rng(5), neo_hooke(1e6, 0.3, 1.0)
    if dimension == 2:
        lower, upper = rectangle("a", (1.0, 0.3), (5, 1), soft), rectangle("b", (0.6, 0.3), (4, 1), soft)
        shift, down, up = (0.21, 0.29), "y-", "y+"
    else:
        lower, upper = brick("a", (1.0, 1.0, 0.3), (4, 4, 1), soft), brick("b", (0.5, 0.5, 0.3), (3, 3, 1), soft)
        shift, down, up = (0.21, 0.17, 0.29), "z-", "z+"
    model = build_model([Body("a", lower), Body("b", upper, translation=shift)])
    surfaces = (contact_surface(model, [of]) for of in (("b", down), ("a", up)))
    detector = Detector([SurfacePair(*surfaces, 0.3, 0.05, **rule)], model.n_nodes)
    x = model.reference + 1e-3 * rng.normal(size=model.reference.shape)
    x[:, : dimension - 1] += graded * x[:, : dimension - 1] ** 2
    met = detector(x)
    force, way = rng.normal(size=(len(met), dimension)), rng.normal(size=x.shape)
    motion = rng.normal(size=x.shape)
    slopes = contact_slopes(detector, met, force, motion, joined_by_facets(model, detector.nodes), x)
    assert slopes is not None
    B, E = slopes

    def forces(at: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        now = detector(at)
        assert np.array_equal(now.identity, met.identity)
        N, M = met.frame[:, 0], now.frame[:, 0]
        r, tangential = np.einsum("ad,ad->a", force, N), force - np.einsum("ad,ad->a", force, N)[:, None] * N
        p = r[:, None] * M + tangential - np.einsum("ad,ad->a", tangential, M)[:, None] * M
        total = np.zeros_like(x)
        np.add.at(total, np.maximum(now.nodes, 0), np.where(now.nodes >= 0, now.weights, 0.0)[:, :, None] * p[:, None])
        slip = np.einsum("ak,akd->ad", np.where(now.nodes >= 0, now.weights, 0.0), motion[now.nodes])
        T = met.frame[:, 1:] - np.einsum("abd,ad->ab", met.frame[:, 1:], M)[:, :, None] * N[:, None]
        return total.ravel(), now.gap, np.einsum("abd,ad->ab", T, slip)

    e = 1e-7
    (more, gap, slip), (less, before, slipped) = forces(x + e * way), forces(x - e * way)
    assert_allclose(B @ way.ravel(), -(more - less) / (2 * e), atol=1e-5 * abs(more - less).max() / (2 * e))
    along = np.einsum("ad,ak,akd->a", met.frame[:, 0], np.where(met.nodes >= 0, met.weights, 0.0), way[met.nodes])
    found = (E.T @ way.ravel()).reshape(-1, dimension)
    assert_allclose(found[:, 0] + along, (gap - before) / (2 * e), atol=1e-5 * abs(gap - before).max() / (2 * e))
    assert_allclose(found[:, 1:], (slip - slipped) / (2 * e), atol=1e-5 * abs(slip - slipped).max() / (2 * e))
