"""Line and point contact against Johnson's formulas with the numbers of published problems (A2, A3, A4, A5, A14); plane strain.

Forces are given: the approach of the clamped planes is found by secants. The formulas are those of half-spaces: what a mesh of any
fineness leaves is of the order (a/R)^2. Source: K. L. Johnson, Contact mechanics, 1985, chapters 4 and 7.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import brentq

from fcsim.assembly.elasticity import pressure as unit_pressure
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import ExactContacts
from fcsim.mesh.exact.rigid_shapes import rigid_plane
from fcsim.mesh.graded import graded_rectangle, half_ball, half_disk
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part
from fcsim.timestep.step import Step
from tests.analytic.references.loading import contact_force, held, loaded, pair, support_force


class Pressed(NamedTuple):
    """Of the upper body's contact: force [N] of the meshed part, radius by the forces' second moment, nodes' x, pressure and traction."""

    force: float
    shear: float
    radius: float
    x: np.ndarray
    pressure: np.ndarray
    traction: np.ndarray


def measured(model: Model, step: Step, moment: float) -> Pressed:
    """moment: force r^2 / radius^2 of the formula's pressure, 1/4 in 2D, 2/5 in 3D."""
    body = model.deformable[model.number["upper"]]
    nodes = np.unique(body.part.surfaces["contact"])
    f = contact_force(model, step, "upper")[nodes]
    x = body.points[nodes, :-1]
    area = np.linalg.norm(unit_pressure(body.part, "contact", 1.0).reshape(-1, model.dimension), axis=1)[nodes]
    normal = f[:, -1]
    radius = np.sqrt((normal @ np.square(x).sum(axis=1)) / normal.sum() / moment)
    return Pressed(float(normal.sum()), float(f[:, 0].sum()), float(radius), x[:, 0], normal / area, -f[:, 0] / area)


def until(target: float, of: Callable[[float], float], guess: float) -> float:
    """The argument at which an increasing function is `target`, by secants from zero."""
    a, fa, b = 0.0, 0.0, guess
    for _ in range(8):
        fb = of(b)
        if abs(fb / target - 1) < 1e-6:
            break
        a, fa, b = b, fb, b + (target - fb) * (b - a) / (fb - fa)
    return b


def two_bodies(
    upper: Part, lower: Part, mu: float, down: float, aside: float = 0.0, presses: int = 1, shears: int = 0
) -> tuple[Model, list[Step]]:
    """The middle of the upper body goes down in some steps, then aside in `shears`; symmetry on "x-", "y-" where there are such planes."""
    d = upper.dimension
    across, along = tuple("xy"[: d - 1]), "xyz"[d - 1]
    supports = [Support(part.name, (axis,), axis + "-") for part in (upper, lower) for axis in across if axis + "-" in part.surfaces]
    supports += [
        Support("lower", (*across, along), "base" if "base" in lower.surfaces else "middle"),
        Support("upper", (along,), "middle", velocity=lambda t: -down / presses if t < presses else 0.0),
        Support("upper", across, "middle", velocity=(lambda t: aside / shears if t > presses else 0.0) if shears else 0.0),
    ]
    model = build_model([Body("upper", upper), Body("lower", lower)], supports=supports)
    one = pair(model, ("upper", "contact"), ("lower", "contact"), mu, alert=float(upper.points.max()))
    return model, loaded(model, [one], presses + shears, last=float(presses + shears))


def pressed_with(force: float, upper: Part, lower: Part, guess: float, moment: float = 0.25, presses: int = 1) -> Pressed:
    """Both pressed without friction by a force [N] on their meshed parts, in some steps."""

    @cache
    def at(down: float) -> Pressed:
        model, steps = two_bodies(upper, lower, 0.0, down, presses=presses)
        return measured(model, steps[-1], moment)

    return at(until(force, lambda down: at(down).force, guess))


def hertz_line(P: float, R: float, modulus: float) -> tuple[float, float]:
    a = np.sqrt(4 * P * R / (np.pi * modulus))
    return a, 2 * P / (np.pi * a)


MESH = 0.5 * (1.3 / 16) ** 2
"""What 16 elements over 1.3 contact radii leave."""


def compare(one: Pressed, a: float, p0: float, tolerance: float) -> None:
    middle = one.pressure[np.argmin(np.abs(one.x))]
    assert_allclose([one.radius, middle], [a, p0], rtol=tolerance)


@pytest.mark.parametrize("share", [1.0, 1 / 16])
def test_A2_cylinder_on_a_block(share: float) -> None:
    """NAFEMS CB1, code_aster ssnp154: R 50, E 210e3 on a block of 200 x 200 with E 70e3, nu 0.3, 35 kN/mm: p0 3585.4, a 6.215; and a
    sixteenth of the force, with which a / R is a quarter."""
    a, p0 = hertz_line(share * 35e3, 50.0, 1 / (0.91 / 210e3 + 0.91 / 70e3))
    assert_allclose([a, p0], [6.215 * share**0.5, 3585.4 * share**0.5], rtol=2e-4)
    upper = half_disk("upper", 50.0, 1.3 * a, 16, Material(210e3, 0.3, 1.0))
    lower = graded_rectangle("lower", 200.0, 1.3 * a, 16, Material(70e3, 0.3, 1.0))
    compare(pressed_with(share * 17.5e3, upper, lower, 1.3 * share), a, p0, 5e-3)


