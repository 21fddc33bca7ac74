"""Slender strips of solid cells that bend far: a column beyond its buckling load, a strip wrapped on a drum, Lee's frame at its limit load.

The first two against elasticas (the length is kept, M = E I theta'): with phi the angle between the tangent and the end's dead force F,
E I phi'^2 / 2 = F (cos phi - cos alpha), alpha that at the end.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ellipk, ellipkinc

from fcsim import Body, Everything, ExactContacts, Limits, Part, QuasiStatic, Simulation, Support, Traction, build_model
from fcsim.mesh import rectangle, rigid_sphere
from fcsim.mesh.material import saint_venant_kirchhoff
from tests.analytic.references.loading import displacement
from tests.analytic.references.meshes import block, spaced

ANY = Limits(rotation=np.inf, strain=np.inf)


def strip(h: float, cells: int) -> Part:
    """1 x h, E I = 1."""
    material = saint_venant_kirchhoff(12 / h**3, 0.0, 1.0)
    return rectangle("strip", (1.0, h), (cells, 1), material, elements="Q2", plane="stress")


def end_of_column(P: float, Q: float) -> tuple[float, float, float]:
    """Angle, x, y of the end of a clamped column of length and E I 1 under the forces P along it and Q across."""
    F, delta = np.hypot(P, Q), np.arctan2(Q, P)

    def beyond(alpha: float) -> float:
        k = np.sin(alpha / 2)
        return float(ellipk(k**2) - ellipkinc(np.arcsin(np.sin(delta / 2) / k), k**2) - np.sqrt(F))

    alpha = brentq(beyond, 1.0001 * delta, np.pi - 1e-6, xtol=1e-13)
    k = np.sin(alpha / 2)

    def along(of: object) -> float:  # sin(phi / 2) = k sin(psi)
        def value(psi: float) -> float:
            s = k * np.sin(psi)
            return float(of(2 * np.arcsin(s) - delta) / np.sqrt(F * (1 - s * s)))  # type: ignore[operator]

        return float(quad(value, np.arcsin(np.sin(delta / 2) / k), np.pi / 2, epsabs=1e-12)[0])

    return alpha - delta, along(np.cos), along(np.sin)


def test_a_column_beyond_its_buckling_load() -> None:
    """S. P. Timoshenko, J. M. Gere, Theory of elastic stability, section 2.7: of a column under 1.015, 1.063, 1.152, 1.293, 1.518 times
    its buckling load the end turns by 20, 40, 60, 80, 100 degrees."""
    euler = np.pi**2 / 4
    assert_allclose(np.degrees([end_of_column(m * euler, 1e-9)[0] for m in (1.063, 1.293, 1.518)]), [40, 80, 100], atol=0.25)
    h, most, across, steps = 0.02, 1.518 * euler, 1e-3, 20
    part = strip(h, 20)
    loads = [Traction("strip", "x+", (-most / h, across / h), lambda t: t)]
    model = build_model([Body("strip", part)], supports=[Support("strip", ("x", "y"), "x-")], loads=loads)
    end = np.unique(part.surfaces["x+"])
    found, expected = [], []
    for step in Simulation(model, Everything(model, mu=0.0), QuasiStatic(1 / steps), steps, limits=ANY, witness=None):
        u = displacement(model, step, "strip")[end]
        found.append((1 + u[:, 0].mean(), u[:, 1].mean()))
        expected.append(end_of_column(step.state.t * most, step.state.t * across)[1:])
    assert_allclose(found, expected, atol=3e-3)


def end_on_drum(R: float, F: float) -> tuple[float, float, float]:
    """The length that lies on the drum, and where the end of a strip of length and E I 1 is, R the radius of its middle line: the tangent
    at the angle b = a / R to the horizontal leaves the drum with the curvature 1 / R, and sin b1 = sin b + E I / (2 F R^2) at the end."""

    def free(b: float, of: object) -> float:
        b1 = np.arcsin(np.sin(b) + 0.5 / (F * R**2))

        def value(s: float) -> float:  # theta = b1 - s^2
            theta = b1 - s * s
            # sin b1 - sin theta = 2 cos((b1 + theta) / 2) sin(s^2 / 2)
            share = np.cos(0.5 * (b1 + theta)) * (np.sinc(0.5 * s * s / np.pi))
            return float(2 * of(theta) / np.sqrt(2 * F * share))  # type: ignore[operator]

        return float(quad(value, 0.0, np.sqrt(b1 - b), epsabs=1e-12)[0])

    top = float(np.arcsin(1 - 0.5 / (F * R**2)))
    b = brentq(lambda b: R * b + free(b, lambda theta: 1.0) - 1, 0.0, top - 1e-9)
    return R * b, R * np.sin(b) + free(b, np.cos), R * (np.cos(b) - 1) - free(b, np.sin)


@pytest.mark.slow
def test_a_strip_wrapped_on_a_drum() -> None:
    """A strip lies on a smooth drum where it is clamped and is bent round it by a dead force at its end: where it lies on the drum its
    curvature is the drum's, and it bears on it where it leaves it."""
    h, R, F, steps, gap = 0.01, 0.5, 6.0, 12, 1e-5
    part = strip(h, 64)
    drum = rigid_sphere("drum", R, (0.0, -R - gap), 1.0)
    supports = [Support("strip", ("x", "y"), "x-"), Support("drum", ("x", "y", "rz"))]
    model = build_model([Body("strip", part), drum], supports=supports, loads=[Traction("strip", "x+", (0.0, -F / h), lambda t: t)])
    *_, last = Simulation(model, ExactContacts(model, 0.0, 0.02), QuasiStatic(1 / steps), steps, limits=ANY)
    u = displacement(model, last, "strip")
    end = u[np.unique(part.surfaces["x+"])].mean(axis=0)
    a, x, y = end_on_drum(R + h / 2, F)
    at = part.points + u
    assert_allclose([1 + end[0], end[1]], [x, y], atol=1e-3)
    inner = at[np.isclose(part.points[:, 1], h / 2) & (part.points[:, 0] < 0.9 * a)]
    assert_allclose(np.hypot(inner[:, 0], inner[:, 1] + R + gap), R + h / 2, atol=1e-3 * R)


