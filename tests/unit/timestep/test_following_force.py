"""Forces and moments that turn with surfaces of deformable bodies: momentum, energy, the same bits; the elastica in statics."""

from itertools import islice, pairwise
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from fcsim.assembly.loads import FollowerForce
from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material, neo_hooke, saint_venant_kirchhoff
from fcsim.mesh.part import Body
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.limits import Limits
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta
from tests.unit.timestep.test_following_pressure import EVERY_STRAIN, MATERIALS, RHO, E, momenta

LOADS = {2: (np.array([16e3, -12e3]), np.array([1.2e3])), 3: (np.array([800.0, -600.0, 2400.0]), np.array([60.0, -160.0, 40.0]))}
"""Force [N] and moment [N m] by the dimension."""


def thrust(material: Any, d: int, scheme: Scheme, steps: int) -> Simulation:
    """A block at rest, then under a force and a moment on its face x+; a rigid one far away."""
    if d == 3:
        part, far = brick("bar", (0.6, 0.3, 0.2), (2, 1, 1), material), rigid_box("far", (1, 1, 1), (1e3, 0, 0), 1.0)
    else:
        part, far = rectangle("bar", (0.6, 0.3), (4, 1), material), rigid_rectangle("far", (1, 1), (1e3, 0), 1.0)
    model = build_model(
        [Body("bar", part), far],
        supports=[Support("far", ("x", "y", "rz") if d == 2 else ("x", "y", "z", "rx", "ry", "rz"))],
        loads=[FollowerForce("bar", *map(tuple, LOADS[d]), surface="x+")],
    )
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)
    return Simulation(model, detector, scheme, steps, limits=EVERY_STRAIN, keep=5)


@pytest.mark.each_value
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", MATERIALS)
def test_momentum_and_angular_momentum_are_those_of_the_force(name: str, d: int) -> None:
    """At theta = 1/2 each step adds h |f| to the momentum wherever the force points, and to the angular momentum that at the middle of
    the face in the middle of the step, and h |m|, wherever the moment points."""
    h = 5e-3
    force, moment = LOADS[d]
    simulation = thrust(MATERIALS[name], d, Theta(h), 10)
    model = simulation.model
    face = np.unique(model.facets("bar", "x+"))  # one cell: equal shares of its area
    states = [at_rest(model), *(step.state for step in simulation)]
    for before, after in pairwise(states):
        (p0, L0), (p1, L1) = momenta(model, before), momenta(model, after)
        middle = model.positions(0.5 * (before.x + after.x))[face].mean(axis=0)
        assert_allclose(np.linalg.norm(p1 - p0), h * np.linalg.norm(force), rtol=1e-8)
        turning = L1 - L0 - np.cross(np.pad(middle, (0, 3 - d)), p1 - p0)
        assert_allclose(np.linalg.norm(turning), h * np.linalg.norm(moment), rtol=1e-6)
    angle = np.degrees(np.arccos(p1 @ np.pad(force, (0, 3 - d)) / np.linalg.norm(p1) / np.linalg.norm(force)))
    assert angle > 1  # it has turned with the face


@pytest.mark.each_value
@pytest.mark.parametrize("scheme", [Theta(2e-3, 0.7), GeneralisedAlpha(2e-3, 0.6)], ids=["theta", "generalised alpha"])
@pytest.mark.parametrize("name", ["linear", "neo-hooke"])
def test_the_balance_of_energy_closes(name: str, scheme: Scheme) -> None:
    for step in thrust(MATERIALS[name], 2, scheme, 10):
        assert abs(step.energy.residual) < 1e-8 * max(step.energy.kinetic, 1e-3)
    assert step.energy.kinetic > 1e-2


def test_going_on_gives_the_same_bits() -> None:
    def run() -> Simulation:
        return thrust(MATERIALS["plastic"], 3, Theta(2e-3), 8)

    whole, done = list(run()), list(islice(run(), 7))
    (rest,) = run().run(after=done[6].moment, anchor=done[4].moment)
    assert_array_equal(rest.state.x, whole[7].state.x)
    assert_array_equal(rest.state.v, whole[7].state.v)


