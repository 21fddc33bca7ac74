"""Joints that hold by springs and strength, in motion: a glued cube swings, breaks and is carried round as a mass on a spring does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fcsim import Cohesive, DrivenRotation, Everything, Simulation, SolverSettings, Springs, Support, Theta, at_rest, build_model
from fcsim.mesh import rigid_box
from fcsim.timestep.step import Step

MASS, SIDE, AREA, K = 2.0, 0.1, 0.01, 1e8
HELD = Support("low", ("x", "y", "z", "rx", "ry", "rz"))
LOW, UP = rigid_box("low", (0.3, 0.3, 0.1), (0, 0, -0.05), 1.0), rigid_box("up", (SIDE, SIDE, SIDE), (0, 0, SIDE / 2), MASS)


def run(supports: list[Any], law: Cohesive, velocity: np.ndarray, scheme: Theta, steps: int, lifted: float = 0.0) -> list[Step]:
    """A cube of one facet a side, glued to what is below it; it begins `lifted` [m] with a velocity (6,)."""
    model = build_model([LOW, UP], supports=supports)
    start, first = at_rest(model), model.dof_offset[model.number["up"]]
    start.v[first : first + 6], start.x[first + 2] = velocity, lifted
    rule, settings = Everything(model, 0.5, alert=0.02), SolverSettings(tol=1e-10)
    return list(Simulation(model, rule, replace(scheme, law=law), steps, settings, initial=start, created=np.inf))


def up(step: Step, values: Any) -> Any:
    first = step.model.dof_offset[step.model.number["up"]]
    return values[first : first + 6]


def glue(tension: float, energy: float) -> Cohesive:
    return Cohesive(tension=tension, mode_1=energy, mode_2=energy, springs=Springs(normal=K, tangential=K))


def test_a_glued_cube_swings_as_a_mass_on_a_spring() -> None:
    """z = v / w sin(w t), w^2 = k A / m, through tension and pressure; m z'^2 / 2 + k A z^2 / 2 is kept at theta = 1/2."""
    w, v = np.sqrt(K * AREA / MASS), 0.1
    steps = run([HELD], glue(1e6, 1e3), np.array([0, 0, v, 0, 0, 0]), Theta(2e-4), 30)  # a period is 8.9 ms
    z = np.array([up(step, step.state.x)[2] for step in steps])
    scaled = 2 / 2e-4 * np.arctan(w * 2e-4 / 2)  # what the midpoint rule makes of w
    assert z == pytest.approx(v / w * np.sin(scaled * np.array([step.state.t for step in steps])), abs=2e-3 * v / w)
    energy = [step.energy.kinetic + step.energy.contact for step in steps]
    assert energy == pytest.approx(np.full(len(steps), 0.5 * MASS * v**2), rel=1e-9)


def test_a_glued_cube_that_is_torn_off_has_lost_the_fracture_energy() -> None:
    """Its springs give back what they hold as the strength falls: m (v^2 - v'^2) / 2 = G A; the force is never above f_t A."""
    steps = run([HELD], glue(1e5, 100.0), np.array([0, 0, np.sqrt(2), 0, 0, 0]), Theta(1e-4), 40)
    assert sum(step.energy.fracture_dissipation for step in steps) == pytest.approx(100.0 * AREA, rel=1e-9)
    assert up(steps[-1], steps[-1].state.v)[2] == pytest.approx(np.sqrt(2 - 2 * 100.0 * AREA / MASS), rel=3e-3)
    pull = [-step.contact_force_on(step.model.number["up"])[2] for step in steps]
    assert 0.9e5 * AREA < max(pull) <= 1e5 * AREA * (1 + 1e-9)
    assert pull[-1] == pytest.approx(0.0, abs=1e-9)


def test_glue_on_springs_carries_a_cube_round() -> None:
    """Turned about an axis below it at W, its joint bears m W^2 R, stretched by that over k A."""
    rate, h = 5.0, 1e-3
    stretch = MASS * rate**2 * SIDE / 2 / (K * AREA)
    turned = DrivenRotation("low", lambda t: rate * t, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    velocity = np.array([rate * SIDE / 2, 0.0, 0.0, 0.0, rate, 0.0])
    for step in run([turned], glue(1e6, 1e3), velocity, Theta(h, 1.0), 40, stretch):
        angle = rate * step.state.t
        force = step.contact_force_on(step.model.number["up"])
        centre = up(step, step.state.x)[:3] + np.array([0.0, 0.0, SIDE / 2])
        assert np.hypot(centre[0], centre[2]) == pytest.approx(SIDE / 2, rel=1e-3)
    assert np.linalg.norm(force) == pytest.approx(MASS * rate**2 * SIDE / 2, rel=1e-2)
    assert centre[[0, 2]] == pytest.approx(SIDE / 2 * np.array([np.sin(angle), np.cos(angle)]), abs=1e-3 * SIDE)
