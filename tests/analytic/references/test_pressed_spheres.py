"""Rigid bodies of exact, round shape, pressed into deformable ones: Hertz, Lee and Radok, Johnson's first yield."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from fcsim import Body, ExactContacts, QuasiStatic, Simulation, Support, build_model
from fcsim.mesh import rigid_capsule, rigid_cylinder, rigid_sphere
from fcsim.mesh.material import Material, Plastic, Viscoelastic, saint_venant_kirchhoff
from fcsim.timestep.step import Step
from tests.analytic.references.meshes import block, meridian, spaced, wedge

ANGLE = np.radians(6.0)


def pressed(
    R: float, depth: float, law: Any, elements: str, steps: int, cells: int = 10, far: float = 60.0
) -> tuple[list[Step], np.ndarray]:
    """Steps and forces (steps,) on the whole sphere, driven evenly to a depth; a wedge of a half space of `far` radii of contact."""
    a = np.sqrt(R * depth)
    outer = spaced(1.4 * a, far * a, 13, 1.4)[1:]
    axes = [
        np.concatenate([[0.02 * a], spaced(0, 1.4 * a, cells)[1:], outer]),
        -np.concatenate([spaced(0, 1.4 * a, cells), outer])[::-1],
        [0, 1],
    ]
    supports = [Support("half", ("y",), side, axes=meridian(ANGLE, sign)) for side, sign in (("z-", 1), ("z+", -1))]
    supports += [Support("half", ("x",), "x+"), Support("half", ("z",), "y-")]
    supports += [Support("ball", ("x", "y", "rx", "ry", "rz")), Support("ball", ("z",), velocity=-depth)]
    half = Body("half", block("half", axes, law, elements, wedge(ANGLE)))
    model = build_model([half, rigid_sphere("ball", R, (0.0, 0.0, R), 1.0)], supports=supports)
    done = list(Simulation(model, ExactContacts(model, mu=0.0), QuasiStatic(1 / steps), steps, witness=None))
    return done, np.array([-step.contact_force_on(model.number["half"])[2] for step in done]) * 2 * np.pi / ANGLE


@pytest.mark.parametrize(
    ("law", "elements", "unit"),
    [
        pytest.param(Material, "Q1-enhanced", 1.0, marks=pytest.mark.slow),
        (Material, "Q1-enhanced", 1e-3),
        (saint_venant_kirchhoff, "Q1-bbar", 1.0),
    ],
)
def test_hertz(law: Any, elements: str, unit: float) -> None:
    """F = 4/3 E* sqrt(R) d^(3/2), H. Hertz 1881, at each of four depths (mm, and m); contacts by the vertices, not by one facet."""
    R, depth, E, nu = 10.0 * unit, 0.01 * unit, 210e3 / unit**2, 0.3
    steps, force = pressed(R, depth, law(E, nu, 7.8e-9 / unit**4), elements, 4)
    d = depth * np.arange(1, 5) / 4
    assert_allclose(force, 4 / 3 * E / (1 - nu**2) * np.sqrt(R) * d**1.5, rtol=0.04)
    assert np.count_nonzero(steps[-1].contact_force[:, 0] > 0) >= 14


def test_a_sphere_driven_into_a_viscoelastic_half_space() -> None:
    """E. H. Lee and J. R. M. Radok, J. Appl. Mech. 27, 1960, incompressible, d = v t: F = 16/3 sqrt(R) int_0^t G(t - s) d(d^(3/2))."""
    R, G, g, tau, depth = 10.0, 1.0, 0.6, 1.0, 0.1
    law = Viscoelastic(2 * G * 1.499, 0.499, 1e-9, ((g, 0.5 * tau),))  # the run's unit of time is 2 tau
    _, force = pressed(R, depth, law, "Q1-bbar", 20)
    for t in (0.25, 0.5, 0.75, 1.0):

        def rate(s: float, t: float = t) -> float:
            return float(G * (1 - g + g * np.exp(-(t - s) / (0.5 * tau))) * 1.5 * depth * np.sqrt(depth * s))

        assert_allclose(force[round(20 * t) - 1], 16 / 3 * np.sqrt(R) * quad(rate, 0, t)[0], rtol=0.04)


def rolled(kind: str, law: Any, elements: str, length: float, depth: float = 0.05, cells: int = 10, width: float = 0.2) -> np.ndarray:
    """Forces (2,) a unit of length on half a roller of R = 10, driven into half a block; a disk in plane strain, else `length` long."""
    R, a = 10.0, np.sqrt(10.0 * depth)
    outer = spaced(1.4 * a, 40 * a, 11, 1.4)[1:]
    x = np.concatenate([spaced(0, 1.4 * a, cells), outer])
    d, up = (2, "y") if kind == "disk" else (3, "z")
    axes = [x, -x[::-1]] if d == 2 else [x, np.linspace(0, width, 3), -x[::-1]]
    supports = [Support("half", ("x",), side) for side in ("x-", "x+")] + [Support("half", (up,), up + "-")]
    if kind == "disk":
        ball = rigid_sphere("ball", R, (0.0, R), 1.0)
    else:
        supports += [Support("half", ("y",), side) for side in ("y-", "y+")]
        make = rigid_cylinder if kind == "cylinder" else rigid_capsule
        ball = make("ball", R, length * width, (0.0, width / 2, R), 1.0, axis=(0, 1, 0))
    supports += [Support("ball", ("x", "rz") if d == 2 else ("x", "y", "rx", "ry", "rz")), Support("ball", (up,), velocity=-depth)]
    model = build_model([Body("half", block("half", axes, law(210e3, 0.3, 7.8e-9), elements)), ball], supports=supports)
    steps = list(Simulation(model, ExactContacts(model, mu=0.0), QuasiStatic(0.5), 2, witness=None))
    return np.array([-step.contact_force_on(model.number["half"])[d - 1] for step in steps]) / (1 if d == 2 else width)


@pytest.mark.parametrize(
    ("law", "elements"),
    [(Material, "Q1-enhanced"), pytest.param(saint_venant_kirchhoff, "Q1-bbar", marks=pytest.mark.slow)],  # the latter: test_hertz too
)
def test_rollers_press_as_the_disk_of_plane_strain(law: Any, elements: str) -> None:
    """Capsules and cylinders longer than a slab that is held in its width, and a cylinder that ends with it: the disk's force in plane
    strain on the same cells, six facets in the half width; Hertz' half width for it, 2 sqrt(F R / (pi E*)), covers as many."""
    disk = rolled("disk", law, elements, 1.0)
    for kind, length in (("cylinder", 3.0), ("capsule", 3.0), ("cylinder", 1.0)):
        assert_allclose(rolled(kind, law, elements, length), disk, rtol=1e-4)


@pytest.mark.slow
def test_first_yield_below_a_sphere() -> None:
    """K. L. Johnson, Contact mechanics, 1985, section 6.2: von Mises' yield begins at p_0 = 1.60 sy, F = pi^3 R^2 (1.6 sy)^3 / (6 E*^2)."""
    R, E, nu, sy = 10.0, 210e3, 0.3, 500.0
    first = np.pi**3 * R**2 * (1.6 * sy) ** 3 / 6 * ((1 - nu**2) / E) ** 2
    depth = 1.5 * (0.75 * first * R * (1 - nu**2) / E) ** (2 / 3) / R
    steps, force = pressed(R, depth, Plastic(E, nu, 7.8e-9, sy), "Q1-bbar", 30, 18, 14.0)
    yielded = np.array([step.energy.material_dissipation for step in steps]) > 1e-12 * force[-1] * depth
    assert_allclose(force[np.argmax(yielded)], first, rtol=0.1)
    assert yielded.any() and not yielded[0]
