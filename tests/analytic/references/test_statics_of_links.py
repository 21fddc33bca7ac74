"""Links in statics: bodies that nothing but a link holds, turned far, against closed forms; eta so small that it is seen nowhere."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fcsim import (
    Ball,
    Body,
    Control,
    Everything,
    Hinge,
    Linkage,
    Material,
    QuasiStatic,
    Simulation,
    SpringDamper,
    Support,
    Tied,
    build_model,
    without_contact_of,
)
from fcsim.errors import InputError
from fcsim.mesh import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import saint_venant_kirchhoff
from fcsim.timestep.limits import Limits

ANY = Limits(rotation=np.inf, strain=np.inf)


@pytest.mark.parametrize(
    ("unit", "force", "angle", "cells", "n"),
    [
        (1e3, 1e-6, 0.5 * np.pi, 16, 2),
        pytest.param(1.0, 1.0, 2 * np.pi, 24, 8, marks=pytest.mark.slow),
        pytest.param(1e3, 1e-6, 2 * np.pi, 24, 8, marks=pytest.mark.slow),
    ],
)
def test_a_beam_rolled_up_into_a_circle(unit: float, force: float, angle: float, cells: int, n: int) -> None:
    """A plate glued to the end of a slender cantilever is turned, by 2 pi in the end: the moment at the plate and at the clamp is
    E I theta / L all the way and the end comes back to the clamp (Euler's elastica of no transverse force). The plate turns by 45 degrees
    a step: with the rows of a step's beginning its moment is short by the cosine of that."""
    L, h, E = unit, 0.02 * unit, 1e6 * force / unit**2
    strip = rectangle("strip", (L, h), (cells, 1), saint_venant_kirchhoff(E, 0.0, 1e-12 * E / unit**2), elements="Q2", plane="stress")
    plate = rigid_rectangle("plate", (0.01 * unit, h), (L + 0.005 * unit, 0.5 * h), 1e-12 * E)
    supports = [Support("strip", ("x", "y"), "x-"), Support("plate", ("rz",), velocity=angle)]
    model = build_model([Body("strip", strip), plate], supports=supports)
    links = Linkage(model, [Tied("glue", ("strip", "x+"), ("plate", "x-"))])
    detector = without_contact_of(Everything(model, mu=0.0), model, [("strip", "plate")])
    steps = list(Simulation(model, detector, QuasiStatic(1 / n, eta=1e-4), n, linkage=links, limits=ANY, witness=None))
    assert all(step.substeps == 1 for step in steps)
    own, turned = (slice(*model.dof_offset[k : k + 2]) for k in (model.number["strip"], model.number["plate"]))
    for step in steps:
        theta = angle * step.state.t
        at, f = strip.points + step.state.x[own].reshape(-1, 2), step.support_impulse[own].reshape(-1, 2)
        clamp = -float(np.sum(at[:, 0] * f[:, 1] - at[:, 1] * f[:, 0]))
        # the energy of Green and Lagrange's strain: M = E I k (1 + k^2 h^2 3 / 40) for the curvature k
        moment = E * h**3 / 12 * theta / L * (1 + 3 / 40 * (theta * h / L) ** 2)
        assert_allclose([step.support_impulse[turned][-1], clamp], moment, rtol=5e-3)
        end = at[np.unique(strip.surfaces["x+"])].mean(axis=0)
        circle = L / theta * np.array([np.sin(theta), 1 - np.cos(theta)])
        assert_allclose(end, circle + np.array([0.0, 0.5 * h]), atol=2e-3 * L)


def truss(unit: float, eta: float, steps: int) -> tuple[Any, float, float, float]:
    """A shallow truss of two solid bars on pins, its apex driven through."""
    w, H, E, t = unit, 0.3 * unit, 1e6, 0.05 * unit
    length, angle = float(np.hypot(w, H)), float(np.arctan2(H, w))
    bar = rectangle("bar", (length, t), (4, 1), Material(E, 0.0, 1.0), elements="Q1-enhanced", plane="stress", origin=(0, -t / 2))

    def turn(a: float) -> np.ndarray:
        return np.array([[np.cos(a), -np.sin(a)], [np.sin(a), np.cos(a)]])

    bodies = [
        Body("left", bar, rotation=turn(angle), translation=(-w, 0.0)),
        Body("right", bar, rotation=turn(np.pi - angle), translation=(w, 0.0)),
    ]
    model = build_model(bodies, kinematics="turning")
    links = [
        Ball("a", None, "left", (-w, 0.0)),
        Ball("b", None, "right", (w, 0.0)),
        Ball("apex", "left", "right", (0.0, H)),
        Control("push", (("left", (0.0, H), 1.0),), (0.0, -1.0), rate=2 * H),
    ]
    detector = without_contact_of(Everything(model, mu=0.0), model, [("left", "right")])
    run = Simulation(model, detector, QuasiStatic(1 / steps, eta=eta), steps, linkage=Linkage(model, links), limits=ANY, witness=None)
    return run, E * t, w, H


@pytest.mark.parametrize(("unit", "eta"), [(1.0, 1e-6), (1e3, 1e-12)])
def test_a_shallow_truss_snaps_through(unit: float, eta: float) -> None:
    """R. von Mises' truss (1923): P = 2 E A (L0 - L) / L0 y / L, up to the limit load, down through zero and to its mirror image."""
    run, EA, w, H = truss(unit, eta, 8)
    found, closed = [], []
    for step in run:
        y = H - 2 * H * step.state.t
        L0, L = np.hypot(w, H), np.hypot(w, y)
        found.append(-step.link_force("push")[1])
        closed.append(2 * EA * (L0 - L) / L0 * y / L)
    assert_allclose(found, closed, atol=1e-6 * max(closed))


@pytest.mark.parametrize("stiffness", [20.0, 5e4])
def test_a_spring_across_a_hinge_in_equilibrium(stiffness: float) -> None:
    """A rigid bar on a hinge, its weight borne by a spring: the moments of weight and spring about the hinge balance where it has come to
    rest, a little or 20 degrees from where it began."""
    bar = rigid_box("bar", (1.0, 0.1, 0.1), (0.5, 0.0, 0.0), 1.0)
    model = build_model([bar], gravity=lambda t: (0.0, 0.0, -9.81 * t))
    links = [
        Hinge("hinge", None, "bar", ends=((0.0, -0.1, 0.0), (0.0, 0.1, 0.0))),
        SpringDamper("spring", None, "bar", ends=((0.5, 0.0, 1.0), (1.0, 0.0, 0.0)), stiffness=stiffness),
    ]
    detector = Everything(model, mu=0.0)
    run = Simulation(model, detector, QuasiStatic(0.25, eta=1e-9), 4, linkage=Linkage(model, links), witness=None)
    *_, last = run
    R, x = model.rigid_rotation(last.state.x)[0], model.rigid_part(last.state.x)[0, :3]
    centre = np.array([0.5, 0.0, 0.0]) + x
    assert_allclose(centre - R @ [0.5, 0.0, 0.0], 0.0, atol=1e-9)
    end, top = centre + R @ [0.5, 0.0, 0.0], np.array([0.5, 0.0, 1.0])
    way = top - end
    pull = stiffness * (np.linalg.norm(way) - np.hypot(0.5, 1.0)) * way / np.linalg.norm(way)
    moments = np.cross(centre, [0.0, 0.0, -9.81])[1], np.cross(end, pull)[1]
    # forces are those of the last round's rows, which are off by the root of what links are closed to, 1e-10
    assert_allclose(moments[0], -moments[1], rtol=1e-5)
    assert_allclose(last.link_force("hinge")[2], -(9.81 - pull[2]), rtol=1e-5)


def test_a_control_with_points_that_are_none() -> None:
    model = build_model([rigid_rectangle("a", (1.0, 1.0), (0.0, 0.0), 1.0)])
    points: Any = [("a", (0.0, 0.0))]
    with pytest.raises(InputError, match=r"expected points \(body, place, weight\), got"):
        Linkage(model, [Control("push", points, (0.0, 1.0), rate=1.0)])


@pytest.mark.parametrize("height", [0.0, 0.5])
@pytest.mark.parametrize("eta", [1e-1, 1e-2, 1e-4])
def test_a_free_block_that_control_drives_over_a_floor_slides_at_mu_of_its_weight(eta: float, height: float) -> None:
    """A cube of 1 m, E = 1e10 Pa: mu W at any eta, within what eta / h^2 M bears of the motion, some eta 1e-3 M."""
    floor, weight = rigid_box("floor", size=(4.0, 4.0, 1.0), centre=(0.5, 0.5, -0.5), mass=1.0), 2e4
    block = Body("block", brick("block", (1.0,) * 3, (2, 2, 2), Material(E=1e10, nu=0.2, density=2000.0)))
    model = build_model([block, floor], supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=lambda t: (0.0, 0.0, -10.0))
    linkage = Linkage(model, [Control("push", (("block", (0.0, 0.5, height), 1.0),), (1.0, 0.0, 0.0), rate=1e-3)])
    *_, step = Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, eta=eta), 3, linkage=linkage)
    assert_allclose(step.contact_force_on(0) / weight, (-0.5, 0.0, 1.0), atol=1e-3 * eta + 1e-8)
    assert_allclose(step.state.x[: model.dof_offset[1] : 3].mean(), 3e-3, atol=1e-5)
