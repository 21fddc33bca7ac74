"""Rigid bodies that what is driven squeezes: no reactions keep them apart, and the error names them."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim import Everything, ExactContacts, QuasiStatic, RigidBody, Simulation, SolverSettings, Support, Theta, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.errors import NotConverged
from fcsim.mesh import rigid_box, rigid_polygon, rigid_rectangle, rigid_sphere
from fcsim.timestep.scheme import Scheme


@pytest.mark.parametrize("unit", [1.0, pytest.param(1e6, marks=pytest.mark.slow)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_block_that_a_wall_drives_on_to_a_stop_is_named(dimension: int, unit: float) -> None:
    """The wall at 0.5 m/s meets a block at rest, which meets a stop that is held 1 cm behind it, after 20 ms."""
    make, axes = (rigid_box, (0, 1, 2)) if dimension == 3 else (rigid_rectangle, (0, 2))

    def block(name: str, size: tuple[float, ...], centre: tuple[float, ...]) -> RigidBody:
        return make(name, [size[a] * unit for a in axes], [centre[a] * unit for a in axes], 2.0)

    bodies = [
        block("wall", (0.1, 1.0, 0.5), (-0.05, 0.0, 0.25)),
        block("block", (0.2, 0.2, 0.2), (0.1, 0.0, 0.1)),
        block("stop", (0.1, 1.0, 0.5), (0.26, 0.0, 0.25)),
        block("far", (0.2, 0.2, 0.2), (5.0, 0.0, 0.1)),
    ]
    held = DIRECTIONS[dimension]
    supports = [Support("wall", ("x",), velocity=0.5 * unit), Support("wall", held[1:]), Support("stop", held)]
    model = build_model(bodies, supports=supports)
    with pytest.raises(NotConverged, match=r"squeezes 'wall' and 'block', 'block' and 'stop': only reactions of \S+ times the usual would"):
        list(Simulation(model, Everything(model, 0.3), Theta(1e-3), 30, SolverSettings(fallback=()), cuttings=1))


@pytest.mark.parametrize(
    ("overlap", "closing", "scheme", "what"),
    [
        (1e-4, 0.0, QuasiStatic(1.0, 1e4), "lie up to 0.0001 m in each other, squeezed between what holds them"),
        (0.0, 0.1, Theta(1e-3), "are driven into each other"),
    ],
)
def test_a_ball_too_large_for_its_bearing_is_said_to_be(overlap: float, closing: float, scheme: Scheme, what: str) -> None:
    """Jaws at 10 degrees from upright: mu = 0.5 is more than tan 10 degrees, so that the ball cannot slip out, and nothing gives way."""
    R, sides = 0.05, {"left": 1.0, "right": -1.0}
    jaws = []
    for name, side in sides.items():
        normal = np.array([side * np.cos(np.radians(10.0)), np.sin(np.radians(10.0))])
        along = np.array([-normal[1], normal[0]])
        square = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        jaws.append(rigid_polygon(name, [-normal * (2 * R - overlap) + 0.2 * a * along + R * b * normal for a, b in square], mass=1.0))
    supports = [Support(name, ("x",), velocity=closing * side) for name, side in sides.items()]
    supports += [Support(name, ("y", "rz")) for name in sides]
    model = build_model([*jaws, rigid_sphere("ball", R, (0.0, 0.0), 1.0)], supports=supports, gravity=(0.0, -9.81))
    pairs = "'left' and 'ball', 'right' and 'ball'"
    with pytest.raises(NotConverged, match=rf"{pairs} {what}, and friction locks them .*Is a body too large for its place\?"):
        list(Simulation(model, ExactContacts(model, 0.5), scheme, 3, SolverSettings(fallback=()), cuttings=1))
