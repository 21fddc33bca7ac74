"""A shaft turns in a sleeve: the friction circle, torque r W sin(phi), phi = atan(mu), and what facets make of it."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection.exact import ExactContacts
from fcsim.mesh.exact.rigid_shapes import rigid_sphere
from fcsim.mesh.part import RigidBody
from fcsim.running.case import load_case
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.theta import Theta

OTHERS = [(8, 0.3, 1.0, 2.0), (24, 0.3, 1.0, 1e-9), (16, 0.6, 1.0, 2.0)]
CASE = Path(__file__).parents[2] / "cases" / "shaft"


@pytest.mark.parametrize(
    ("n", "mu", "unit", "mass"), [(16, 0.3, 1e3, 2e-3), *(pytest.param(*slow, marks=pytest.mark.slow) for slow in OTHERS)]
)
def test_a_shaft_in_a_sleeve_of_facets_is_braked_as_in_a_groove(n: int, mu: float, unit: float, mass: float) -> None:
    """It lies on two facets, d_1 below and d_2 above the angle of friction, d_1 + d_2 = b = 2 pi / n: each reaction with its friction is
    off the vertical by d_1, d_2, so together they are W cos((d_1 - d_2) / 2) / cos(b / 2), and so much larger than the friction circle's
    is the torque: the groove of the V-belt. It is between 1 and 1 / cos(pi / n) of that: 1.02 with 16 facets, 1.0005 with 96."""
    r, c, g, h, steps, omega = 0.1 * unit, 1e-3 * unit, 9.81 * unit, 1e-3, 60, 30.0
    at = 2 * np.pi * np.arange(n) / n - np.pi / 2
    points = (r + c) / np.cos(np.pi / n) * np.stack([np.cos(at), np.sin(at)], axis=1)
    facets = np.stack([(np.arange(n) + 1) % n, np.arange(n)], axis=1)
    sleeve = RigidBody("sleeve", mass, np.array([[mass * r**2]]), np.zeros(2), points, {"inside": facets})
    phi, b = np.arctan(mu), 2 * np.pi / n
    slopes = b * (np.arange(-2, 3) + 0.5)  # of the facets, the corners are at multiples of b
    low = slopes[slopes < phi].max()
    corner = low + b / 2
    # it begins where it will lie: on the two facets beside the corner above the lower one
    centre = c / np.cos(b / 2) * np.array([-np.sin(corner), -np.cos(corner)])
    model = build_model(
        [rigid_sphere("shaft", r, centre, mass), sleeve], supports=[Support("sleeve", ("x", "y", "rz"))], gravity=lambda t: (0, -g)
    )
    start = at_rest(model)
    start.v[2] = omega
    settings = SolverSettings(tol=1e-10, floor=1e-9 * unit)
    found = list(Simulation(model, ExactContacts(model, mu), Theta(h), steps, settings, initial=start, witness=None))
    torque = float(model.rigid[0].inertia[0, 0]) * (omega - found[-1].state.v[2]) / (steps * h)
    groove = np.cos(phi - low - b / 2) / np.cos(b / 2)
    assert_allclose(torque / (r * mass * g * np.sin(phi)), groove, rtol=1e-3)
    assert np.count_nonzero(found[-1].contact_status == 2) == 2
    assert 1 <= groove <= 1 / np.cos(np.pi / n) + 1e-12


@pytest.mark.slow
def test_the_case_meets_the_friction_circle() -> None:
    """The shaft begins in the lowest place, climbs to phi and swings about it, then it is braked by r W sin(phi): by
    a^2 / 4 more while it still swings by a, as the pull of a pendulum is, so that 1 % is left after three swings."""
    script = load_case(CASE)
    p = script.parameters(cells=(1, 96), steps=160)  # type: ignore[call-arg]
    case = script.build(p)
    speed, _, torque, circle, place = case.sensors
    rows = np.array([[speed.measure(s), torque.measure(s), circle.measure(s), place.measure(s)] for s in case.simulation])
    phi = np.degrees(np.arctan(0.3))
    later = slice(80, 160)
    assert_allclose(rows[later, 1].mean(), rows[0, 2], rtol=1e-2)
    assert_allclose(np.diff(rows[[80, 159], 0])[0] / (79 * 1e-3), rows[0, 2] / (0.5 * 60.0 * 0.05**2), rtol=1e-2)
    assert_allclose(rows[later, 3].mean(), phi, atol=2.0)  # in a corner of facets, 360 / 96 degrees apart