@pytest.mark.parametrize("share", [1.0, pytest.param(1 / 16, marks=pytest.mark.slow)])
def test_A3_two_cylinders(share: float) -> None:
    """VM191: R 10 (E 30000, nu 0.25) on R 13 (E 29120, nu 0.3), 3200 N/mm: half width 1.1997 mm, p0 1698.1; and a sixteenth. In
    eight steps: those of one step are paired along the normals of the beginning, which miss each other by 0.013 of the radius at full load
    (found then: -1.6 and 1.2 %). CalculiX on the same mesh: -0.1 and 0.1 %."""
    modulus = 1 / ((1 - 0.0625) / 30000 + 0.91 / 29120)
    a, p0 = hertz_line(share * 3200.0, 1 / (1 / 10 + 1 / 13), modulus)
    assert_allclose([a, p0], [1.1997 * share**0.5, 1698.1 * share**0.5], rtol=2e-4)
    upper = half_disk("upper", 10.0, 1.3 * a, 16, Material(30000, 0.25, 1.0))
    lower = half_disk("lower", 13.0, 1.3 * a, 16, Material(29120, 0.3, 1.0), side="below")
    compare(pressed_with(share * 1600.0, upper, lower, 0.4 * share, presses=8), a, p0, 5e-3)


@pytest.mark.slow
def test_A4_partial_slip() -> None:
    """VM272, Yang, Laursen, Meng: two half disks R 8, E 200, nu 0.3, mu 0.2, P 10, Q 0.93622: b 0.68078, p0 9.3514, c 0.49650 and the
    traction mu p0 / b (sqrt(b^2 - x^2) - sqrt(c^2 - x^2)), 0.5063 in the middle, 1.2796 at c."""
    b, p0 = hertz_line(10.0, 4.0, 200 / 0.91 / 2)
    Q, mu = 0.93622, 0.2
    c = b * np.sqrt(1 - Q / (mu * 10))
    assert_allclose([b, p0, c], [0.68078, 9.3514, 0.49650], rtol=2e-4)

    def exact(x: np.ndarray) -> np.ndarray:
        return mu * p0 / b * (np.sqrt(np.maximum(b**2 - x**2, 0)) - np.sqrt(np.maximum(c**2 - x**2, 0)))

    assert_allclose(exact(np.array([0.0, c])), [0.5063, 1.2796], rtol=2e-4)
    upper = half_disk("upper", 8.0, 1.25 * b, 16, Material(200.0, 0.3, 1.0), whole="x")
    lower = half_disk("lower", 8.0, 1.25 * b, 16, Material(200.0, 0.3, 1.0), whole="x", side="below")
    down = until(10.0, lambda down: measured(*last(two_bodies(upper, lower, mu, down)), 0.25).force, 0.2)
    model, steps = two_bodies(upper, lower, mu, down, 0.032, 12, 16)  # faces that become flat: normals are those of a step's beginning
    records = [measured(model, step, 0.25) for step in steps[12:]]
    shears = np.array([-one.shear for one in records])
    k = int(np.searchsorted(shears, Q))
    share = (Q - shears[k - 1]) / (shears[k] - shears[k - 1])
    before, after = records[k - 1 : k + 1]
    assert abs(after.force / 10 - 1) < 1e-3  # like bodies: shear changes no pressure
    q = (1 - share) * before.traction + share * after.traction
    # the inclination of the surfaces adds p x / R on one side and takes it from the other
    order = np.argsort(after.x)
    x, q, p = after.x[order], q[order], after.pressure[order]
    q, p = 0.5 * (q + q[::-1]), 0.5 * (p + p[::-1])
    assert_allclose(q[np.argmin(np.abs(x))], 0.5063, rtol=0.01)
    off = q - exact(x)  # its slope is infinite at c: of order one in the elements
    assert np.sqrt(off @ off / (mu * p @ (mu * p))) < 0.6 * 1.25 / 16
    stuck = 1 - (q @ x**2) / (mu * p @ x**2)
    assert_allclose(b * stuck**0.25, 0.49650, rtol=0.01)


@pytest.mark.slow
def test_A5_hemispheres() -> None:
    """Two hemispheres R 6.1237 m, E 1e8 and 1e6, nu 0.29, 117 808.8 N: a 0.6302 m, p0 1.4164e5 Pa."""
    modulus = 1 / ((1 - 0.29**2) * (1e-8 + 1e-6))
    a, p0 = hertz_point(117808.8, 6.1237 / 2, modulus)
    assert_allclose([a, p0], [0.6302, 1.4164e5], rtol=2e-4)
    upper = half_ball("upper", 6.1237, 1.3 * a, 8, Material(1e6, 0.29, 1.0))
    lower = half_ball("lower", 6.1237, 1.3 * a, 8, Material(1e8, 0.29, 1.0), side="below")
    one = pressed_with(117808.8 / 4, upper, lower, 0.15, 0.4)
    compare(one, a, p0, 4 * MESH + 2 * (a / 6.1237) ** 2)


