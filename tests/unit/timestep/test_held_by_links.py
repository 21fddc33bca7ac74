"""Bodies that touch where links hold them along the normal, as wheels on pins: no reaction there has an effect."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import (
    Ball,
    Control,
    Everything,
    ExactContacts,
    Force,
    Hinge,
    Linkage,
    QuasiStatic,
    Simulation,
    Slider,
    Step,
    Support,
    Theta,
    Witness,
    build_model,
)
from fcsim.errors import InputError
from fcsim.mesh import rigid_cylinder, rigid_rectangle, rigid_sphere

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
    """Such contacts are no part of the problem, and a wheel turns as if alone: nothing determines how the pins press the wheels on each
    other, and the least, which is nothing, has no friction; a remark says so once. omega = M t / (m R^2 / 2). What overlaps stays."""
    steps = turned(d, overlap, 5, unit)
    assert not any(len(step.contacts) for step in steps)
    (text,) = [remark for step in steps for remark in step.remarks if "is not determined" in remark]
    assert "'a' and 'b' touch at " in text and "where supports or links hold both along the contact's normal" in text
    assert_allclose(steps[-1].state.v[[5, 11] if d == 3 else [2, 5]], [MOMENT * 5e-3 / (0.5 * MASS * R**2), 0.0], atol=1e-9)


@pytest.mark.parametrize("h", [1e-3, 1e-2])
def test_a_rod_hinged_where_it_touches_its_wall_falls_as_a_pendulum(h: float) -> None:
    """The step in which its end lay 5e-9 m in the wall, by what closing the link leaves, was proved to have no answer. A rod of L x b from
    rest: alpha = m g L / 2 / (m (L^2 + b^2) / 3) about its lower corner, which bears m (alpha b / 2, g - alpha L / 2)."""
    m, L, b, g, steps = 10.0, 1.0, 0.1, 9.81, 3
    bodies = [rigid_rectangle("wall", (1.0, 4.0), (-0.5, 0.0), 1.0), rigid_rectangle("rod", (L, b), (L / 2, 0.0), m)]
    model = build_model(bodies, supports=[Support("wall", ("x", "y", "rz"))], gravity=(0.0, -g))
    linkage = Linkage(model, [Ball("hinge", "rod", "wall", (0.0, -b / 2))])
    *_, last = Simulation(model, Everything(model, mu=0.5), Theta(h), steps, linkage=linkage)
    alpha = m * g * L / 2 / (m * (L**2 + b**2) / 3)
    assert_allclose(last.state.v[5], -alpha * steps * h, rtol=10 * (steps * h) ** 2)
    assert_allclose(last.link_force("hinge"), [m * alpha * b / 2, m * (g - alpha * L / 2)], atol=10 * m * g * (steps * h))


def test_a_link_that_drives_a_body_into_its_wall_is_refused() -> None:
    """Guided by a slider, the block can move along x alone, and the control moves it there by 0.1 m a second."""
    bodies = [rigid_rectangle("wall", (1.0, 4.0), (-0.5, 0.0), 1.0), rigid_rectangle("block", (1.0, 1.0), (0.51, 0.0), 1.0)]
    model = build_model(bodies, supports=[Support("wall", ("x", "y", "rz"))])
    guide = Slider("guide", None, "block", ((0.1, 0.0), (0.9, 0.0)))
    control = Control("push", (("block", (0.51, 0.0), 1.0),), (-1.0, 0.0), 0.1)
    simulation = Simulation(model, Everything(model, mu=0.5), Theta(1e-2), 20, linkage=Linkage(model, [guide, control]))
    with pytest.raises(InputError, match=r"supports or links drive 'block' and 'wall' 0\.00[0-9]+ m into each other"):
        list(simulation)


@pytest.mark.parametrize("gap", [1e-4, 1e-3])
def test_an_eccentric_disc_is_stopped_past_its_dead_point(gap: float) -> None:
    """Its centre lies e = 0.05 m beside its pin, away from a wall: the wall's normal meets the pin, which holds the disc along it until it
    has turned. A moment M turns it to cos a = 1 - gap / e, where the wall bears M / (e sin a). It "drove into the wall", or did not
    settle."""
    e, M = 0.05, 0.01
    disc, wall = rigid_sphere("disc", 2 * e, (-e, 0.0), 1.0), rigid_rectangle("wall", (1.0, 4.0), (0.5 + e + gap, 0.0), 1.0)
    model = build_model([disc, wall], supports=[Support("wall", ("x", "y", "rz"))], loads=[Force("disc", (0.0, 0.0), (M,))])
    linkage = Linkage(model, [Ball("pin", "disc", None, (0.0, 0.0))])
    *_, step = Simulation(model, ExactContacts(model, mu=0.0), QuasiStatic(0.5, 1e-6), 2, linkage=linkage, witness=None)
    turned = np.arccos(1 - gap / e)
    assert step.state.x[2] == pytest.approx(turned, rel=1e-5)
    assert abs(step.force_in_space.sum(axis=0)[0]) == pytest.approx(M / (e * np.sin(turned)), rel=1e-5)
