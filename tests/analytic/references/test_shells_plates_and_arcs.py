"""Thin bodies as solids: twisted beam, shell roof, plates and arcs bent far; NAFEMS' membranes; a plastic sphere; a bar that relaxes."""

from typing import Any

import numpy as np
import pytest
import scipy.sparse.linalg as spla
from numpy.testing import assert_allclose

from fcsim import BodyForce, FormLoad, Material, Support, Traction
from fcsim.assembly import elasticity
from fcsim.assembly.stress import stress_at
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.material import Plastic, Viscoelastic, saint_venant_kirchhoff
from fcsim.mesh.part import Part
from tests.analytic.references.loading import alone, displacement, support_force
from tests.analytic.references.meshes import block, spaced


def nearest(part: Part, place: tuple[float, ...]) -> int:
    return int(np.argmin(np.linalg.norm(part.points - place, axis=1)))


@pytest.mark.parametrize(("elements", "cells"), [("Q1-enhanced", (24, 4, 2)), ("Q2", (12, 2, 1))])
def test_twisted_beam(elements: str, cells: tuple[int, int, int]) -> None:
    """R. H. MacNeal and R. L. Harder, "A proposed standard set of problems to test finite element accuracy", 1985: 12 x 1.1 x 0.32, twisted
    by 90 degrees, E 29e6, nu 0.22; a unit force moves the tip by 5.424e-3 in its plane, by 1.754e-3 across."""
    L, w, t = 12.0, 1.1, 0.32

    def at(p: np.ndarray) -> np.ndarray:
        a = 0.5 * np.pi * p[:, 0] / L
        return np.stack([p[:, 0], p[:, 1] * np.cos(a) - p[:, 2] * np.sin(a), p[:, 1] * np.sin(a) + p[:, 2] * np.cos(a)], axis=1)

    axes = [spaced(0, L, cells[0]), spaced(-w / 2, w / 2, cells[1]), spaced(-t / 2, t / 2, cells[2])]
    part = block("body", axes, Material(29e6, 0.22, 1.0), elements, at)
    tip = np.isclose(part.points[:, 0], L)
    for k, published in ((2, 5.424e-3), (1, 1.754e-3)):
        force = np.zeros(3)
        force[k] = 1 / (w * t)
        model, steps = alone(part, [Support("body", ("x", "y", "z"), "x-")], [Traction("body", "x+", tuple(force))])
        assert_allclose(displacement(model, steps[-1], "body")[tip, k].mean(), published, rtol=6e-3)


def test_scordelis_lo_roof() -> None:
    """A. C. Scordelis and K. S. Lo, 1964 (MacNeal and Harder's data): R 25, L 50, t 0.25, 80 degrees, E 4.32e8, nu 0, 90 per area, ends on
    diaphragms: 0.3024 in the middle of the free edge by shallow shells, 0.3006 by deep ones."""
    R, L, t, edge = 25.0, 25.0, 0.25, np.radians(40)

    def at(p: np.ndarray) -> np.ndarray:
        return np.stack([(R + p[:, 2]) * np.sin(edge * p[:, 0]), p[:, 1], (R + p[:, 2]) * np.cos(edge * p[:, 0])], axis=1)

    axes = [spaced(0, 1, 16), spaced(0, L, 16), spaced(-t / 2, t / 2, 1)]
    part = block("body", axes, Material(4.32e8, 0.0, 1.0), "Q1-enhanced", at)
    supports = [Support("body", ("x",), "x-"), Support("body", ("y",), "y-"), Support("body", ("x", "z"), "y+")]
    model, steps = alone(part, supports, [BodyForce("body", (0.0, 0.0, -90 / t))])
    middle = [nearest(part, (r * np.sin(edge), 0.0, r * np.cos(edge))) for r in (R - t / 2, R + t / 2)]
    assert_allclose(-displacement(model, steps[-1], "body")[middle, 2].mean(), 0.3006, rtol=5e-3)