@pytest.mark.slow
def test_A5_two_spheres() -> None:
    """code_aster ssnv104: spheres R 50, E 20000, nu 0.3, p0 2798.3 and a 10, which is for an approach of 4 (a / R = 0.2); and a 64th of
    the force, a quarter of both."""
    for share in (1.0, 1 / 64):
        size = share ** (1 / 3)
        a, p0 = hertz_point(share * 5.8607e5, 25.0, 20000 / 0.91 / 2)
        assert_allclose([a, p0], [10.0 * size, 2798.3 * size], rtol=2e-4)
        balls = [half_ball(side, 50.0, 1.3 * a, 8, Material(20000.0, 0.3, 1.0), side=side) for side in ("above", "below")]
        upper, lower = (replace(ball, name=name) for ball, name in zip(balls, ("upper", "lower"), strict=True))
        compare(pressed_with(share * 5.8607e5 / 4, upper, lower, 4.0 * size**2, 0.4), a, p0, 4 * MESH + 2 * (a / 50) ** 2)


@pytest.mark.slow
def test_A5_rigid_sphere() -> None:
    """MOOSE: a rigid sphere R 2 pressed by 0.01 on an elastic one of R 2, E 1.40625e7, nu 0.25: a 0.1, p0 9.549e5, F 2.0e4. What is
    pressed by the approach deviates with a/R, since the middle of the sphere is not at infinity; by the force with its square."""
    E, nu = 1.40625e7, 0.25
    a, p0 = hertz_point(2.0e4, 1.0, E / (1 - nu**2))
    assert_allclose([a, p0], [0.1, 9.549e5], rtol=2e-4)
    lower = half_ball("lower", 2.0, 1.3 * a, 8, Material(E, nu, 1.0), side="below")
    upper = half_ball("upper", 2.0, 1.3 * a, 8, Material(1e6 * E, nu, 1.0))
    compare(pressed_with(2.0e4 / 4, upper, lower, 0.01, 0.4), a, p0, 4 * MESH + 2 * (a / 2) ** 2)
    model, steps = two_bodies(upper, lower, 0.0, 0.01)
    assert_allclose(4 * measured(model, steps[-1], 0.4).force, 2.0e4, rtol=1.5 * a / 2 + 4 * MESH)


def last(run: tuple[Model, list[Step]]) -> tuple[Model, Step]:
    return run[0], run[1][-1]


def hertz_point(P: float, R: float, modulus: float) -> tuple[float, float]:
    a = (0.75 * P * R / modulus) ** (1 / 3)
    return a, 1.5 * P / (np.pi * a**2)


@pytest.mark.slow
def test_A14_half_disk_pressed_on_a_plane_and_slid() -> None:
    """MOOSE's hertz_cyl: half a disk R 3, E 1e6, nu 0.3, its flat side held, pressed by 0.002 on a rigid plane and slid by 0.0014 without
    friction: 716.81, contact pressure 9106.4 in the middle. (Half width 0.050 and pressure give the radius 3 of a plane.) Johnson's
    equation 5.57, delta = P (1 - nu^2) / (pi E) (2 ln(4 R / a) - 1), whose flat side is free to widen, has 690."""

    def approach(P: float) -> float:
        a, _ = hertz_line(P, 3.0, 1e6 / 0.91)
        return float(P * 0.91 / (np.pi * 1e6) * (2 * np.log(12 / a) - 1))

    assert_allclose(brentq(lambda P: approach(P) - 0.002, 1.0, 2000.0), 716.81, rtol=0.04)
    disk = half_disk("disk", 3.0, 0.065, 16, Material(1e6, 0.3, 1.0), whole="x")
    model = build_model(
        [Body("disk", disk, translation=(0.0, 1.0)), rigid_plane("plane", (0.0, 1.0), (0.0, 1.0), size=6.0)],
        supports=[
            held("plane", 2),
            Support("disk", ("x",), "middle", velocity=lambda t: 1.4e-4 if t > 4 else 0.0),
            Support("disk", ("y",), "middle", velocity=lambda t: -5e-4 if t < 4 else 0.0),
        ],
    )
    steps = loaded(model, ExactContacts(model, 0.0, alert=0.02), 14, last=14.0)
    force = np.array([-support_force(model, step, "disk")[:, 1].sum() for step in steps[3:]])
    assert_allclose(force, 716.81, rtol=0.005)
    assert_allclose(force, force[0], rtol=1e-6)
    low = np.unique(disk.surfaces["contact"])
    area = np.linalg.norm(unit_pressure(disk, "contact", 1.0).reshape(-1, 2), axis=1)[low]
    pressure = contact_force(model, steps[3], "disk")[low, 1] / area
    assert_allclose(pressure.max(), 9106.4, rtol=0.01)
