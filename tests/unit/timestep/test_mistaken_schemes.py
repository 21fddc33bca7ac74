"""Arguments of schemes and laws that cannot be meant are refused where they are given; theta below 1/2 is said to let vibrations grow."""

from typing import Any

import numpy as np
import pytest

from fcsim import Body, Everything, Gap, GeneralisedAlpha, Material, QuasiStatic, Rolling, Simulation, Support, Theta, Velocity, build_model
from fcsim.errors import InputError
from fcsim.linkage import without_contact_of
from fcsim.mesh import brick, rigid_box
from fcsim.timestep.state import State


@pytest.mark.parametrize("h", [np.inf, np.nan, 0.0, -1e-3, "1e-3", None])
def test_lengths_of_steps(h: Any) -> None:
    for scheme in (Theta, GeneralisedAlpha, QuasiStatic):
        with pytest.raises(InputError, match="h: expected a number > 0"):
            scheme(h)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (Gap, r"got the class Gap itself: Gap\(\.\.\.\)"),
        (Velocity, "got the class Velocity itself"),
        (0.5, "expected a contact law, as Gap.* got 0.5"),
        (None, "expected a contact law, as Gap.* got None"),
    ],
)
def test_what_is_no_law(law: Any, said: str) -> None:
    for scheme in (Theta, GeneralisedAlpha, QuasiStatic):
        with pytest.raises(InputError, match=said):
            scheme(1e-3, law=law)
    with pytest.raises(InputError, match="Rolling, law: expected a contact law"):
        Rolling(0.01, law)


@pytest.mark.parametrize(
    ("friction", "said"),
    [(0.3, "expected a function of what slides.* got 0.3"), (lambda sliding: 0.3, r"expected 4 finite coefficients >= 0, got \(\)")],
)
def test_friction_that_is_no_function_of_contacts(friction: Any, said: str) -> None:
    bodies = [rigid_box("floor", (4.0, 4.0, 1.0), (0.0, 0.0, -0.5), 1.0), rigid_box("box", (0.4, 0.4, 0.2), (0.0, 0.0, 0.1), 64.0)]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=lambda t: (0.0, 0.0, -9.81))
    with pytest.raises(InputError, match=said):
        list(Simulation(model, Everything(model, mu=0.3), Theta(1e-3, law=Gap(friction=friction)), 1))


def test_theta_below_one_half_is_said_to_let_vibrations_grow() -> None:
    """A bar that is free of all and vibrates gains energy as the formula of the remark says, to which (1 - theta) / theta is the limit."""
    theta, h, E, density = 0.45, 1e-3, 1e7, 1000.0
    bar = brick("bar", (1.0, 1.0, 1.0), (1, 1, 1), Material(E, 0.0, density))
    model = build_model([Body("bar", bar, kinematics="linear")])
    stretch = np.zeros((len(bar.points), 3))
    stretch[:, 0] = np.where(bar.points[:, 0] > 0.5, 1.0, -1.0)  # two lumped masses of a half on a spring E A / L
    w = np.sqrt(E / (density / 4))
    start = State(0.0, np.zeros(model.n_dofs), 1e-6 * stretch.ravel())
    steps = list(Simulation(model, Everything(model, mu=0.0), Theta(h, theta), 8, initial=start))
    assert any("theta = 0.45 lets vibrations grow, stiff ones 1.22 times a step" in remark for remark in steps[0].remarks)

    def energy(state: State) -> float:
        x, v = state.x.reshape(-1, 3)[:, 0] @ stretch[:, 0] / 8, state.v.reshape(-1, 3)[:, 0] @ stretch[:, 0] / 8
        return density / 2 * v**2 + E / 2 * (2 * x) ** 2

    growth = np.sqrt(energy(steps[-1].state) / energy(steps[0].state)) ** (1 / 7)
    assert abs(growth - np.sqrt((1 + (h * w * (1 - theta)) ** 2) / (1 + (h * w * theta) ** 2))) < 1e-6
    for quiet in (Theta(h, 0.5), Theta(h, 1.0), GeneralisedAlpha(h, 0.5)):
        remarks = next(iter(Simulation(model, Everything(model, mu=0.0), quiet, 1))).remarks
        assert not any("vibrations grow" in remark for remark in remarks)


def test_a_detector_of_other_bodies_is_refused() -> None:
    """Its friction and facets go by the bodies' numbers; the same bodies elsewhere will do."""
    one, two = (rigid_box(name, (0.1, 0.1, 0.1), (k, 0, 0), 1.0) for k, name in enumerate(("one", "two")))
    moved = rigid_box("two", (0.1, 0.1, 0.1), (3, 0, 0), 1.0)
    detector = Everything(build_model([one, two]), {("one", "*"): 0.3, ("*", "*"): 0.6})
    wrapped = without_contact_of(detector, detector.model, [("one", "two")])
    for found in (detector, wrapped):
        with pytest.raises(InputError, match="got one of another: body 0 is 'two' of 8 points, there 'one' of 8 points"):
            Simulation(build_model([two, one]), found, Theta(1e-3), 1)
        with pytest.raises(InputError, match="body 1 is none, there 'two'"):
            Simulation(build_model([one]), found, Theta(1e-3), 1)
    Simulation(build_model([one, moved]), wrapped, Theta(1e-3), 1)