@pytest.mark.parametrize(("elements", "n", "off"), [("Q2", 8, 0.006), ("Q1-enhanced", 16, 0.012)])
def test_nafems_le1_elliptic_membrane(elements: str, n: int, off: float) -> None:
    """sigma_yy = 92.7 MPa at (2, 0): ellipses of half axes 2, 1 and 3.25, 2.75 m, pulled outwards by 10 MPa."""

    def at(p: np.ndarray) -> np.ndarray:
        a = 0.5 * np.pi * p[:, 1]
        inner, outer = (np.stack([x * np.cos(a), y * np.sin(a)], axis=1) for x, y in ((2.0, 1.0), (3.25, 2.75)))
        return inner + (outer - inner) * p[:, :1]

    material = Material(210e9, 0.3, 7800.0)
    part = block("body", [spaced(0, 1, n), spaced(0, 1, n)], material, elements, at, plane="stress", thickness=0.1)
    supports = [Support("body", ("y",), "y-"), Support("body", ("x",), "y+")]

    def pull(p: Any) -> Any:
        import ufl

        return 10e6 * ufl.inner(p.normal, p.v) * p.ds("x+")

    model, steps = alone(part, supports, [FormLoad("body", pull)])
    node = nearest(part, (2.0, 0.0))
    cell = int(np.flatnonzero((part.cells == node).any(axis=1))[0])
    corner = CELL_TYPES[part.cell_type].nodes[list(part.cells[cell]).index(node)][None]
    stress = (stress_at(part, corner) @ displacement(model, steps[-1], "body").ravel()).reshape(-1, 6)
    assert_allclose(stress[cell, 1], 92.7e6, rtol=off)


def test_nafems_fv32_tapered_membrane() -> None:
    """A cantilever 10 m long, 5 to 1 m wide, E 200 GPa, nu 0.3, 8000 kg/m^3: six frequencies."""

    def at(p: np.ndarray) -> np.ndarray:
        return np.stack([p[:, 0], p[:, 1] * (2.5 - 0.2 * p[:, 0])], axis=1)

    part = block("body", [spaced(0, 10, 16), spaced(-1, 1, 8)], Material(200e9, 0.3, 8000.0), "Q2", at, plane="stress", thickness=0.05)
    free = np.repeat(~np.isin(np.arange(len(part.points)), part.surfaces["x-"]), 2)
    K, M = (A[free][:, free].tocsc() for A in (elasticity.stiffness(part), elasticity.consistent_mass(part)))
    squares = np.sort(spla.eigsh(K, 6, M, sigma=0)[0])
    assert_allclose(np.sqrt(squares) / (2 * np.pi), [44.623, 130.03, 162.70, 246.05, 379.90, 391.44], rtol=2e-4)


@pytest.mark.slow
def test_arc_of_45_degrees_bent_out_of_its_plane() -> None:
    """K.-J. Bathe and S. Bolourchi, 1979: R 100, a square of 1 x 1, E 1e7, nu 0, 300 and 600 across at its end, which comes to (58.84,
    22.33, 40.08) and (47.23, 15.79, 53.37) of beams (J. C. Simo and L. Vu-Quoc, 1986)."""
    R = 100.0

    def at(p: np.ndarray) -> np.ndarray:
        a = np.pi / 4 * p[:, 0]
        return np.stack([(R - p[:, 1]) * np.sin(a), R - (R - p[:, 1]) * np.cos(a), p[:, 2]], axis=1)

    axes = [spaced(0, 1, 32), spaced(-0.5, 0.5, 1), spaced(-0.5, 0.5, 1)]
    part = block("body", axes, saint_venant_kirchhoff(1e7, 0.0, 1.0), "Q2", at)
    load = Traction("body", "x+", (0.0, 0.0, 600.0), factor=lambda t: t)
    model, steps = alone(part, [Support("body", ("x", "y", "z"), "x-")], [load], 6)
    end = np.unique(part.surfaces["x+"])
    for step, published in ((steps[2], (58.84, 22.33, 40.08)), (steps[5], (47.23, 15.79, 53.37))):
        assert_allclose((part.points + displacement(model, step, "body"))[end].mean(axis=0), published, atol=0.2)


def test_clamped_square_plate_bent_by_twice_its_thickness() -> None:
    """S. Levy, "Square plate with clamped edges under normal pressure producing large deflections", NACA report 740, 1942: nu 0.316,
    p a^4 / (E h^4) = 17.79, 63.4, 184, 402 bend its middle by 0.237, 0.695, 1.323, 1.902 h. (A linear plate: 0.24, 0.88, 2.5, 5.6.)"""
    a, h, E = 1.0, 0.01, 1e9
    loads = np.array([0.0, 17.79, 63.4, 184.0, 402.0])
    axes = [spaced(0, a / 2, 6, 0.85), spaced(0, a / 2, 6, 0.85), spaced(-h / 2, h / 2, 1)]
    part = block("body", axes, saint_venant_kirchhoff(E, 0.316, 1.0), "Q2")
    supports = [Support("body", ("x",), "x-"), Support("body", ("y",), "y-")]
    supports += [Support("body", ("x", "y", "z"), side) for side in ("x+", "y+")]
    pressure = BodyForce("body", (0.0, 0.0, E * h**3 / a**4), factor=lambda t: float(np.interp(4 * t, np.arange(5), loads)))
    model, steps = alone(part, supports, [pressure], 4)
    middle = nearest(part, (0.0, 0.0, 0.0))
    found = [displacement(model, step, "body")[middle, 2] / h for step in steps]
    assert_allclose(found, [0.237, 0.695, 1.323, 1.902], rtol=0.03)
    assert not [text for step in steps for text in step.remarks if "bent" in text]


