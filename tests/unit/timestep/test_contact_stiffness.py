"""The geometric stiffness of contact: the derivative of contact forces, and the order of convergence that it restores."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle
from fcsim.mesh.material import Material, neo_hooke
from fcsim.mesh.part import Body
from fcsim.problem.reduction import BlockFactor
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.contact_tangent.stiffness import contact_stiffness

UNHINDERED = Limits(rotation=np.inf, strain=np.inf)


@pytest.mark.each_value
@pytest.mark.parametrize(
    ("cell", "candidates"),
    [("quadrilateral", "nodes"), ("quadrilateral", "gauss"), ("hexahedron", "nodes"), ("tetrahedron", "gauss"), ("hexahedron", "faces")],
)
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_it_is_the_derivative_of_the_contact_forces(cell: str, candidates: Any, unit: float) -> None:
    """Against central differences of the forces that detection gives at moved nodes, warped facets included; frames are carried along
    without a spin about the normal."""
    rng, stone = np.random.default_rng(3), Material(1e6, 0.3, 1.0)
    if cell == "quadrilateral":
        lower, upper = (rectangle(n, unit * np.array(s), k, stone) for n, s, k in (("a", (1, 0.3), (2, 1)), ("b", (0.6, 0.3), (3, 1))))
        shift, down, up = (0.21, 0.3005), "y-", "y+"
    else:
        lower = brick("a", unit * np.array((1, 1, 0.3)), (2, 2, 1), stone, cell)
        upper = brick("b", unit * np.array((0.5, 0.5, 0.3)), (3, 3, 1), stone, cell)
        shift, down, up = (0.21, 0.17, 0.3005), "z-", "z+"
    model = build_model([Body("a", lower), Body("b", upper, translation=tuple(unit * np.array(shift)))])
    pair = SurfacePair(contact_surface(model, [("b", down)]), contact_surface(model, [("a", up)]), 0.3, 0.05 * unit, candidates)
    detector = Detector([pair], model.n_nodes)
    x = 1e-3 * unit * rng.normal(size=model.n_dofs)
    met = detector(model.positions(x))
    r = rng.normal(size=(len(met), met.dimension))
    tangential = np.einsum("aij,ai->aj", met.frame, r) - r[:, :1] * met.frame[:, 0]

    def forces(x: np.ndarray) -> np.ndarray:
        now = detector(model.positions(x))
        assert np.array_equal(now.identity, met.identity)
        N = now.frame[:, 0]
        p = r[:, :1] * N + tangential - np.einsum("ad,ad->a", tangential, N)[:, None] * N
        total = np.zeros((model.n_nodes, met.dimension))
        np.add.at(total, np.maximum(now.nodes, 0), np.where(now.nodes >= 0, now.weights, 0.0)[:, :, None] * p[:, None])
        return total.ravel()

    e = 1e-6 * unit
    slope = np.array([(forces(x + e * way) - forces(x - e * way)) / (2 * e) for way in np.eye(len(x))]).T
    found = contact_stiffness(model, met, r.ravel(), x).toarray()
    assert_allclose(found, -slope, atol=1e-8 * abs(slope).max())
    without = contact_stiffness(model, met, (r * (np.arange(met.dimension) == 0)).ravel(), x).toarray()
    assert_allclose(without, without.T, atol=1e-10 * abs(without).max())


def sliding(mu: float, slide: float, steps: int, unit: float = 1.0, E: float = 1e6) -> list[Step]:
    """A punch pressed by a fifth of its bed's height and then drawn along it, four facets of the bed long."""
    bed = rectangle("bed", (4 * unit, unit), (4, 2), neo_hooke(E, 0.3, 1.0))
    punch = rectangle("punch", (0.5 * unit, 0.5 * unit), (3, 3), neo_hooke(3 * E, 0.3, 1.0))
    supports = [
        Support("bed", ("x", "y"), "y-"),
        Support("punch", ("y",), "y+", velocity=lambda t: -0.2 * unit if t < 1 else 0.0),
        Support("punch", ("x",), "y+", velocity=lambda t: slide * unit if t > 1 else 0.0),
    ]
    model = build_model([Body("bed", bed), Body("punch", punch, translation=(0.6 * unit, unit))], supports=supports)
    pair = SurfacePair(contact_surface(model, [("punch", "y-")]), contact_surface(model, [("bed", "y+")]), mu, 0.05 * unit)
    return list(
        Simulation(
            model, Detector([pair], model.n_nodes), QuasiStatic(0.5), steps, SolverSettings(tol=1e-12), limits=UNHINDERED, witness=None
        )
    )


def orders(step: Step) -> list[float]:
    """Of convergence at each iteration whose residuals are below 10 % and above round-off."""
    r = [problem.residual for problem in step.linearised]
    return [np.log(r[k + 1] / r[k]) / np.log(r[k] / r[k - 1]) for k in range(1, len(r) - 1) if r[k - 1] < 1e-1 and r[k + 1] > 1e-12]


@pytest.mark.parametrize(("unit", "E"), [(1.0, 1e6), (1e3, 1.0)])
def test_large_sliding_converges_quadratically(unit: float, E: float) -> None:
    """Residuals of the steps while the punch is drawn over 0.9 m, four nodes over three facets (docs/measures/deformable_bodies.md): none
    takes more than six iterations; without the stiffness of contact the second step does not converge at all."""
    steps = sliding(0.0, 0.3, 8, unit, E)
    assert all(step.substeps == 1 and len(step.linearised) <= 6 for step in steps)
    assert all(step.linearised[-1].residual < 1e-9 and step.penetration < 1e-7 * unit for step in steps)
    assert np.median([order for step in steps for order in orders(step)]) > 1.7
    for step in steps:
        pressure = step.contact_force_on(1)
        held = step.support_impulse[step.model.n_elastic - 32 :].reshape(-1, 2).sum(axis=0)  # the punch's 16 nodes
        assert_allclose(held + pressure, 0, atol=1e-6 * np.linalg.norm(pressure))


def test_sliding_with_friction_in_the_plane_converges_quadratically() -> None:
    for step in sliding(0.3, 0.1, 3):
        assert step.substeps == 1 and len(step.linearised) <= 4
        assert step.linearised[-1].residual < 1e-9


def test_the_problem_is_the_one_that_its_own_matrix_says() -> None:
    """What stands for M^-1, the bodies' factors corrected by few unknowns, against a factor of the exported M itself."""
    for step in sliding(0.3, 0.1, 3)[1:]:
        p, rng = step.problem, np.random.default_rng(1)
        assert abs(p.M - p.M.T).max() > 1e-6 * abs(p.M).max()  # friction's share is not symmetric
        whole, x = BlockFactor(p.M), rng.normal(size=p.M.shape[0])
        assert_allclose(step.reduction.factor.solve(x), whole.solve(x), atol=1e-9 * abs(whole.solve(x)).max())
        W = p.H.T @ np.array([whole.solve(column) for column in p.H.toarray().T]).T
        own = step.reduction.local.W
        own = own if isinstance(own, np.ndarray) else own.toarray()
        assert_allclose(own, W, atol=1e-9 * abs(W).max())
