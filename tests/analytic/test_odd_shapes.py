"""Contact of everything among shapes that are no boxes, in several units, against statics."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import rigid_box
from fcsim.mesh.exact.rigid_polyhedron import rigid_polyhedron
from fcsim.mesh.part import RigidBody
from fcsim.timestep.simulation import Simulation, SolverSettings, Step
from fcsim.timestep.theta import Theta

G = 9.81
UNITS = [(1.0, 1.0), (1e-3, 1e-9), (1e3, 1.0)]  # of length [m] and of mass [kg]


def model_of(bodies: list[RigidBody], held: list[str], unit: float) -> Model:
    supports = [Support(name, ("x", "y", "z", "rx", "ry", "rz")) for name in held]
    return build_model(bodies, supports=supports, gravity=lambda t: (0, 0, -G * unit))


def last_of(model: Model, mu: float, steps: int = 20) -> Step:
    return list(Simulation(model, Everything(model, mu), Theta(1e-3), steps, SolverSettings(name="auto", tol=1e-9)))[-1]


def prism(name: str, section: list[tuple[float, float]], length: float, density: float) -> RigidBody:
    """A convex section in x, z along y."""
    return rigid_polyhedron(name, [(x, y, z) for y in (-length / 2, length / 2) for x, z in section], density)


@pytest.mark.parametrize(("unit", "mass"), UNITS)
def test_a_wedge_in_a_groove(unit: float, mass: float) -> None:
    """Without friction each flank at 45 degrees bears half the weight, and as much sideways; with friction both together the weight."""
    rho = mass / unit**3
    left = prism("left", [(-unit, 0), (0, 0), (-unit, unit)], 2 * unit, rho)
    right = prism("right", [(0, 0), (unit, 0), (unit, unit)], 2 * unit, rho)
    wedge = prism("wedge", [(0, 0), (unit / 2, unit / 2), (-unit / 2, unit / 2)], unit, rho)
    model = model_of([left, right, wedge], ["left", "right"], unit)
    weight = wedge.mass * G * unit
    last = last_of(model, 0.0)
    assert_allclose(last.contact_force_on(0) / weight, [-0.5, 0, -0.5], atol=1e-6)
    assert_allclose(last.contact_force_on(1) / weight, [0.5, 0, -0.5], atol=1e-6)
    last = last_of(model, 0.6)
    assert_allclose((last.contact_force_on(0) + last.contact_force_on(1)) / weight, [0, 0, -1], atol=1e-6)
    assert np.abs(last.state.x).max() < 1e-8 * unit + 1e-8


@pytest.mark.parametrize(("unit", "mass"), UNITS)
def test_a_house_of_two_cards(unit: float, mass: float) -> None:
    """Two leaning cards hold each other by their upper edges if mu is at least tan(15 degrees) / 2."""
    cards = []
    for side in (-1, 1):
        card = rigid_box("card", (0.02 * unit, 0.5 * unit, unit), (0, 0, 0), 1.0)
        points = Rotation.from_euler("y", 15 * side, degrees=True).apply(card.points)
        points[:, 2] -= points[:, 2].min()
        points[:, 0] -= points[:, 0].max() if side > 0 else points[:, 0].min()
        cards.append(rigid_polyhedron(f"card {side}", points, mass / unit**3))
    floor = rigid_box("floor", (4 * unit, 4 * unit, 0.2 * unit), (0, 0, -0.1 * unit), 1.0)
    model = model_of([floor, *cards], ["floor"], unit)
    weight = 2 * cards[0].mass * G * unit
    last = last_of(model, 0.4, 30)
    assert_allclose(last.contact_force_on(0) / weight, [0, 0, -1], atol=1e-6)
    assert np.abs(last.state.x).max() < 1e-6 * unit + 1e-6
    assert np.abs(last_of(model, 0.05, 30).state.v).max() > 1e-3  # they slide apart