def test_hollow_sphere_half_plastic() -> None:
    """R. Hill, The mathematical theory of plasticity, 1950, chapter 5: plastic to c, p = 2 sy ln(c/a) + 2/3 sy (1 - c^3/b^3), and
    u(b) = (1 - nu) sy c^3 / (E b^2); a pyramid of the sphere between planes through its centre, on oblique rollers."""
    a, b, c, E, nu, sy, t = 1.0, 2.0, 1.5, 1000.0, 0.3, 1.0, 0.2
    p = 2 * sy * np.log(c / a) + 2 / 3 * sy * (1 - c**3 / b**3)

    def at(q: np.ndarray) -> np.ndarray:
        along = np.stack([np.ones(len(q)), np.tan(t * q[:, 1]), np.tan(t * q[:, 2])], axis=1)
        place: np.ndarray = q[:, :1] * along / np.linalg.norm(along, axis=1)[:, None]
        return place

    part = block("body", [spaced(a, b, 16), spaced(0, 1, 1), spaced(0, 1, 1)], Plastic(E, nu, 1.0, sy), "Q2", at)
    cos, sin = np.cos(t), np.sin(t)
    supports = [
        Support("body", ("y",), "y-"),
        Support("body", ("z",), "z-"),
        Support("body", ("y",), "y+", axes=np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])),
        Support("body", ("z",), "z+", axes=np.array([[cos, 0, -sin], [0, 1, 0], [sin, 0, cos]])),
    ]

    def press(q: Any) -> Any:
        import ufl

        return -p * ufl.inner(q.normal, q.v) * q.ds("x-")

    model, steps = alone(part, supports, [FormLoad("body", press, factor=lambda t: t)], 8)
    u, outer = displacement(model, steps[-1], "body"), np.isclose(np.linalg.norm(part.points, axis=1), b)
    radial = np.einsum("ij,ij->i", u, part.points)[outer] / b
    assert_allclose(radial, (1 - nu) * sy * c**3 / (E * b**2), rtol=1e-4)


def test_a_bar_of_prony_series_relaxes() -> None:
    """Pulled within a step and held: with K constant and G(t) = G (1 - g + g exp(-t / tau)) the bar's modulus has the transform
    9 K G / (3 K + G) of p G~(p), which is one exponential of the rate (3 K + G_inf) / (3 K + G_0) / tau."""
    E, nu, g, tau, pull = 1000.0, 0.3, 0.4, 2.0, 1e-3
    K, G0 = E / (3 * (1 - 2 * nu)), E / (2 * (1 + nu))
    Ginf, h, n = (1 - g) * G0, 0.05, 60
    drawn = Support("body", ("x",), "x+", velocity=lambda t: n * pull if n * t < 0.999 else 0.0)
    supports = [Support("body", ("x",), "x-"), Support("body", ("y",), "y-"), drawn]
    scale = n * h  # `alone` ends at t = 1: the times of the law in that unit
    part = block("body", [spaced(0, 1, 2), spaced(0, 1, 2)], Viscoelastic(E, nu, 1.0, ((g, tau / scale),)), "Q1", plane="stress")
    model, steps = alone(part, supports, [], n)
    force = np.array([support_force(model, step, "body")[np.unique(part.surfaces["x+"]), 0].sum() for step in steps])
    first, last = (9 * K * G / (3 * K + G) for G in (G0, Ginf))
    rate = (3 * K + Ginf) / (3 * K + G0) / tau
    t, r = h * np.arange(1, n + 1), rate * h
    # a ramp over the first step: the mean of the exponential over it
    exact = pull * (last + (first - last) * (1 - np.exp(-r)) / r * np.exp(-rate * (t - h)))
    assert_allclose(force, exact, rtol=1e-5)
