"""Rigid bodies that what is driven squeezes: no reactions keep them apart, and the error names them."""

from __future__ import annotations

import pytest

from fcsim import Everything, RigidBody, Simulation, SolverSettings, Support, Theta, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.errors import NotConverged
from fcsim.mesh import rigid_box, rigid_rectangle


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
