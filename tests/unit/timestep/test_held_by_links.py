"""Wheels on pins that touch: nothing can move them along the line between the pins, so that no reaction there has an effect."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Ball, ExactContacts, Force, Hinge, Linkage, Simulation, Step, Theta, Witness, build_model
from fcsim.mesh import rigid_cylinder, rigid_sphere

R, MASS, MOMENT = 0.1, 1.0, 1.0


def turned(d: int, overlap: float, steps: int, unit: float = 1.0) -> list[Step]:
    """A wheel of radius R under a moment beside one of 2 R, each on a pin of its own, `overlap` [m] closer than they fit."""
    far = (3 * R - overlap) * unit
    size = ("a", R * unit, MASS), ("b", 2 * R * unit, 2 * MASS)
    if d == 2:
        wheels = [rigid_sphere(name, r, (x, 0.0), m) for (name, r, m), x in zip(size, (0.0, far), strict=True)]
        pins = [Ball(f"pin {w.name}", w.name, None, tuple(w.centre)) for w in wheels]
    else:
        wheels = [
            rigid_cylinder(name, r, R * unit, (x, 0.0, 0.0), m, (0.0, 0.0, 1.0)) for (name, r, m), x in zip(size, (0.0, far), strict=True)
        ]
        pins = [Hinge(f"pin {w.name}", w.name, None, tuple((w.centre[0], 0.0, z * unit) for z in (-R, R))) for w in wheels]
    moment = (0.0,) * (2 * d - 4) + (MOMENT * unit**2,)
    model = build_model(wheels, loads=[Force("a", (0.0,) * d, moment)])
    detection = ExactContacts(model, mu=0.5)
    return list(Simulation(model, detection, Theta(1e-3), steps, linkage=Linkage(model, pins), witness=Witness()))


@pytest.mark.parametrize(("d", "overlap", "unit"), [(2, 0.0, 1.0), (2, 1e-7, 1.0), (2, 1e-5, 1e3), (3, 1e-7, 1.0)])
def test_wheels_on_pins_that_touch(d: int, overlap: float, unit: float) -> None:
    """W has no entry along the normals, to the last bit, and a wheel turns as if alone: nothing determines how the pins press the wheels on
    each other, and the least, which is nothing, has no friction. omega = M t / (m R^2 / 2). What overlaps is proved at once to have no
    reaction that takes it back, and stays."""
    steps = turned(d, overlap, 5, unit)
    for step in steps:
        W = step.reduction.local.W
        W = W if isinstance(W, np.ndarray) else W.toarray()
        assert not W[::d].any() and not W[:, ::d].any()
        assert sum(attempt.iterations for attempt in step.attempts) < 3000
    assert_allclose(steps[-1].state.v[[5, 11] if d == 3 else [2, 5]], [MOMENT * 5e-3 / (0.5 * MASS * R**2), 0.0], atol=1e-9)
