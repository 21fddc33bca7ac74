"""Hertz's contact against the formulas of K. L. Johnson, Contact Mechanics, 1985, and the benchmark SSNV104 of code_aster.

All is computed here from nodal forces and positions alone. The formulas take the bodies for half-spaces: what remains under refinement
is of the order (a/R)^2 where the force is given, and a/R where the approach is, since points at a distance R are not at rest.
Errors are root mean squares over the upper half of the load steps, since they depend on where the edge of the contact falls in an element.
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from fcsim.assembly.elasticity import pressure as pressure_load
from fcsim.running.case import CaseScript, load_case

R, E, NU = 0.05, 20e9, 0.3


@cache
def script() -> CaseScript:
    return load_case(Path(__file__).parents[2] / "cases" / "hertz")


class Loaded(NamedTuple):
    """A step: approach [m], resultant of the whole contact [N], radius from the forces' second moment [m], nodal (r, pressure, area)."""

    approach: float
    force: float
    radius: float
    r: np.ndarray
    pressure: np.ndarray
    area: np.ndarray


@cache
def load(**parameters: Any) -> list[Loaded]:
    """Forces by (H r) on the upper body's nodes; areas by the resultants of a unit pressure on them."""
    p = script().parameters(radius=R, E=E, nu=NU, **parameters)
    simulation = script().build(p).simulation
    model = simulation.model
    body = model.deformable[0]
    d, nodes = model.dimension, np.unique(body.part.surfaces["contact"])
    area = np.linalg.norm(pressure_load(body.part, "contact", 1.0).reshape(-1, d), axis=1)[nodes]
    r = np.linalg.norm(body.points[nodes, :-1], axis=1)
    records = []
    for step in simulation:
        if step.number <= p.steps / 2:
            continue
        on_body = (step.H @ step.result.r)[: d * len(body.points)].reshape(-1, d)
        assert np.abs(np.delete(on_body, nodes, axis=0)).max() == 0
        f = on_body[nodes]
        normal = np.linalg.norm(f, axis=1)
        # both models are cut by planes of symmetry: a quarter in 3D, a half in 2D
        P = f[:, -1].sum() * 2 ** (d - 1)
        radius = np.sqrt({3: 5 / 2, 2: 4}[d] * (normal @ r**2) / normal.sum())
        records.append(Loaded(step.state.t * p.approach, P, float(radius), r, normal / area, area))
    return records


def formula(d: int, P: float, radius: float = R, modulus: float = E / (1 - NU**2)) -> tuple[float, float]:
    """(a, p0): a^3 = 3 P R / (4 E*), p0 = 3 P / (2 pi a^2); a cylinder: a^2 = 4 P R / (pi E*), p0 = 2 P / (pi a)."""
    a = (0.75 * P * radius / modulus) ** (1 / 3) if d == 3 else (4 * P * radius / (np.pi * modulus)) ** 0.5
    return a, (1.5 * P / (np.pi * a**2) if d == 3 else 2 * P / (np.pi * a))


def errors(d: int, records: list[Loaded], **relative: float) -> np.ndarray:
    """Relative errors of the radius, of the pressure in the middle and of the pressure in the L2 norm over the surface, for the force."""
    found = []
    for one in records:
        a, p0 = formula(d, one.force, **relative)
        exact = p0 * np.sqrt(np.maximum(1 - (one.r / a) ** 2, 0))
        norm = np.sqrt(one.area @ (one.pressure - exact) ** 2 / (one.area @ exact**2))
        found.append((one.radius / a - 1, one.pressure[np.argmin(one.r)] / p0 - 1, norm))
    return np.sqrt(np.mean(np.square(found), axis=0))


def test_cylinder_on_a_plane_converges() -> None:
    """a/R = 0.02; radius and largest pressure with order 2, the pressure, whose slope is infinite at the edge, with order 1."""
    divisions = (4, 8, 16)
    found = [errors(2, load(contact="cylinder", approach=4.8e-5, divisions=n, steps=60)) for n in divisions]
    slopes = np.polyfit(np.log(divisions), np.log(found), 1)[0]
    assert -slopes == pytest.approx([2, 2, 1], abs=0.3), f"slopes {slopes} of {found}"
    h = 1.25 / np.array(divisions)  # element / contact radius at the last step
    assert np.all(np.array(found) <= np.outer(h, [0.5, 0.5, 0.5]) * np.stack([h, h, np.ones_like(h)], axis=1)), found


def test_cylinder_on_a_plane_approaches_as_between_two_planes() -> None:
    """delta = P (1 - nu^2) / (pi E) (2 ln(4 R / a) - 1), Johnson eq. 5.57 for one of two contacts: exact for a disk but for (a/R)^2."""
    for aspect, approach in ((0.02, 4.8e-5), (0.05, 2.4e-4)):
        for one in load(contact="cylinder", approach=approach, divisions=16, steps=60)[-3:]:
            a, _ = formula(2, one.force)
            assert a / R == pytest.approx(aspect, rel=0.05)
            assert one.approach == pytest.approx(one.force * (1 - NU**2) / (np.pi * E) * (2 * np.log(4 * R / a) - 1), rel=2e-3)


def test_sphere_on_a_plane_converges() -> None:
    """a/R = 0.02; the errors as of the cylinder, and the approach delta = a^2 / R but for a/R."""
    divisions = (3, 6)
    found = [errors(3, load(approach=2e-5, divisions=n, steps=40)) for n in divisions]
    orders = np.log2(found[0] / found[1])
    assert orders[0] == pytest.approx(2, abs=0.5) and orders[2] == pytest.approx(1, abs=0.3), f"orders {orders} of {found}"
    h = 1.25 / 6
    assert np.all(found[1] <= [0.5 * h**2, 0.5 * h**2, 0.5 * h]), found
    last = load(approach=2e-5, divisions=6, steps=40)[-1]
    a, _ = formula(3, last.force)
    assert 0 < a**2 / R / last.approach - 1 < a / R
    assert last.force / (4 / 3 * E / (1 - NU**2) * np.sqrt(R) * last.approach**1.5) == pytest.approx(1, abs=1.5 * a / R)


def test_two_spheres() -> None:
    """SSNV104: R = 50 mm, approach h = 4 mm: p0 = E/(pi (1 - nu^2)) sqrt(2 h/R) = 2798.3 MPa, a = sqrt(R h/2) = 10 mm, a/R = 0.2.

    With a force P given the formulas hold to (a/R)^2 and the mesh. With the approach of the middle planes given, the deviation is
    proportional to a/R: half of it, and more, is gone at a quarter of the approach, where a/R is half.
    """
    deviations = []
    for h, p0_table, a_table in ((4e-3, 2798.3e6, 10e-3), (1e-3, 2798.3e6 / 2, 5e-3)):
        records = load(contact="two-spheres", approach=h, divisions=6, steps=3)
        last = records[-1]
        assert p0_table == pytest.approx(E / (np.pi * (1 - NU**2)) * np.sqrt(2 * h / R), rel=1e-4)
        mesh = 0.5 * (1.25 / 6) ** 2
        assert np.all(errors(3, records, radius=R / 2, modulus=E / (1 - NU**2) / 2)[:2] <= mesh + (a_table / R) ** 2)
        found = last.pressure[np.argmin(last.r)] / p0_table - 1, last.radius / a_table - 1
        assert np.all(np.abs(found) <= 0.25 * a_table / R + mesh), found
        deviations.append(np.array(found))
    assert deviations[1] / deviations[0] == pytest.approx(0.5, abs=0.2)
