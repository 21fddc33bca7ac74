"""What the first half step would pass: the step is cut until it meets nothing, or refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Velocity
from fcsim.errors import InputError
from fcsim.mesh.blocks import rigid_box
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.step import Moment
from fcsim.timestep.theta import Theta

HELD = ("x", "y", "z", "rx", "ry", "rz")


def shot(unit: float, height: float, speed: float) -> tuple[Model, State]:
    """A cube of 1 cm above a plate of 5 mm, in lengths of 1 / unit m."""
    plate = rigid_box("plate", np.array([0.3, 0.3, 0.005]) * unit, np.array([0, 0, -0.0025]) * unit, 1.0)
    cube = rigid_box("cube", np.full(3, 0.01) * unit, np.array([0.013, 0.021, height + 0.005]) * unit, 2e-3)
    model = build_model([plate, cube], supports=[Support("plate", HELD)])
    initial = at_rest(model)
    initial.v[model.dof_offset[1] + 2] = -speed * unit
    return model, initial


def detection(kind: str, model: Model, unit: float):
    if kind == "everything":
        return Everything(model, 0.3)
    sides = (contact_surface(model, [("cube", "z-")]), contact_surface(model, [("plate", "z+")]))
    return Detector([SurfacePair(*sides, mu=0.3, alert=1e-3 * unit)], model.n_nodes)


@pytest.mark.each_value
@pytest.mark.parametrize("unit", [1.0, 1e3, 1e-3])
@pytest.mark.parametrize("kind", ["everything", "pairs"])
def test_a_shot_does_not_pass_in_the_first_half_step(kind: str, unit: float) -> None:
    """2000 m/s from 0.5 m above, h = 1 ms: the middle of the first step is behind the plate."""
    model, initial = shot(unit, 0.5, 2000.0)
    steps = list(Simulation(model, detection(kind, model, unit), Theta(1e-3), 3, SolverSettings(name="auto", tol=1e-9), initial))
    assert steps[0].substeps > 1
    height = [0.5 * unit + step.state.x[model.dof_offset[1] + 2] for step in steps]
    assert_allclose(height, 0.0, atol=1e-6 * unit)
    velocity = steps[-1].state.v[model.dof_offset[1] :] / np.repeat([2000.0 * unit, 2000.0 / 0.01], 3)
    assert_allclose(velocity, 0.0, atol=1e-8)


def test_what_cannot_be_cut_short_enough_is_refused() -> None:
    model, initial = shot(1.0, 0.001, 2000.0)
    with pytest.raises(InputError, match=r"step 1, .*'plate' and 'cube'|step 1, .*'cube' and 'plate'"):
        list(Simulation(model, Everything(model, 0.3), Theta(1e-3), 3, initial=initial))
    model, initial = shot(1.0, 0.5, 2000.0)
    with pytest.raises(InputError, match="shorter h"):
        list(Simulation(model, Everything(model, 0.3), Theta(1e-3), 3, initial=initial, cuttings=0))


def test_a_longer_step_than_the_one_before_is_looked_at_too() -> None:
    """Steps of 1 us until the cube is near, then of 1 ms."""
    model, initial = shot(1.0, 0.5, 2000.0)
    short = Simulation(model, Everything(model, 0.3), Theta(1e-6), 3, SolverSettings(name="auto"), initial)
    moment = list(short)[-1].moment
    long = Simulation(model, Everything(model, 0.3), Theta(1e-3), 6, SolverSettings(name="auto"))
    last = list(long.run(after=moment))[-1]
    assert_allclose(0.5 + last.state.x[model.dof_offset[1] + 2], 0.0, atol=1e-6)


def test_what_meets_nothing_is_not_cut() -> None:
    model, initial = shot(1.0, 0.5, 100.0)
    law = Velocity(1.0)
    steps = list(Simulation(model, Everything(model, 0.0), Theta(1e-3, law=law), 4, SolverSettings(name="auto"), initial))
    assert [step.substeps for step in steps] == [1] * 4
    last = steps[-1].moment
    assert isinstance(last, Moment) and last.seen == 1e-3
    assert_allclose(steps[-1].energy.kinetic, 0.5 * 2e-3 * 100.0**2, rtol=1e-9)


@pytest.mark.parametrize(("e", "speed"), [(1.0, 500.0), (0.5, 200.0), (0.0, 500.0)])
def test_a_velocity_law_does_not_let_pass_what_comes_fast(e: float, speed: float) -> None:
    """It takes closed contacts only: where a step would go from one side to the other it is cut; v+ = -e v-."""
    wall, ball = rigid_box("wall", (0.05, 1, 1), (0, 0, 0), 1.0), rigid_box("ball", (0.05, 0.05, 0.05), (-0.5, 0.1, 0.03), 1.0)
    model = build_model([wall, ball], supports=[Support("wall", HELD)])
    initial = at_rest(model)
    initial.v[model.dof_offset[1]] = speed
    simulation = Simulation(
        model, Everything(model, 0.0), Theta(1e-3, law=Velocity(e)), 8, SolverSettings(name="auto"), initial, witness=None
    )
    last = list(simulation)[-1]
    assert_allclose(last.state.v[model.dof_offset[1]], -e * speed, atol=1e-6 * speed)
    assert last.state.x[model.dof_offset[1]] < 0.5
    with pytest.raises(InputError, match="'ball'"):
        list(Simulation(model, Everything(model, 0.0), Theta(1e-3, law=Velocity(e)), 8, initial=initial, cuttings=0, witness=None))
