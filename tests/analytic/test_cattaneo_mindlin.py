"""Partial slip of a cylinder and a sphere on a block of the same material: K. L. Johnson, Contact Mechanics, 1985, section 7.2.

c/a = (1 - Q/(mu P))^(1/2) (cylinder), ^(1/3) (sphere). Forces on the nodes are taken from H r, areas from a unit pressure. c/a is that of
the formula with the same second moments: sum q r^2 / (mu sum p r^2) = 1 - (c/a)^(d + 2). It converges with order 2 in the element h up to
(a/R)^2, the traction, whose slope is infinite at c, with order 1.
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from fcsim.assembly.elasticity import pressure as pressure_load
from fcsim.running.case import CaseScript, load_case

R, E, NU, MU, A = 0.05, 20e9, 0.3, 0.3, 1e-3
CORE = 1.25


@cache
def script() -> CaseScript:
    return load_case(Path(__file__).parents[2] / "cases" / "cattaneo_mindlin")


class Sheared(NamedTuple):
    """A step of the tangential loading: whole P and Q [N]; per node r [m], area [m^2], normal and tangential force [N]."""

    P: float
    Q: float
    r: np.ndarray
    area: np.ndarray
    normal: np.ndarray
    tangential: np.ndarray


@cache
def shear(**parameters: Any) -> list[Sheared]:
    p = script().parameters(radius=R, E=E, nu=NU, mu=MU, contact_radius=A, core=CORE, **parameters)
    simulation = script().build(p).simulation
    body = simulation.model.deformable[0]
    assert body.name == "round"
    d, nodes = simulation.model.dimension, np.unique(body.part.surfaces["contact"])
    area = np.linalg.norm(pressure_load(body.part, "contact", 1.0).reshape(-1, d), axis=1)[nodes]
    x = body.points[nodes]
    records = []
    for step in simulation:
        assert step.result.error <= 1e-8 and len(step.attempts) == 1
        f = (step.H @ step.result.r)[: d * len(body.points)].reshape(-1, d)[nodes]
        if step.number > p.steps / 2:
            whole = 2 if d == 3 else 1  # the plane y = 0 cuts the sphere in two
            r = np.linalg.norm(x[:, :-1], axis=1)
            records.append(Sheared(whole * f[:, -1].sum(), -whole * f[:, 0].sum(), r, area, f[:, -1], -f[:, 0]))
    return records


def ratios(d: int, one: Sheared) -> tuple[float, float]:
    """c/a from the nodal forces and from Q/(mu P)."""
    measured = 1 - (one.tangential @ one.r**2) / (MU * (one.normal @ one.r**2))
    return float(measured ** (1 / (d + 2))), float((1 - one.Q / (MU * one.P)) ** (1 / d))


def traction_error(d: int, one: Sheared) -> float:
    """L2 norm of the traction's error on the contact, relative to that of mu p."""
    modulus = E / (1 - NU**2) / 2
    a = (0.75 * one.P * R / modulus) ** (1 / 3) if d == 3 else (4 * one.P * R / (np.pi * modulus)) ** 0.5
    p0 = 1.5 * one.P / (np.pi * a**2) if d == 3 else 2 * one.P / (np.pi * a)
    c = a * ratios(d, one)[1]
    largest = MU * p0 * np.sqrt(np.maximum(1 - (one.r / a) ** 2, 0))
    exact = largest - MU * p0 * np.sqrt(np.maximum(c**2 - one.r**2, 0)) / a
    # both sides of the middle together: the inclination of the surface, up to a/R, adds p x/R on one side and takes it from the other
    mean = np.array([one.tangential[np.isclose(one.r, r)].sum() / one.area[np.isclose(one.r, r)].sum() for r in one.r])
    return float(np.sqrt(one.area @ (mean - exact) ** 2 / (one.area @ largest**2)))


def check(d: int, records: list[Sheared], divisions: int) -> tuple[float, float]:
    """Root mean squares of both errors over the steps, within what the mesh allows."""
    h = CORE / divisions  # element / contact radius
    found = [ratios(d, one) for one in records]
    assert np.all(np.diff([exact for _, exact in found]) < 0)  # Q grows
    ratio = np.sqrt(np.mean([(measured - exact) ** 2 for measured, exact in found]))
    traction = np.sqrt(np.mean([traction_error(d, one) ** 2 for one in records]))
    assert ratio <= 0.25 * h**2 + (A / R) ** 2
    assert traction <= 0.3 * h
    return ratio, traction


def test_cylinder() -> None:
    coarse, fine = (check(2, shear(divisions=n), n) for n in (8, 16))
    assert np.log2(coarse[0] / fine[0]) > 1.5
    assert np.log2(coarse[1] / fine[1]) == pytest.approx(1, abs=0.3)
    first, last = shear(divisions=16)[0], shear(divisions=16)[-1]
    assert 0.5 < last.Q / (MU * last.P) < 0.9  # a good part slips
    assert abs(last.P - first.P) <= 1e-4 * first.P  # like bodies: pushing sideways does not change P


def test_cylinder_sticks_inside_and_slips_outside() -> None:
    """Nodes farther than an element inside c hold less than mu p, those farther than an element outside hold mu p.

    The bound on q/(mu p) inside is the formula's at the distance c - h, so the test would fail with the whole contact slipping.
    """
    d, n = 2, 16
    for one in shear(divisions=n)[3:]:
        h, c = CORE * A / n, A * ratios(d, one)[1]
        closed = one.normal > 1e-3 * one.normal.max()
        share = one.tangential / np.where(closed, MU * one.normal, np.inf)
        inside, outside = one.r < c - h, closed & (one.r > c + h)
        assert inside.any() and outside.any()
        rim = 1 - np.sqrt((2 * c * h - h**2) / (A**2 - (c - h) ** 2))
        assert share[inside].max() <= rim + 0.15
        assert share[outside] == pytest.approx(1, abs=1 / MU * A / R)  # mu p along the inclined surface


def test_sphere() -> None:
    check(3, shear(contact="sphere", shear=4.5e-6, divisions=4), 4)
