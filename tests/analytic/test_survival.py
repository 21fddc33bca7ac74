"""What collapses and piles up: no overlap, no energy from nothing, rest in the end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim import Everything, Gap, Simulation, SolverSettings, State, Step, Support, Theta, Witness, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import rigid_box
from fcsim.running.case import load_case

CASES = Path(__file__).parents[2] / "cases"

pytestmark = pytest.mark.slow


def simulation(name: str, **parameters: Any) -> Simulation:
    script = load_case(CASES / name)
    return script.build(script.parameters(**parameters)).simulation


def survived(run: Simulation, overlap: float, rest: float) -> Step:
    """The last step; overlap: largest share of a body's extent at any witness; rest: kinetic energy in the end by its largest."""
    kinetic = []
    for step in run:
        kinetic.append(step.energy.kinetic)
        if step.overlap is not None:
            assert step.overlap.share <= overlap, f"step {step.number}: {step.overlap.between}"
        assert step.ledger.created <= 1e-4 * step.ledger.supplied + 1e-9
    assert kinetic[-1] < rest * max(kinetic)
    return step


@pytest.mark.parametrize("seed", [1, 2])
def test_balls_poured_into_a_box(seed: int) -> None:
    """Exact spheres: no overlap at all, and the floor carries what does not hang on the walls by friction."""
    run = simulation("granular", n=40, seed=seed)
    last = survived(run, overlap=1e-4, rest=1e-2)
    model = run.model
    weight = 9.81 * sum(body.mass for body in model.rigid[:40])
    walls = -sum(last.contact_force_on(model.number[name])[2] for name in ("floor", "left", "right", "front", "back"))
    assert walls == pytest.approx(weight, rel=0.05)
    centres = np.array([body.centre for body in model.rigid[:40]]) + model.rigid_part(last.state.x)[:40, :3]
    radii = np.array([body.shape.radius for body in model.rigid[:40] if body.shape is not None])
    assert np.all(centres > radii[:, None] * (1 - 1e-4))
    assert np.all(centres[:, :2] < 0.24 - radii[:, None] * (1 - 1e-4))


def test_rocks_poured_into_a_box() -> None:
    """Polyhedra found by `Everything`, which turn by up to 0.06 rad a step."""
    survived(simulation("rocks", n=8), overlap=1e-4, rest=5e-2)


def test_a_wall_is_hit_by_a_block_at_20_metres_a_second() -> None:
    """Nine rigid boxes in running bond: no overlap above 1e-4 of a box, and no energy from nothing."""
    boxes = [
        rigid_box(f"box {course} {k}", (0.4, 0.2, 0.2), (0.4 * k + 0.2 * (course % 2), 0, 0.1 + 0.2 * course), 30.0)
        for course in range(3)
        for k in range(3)
    ]
    shot = rigid_box("shot", (0.2, 0.2, 0.2), (0.5, -1.0, 0.3), 20.0)
    floor = rigid_box("floor", (8, 8, 0.4), (0, 0, -0.2), 1.0)
    supports = [Support("floor", DIRECTIONS[3])]
    model = build_model([*boxes, shot, floor], supports=supports, gravity=lambda t: np.array([0, 0, -9.81]))
    start = at_rest(model)
    v = start.v.copy()
    v[model.dof_offset[model.number["shot"]] + 1] = 20.0
    settings = SolverSettings(name="auto", tol=1e-6)
    detection, scheme = Everything(model, 0.5), Theta(1e-3, 0.5, Gap())
    run = Simulation(model, detection, scheme, 200, settings, initial=State(0.0, start.x, v), witness=Witness(every=5))
    survived(run, overlap=1e-4, rest=0.2)
