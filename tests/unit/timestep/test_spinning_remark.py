"""A plate that spins on its corners is told that its friction torque is that of four points; one that slides is not."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim import Body, Everything, Force, Gap, Material, Simulation, SolverSettings, State, Support, Theta, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.contact_law import Spinning
from fcsim.contact_law.law import Law
from fcsim.mesh import RigidBody, brick, rigid_box
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid


def remarks_of(velocity: list[float], law: Law, tilted: bool = False, mu: float = 0.4) -> list[str]:
    up = np.array([0, 0, -9.81]) if not tilted else np.array([6.0, 0, -9.81])
    bodies = [rigid_box("plate", (0.4, 0.3, 0.05), (0, 0, 0.025), 10.0), rigid_box("table", (2, 2, 0.2), (0, 0, -0.1), 1.0)]
    model = build_model(bodies, supports=[Support("table", DIRECTIONS[3])], gravity=lambda t: up)
    start = at_rest(model)
    v = start.v.copy()
    v[:6] = velocity
    run = Simulation(model, Everything(model, mu), Theta(1e-3, 0.5, law), 4, SolverSettings(name="auto", tol=1e-8), State(0.0, start.x, v))
    return [remark for step in run for remark in step.remarks if "spin on each other" in remark]


def test_a_plate_that_spins_is_told_once() -> None:
    (remark,) = remarks_of([0, 0, 0, 0, 0, 3.0], Gap())
    assert "'plate' and 'table'" in remark and "4 points" in remark


@pytest.mark.parametrize("velocity", [[1.0, 0, 0, 0, 0, 0], [1.0, 0, 0, 0, 0, 1.0], [0, 0, 0, 0, 0, 0]])
def test_one_that_slides_or_rests_is_not(velocity: list[float]) -> None:
    assert not remarks_of(velocity, Gap())
    assert not remarks_of(velocity, Gap(), tilted=True)


def test_nor_one_without_friction() -> None:
    assert not remarks_of([0, 0, 0, 0, 0, 3.0], Gap(), mu=0.0)


def test_nor_a_wedge_that_rests_just_below_its_limit() -> None:
    """Pushed down a slope of 10 degrees by 0.99 of W tan(phi - 10 degrees): at rest, to what solvers leave."""
    slope = np.radians(10)
    wedge = [(-0.1, -0.1 * np.tan(slope)), (0.1, 0.1 * np.tan(slope)), (0.1, 0.1), (-0.1, 0.1)]
    bed = [(-1.0, -0.5), (1.0, -0.5), (1.0, np.tan(slope)), (-1.0, -np.tan(slope))]
    bodies = [rigid_prism("bed", bed, 0.5), rigid_prism("wedge", wedge, 0.1)]
    push = 0.99 * bodies[1].mass * 9.81 * np.tan(slope - np.arctan(0.3))
    model = build_model(
        bodies,
        supports=[Support("bed", DIRECTIONS[3])],
        loads=[Force("wedge", (push, 0, 0))],
        gravity=lambda t: np.array([0, 0, -9.81]),
    )
    steps = list(Simulation(model, Everything(model, 0.3), Theta(1e-3), 20))
    assert np.abs(steps[-1].state.v).max() < 1e-9
    assert not [remark for step in steps for remark in step.remarks]


def rigid_prism(name: str, polygon: list[tuple[float, float]], half: float) -> RigidBody:
    """A polygon in x, z from -half to half along y."""
    n = len(polygon)
    points = np.concatenate([np.insert(np.array(polygon), 1, y, axis=1) for y in (-half, half)])
    faces = [list(range(n)), list(range(n, 2 * n)), *([i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n))]
    return rigid_solid(closed_surface(name, points, faces), density=1000.0)


def test_nor_one_whose_law_resists_spinning() -> None:
    assert not remarks_of([0, 0, 0, 0, 0, 3.0], Spinning(0.05, law=Gap()))


def test_nor_an_elastic_block_that_creeps_while_some_of_its_points_stick() -> None:
    """On a slope of 0.45 under mu = tan(0.4636): at rest, although the load is uneven and the least pressed points give way."""
    stone = brick("dam", (2.0, 3.0, 1.0), (2, 3, 1), Material(30e9, 0.2, 2400.0))
    bodies = [Body("dam", stone), rigid_box("floor", (9.0, 9.0, 1.0), (1.0, 1.5, -0.5), 1.0)]
    down = (9.81 * np.sin(0.45), 0.0, -9.81 * np.cos(0.45))
    model = build_model(bodies, supports=[Support("floor", DIRECTIONS[3])], gravity=lambda t: down, beta=1e-2)
    run = list(Simulation(model, Everything(model, 0.5), Theta(2e-3, 1.0), 160))
    assert not [remark for step in run for remark in step.remarks]
    assert np.abs(run[-1].state.x[: model.n_nodes * 3]).max() < 1e-5
