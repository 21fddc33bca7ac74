"""Adverse contact of rubber in statics, each step held against what does not use the solver: the energy's differences, balances of forces
and moments of each body, Coulomb's cone, the direction of friction, the witness's overlap. In metres, and in mm with MPa and tonnes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import rectangle
from fcsim.mesh.material import neo_hooke
from fcsim.mesh.part import Body, Part
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.step import Step
from fcsim.witness import Witness
from tests.analytic.references.loading import ANY
from tests.analytic.references.meshes import block, sector, spaced

UNITS = pytest.mark.parametrize("unit", [1.0, 1e3], ids=["m", "mm"])
METRES = pytest.mark.parametrize("unit", [1.0, pytest.param(1e3, marks=pytest.mark.slow)], ids=["m", "mm"])


def rubber(E: float, unit: float, nu: float = 0.3) -> Any:
    """E [Pa], with 1000 kg/m^3; unit: of length in m."""
    return neo_hooke(E / unit**2, nu, 1000.0 / unit**4)


def outer_forces(step: Step) -> np.ndarray:
    """Of contacts, from their points' weights and frames, and of supports, (n_dofs,) [N]."""
    model, contacts = step.model, step.contacts
    nodal = np.zeros((model.n_nodes, model.dimension))
    for nodes, weights in zip(contacts.nodes.T, contacts.weights.T, strict=True):
        there = nodes >= 0
        np.add.at(nodal, nodes[there], weights[there, None] * step.force_in_space[there])
    forces = step.support_impulse.copy()
    forces[model.dof_of_node.ravel()] += nodal.ravel()
    return forces


def assert_energy_is_stationary(step: Step, forces: np.ndarray, largest: float) -> None:
    """dE . v = f . v along random directions, by central differences of fourth order: to 1e-6 of the largest force so far."""
    model, x, rng = step.model, step.state.x, np.random.default_rng(step.number)
    e = 1e-6 * float(np.ptp(model.reference))

    def energy(s: float) -> float:
        return model.nonlinear.inner(x + s * e * v, step.previous.internal, step.state.t, 0.0).energy

    for _ in range(3):
        v = rng.uniform(-1, 1, len(x))
        slope = (8 * (energy(1) - energy(-1)) - energy(2) + energy(-2)) / (12 * e)
        assert abs(slope - forces @ v) < 1e-6 * largest * np.linalg.norm(v)


def assert_bodies_are_in_balance(step: Step, forces: np.ndarray, largest: float) -> None:
    """Resultant and moment of what acts on each body vanish."""
    model, x = step.model, step.model.positions(step.state.x)
    for body in range(len(model.deformable)):
        own = slice(*model.dof_offset[body : body + 2])
        p = x[(own.start <= model.dof_of_node[:, 0]) & (model.dof_of_node[:, 0] < own.stop)]
        f = forces[own].reshape(-1, 2)
        moment = float((p[:, 0] * f[:, 1] - p[:, 1] * f[:, 0]).sum())
        assert np.abs(f.sum(axis=0)).max() < 1e-7 * largest * len(f)
        assert abs(moment) < 1e-7 * largest * len(f) * np.abs(p).max()


def assert_coulomb(step: Step, largest: float) -> None:
    """r in its cone; where nodes slide friction is mu r_N and against their way, from positions at both ends of the step."""
    contacts, r = step.contacts, step.contact_force
    assert np.all(r[:, 0] >= -1e-9 * largest)
    assert np.all(np.abs(r[:, 1]) <= contacts.mu * r[:, 0] + 1e-7 * largest)
    way = step.model.positions(step.state.x) - step.model.positions(step.previous.x)
    slip = np.einsum("ak,akj,aj->a", contacts.weights, way[contacts.nodes] * (contacts.nodes >= 0)[..., None], contacts.frame[:, 1])
    lost = r[:, 1] * slip + contacts.mu * r[:, 0] * np.abs(slip)  # zero where it sticks, and where friction is all that it can be
    assert np.all(np.abs(lost) < 1e-5 * largest * float(np.ptp(step.model.reference)))


def held_up(model: Model, detection: Any, steps: int, overlap: float = 1e-3) -> list[Step]:
    """The steps, each of which has been looked at."""
    largest, found = 0.0, []
    witness = Witness(every=1, tolerance=overlap, initial="allow")
    for step in Simulation(model, detection, QuasiStatic(1 / steps), steps, SolverSettings(tol=1e-9), limits=ANY, witness=witness):
        forces = outer_forces(step)
        largest = max(largest, float(np.abs(forces).max()))
        if np.abs(step.reaction).max(initial=0.0) > 1e-6 * largest:
            assert_energy_is_stationary(step, forces, largest)
            assert_bodies_are_in_balance(step, forces, largest)
            assert_coulomb(step, largest)
        found.append(step)
    return found