def test_the_frame_of_lee() -> None:
    """S. L. Lee, F. S. Manuel, E. C. Rossow (1968); K. H. Schweizerhof, P. Wriggers, CMAME 59 (1986): two legs of 120, 3 x 2, E = 7.2e6,
    nu = 0.3, hinged at both ends, loaded at a fifth of the upper one: limit load 18 552, after which it falls."""
    L, h, cells, steps = 120.0, 2.0, 30, 9

    def at(p: np.ndarray) -> np.ndarray:
        s, n = p[:, 0], -p[:, 1]
        up = np.stack([n, s * (L - n) / L], axis=1)
        along = np.stack([n + (s - L) * (L - n) / L, L - n], axis=1)
        return np.where((s <= L)[:, None], up, along)

    axes = [spaced(0, 2 * L, 2 * cells), spaced(-h / 2, h / 2, 2)]
    part = block("frame", axes, saint_venant_kirchhoff(7.2e6, 0.3, 1.0), "Q2", at, plane="stress", thickness=3.0)
    hinges = [Support("frame", ("x", "y"), at=(0.0, 0.0)), Support("frame", ("x", "y"), at=(L, L))]
    driven = Support("frame", ("y",), at=(L / 5, L), velocity=-54.0)
    model = build_model([Body("frame", part)], supports=[*hinges, driven])
    run = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1 / steps), steps, limits=ANY, witness=None)
    force = []
    for step in run:
        force.append(-step.support_force(driven)[1])
    assert_allclose(max(force), 18552.0, rtol=5e-3)
    assert force[-1] < 0.98 * max(force)
