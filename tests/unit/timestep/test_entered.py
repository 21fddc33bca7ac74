"""A slave coarser than its master bears on its few points alone: a run says so, beside the answer of rules that spread the pressure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fcsim import (
    Body,
    Compliant,
    Detector,
    Everything,
    Gap,
    Material,
    QuasiStatic,
    Simulation,
    Springs,
    Support,
    SurfacePair,
    Theta,
    Traction,
    build_model,
    contact_surface,
    two_pass,
)
from fcsim.mesh import rectangle

STEEL = Material(E=210e9, nu=0.0, density=7800.0)
SETTLES = 2e6 / 210e9
"""[m] The upper face of two blocks of 1 m, pressed by 1 MPa: E strain = p with nu = 0."""


def pressed(upper: int, lower: int, rule: str, unit: float = 1.0, law: Any = None) -> tuple[float, tuple[str, ...]]:
    """How far a block of `upper` cells in its width comes down on one of `lower`, relative to `SETTLES`, and what is said."""
    material = Material(E=STEEL.E / unit, nu=0.0, density=STEEL.density / unit**3)
    size = (unit, unit)
    bodies = [
        Body("above", rectangle("above", size, (upper, 4), material), translation=(0.0, unit)),
        Body("below", rectangle("below", size, (lower, 4), material)),
    ]
    load = Traction("above", "y+", (0.0, -1e6 / unit))
    held = [Support("below", ("x", "y"), "y-"), Support("above", ("x",), "y+")]
    model = build_model(bodies, supports=held, loads=[load])
    slave, master = contact_surface(model, [("above", "y-")]), contact_surface(model, [("below", "y+")])
    alert = 0.02 * unit
    given: Any = rule
    detection: Any
    if rule == "Everything":
        detection = Everything(model, 0.0)
    elif rule == "two passes":
        detection = Detector(two_pass(slave, master, 0.0, alert), model.n_nodes)
    else:
        detection = Detector([SurfacePair(slave, master, 0.0, alert, given)], model.n_nodes)
    (step,) = Simulation(model, detection, QuasiStatic(1.0, eta=1e-3, law=law or Gap()), 1)
    top = np.isclose(model.reference[:, 1], 2 * unit)
    down = -(model.positions(step.state.x) - model.reference)[top, 1].mean()
    return float(down / (SETTLES * unit)), tuple(said for said in step.remarks if "between its points" in said)


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("rule", ["nodes", "gauss"])
def test_a_slave_of_one_facet_on_fifty_is_named(rule: str, unit: float) -> None:
    came, said = pressed(1, 50, rule, unit)
    assert came > 1.05
    assert len(said) == 1
    assert "pair 1 (slave 'above', master 'below')" in said[0]


@pytest.mark.parametrize(
    ("upper", "lower", "rule"),
    [(50, 1, "nodes"), (5, 4, "nodes"), (4, 4, "faces"), (1, 50, "mortar"), (1, 50, "two passes"), (1, 50, "Everything")],
)
def test_what_is_said_to_help_does(upper: int, lower: int, rule: str) -> None:
    came, said = pressed(upper, lower, rule)
    assert came == pytest.approx(1.0, abs=0.01)
    assert said == ()


@pytest.mark.parametrize("rule", ["nodes", "faces", "gauss"])
def test_joints_that_give_way_are_as_deep_as_they_are_meant_to_be(rule: str) -> None:
    """Springs that are pressed by half as much as the blocks: p / k deep all over, which was said to be between points of few."""
    springs = Compliant(Springs(normal=1e6 / (0.5 * SETTLES), tangential=1e9))
    came, said = pressed(4, 4, rule, law=springs)
    assert came == pytest.approx(1.5, abs=0.01)
    assert said == ()
    assert len(pressed(1, 50, rule, law=springs)[1]) == 1


@pytest.mark.parametrize(("upper", "lower", "named"), [(1, 50, 1), (4, 4, 0)])
def test_in_dynamics_energy_and_forces_of_all_steps_tell(upper: int, lower: int, named: int) -> None:
    """A soft block comes to lie on another under its weight, begun at once, and swings: one step alone says nothing."""
    material = Material(E=1e7, nu=0.2, density=2000.0)
    bodies = [
        Body("above", rectangle("above", (1.0, 1.0), (upper, 4), material), translation=(0.0, 1.0)),
        Body("below", rectangle("below", (1.0, 1.0), (lower, 4), material)),
    ]
    model = build_model(bodies, supports=[Support("below", ("x", "y"), "y-")], gravity=lambda t: (0.0, -9.81), beta=1e-3)
    pair = SurfacePair(contact_surface(model, [("above", "y-")]), contact_surface(model, [("below", "y+")]), 0.3, 0.02, "nodes")
    steps = Simulation(model, Detector([pair], model.n_nodes), Theta(5e-4), 64)
    said = {said for step in steps for said in step.remarks if "between its points" in said}
    assert len(said) == named
