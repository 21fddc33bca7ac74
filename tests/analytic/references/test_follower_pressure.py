"""Pressures that follow what they deform: a ring and a hollow sphere of rubber blown up, a cantilever rolled by pressure on one side."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from fcsim import Body, Everything, QuasiStatic, Simulation, Support, build_model
from fcsim.assembly.loads import FollowerPressure
from fcsim.mesh.blocks import rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import neo_hooke, saint_venant_kirchhoff
from fcsim.timestep.limits import Limits
from tests.analytic.references.meshes import block, sector, spaced

EVERY_STRAIN = Limits(rotation=np.inf, strain=np.inf)


def pressed(part: Any, supports: list[Support], surface: str, pressure: float, steps: int) -> np.ndarray:
    """Places (nn, d) of the part's nodes under the pressure, reached in so many steps."""
    far = rigid_rectangle("far", (1, 1), (1e3, 0), 1.0) if part.dimension == 2 else rigid_box("far", (1, 1, 1), (1e3, 0, 0), 1.0)
    held = Support("far", ("x", "y", "rz") if part.dimension == 2 else ("x", "y", "z", "rx", "ry", "rz"))
    loads = [FollowerPressure("body", surface, pressure, lambda t: t)]
    model = build_model([Body("body", part), far], supports=[*supports, held], loads=loads)
    *_, step = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1 / steps), steps, limits=EVERY_STRAIN)

    assert abs(step.energy.residual) < 3e-6 * step.energy.load_work  # the residual of 1e-9 times the way of a slender body
    places: np.ndarray = part.points + step.state.x[: model.n_elastic].reshape(part.points.shape)
    return places


def bore_under_pressure(p: float, n: int, mu: float, lame: float) -> float:
    """Radius of the bore of a wall from 1 to 2 of W = mu/2 (tr C - 3) - mu ln J + lambda/2 (ln J)^2 under the pressure p; n = 1: a tube in
    plane strain, 2: a sphere. d(R^n P_R)/dR = n R^(n-1) P_t with the stretches r', r / R, P_R = 0 outside and -p (r / R)^n inside, by
    shooting."""

    def nominal(a: float, other: float) -> float:
        return mu * (a - 1 / a) + lame * np.log(a * other) / a

    def stretch(P: float, t: float) -> float:
        return brentq(lambda a: nominal(a, t**n) - P, 1e-2, 1e2)

    def outside(a: float) -> float:
        def slopes(R: float, y: np.ndarray) -> list[float]:
            t = y[0] / R
            radial = stretch(y[1] / R**n, t)
            return [radial, n * R ** (n - 1) * nominal(t, radial * t ** (n - 1))]

        return float(solve_ivp(slopes, (1, 2), [a, -p * a**n], rtol=1e-9, atol=1e-11).y[1, -1])

    return brentq(outside, 1.0, 1.7)


def test_thick_ring_of_rubber() -> None:
    """Opened by 40 %: by a pressure on the reference it would be 26 %."""
    E, nu = 2.6, 0.3
    part = block("body", [spaced(1, 2, 4), spaced(0, 1, 3)], neo_hooke(E, nu, 1.0), "Q2", sector(0, 1, 0, np.pi / 2))
    x = pressed(part, [Support("body", ("y",), "y-"), Support("body", ("x",), "y+")], "x-", 0.45, 3)
    expected = bore_under_pressure(0.45, 1, 1.0, 1.5)
    assert expected > 1.3
    assert_allclose(np.linalg.norm(x[np.unique(part.surfaces["x-"])], axis=1), expected, rtol=1e-3)


def test_hollow_sphere_of_rubber() -> None:
    """A third of an octant, where x is the largest coordinate; its faces y = 0, z = 0, x = y, x = z are planes of symmetry."""

    def face(q: np.ndarray) -> np.ndarray:
        way = np.column_stack([np.ones(len(q)), np.tan(np.pi / 4 * q[:, 1]), np.tan(np.pi / 4 * q[:, 2])])
        return q[:, :1] * way / np.linalg.norm(way, axis=1)[:, None]

    part = block("body", [spaced(1, 2, 2), spaced(0, 1, 2), spaced(0, 1, 2)], neo_hooke(2.6, 0.3, 1.0), "Q2", face)
    slanted = np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, np.sqrt(2)]]) / np.sqrt(2)
    other = np.array([[1.0, 0.0, -1.0], [0.0, np.sqrt(2), 0.0], [1.0, 0.0, 1.0]]) / np.sqrt(2)
    flat = [Support("body", ("y",), "y-"), Support("body", ("z",), "z-")]
    across = [Support("body", ("y",), "y+", axes=slanted), Support("body", ("z",), "z+", axes=other)]
    x = pressed(part, [*flat, *across], "x-", 0.5, 2)
    expected = bore_under_pressure(0.5, 2, 1.0, 1.5)
    assert expected > 1.2
    assert_allclose(np.linalg.norm(x[np.unique(part.surfaces["x-"])], axis=1), expected, rtol=2e-3)


@pytest.mark.slow
def test_cantilever_rolled_by_the_pressure_on_one_side() -> None:
    """p L^3 / EI = 20 turns its end by 153 degrees. The elastica M = EI theta', F' = -q n, M' = -t x F is an initial value problem from the
    free end, where all forces vanish, since the load turns with the beam: then all is turned to theta = 0 at the clamp. q is p on the
    fibre h / 2 away, which the curvature stretches."""
    L, h, E = 1.0, 0.01, 1e9
    EI = E * h**3 / 12
    p = 20 * EI / L**3
    part = rectangle("body", (L, h), (40, 1), saint_venant_kirchhoff(E, 0.0, 1.0), elements="Q2")
    x = pressed(part, [Support("body", ("x", "y"), "x-")], "y+", p, 10)

    def slopes(_: float, y: np.ndarray) -> list[float]:
        theta, M, Fx, Fy = y[:4]
        curvature = M / EI
        q = p * (1 - curvature * h / 2)
        c, s = np.cos(theta), np.sin(theta)
        return [curvature, Fx * s - Fy * c, -q * s, q * c, c, s]

    end = solve_ivp(slopes, (L, 0), np.zeros(6), rtol=1e-10, atol=1e-12).y[:, -1]
    turn = np.array([[np.cos(end[0]), np.sin(end[0])], [-np.sin(end[0]), np.cos(end[0])]])
    tip = x[np.isclose(part.points[:, 0], L)].mean(axis=0) - [0, h / 2]
    assert_allclose(tip, -turn @ end[4:], atol=0.01 * L)
    assert np.degrees(end[0]) > 150