def bent(load: FollowerForce, length: float, height: float, law: Any, steps: int) -> tuple[np.ndarray, list[list[float]]]:
    """Displacement (2,) of a clamped beam's end and the residuals of its load steps; the load on the end grows to that at t = 1."""
    part = rectangle("beam", (length, height), (24, 1), law, elements="Q2", origin=(0.0, -0.5 * height))
    model = build_model(
        [Body("beam", part), rigid_rectangle("far", (1, 1), (10, 0), 1.0)],
        supports=[Support("beam", ("x", "y"), "x-"), Support("far", ("x", "y", "rz"))],
        loads=[load],
    )
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector = Detector([SurfacePair(slave, master, 0.0, 1e-3)], model.n_nodes)
    found = list(Simulation(model, detector, QuasiStatic(1 / steps), steps, limits=Limits(rotation=np.inf, strain=np.inf)))
    assert all(abs(step.energy.residual) < 1e-6 * step.energy.load_work for step in found)
    tip = int(np.argmin(np.linalg.norm(part.points - [length, 0.0], axis=1)))
    return found[-1].state.x[: model.n_elastic].reshape(-1, 2)[tip], [[p.residual for p in step.linearised] for step in found]


def quadratic(residuals: list[float]) -> bool:
    """Whether few iterations are needed, and the last one gains two digits at least, or ends below the tolerance (1e-9) from 1e-7 on:
    bodies keep tangents that differ by less than 1e-5."""
    return len(residuals) <= 6 and (residuals[-1] < 1e-2 * residuals[-2] or (residuals[-1] < 1e-9 and residuals[-2] < 1e-7))


def test_elastica_under_a_force_across_its_end() -> None:
    """The force keeps its right angle with the end of a cantilever. From the end, with the angle phi to it, EI phi'' = P cos(phi), phi and
    phi' = 0 there; along the length that gives the end's place seen from the clamp. Stiff against shear and stretching: h / L = 0.02 and
    strains of 2 %."""
    length, height = 1.0, 0.02
    bending = E * height**3 / 12
    P = 2.0 * bending / length**2
    tip, residuals = bent(FollowerForce("beam", (0.0, P), None, lambda t: t, "x+"), length, height, saint_venant_kirchhoff(E, 0.0, RHO), 8)

    def along(s: float, y: np.ndarray) -> list[float]:
        return [y[1], P / bending * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]

    phi, _, X, Y = solve_ivp(along, (0.0, length), [0.0] * 4, rtol=1e-11, atol=1e-12).y[:, -1]
    exact = np.array([np.cos(phi) * X + np.sin(phi) * Y - length, np.sin(phi) * X - np.cos(phi) * Y])
    assert phi > 0.9
    assert_allclose(tip, exact, atol=2e-3 * length)
    assert all(quadratic(own) for own in residuals)


def test_a_moment_on_its_end_rolls_a_beam_up() -> None:
    """M = EI theta / L bends it into an arc of the angle theta = 1: u = L (sin(theta) / theta - 1), v = L (1 - cos(theta)) / theta."""
    length, height, theta = 1.0, 0.03, 1.0
    load = FollowerForce("beam", (0.0, 0.0), (E * height**3 / 12 * theta / length,), lambda t: t, "x+")
    tip, residuals = bent(load, length, height, neo_hooke(E, 0.0, RHO), 4)
    assert_allclose(tip, [length * (np.sin(theta) / theta - 1), length * (1 - np.cos(theta)) / theta], atol=2e-3 * length)
    assert all(quadratic(own) for own in residuals)


def test_a_turning_body_in_statics() -> None:
    """Of linear material in its frame: the clamp bears the force as it has turned, the balance closed."""
    part = rectangle("b", (1.0, 0.3), (4, 1), Material(E, 0.2, RHO))
    model = build_model(
        [Body("b", part, kinematics="turning"), rigid_rectangle("far", (1, 1), (10, 0), 1.0)],
        supports=[Support("b", ("x", "y"), "x-"), Support("far", ("x", "y", "rz"))],
        loads=[FollowerForce("b", (0.0, -300.0), None, lambda t: t, "x+")],
    )
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector = Detector([SurfacePair(slave, master, 0.0, 1e-3)], model.n_nodes)
    *_, step = Simulation(model, detector, QuasiStatic(0.5), 2)
    clamp = step.support_impulse[: model.n_elastic].reshape(-1, 2).sum(axis=0)
    x = model.positions(step.state.x)[np.unique(model.facets("b", "x+"))]
    along = np.diff(x, axis=0)[0]
    along *= np.sign(along[1])
    assert_allclose(-clamp, -300.0 * along / np.linalg.norm(along), atol=1e-5)
    assert abs(clamp[0]) > 3  # the end sinks, and the face with it
    assert abs(step.energy.residual) < 1e-8 * step.energy.load_work
