"""Turning bodies in time: free spin, the guards, and steps that cannot settle."""

import math
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.mesh.blocks import rectangle, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.limits import KinematicsLeft, Limits
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.theta import Theta
from tests.unit.timestep.free_spin import FAR, angular_momentum, spinning


def simulation(model: Model, state: State, scheme: Scheme, steps: int, **options: Any) -> Simulation:
    slave, master = (contact_surface(model, [(body.name, "x-")]) for body in model.bodies)
    detector = Detector([SurfacePair(slave, master, 0.5, 1e-3)], model.n_nodes)
    return Simulation(model, detector, scheme, steps, initial=state, **options)


@pytest.mark.slow
@pytest.mark.parametrize("lumped", [True, False])
@pytest.mark.parametrize("d", [2, 3])
def test_free_spin_keeps_energy_and_angular_momentum_over_ten_turns(d: int, lumped: bool) -> None:
    """Started without centrifugal strain, so that the block vibrates too; the step is a quarter of a radian, and its axis moves in 3D."""
    model, start = spinning(Material(1e7, 0.3, 1000.0), 20.0, d, lumped=lumped)
    energy, momentum = 0.5 * start.v @ model.apply_mass(start.v), angular_momentum(model, start)
    turns, before = 0.0, np.eye(d)
    for step in simulation(model, start, Theta(0.0125), int(10 * 2 * np.pi / 20 / 0.0125) + 1):
        R = model.elastic.rotation(model.elastic.at(step.state.x))[0]
        turns += np.arccos(np.clip((np.trace(R @ before.T) - (d - 2)) / 2, -1, 1)) / (2 * np.pi)
        before = R
    assert turns > (9.9 if d == 2 else 8)
    assert_allclose(step.energy.kinetic + step.energy.elastic, energy, rtol=1e-8)
    assert_allclose(angular_momentum(model, step.state), momentum, rtol=1e-8, atol=1e-8 * np.linalg.norm(momentum))
    assert step.substeps == 1


@pytest.mark.parametrize("scheme", [Theta(2e-3, 0.7), GeneralisedAlpha(2e-3, 0.6)], ids=["theta", "generalised alpha"])
def test_balance_of_energy_closes_with_dissipation(scheme: Scheme) -> None:
    model, start = spinning(Material(1e7, 0.3, 1000.0), 20.0, 3, beta=1e-3)
    energy = 0.5 * start.v @ model.apply_mass(start.v)
    for step in simulation(model, start, scheme, 60):
        assert abs(step.energy.residual) < 1e-9 * energy
        if isinstance(scheme, Theta):  # generalised alpha damps at another velocity than the strain's rate: in single steps of any sign
            assert step.energy.damping_dissipation > -1e-9 * energy
    assert step.energy.kinetic + step.energy.elastic < energy


def test_steady_spin_has_the_centrifugal_stretch() -> None:
    """A slender bar in steady rotation, k L = w L sqrt(rho / E) = 0.1: u(L) / L = k^2 L^2 / 3 of small strain (D4), L the half length.

    The bar is started with that strain and damped a little; the mesh is fine along it, nu = 0.
    """
    L, E, rho = 0.5, 1e7, 1000.0
    omega = 0.1 / L * math.sqrt(E / rho)
    part = rectangle("b", (2 * L, 0.05), (20, 1), Material(E, 0.0, rho), plane="stress")
    far = rigid_rectangle("far", (1, 1), (FAR, 0), 1.0)
    model = build_model([Body("bar", part), far], supports=[Support("far", ("x", "y", "rz"))], beta=2e-4)
    x = part.points[:, 0] - L
    u = (omega**2 * rho / E) * (L**2 * x / 2 - x**3 / 6)  # E u'' = -rho w^2 x, u'(L) = 0
    arm = np.column_stack([x + u, part.points[:, 1] - 0.025])
    start = State(0.0, np.zeros(model.n_dofs), np.zeros(model.n_dofs))
    start.x[: model.n_elastic : 2] = u
    start.v[: model.n_elastic] = omega * np.column_stack([-arm[:, 1], arm[:, 0]]).ravel()
    *_, step = simulation(model, start, Theta(2e-3), 200)
    y = model.strained_displacement(step.state.x)[: len(x), 0]
    assert_allclose((y[x == x.max()].mean() - y[x == x.min()].mean()) / (2 * L), 0.1**2 / 3, rtol=0.01)


def test_guards_name_once_and_stop() -> None:
    """A linear body that spins: said from 2 degrees on, once, and ended beyond 10; the last step is yielded."""
    model, start = spinning(Material(1e9, 0.3, 1000.0), 10.0, kinematics="linear")
    done = []
    with pytest.raises(KinematicsLeft, match=r"step \d+, t = .* s: body 'block' of linear kinematics has turned by 1[01].* allowed are 10"):
        for step in simulation(model, start, Theta(1e-3), 100):
            done.append(step)
    said = [remark for step in done for remark in step.remarks if "kinematics" in remark]  # another says that the far wall is far
    assert len(said) == 1 and "of linear kinematics has turned by 2." in said[0]
    assert 17 <= done[-1].number <= 19  # 10 degrees are 0.1745 rad
    limits = Limits(rotation=math.inf, strain=math.inf)
    assert len(list(simulation(model, start, Theta(1e-3), 30, limits=limits))) == 30


def test_strain_stops_a_turning_body() -> None:
    """Rubber that is too soft for its spin, E far below rho w^2 L^2: named at 5 %, ended at 20 %."""
    model, start = spinning(Material(3e4, 0.3, 1000.0), 50.0)
    done = []
    with pytest.raises(KinematicsLeft, match=r"body 'block' (is strained by|has an inverted cell)"):
        for step in simulation(model, start, Theta(1e-3), 200):
            done.append(step)
    assert any("is strained by" in remark for step in done for remark in step.remarks)
