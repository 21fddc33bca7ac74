"""Polygons poured into a box at steps in which they turn by a tenth of a radian: nothing overlaps where a step ends, either."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from fcsim import Everything, Gap, Simulation, SolverSettings, Support, Theta, Witness, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh.part import RigidBody
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

CELL, ACROSS, COUNT, DENSITY = 0.22, 4, 24, 2500.0


def stone(name: str, rng: np.random.Generator, centre: tuple[float, float]) -> RigidBody:
    """The hull of 6 to 16 points on an ellipse, anyhow turned."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, 2 * int(rng.integers(3, 9))))
    points = 0.1 * np.stack([np.cos(angle), np.sin(angle)], axis=1) * [1, rng.uniform(0.4, 1)]
    turn = rng.uniform(0, 6.3)
    points = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    hull = ConvexHull(points)
    return rigid_polygon(name, points[hull.vertices] + centre, mass=DENSITY * hull.volume)


def block(name: str, low: tuple[float, float], high: tuple[float, float]) -> RigidBody:
    return rigid_polygon(name, np.array([low, (high[0], low[1]), high, (low[0], high[1])]), mass=1.0)


def poured(seed: int, h: float, steps: int) -> Simulation:
    rng = np.random.default_rng(seed)
    stones = [stone(f"stone {k}", rng, (CELL * (k % ACROSS + 0.5), CELL * (k // ACROSS + 0.6))) for k in range(COUNT)]
    w, high = ACROSS * CELL, CELL * (COUNT // ACROSS + 2)
    walls = [block("floor", (-0.2, -0.2), (w + 0.2, 0)), block("left", (-0.2, 0), (0, high)), block("right", (w, 0), (w + 0.2, high))]
    held = [Support(wall.name, DIRECTIONS[2]) for wall in walls]
    model = build_model([*stones, *walls], supports=held, gravity=lambda t: (0, -9.81))
    witness, settings = Witness(every=1, stop=False), SolverSettings(tol=1e-6)
    return Simulation(model, Everything(model, 0.5), Theta(h, 0.5, Gap()), steps, settings, witness=witness)


@pytest.mark.parametrize(
    ("seed", "h", "steps"),
    [
        (10, 6e-3, 62),  # a corner that a step turned below another one, found behind its face: 5.6e-3 of a stone before
        pytest.param(1, 6e-3, 250, marks=pytest.mark.slow),
        pytest.param(4, 6e-3, 250, marks=pytest.mark.slow),
        pytest.param(5, 1e-2, 200, marks=pytest.mark.slow),  # a resting corner hid a blade's tip that another one had gone through: 0.2
        pytest.param(12, 1e-2, 200, marks=pytest.mark.slow),
    ],
)
def test_no_stone_overlaps_another_at_the_end_of_any_step(seed: int, h: float, steps: int) -> None:
    run = poured(seed, h, steps)
    shares, parts = [], []
    for step in run:
        assert step.overlap is not None
        shares.append(step.overlap.share)
        parts.append(step.substeps)
    assert max(shares) < 1e-4
    assert np.count_nonzero(np.array(parts) > 1) < 0.05 * steps
    assert step.ledger.created < 1e-4 * step.ledger.supplied
