"""Rigid polyhedra on each other against statics: sliding and toppling on slopes, a twisted tower, a fast cube, in several units.

Coulomb: a block slides on a slope iff tan(a) > mu, with v = g (sin a - mu cos a) t; a regular hexagonal prism on a face topples beyond
30 degrees.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim import Everything, RigidBody, Simulation, Step, Support, Theta, at_rest, build_model
from fcsim.mesh import rigid_polyhedron

ALL = ("x", "y", "z", "rx", "ry", "rz")
CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
G = 9.81


def solid(name: str, points: np.ndarray, density: float = 2000.0) -> RigidBody:
    return rigid_polyhedron(name, points, density)


def last(bodies: list[RigidBody], mu: float, h: float, steps: int) -> Step:
    model = build_model(bodies, supports=[Support("floor", ALL)], gravity=lambda t: (0.0, 0.0, -G))
    *_, step = Simulation(model, Everything(model, mu), Theta(h), steps)
    return step


@pytest.mark.each_value
@pytest.mark.parametrize(("size", "density"), [(1.0, 2000.0), (1e-3, 2000.0), (1.0, 1e-9)])
@pytest.mark.parametrize("degrees", [21.0, 23.0])
def test_sliding_begins_at_the_angle_of_friction(size: float, density: float, degrees: float) -> None:
    """mu = 0.4: 21.8 degrees."""
    a, mu = np.radians(degrees), 0.4
    turn = Rotation.from_rotvec([0, a, 0])
    block = solid("block", size * turn.apply(CORNERS * [0.3, 0.2, 0.1] + [0, 0, 0.05]), density)
    floor = solid("floor", size * turn.apply(CORNERS * [4, 4, 1] - [0, 0, 0.5]), density)
    step = last([block, floor], mu, 1e-3 * np.sqrt(size), 100)
    expected = max(0.0, G * (np.sin(a) - mu * np.cos(a)) * step.state.t)
    assert_allclose(np.linalg.norm(step.state.v[:3]), expected, rtol=1e-5, atol=1e-7 * np.sqrt(G * size))


@pytest.mark.parametrize(("degrees", "rests"), [(25.0, True), (34.0, False)])
def test_a_hexagonal_prism_topples_beyond_30_degrees(degrees: float, rests: bool) -> None:
    turn = Rotation.from_rotvec([0, np.radians(degrees), 0])
    ring = np.array([[np.cos(k), y, np.sin(k)] for k in np.pi / 3 * np.arange(6) for y in (-1.0, 1.0)]) * 0.1
    prism = solid("prism", turn.apply(ring - [0, 0, ring[:, 2].min()]))
    floor = solid("floor", turn.apply(CORNERS * [4, 2, 0.2] - [0, 0, 0.1]))
    speed = np.abs(last([prism, floor], 2.0, 2e-3, 100).state.v).max()
    assert speed < 1e-6 if rests else speed > 1.0


def test_a_twisted_tower_rests_on_its_floor() -> None:
    turns = np.random.default_rng(3).uniform(0, 2 * np.pi, 8)
    flat = CORNERS * [0.3, 0.2, 0.1]
    blocks = [
        solid(f"b{k}", Rotation.from_rotvec([0, 0, turn]).apply(flat) + np.array([0, 0, 0.05 + 0.1 * k])) for k, turn in enumerate(turns)
    ]
    step = last([*blocks, solid("floor", CORNERS * [2, 2, 0.2] - [0, 0, 0.1])], 0.5, 1e-3, 40)
    weight = sum(block.mass for block in blocks) * G
    assert_allclose(step.contact_force_on(8), [0, 0, -weight], atol=1e-6 * weight)


@pytest.mark.parametrize("speed", [20.0, 2000.0])
def test_a_fast_cube_stops_at_a_thin_plate(speed: float) -> None:
    cube, plate = solid("cube", 0.01 * CORNERS + [0, 0, 0.5]), solid("floor", CORNERS * [0.5, 0.5, 0.005])
    model = build_model([cube, plate], supports=[Support("floor", ALL)])
    v = np.zeros(model.n_dofs)
    v[2] = -speed
    *_, step = Simulation(model, Everything(model, 0.3), Theta(1e-3), int(800 / speed) + 20, initial=replace(at_rest(model), v=v))
    assert_allclose(model.positions(step.state.x)[:8, 2].min(), 0.0025, atol=1e-5)
