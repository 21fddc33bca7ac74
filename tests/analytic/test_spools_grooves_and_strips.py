"""Spools on a thread, balls in a groove, strips lifted off a floor, a disc that is split: closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import Body, Everything, ExactContacts, Force, Material, QuasiStatic, Simulation, Step, Support, Theta, build_model, stress
from fcsim.mesh import meshed_polygon, rectangle, rigid_cylinder, rigid_plane, rigid_rectangle, rigid_sphere

ALL = ("x", "y", "z", "rx", "ry", "rz")
G = 9.81


def velocity(step: Step, body: str) -> np.ndarray:
    first = step.model.dof_offset[step.model.number[body]]
    return step.state.v[first : first + 6]


@pytest.mark.parametrize("angle", [0.0, 0.5, float(np.arccos(0.6)), 1.2])
def test_a_spool_rolls_the_way_its_thread_is_pulled_below_a_critical_angle(angle: float) -> None:
    """A thread that leaves a drum of radius r from below, at an angle, on wheels of radius R: a = F (cos angle - r / R) / (3/2 m)."""
    R, r, mass, F = 0.5, 0.3, 2.0, 1.0
    spool, floor = rigid_cylinder("spool", R, 0.4, (0, 0, R), mass, axis=(0, 1, 0)), rigid_plane("floor", (0, 0, 0), (0, 0, 1), 10.0)
    pull = Force("spool", (F * np.cos(angle), 0.0, F * np.sin(angle)), moment=(0.0, -F * r, 0.0))
    model = build_model([floor, spool], supports=[Support("floor", ALL)], gravity=(0, 0, -G), loads=[pull])
    *_, last = Simulation(model, ExactContacts(model, 0.8), Theta(1e-2), 50)
    assert_allclose(velocity(last, "spool")[0], 0.5 * F * (np.cos(angle) - r / R) / (1.5 * mass), atol=1e-8)


def test_a_ball_rolls_down_a_groove_more_slowly_than_down_a_plane() -> None:
    """Its instant axis is h = R sin(half angle) from the centre: a = g sin(tilt) / (1 + 2/5 (R / h)^2)."""
    R, half, tilt = 0.1, np.deg2rad(40), np.deg2rad(10)
    walls = [rigid_plane(n, (0, 0, 0), (0, side * np.cos(half), np.sin(half)), 10.0) for n, side in (("left", 1), ("right", -1))]
    ball = rigid_sphere("ball", R, (0, 0, R / np.sin(half)), 1.0)
    held = [Support(wall.name, ALL) for wall in walls]
    model = build_model([*walls, ball], supports=held, gravity=(G * np.sin(tilt), 0, -G * np.cos(tilt)))
    *_, last = Simulation(model, ExactContacts(model, 0.6), Theta(1e-2), 50)
    assert_allclose(velocity(last, "ball")[0], 0.5 * G * np.sin(tilt) / (1 + 0.4 / np.sin(half) ** 2), rtol=1e-8)


def test_a_heavy_strip_is_lifted_off_a_floor() -> None:
    """Lifted by h at its end: on the length L = (24 E I h / w)^(1/4) it is free, by a force w L / 2; the floor bears the rest."""
    E, height, length, density, h = 1e9, 0.01, 3.0, 2000.0, 0.02
    strip = rectangle("strip", (length, height), (120, 2), Material(E, 0.0, density), plane="stress", elements="Q1-enhanced")
    floor = rigid_rectangle("floor", (4, 0.2), (1.5, -0.1), 1.0)
    lift = Support("strip", ("y",), at=(length, height), displacement=lambda t: h * t)
    held = [Support("floor", ("x", "y", "rz")), Support("strip", ("x",), "x-"), lift]
    model = build_model([floor, Body("strip", strip)], supports=held, gravity=(0, -G))
    *_, last = Simulation(model, Everything(model, 0.0), QuasiStatic(0.5, eta=1e-6), 2)
    w = density * G * height
    force = last.support_force(lift)[1]
    assert_allclose(force, w / 2 * (2 * E * height**3 * h / w) ** 0.25, rtol=0.01)
    assert_allclose(force + last.contact_force_on("strip")[1], w * length, rtol=1e-6)


def test_a_disc_pressed_between_plates_is_drawn_across() -> None:
    """The Brazilian test: 2 P / (pi D) across the middle, -6 P / (pi D) along the load."""
    D, P = 0.1, 1e4
    a = np.arange(64) * 2 * np.pi / 64 + np.pi / 2
    part = meshed_polygon("disc", D / 2 * np.column_stack([np.cos(a), np.sin(a)]), Material(1e10, 0.25, 2500.0), size=D / 24)
    plates = [rigid_rectangle(n, (0.2, 0.02), (0.0, side * (D / 2 + 0.01)), 1.0) for n, side in (("upper", 1), ("lower", -1))]
    held = [Support("lower", ("x", "y", "rz")), Support("upper", ("x", "rz"))]
    model = build_model([*plates, Body("disc", part)], supports=held, loads=[Force("upper", (0.0, -P))])
    *_, last = Simulation(model, Everything(model, 0.2), QuasiStatic(1.0, eta=2e4), 2)
    middle = part.points[np.argmin(np.hypot(*part.points.T))]
    across, along = (stress("s", model, "disc", c, tuple(middle)).measure(last) for c in ("xx", "yy"))
    assert_allclose([across, along], [2 * P / (np.pi * D), -6 * P / (np.pi * D)], rtol=0.01)
