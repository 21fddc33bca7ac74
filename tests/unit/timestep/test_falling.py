"""What falls past or for long, and fast rotations, in the plane, in other units, along other axes; no alarm where all is right."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import brick, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta


def plane(gap: float, x: float = 0.0, unit: float = 1.0, steps: int = 100, h: float = 1e-3, up: int = 1, v: float = 0.0) -> tuple[str, ...]:
    """What is said of a rigid block of 1 unit `gap` units off a held wall or floor, as gravity goes along the axis `up`."""
    place, size, centre = np.zeros(2), np.full(2, 4.0 * unit), np.zeros(2)
    place[up], place[1 - up], size[up], centre[up] = (0.5 + gap) * unit, x * unit, unit, -0.5 * unit
    bodies = [rigid_rectangle("floor", tuple(size), tuple(centre), 1.0), rigid_rectangle("block", (unit, unit), tuple(place), 1.0)]
    gravity = np.zeros(2)
    gravity[up] = -9.81 * unit
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: gravity)
    start = at_rest(model, h=h)
    start = State(0.0, start.x, np.full(model.n_dofs, v)) if v else start
    return Simulation(model, Everything(model, 0.5), Theta(h), steps)._opening(start)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("up", [0, 1])
def test_a_fall_is_told_in_any_unit_and_along_any_axis(unit: float, up: int) -> None:
    """From 2 units at 9.81 units a s^2 a body falls for sqrt(4/9.81) = 0.639 s."""
    (long,) = plane(2.0, unit=unit, up=up)
    assert "above 'floor' and falls for 0.639 s, 639 steps, more than the run has" in long
    (most,) = plane(2.0, unit=unit, up=up, steps=1000)
    assert "most of the run's 1000" in most
    assert plane(2.0, unit=unit, up=up, steps=2000) == () == plane(0.0, unit=unit, up=up) == plane(1e-3, unit=unit, up=up)
    (lost,) = plane(0.0, x=7.0, unit=unit, up=up)
    assert "nothing lies under body 'block': it falls out of the scene" in lost


@pytest.mark.parametrize("angle", [0.2, 0.48, 0.9])
@pytest.mark.parametrize("along", [-0.9, 0.0, 0.9])
def test_what_lies_on_a_slope_is_over_it(angle: float, along: float) -> None:
    """The slope's upper end is higher than a block on its lower end."""
    R = Rotation.from_euler("y", angle).as_matrix()
    material = Material(1e9, 0.2, 2000.0)
    slope = Body("slope", brick("slope", (4.0, 2.0, 0.5), (1, 1, 1), material), R, R @ (-2.0, -1.0, -0.5))
    stone = Body("stone", brick("stone", (0.4, 0.4, 0.4), (1, 1, 1), material), R, R @ (1.7 * along - 0.2, -0.2, 0.0))
    model = build_model([slope, stone], supports=[Support("slope", ("x", "y", "z"))], gravity=lambda t: (0.0, 0.0, -9.81))
    assert Simulation(model, Everything(model, 0.3), Theta(1e-3), 10)._opening(at_rest(model, h=1e-3)) == ()


def test_what_is_thrown_is_let_fly() -> None:
    assert plane(2.0, v=3.0) == () == plane(0.0, x=7.0, v=3.0)


def test_a_body_that_stands_on_one_that_falls() -> None:
    """Both fall alike, so that they do not hold each other: the way of the lower one is told."""
    bodies = [rigid_box(name, (1.0, 1.0, 1.0), (0.0, 0.0, z), 1.0) for name, z in (("floor", -0.5), ("one", 2.5), ("two", 3.5))]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=lambda t: (0.0, 0.0, -9.81))
    said = Simulation(model, Everything(model, 0.5), Theta(1e-3), 100)._opening(at_rest(model, h=1e-3))
    (told,) = said
    assert "body 'one' is 2 m above 'floor' and falls for 0.639 s" in told


@pytest.mark.parametrize(("angle", "told"), [(lambda t: 30.0 * t, True), (lambda t: 0.5 * t, False), (lambda t: 100.0 * t * t, True)])
def test_rotations(angle: Any, told: bool) -> None:
    bodies = [rigid_box("drum", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5), 1.0), rigid_box("ball", (0.1, 0.1, 0.1), (0.0, 0.0, 1.05), 1.0)]
    model = build_model(bodies, supports=[DrivenRotation("drum", angle, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    said = Simulation(model, Everything(model, 0.5), Theta(1e-2), 100)._opening(at_rest(model, h=1e-2))
    assert any("Angles are in radians" in remark for remark in said) is told