def on_body(steps: Sequence[Step], body: int) -> np.ndarray:
    return np.array([step.contact_force_on(body) for step in steps])


@METRES
@pytest.mark.parametrize(("aside", "mu"), [(0.07, 0.3), (0.03, 0.0), pytest.param(-0.07, 0.3, marks=pytest.mark.slow)])
def test_a_corner_on_a_corner_slides_down_its_side(unit: float, aside: float, mu: float) -> None:
    """Two diamonds, the upper one beside the axis and driven down: it is pushed to where it stands. Corner exactly on corner has two
    answers."""
    turn = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2)

    def diamond(name: str, n: int, E: float) -> Part:
        square = rectangle(name, (unit, unit), (n, n), rubber(E, unit))
        return Part(name, square.points @ turn, square.cells, square.cell_type, square.surfaces, square.material)

    low, up = diamond("low", 4, 1e6), diamond("up", 5, 3e6)
    place = (aside * unit, float(np.ptp(low.points[:, 1])) / 2 + 0.01 * unit + float(low.points[:, 1].mean() - up.points[:, 1].min()))
    supports = [Support("low", ("x", "y"), side) for side in ("x-", "y-")]
    supports += [Support("up", ("x",), side) for side in ("x+", "y+")]
    supports += [Support("up", ("y",), side, velocity=-0.3 * unit) for side in ("x+", "y+")]
    model = build_model([Body("low", low), Body("up", up, translation=place)], supports=supports)
    force = on_body(held_up(model, Everything(model, mu, 0.05 * unit), 12), 1)[-1]
    assert force[1] > 0 and force[0] * aside > 0


@METRES
def test_a_catch_rides_over_a_ridge(unit: float) -> None:
    """A hook of 0.8 mm rises on a ramp of as much in 1 mm, slides over the top, goes down and is free: the force that holds it back is
    the tip's force turned by the slope and the angle of friction on the way up."""
    L, mu = 1e-3 * unit, 0.3

    def beam(p: np.ndarray) -> np.ndarray:
        low = -0.8 * np.interp(10 * p[:, 0], [0, 7.5, 8.5, 8.8, 10], [0, 0, 1, 1, 0])
        return np.stack([10 * p[:, 0] * L, (low + (1 - low) * p[:, 1]) * L], axis=1)

    def ridge(p: np.ndarray) -> np.ndarray:
        top = 0.8 * np.interp(8 * p[:, 0] - 4, [-4, -1.5, -0.5, 0.5, 1.5, 4], [0, 0, 1, 1, 0, 0])
        return np.stack([(8 * p[:, 0] - 4) * L, (-2 + (top + 2) * p[:, 1]) * L], axis=1)

    hook = block("beam", [spaced(0, 1, 30), spaced(0, 1, 3)], rubber(2e9, unit, 0.35), at=beam)
    base = block("ridge", [spaced(0, 1, 24), spaced(0, 1, 3)], rubber(5e9, unit, 0.35), at=ridge)
    supports = [Support("ridge", ("x", "y"), "y-"), Support("beam", ("y",), "x-"), Support("beam", ("x",), "x-", velocity=6 * L)]
    model = build_model([Body("ridge", base), Body("beam", hook, translation=(-11.7 * L, 0.82 * L))], supports=supports)
    steps = held_up(model, Everything(model, mu, 0.2 * L), 20, overlap=1e-2)
    force = on_body(steps, 1)
    pressed = force[:, 1] > 1e-6 * force[:, 1].max()
    assert not pressed[:3].any() and pressed[6:14].all() and not pressed[16:].any()
    assert force[pressed, 0].min() < -mu * force[pressed, 1].max()  # up the ramp
    assert_allclose(np.abs(force[-1]), 0.0, atol=1e-9 * force[:, 1].max())


@UNITS
def test_a_shaft_in_a_tight_hub_with_friction(unit: float) -> None:
    """Both are put down overlapping by 2 % of the radius: the first step takes it back, and nothing changes after it."""
    inner = block("shaft", [spaced(0, 1, 4), spaced(0, 1, 8)], rubber(1e9, unit), at=sector(0.05 * unit, 0.102 * unit, 0, np.pi / 2))
    outer = block("hub", [spaced(0, 1, 4), spaced(0, 1, 10)], rubber(2e9, unit), at=sector(0.1 * unit, 0.2 * unit, 0, np.pi / 2))
    supports = [Support(name, (axis,), side) for name in ("shaft", "hub") for axis, side in (("y", "y-"), ("x", "y+"))]
    model = build_model([Body("shaft", inner), Body("hub", outer)], supports=supports)
    force = on_body(held_up(model, Everything(model, 0.3, 0.02 * unit), 3), 1)
    assert_allclose(force[1:], force[:1].repeat(2, axis=0), rtol=1e-6)
    assert_allclose(force[0, 0], force[0, 1], rtol=0.05)  # the quarter's two axes are alike but for friction and the pairing of nodes
