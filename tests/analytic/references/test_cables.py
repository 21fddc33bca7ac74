"""Cables that turn, against uniform motion on a circle."""

import numpy as np
import pytest

import fcsim
from fcsim.linkage import Cable, Linkage, WithCables
from fcsim.mesh import rigid_sphere


@pytest.mark.parametrize("h", [1e-3, pytest.param(1e-4, marks=pytest.mark.slow), 1e-5])
def test_a_ball_whirled_on_a_cable_stays_on_its_circle(h: float) -> None:
    """1 kg at 20 m/s on a cable of 1 m: distance L, speed v, tension m v^2 / L, to the order (omega h)^2 of the scheme for every step.

    A step of h along the tangent lengthens the cable by (v h)^2 / 2 L. With short steps that went unseen, and was taken back at most as
    slowly as bodies' overlap: at h = 1e-4 the cable was 0.9 mm longer after 0.1 s, 17 mm after 1 s.
    """
    length, speed = 1.0, 20.0
    ball = rigid_sphere("ball", 0.05, (length, 0.0, 0.0), 1.0)
    model = fcsim.build_model([ball])
    linkage = Linkage(model, [Cable("cable", "ball", None, ((length, 0.0, 0.0), (0.0, 0.0, 0.0)))])
    state = fcsim.State(0.0, np.zeros(6), np.array([0.0, speed, 0.0, 0.0, 0.0, 0.0]))
    detection = WithCables(fcsim.ExactContacts(model, mu=0.0), linkage)
    *_, last = fcsim.Simulation(model, detection, fcsim.Theta(h), 100, linkage=linkage, initial=state)
    order = (speed / length * h) ** 2
    assert np.linalg.norm(last.state.x[:3] + np.array([length, 0.0, 0.0])) == pytest.approx(length, abs=order * length + 1e-12)
    assert np.linalg.norm(last.state.v[:3]) == pytest.approx(speed, rel=order)
    assert last.contact_force[0, 0] == pytest.approx(speed**2 / length, rel=4 * order + 1e-5)


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
def test_a_ball_whirled_under_the_law_on_velocities_stays_on_its_circle_too(restitution: float) -> None:
    """As above, with `Velocity`: at h = 1e-3 the cable was 16 % longer after 1 s, the ball slower by as much: 0.8 % after 50 steps."""
    length, speed, h = 1.0, 20.0, 1e-3
    ball = rigid_sphere("ball", 0.05, (length, 0.0, 0.0), 1.0)
    model = fcsim.build_model([ball])
    linkage = Linkage(model, [Cable("cable", "ball", None, ((length, 0.0, 0.0), (0.0, 0.0, 0.0)))])
    state = fcsim.State(0.0, np.zeros(6), np.array([0.0, speed, 0.0, 0.0, 0.0, 0.0]))
    detection = WithCables(fcsim.ExactContacts(model, mu=0.0), linkage)
    scheme = fcsim.Theta(h, law=fcsim.Velocity(restitution))
    *_, last = fcsim.Simulation(model, detection, scheme, 50, linkage=linkage, initial=state)
    order = (speed / length * h) ** 2
    assert np.linalg.norm(last.state.x[:3] + np.array([length, 0.0, 0.0])) == pytest.approx(length, abs=order * length)
    assert np.linalg.norm(last.state.v[:3]) == pytest.approx(speed, rel=order)


@pytest.mark.parametrize(("restitution", "h"), [(0.0, 1e-3), (0.5, 1e-3), (1.0, 1e-3)])
def test_a_ball_that_a_cable_stops_loses_what_the_impact_takes(restitution: float, h: float) -> None:
    """A ball falls by 0.8 m beside the point it hangs from; at 1 m the cable takes 1 - e^2 of m v^2 / 2 along it, v^2 = 2 g 0.8.

    It is begun after 0.38 s of the fall, 0.02 s before the cable is taut."""
    ball = rigid_sphere("ball", 0.05, (0.6, 0.0, 0.0), 1.0)
    model = fcsim.build_model([ball], gravity=lambda t: (0.0, 0.0, -10.0))
    linkage = Linkage(model, [Cable("cable", "ball", None, ((0.6, 0.0, 0.0), (0.0, 0.0, 0.0)), length=1.0)])
    detection = WithCables(fcsim.ExactContacts(model, mu=0.0), linkage)
    scheme = fcsim.Theta(h, law=fcsim.Velocity(restitution))
    fallen = fcsim.State(0.38, np.array([0.0, 0.0, -5.0 * 0.38**2, 0.0, 0.0, 0.0]), np.array([0.0, 0.0, -3.8, 0.0, 0.0, 0.0]))
    *_, last = fcsim.Simulation(model, detection, scheme, round(0.03 / h), linkage=linkage, initial=fallen)
    energy = 0.5 * last.state.v[:3] @ last.state.v[:3] + 10.0 * last.state.x[2]
    along = 2 * 10.0 * 0.8 * 0.8**2  # (v . n)^2 with n = (0.6, 0, -0.8)
    assert energy == pytest.approx(-0.5 * (1 - restitution**2) * along, abs=0.01 * along)
