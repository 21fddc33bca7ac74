"""Impacts of rigid bodies with Newton's restitution, by Moreau's law at velocity level.

A ball dropped from the height H rises to e^2 H, e^4 H, ...; it bounces at times that form a geometric series. Equal masses in a row with
e = 1: struck one after the other (gaps between them) each hands on the whole speed; touching, Newton's law at all contacts at once
gives (-1, 2, 2)/3 of the speed for three: u_1 = v_0 and u_2 = 0 with the momentum kept.
"""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, ExactContacts, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Velocity
from fcsim.mesh import rigid_plane, rigid_sphere
from fcsim.mesh.blocks import rigid_rectangle
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

G = 9.81
SETTINGS = SolverSettings(tol=1e-10, floor=1e-6)


@pytest.mark.parametrize(
    ("scheme", "e"), [(Theta, 0.5), pytest.param(Theta, 0.8, marks=pytest.mark.slow), (Theta, 1.0), (GeneralisedAlpha, 0.8)]
)
def test_heights_of_a_bouncing_ball(scheme: Any, e: float) -> None:
    """To the height and the time that a step's motion at the impact speed amounts to, added up from bounce to bounce."""
    height, h = 0.05, 1e-3
    ball = rigid_rectangle("ball", (0.02, 0.02), (0.0, 0.01 + height), 0.5)
    ground = rigid_rectangle("ground", (1, 1), (0, -0.5), 1.0)
    supports = [Support("ground", ("x", "y", "rz")), Support("ball", ("rz",))]
    model = build_model([ball, ground], supports=supports, gravity=lambda t: (0.0, -G))
    pair = SurfacePair(contact_surface(model, [("ball", "y-")]), contact_surface(model, [("ground", "y+")]), 0.0, 1e-2)
    fall = np.sqrt(2 * height / G)
    bounces = 2
    end = fall * (1 + 2 * sum(e**k for k in range(1, bounces + 1)))
    steps = list(Simulation(model, Detector([pair], model.n_nodes), scheme(h, law=Velocity(e)), int(end / h) - 3, SETTINGS))
    y = height + np.array([step.state.x[1] for step in steps])
    v = np.array([step.state.v[1] for step in steps])
    impacts = 1 + np.flatnonzero((v[1:] > 0) & (v[:-1] < 0))
    speed = G * fall
    for k, after in enumerate(impacts[:bounces], start=1):
        following = impacts[k] if k < len(impacts) else len(y)
        assert_allclose(y[after:following].max(), e ** (2 * k) * height, atol=2 * k * speed * h)
        time = fall * (1 + 2 * sum(e**j for j in range(1, k)))
        assert_allclose(steps[after].state.t, time, atol=(2 + 4 * k) * h)
        # the restitution itself is exact; gravity adds its impulse of one step
        assert_allclose(v[after], -e * v[after - 1], atol=1e-8)
    assert len(impacts) >= bounces


def row(gap: float, steps: int) -> list[Step]:
    """Three equal blocks in a row without weight, the first with 1 m/s."""
    blocks = [rigid_rectangle(f"block {k}", (0.1, 0.1), (k * (0.1 + gap), 0.0), 2.0) for k in range(3)]
    model = build_model(blocks, supports=[Support(block.name, ("y", "rz")) for block in blocks])
    pairs = [
        SurfacePair(contact_surface(model, [(f"block {k}", "x+")]), contact_surface(model, [(f"block {k + 1}", "x-")]), 0.0, 1e-2)
        for k in range(2)
    ]
    initial = at_rest(model)
    initial.v[0] = 1.0
    return list(Simulation(model, Detector(pairs, model.n_nodes), Theta(1e-3, law=Velocity(1.0)), steps, SETTINGS, initial))


def test_blocks_struck_one_after_the_other() -> None:
    """Newton's cradle: the last one leaves with the speed of the first, the others rest."""
    end = row(5.5e-3, 20)[-1]
    assert_allclose(end.state.v[0::3], [0, 0, 1], atol=1e-8)


def test_touching_blocks_struck_at_once() -> None:
    end = row(-1e-9, 3)[-1]
    assert_allclose(end.state.v[0::3], np.array([-1, 2, 2]) / 3, atol=1e-8)
    assert_allclose(end.energy.kinetic, 0.5 * 2.0, rtol=1e-8)


@pytest.mark.each_value
@pytest.mark.parametrize(("e", "mu"), [(0.8, 0.2), (0.5, 0.05), (1.0, 0.5)])
@pytest.mark.parametrize("spin", [0.0, 60.0, -60.0])
def test_a_ball_with_english_strikes_a_cushion(e: float, mu: float, spin: float) -> None:
    """j_N = (1 + e) m v_N; friction stops the surface's v_T + R omega with 2 m / 7 of it where mu j_N is as much, else slides by that."""
    R, m, v_n, v_t = 0.03, 0.17, 1.0, 0.5
    ball, cushion = rigid_sphere("ball", R, (0, 0, 0), mass=m), rigid_plane("cushion", (0.1, 0, 0), (-1, 0, 0))
    model = build_model([ball, cushion], supports=[Support("cushion", ("x", "y", "z", "rx", "ry", "rz"))])
    initial = at_rest(model)
    initial.v[:6] = [v_n, v_t, 0, 0, 0, spin]
    *_, end = Simulation(model, ExactContacts(model, mu), Theta(1e-3, law=Velocity(e)), 150, SETTINGS, initial)
    j = float(np.clip(-2 * m / 7 * (v_t + R * spin), -mu * m * (1 + e) * v_n, mu * m * (1 + e) * v_n))
    assert_allclose(end.state.v[:6], [-e * v_n, v_t + j / m, 0, 0, 0, spin + R * j / (0.4 * m * R**2)], atol=1e-9)


@pytest.mark.parametrize(
    "masses", [(1.0, 1e9), *(pytest.param(own, marks=pytest.mark.slow) for own in ((1e9, 1.0), (1e-9, 1e9))), (1e9, 1e-9), (1e-9, 1e-9)]
)
def test_balls_of_masses_far_apart_strike_each_other(masses: tuple[float, float]) -> None:
    """e = 1: (m_1 - m_2) / (m_1 + m_2) and 2 m_1 / (m_1 + m_2) of the speed."""
    one, other = masses
    model = build_model([rigid_sphere("one", 0.1, (0, 0, 0), mass=one), rigid_sphere("other", 0.1, (0.3, 0, 0), mass=other)])
    initial = at_rest(model)
    initial.v[0] = 1.0
    *_, end = Simulation(model, ExactContacts(model, 0.3), Theta(1e-3, law=Velocity(1.0)), 150, SETTINGS, initial)
    assert end.state.v[0] == pytest.approx((one - other) / (one + other), rel=1e-8, abs=1e-15)
    assert end.state.v[6] == pytest.approx(2 * one / (one + other), rel=1e-8, abs=0.0)
