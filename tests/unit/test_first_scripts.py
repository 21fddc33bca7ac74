"""What is natural in a first script works, or is answered once by what was expected, what came and how to write it."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from fcsim import Everything, Force, InputError, Simulation, SolverSettings, Support, Theta, build_model
from fcsim.mesh import rigid_box, rigid_rectangle

FLOOR, BOX = rigid_box("floor", (1.0, 1.0, 0.1), (0.0, 0.0, -0.05), 1.0), rigid_box("box", (0.2, 0.2, 0.2), (0.0, 0.0, 0.1), 10.0)


def scene(**given: Any) -> Any:
    right: dict[str, Any] = {"supports": [Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], "gravity": (0.0, 0.0, -9.81)}
    return build_model([FLOOR, BOX], **(right | given))


def started(model: Any = None, mu: Any = 0.5, scheme: Any = None, **given: Any) -> Any:
    model = model or scene()
    return Simulation(model, Everything(model, mu), scheme or Theta(1e-3), 3, **given)


@pytest.mark.parametrize("gravity", [(0, 0, -9.81), [0, 0, -9.81], np.array([0.0, 0.0, -9.81]), lambda t: (0.0, 0.0, -9.81)])
def test_gravity_is_an_acceleration_or_a_function(gravity: Any) -> None:
    *_, last = started(scene(gravity=gravity))
    assert last.contact_force_on(last.model.number["box"]) == pytest.approx([0.0, 0.0, 98.1], abs=1e-6)


def in_the_plane() -> Any:
    return build_model([rigid_rectangle("floor", (1.0, 0.1), (0.0, 0.0), 1.0)], gravity=(0, 0, -9.81))


@pytest.mark.parametrize(
    ("written", "answer"),
    [
        (lambda: scene(gravity=9.81), r"gravity: expected an acceleration, as \(0.0, 0.0, -9.81\) .*, got 9.81"),
        (lambda: scene(gravity="down"), "gravity: expected an acceleration, .*, got 'down'"),
        (lambda: scene(gravity=(0.0, 0.0, np.nan)), "gravity: expected an acceleration"),
        (in_the_plane, r"expected an acceleration of 2 finite numbers \[m/s\^2\], got \(0.0, 0.0, -9.81\)"),
        (lambda: started(solver="auto"), r"solver: expected SolverSettings\(...\), got 'auto': write SolverSettings\(name='auto'\)"),
        (lambda: started(solver=SolverSettings(name="gauss-seidel")), "gauss-seidel"),
        (lambda: started(scheme=Theta), "scheme: expected one as Theta.*got the class Theta"),
        (lambda: started(mu={"floor": 0.5}), r"mu: expected pairs of body names as keys, got 'floor': .*\('floor', '\*'\)"),
        (lambda: scene(loads=[Force("box", lambda t: (t, 0, 0))]), "is its factor, a function of the time"),
        (lambda: scene(loads=Force("box", (1, 0, 0))), r"loads: expected several, in a list, got Force: write \[Force"),
        (lambda: scene(supports=[Support("floor", "all")]), "support of body 'floor': expected directions among x, y, z"),
        (lambda: scene(supports=[Support("ground", ("x",))]), "body 'ground': expected one of 'floor', 'box'"),
    ],
)
def test_what_is_not_so_is_answered(written: Callable[[], Any], answer: str) -> None:
    with pytest.raises(InputError, match=answer):
        next(iter(run)) if isinstance(run := written(), Simulation) else None
