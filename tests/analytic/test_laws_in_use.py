"""Laws as users give them: coefficients of place, temperature and time; damped joints; cycles of a joint in any units; exported glue."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, ExactContacts, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import (
    Cohesive,
    Compliant,
    Elliptic,
    Gap,
    RateDependent,
    SlipWeakening,
    Springs,
    Velocity,
    laws_of_bodies,
)
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib, write_fclib
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.exact.rigid_shapes import rigid_plane, rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.running.vtk_series import SeriesWriter
from fcsim.solvers import solve
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation, SolverSettings
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

HELD = ("x", "y", "z", "rx", "ry", "rz")


def slides(
    law: Any, v: float, h: float, steps: int, *, unit: float = 1.0, mass: float = 4.0, g: float = 10.0, push: Any = None
) -> list[Step]:
    """A plate 1 m x 0.5 m that cannot turn, thrown at v or driven by `push` along x on a held floor; lengths in 1 / unit m."""
    L = unit
    plate = rigid_box("plate", (L, 0.5 * L, 0.1 * L), (0, 0, 0.05 * L), mass)
    floor = rigid_box("floor", (90 * L, 9 * L, L), (0, 0, -0.5 * L), mass)
    supports = [Support("floor", HELD), Support("plate", ("rx", "ry", "rz"))]
    if push is not None:
        supports.append(Support("plate", ("x",), velocity=push))
    model = build_model([plate, floor], supports=supports, gravity=lambda t: (0, 0, -g * L))
    start = at_rest(model)
    start.v[0] = v * L
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), 0.3, 0.05 * L, "faces")
    settings = SolverSettings(tol=1e-11, floor=1e-9 * L)
    return list(Simulation(model, Detector([pair], model.n_nodes), Theta(h, law=law), steps, settings, start, witness=None))


@pytest.mark.parametrize(
    ("unit", "mass"), [(1e3, 4e-3), pytest.param(1.0, 4.0, marks=pytest.mark.slow), pytest.param(1.0, 1e-9, marks=pytest.mark.slow)]
)
def test_a_plate_slides_over_friction_that_grows_with_the_place(unit: float, mass: float) -> None:
    """In mm, tonnes and N; in SI; in nanograms. mu = a + b x, x of the contact, the plate's middle: v dv/dx = - g (a + b x) from
    v0, so it stops where a x + b x^2 / 2 = v0^2 / (2 g)."""
    a, b, v0, g = 0.2, 0.5, 2.0, 10.0
    law = Gap(friction=lambda sliding: np.maximum(a + b * sliding.point[:, 0] / unit, 0.0))
    found = slides(law, v0, 8e-3, 90, unit=unit, mass=mass)
    stop = (-a + np.sqrt(a**2 + b * v0**2 / g)) / b
    x = np.array([step.state.x[0] for step in found]) / unit
    assert x[-1] == pytest.approx(stop, rel=0.01)
    moving = (np.arange(90) % 10 == 0) & (x < 0.9 * stop)
    v = np.array([step.state.v[0] for step in found])[moving] / unit
    assert_allclose(v**2, v0**2 - 2 * g * (a * x + b * x**2 / 2)[moving], atol=0.01 * v0**2)


def test_friction_of_a_temperature_that_falls() -> None:
    """T(t) = 100 exp(-t / tau), mu = 0.5 - 0.003 T: v(t) = v0 - g int mu dt, taken at the beginning of each step."""
    tau, v0, g, h, n = 0.2, 2.0, 10.0, 2e-3, 100

    def temperature(point: np.ndarray, t: float) -> np.ndarray:
        return np.full(len(point), 100 * np.exp(-t / tau))

    found = slides(Gap(friction=lambda sliding: 0.5 - 0.003 * temperature(sliding.point, sliding.t)), v0, h, n)
    t = np.array([step.state.t for step in found])
    exact = v0 - g * (0.5 * t - 0.003 * 100 * tau * (1 - np.exp(-t / tau)))
    assert exact[-1] > 0.5
    assert_allclose([step.state.v[0] for step in found], exact, atol=g * 0.3 * h)


def test_a_function_that_scales_the_coefficient_of_the_pair() -> None:
    """`sliding.mu` is the pair's 0.3; half of it brakes half as much."""
    one, half = (slides(law, 2.0, 2e-3, 20)[-1].state.v[0] for law in (Gap(), Gap(friction=lambda sliding: 0.5 * sliding.mu)))
    assert 2 - half == pytest.approx((2 - one) / 2, rel=1e-8) and 2 - one == pytest.approx(0.3 * 10 * 0.04, rel=1e-8)


@pytest.mark.parametrize(("axis", "inclined"), [((1.0, 0.0, 0.0), 20.0), pytest.param((1.0, 1.0, 0.0), 30.0, marks=pytest.mark.slow)])
def test_elliptic_friction_deflects_what_slides_down_an_incline(axis: tuple[float, float, float], inclined: float) -> None:
    """From rest the acceleration keeps its direction: with s = (c, s) the sliding's, g sin(alpha) e - (mu_1^2 c, mu_2^2 s) g cos(alpha) /
    sqrt(mu_1^2 c^2 + mu_2^2 s^2) is along s (the associated rule); beta off the steepest line e, solved for here by bisection."""
    mu_1, mu_2, g, alpha = 0.1, 0.3, 10.0, np.radians(inclined)
    first = np.array(axis) / np.linalg.norm(axis)
    second = np.cross([0, 0, 1.0], first)
    down = np.array([np.cos(0.7), np.sin(0.7), 0.0])
    e = np.array([down @ first, down @ second])

    def off(angle: float) -> float:
        c, s = np.cos(angle), np.sin(angle)
        a = np.sin(alpha) * e - np.cos(alpha) * np.array([mu_1**2 * c, mu_2**2 * s]) / np.hypot(mu_1 * c, mu_2 * s)
        return float(a[0] * s - a[1] * c)

    steepest = np.arctan2(e[1], e[0])
    low, high = steepest - 0.6, steepest + 0.6
    assert off(low) * off(high) < 0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if off(middle) * off(low) > 0 else (low, middle)
    plate, floor = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, 0.05), 4.0), rigid_box("floor", (9, 9, 1), (0, 0, -0.5), 1.0)
    gravity = g * (np.sin(alpha) * down - np.cos(alpha) * np.array([0, 0, 1.0]))
    model = build_model([plate, floor], supports=[Support("floor", HELD), Support("plate", ("rx", "ry", "rz"))], gravity=lambda t: gravity)
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), 0.3, 0.05)
    law = Gap(friction=Elliptic(mu_1, mu_2, axis))
    *_, last = Simulation(model, Detector([pair], model.n_nodes), Theta(2e-3, law=law), 20, SolverSettings(tol=1e-11, floor=1e-9))
    v = last.state.v[:3]
    assert_allclose(np.arctan2(v @ second, v @ first), low, atol=1e-5)
    assert abs(low - steepest) > 0.02  # there is something to see


@pytest.mark.slow
def test_a_dashpot_beside_the_tangential_spring() -> None:
    """Driven at V from rest: A (k V t + c V) until that is mu m g, then mu m g."""
    k, c, V, h = 1.6e5, 8e3, 2e-3, 1e-3
    law = Compliant(Springs(normal=2e6, tangential=k, normal_damping=2e5, tangential_damping=c))
    settled = 40
    found = slides(law, 0.0, h, 120, push=lambda t: V if t > settled * h else 0.0)
    force = -np.array([step.contact_force_on(0)[0] for step in found])
    t = np.maximum(np.array([step.state.t for step in found]) - (settled + 0.5) * h, 0.0)  # an impulse is the mean over its step
    expected = np.where(t > 0, np.minimum(0.5 * (k * V * t + c * V), 0.3 * 4.0 * 10.0), 0.0)
    away = np.arange(120) > settled + 3
    assert_allclose(force[away], expected[away], atol=0.01 * 12.0)


UNITS = [(1e3, 1e-3), pytest.param(1.0, 1.0, marks=pytest.mark.slow), pytest.param(1.0, 1e-9, marks=pytest.mark.slow)]  # mm, t; m, kg; ug


@pytest.mark.parametrize(("length", "mass"), UNITS)
def test_a_joint_that_is_drawn_back_and_on_again_takes_energy_once(length: float, mass: float) -> None:
    """Opened to half of its way, back to a quarter, on to its end: within springs that stretch and give back no energy is taken; the force
    on the way on again is that at which it was left, and the whole is G_I A. The strength left depends on the widest opening alone."""
    force, area = mass * length, 0.5 * length**2
    tension, G = 2e5 * force / length**2, 20.0 * force / length
    opening, k = 2 * G / tension, 2e11 * force / length**3
    law = Cohesive(tension=tension, mode_1=G, mode_2=G, springs=Springs(normal=k, tangential=k))
    plate = rigid_box("plate", (length, 0.5 * length, 0.1 * length), (0, 0, 0.05 * length), mass)
    floor = rigid_box("floor", (9 * length, 9 * length, length), (0, 0, -0.5 * length), mass)
    ways = np.array([*[0.05] * 10, *[-0.05] * 5, *[0.05] * 5, *[0.05] * 12]) * opening
    supports = [Support("floor", HELD), Support("plate", ("x", "y", "rx", "ry", "rz"))]
    supports.append(Support("plate", ("z",), velocity=lambda t: ways[min(round(t - 0.5), len(ways) - 1)]))
    model = build_model([plate, floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("plate", "z-")]), contact_surface(model, [("floor", "z+")]), 0.6, 0.01 * length)
    settings = SolverSettings(tol=1e-9, floor=1e-12 * length)
    found = list(Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, 0.0, law), len(ways), settings, witness=None))
    took = np.array([step.energy.fracture_dissipation for step in found])
    pull = -np.array([step.contact_force_on(0)[2] for step in found])
    assert took[:10].sum() == pytest.approx(G * area * (1 - 0.5**2), rel=0.02)  # i = 1 - d / d_c
    assert_allclose(took[10:20], 0, atol=1e-6 * G * area)
    assert pull[19] == pytest.approx(pull[9], rel=1e-5)  # a step is solved until strengths change by no more than 1e-6
    assert took.sum() == pytest.approx(G * area, rel=1e-5)
    assert_allclose(pull[-1], 0, atol=1e-6 * tension * area)
    assert all(abs(step.energy.residual) < 1e-8 * G * area for step in found)


@pytest.mark.slow
def test_four_laws_in_one_model_on_bodies_of_second_order(tmp_path: Path) -> None:
    """Blocks of P2 cells and rigid ones in mm, tonnes and N, each under its own law, thrown along x: mu g brakes each by its own
    coefficient; a run resumed within goes on bit by bit, and VTK shows what each law remembers."""
    size, g, v0, h, n = 100.0, 9810.0, 400.0, 1e-4, 24
    names, laws = ("gap", "weak", "rate", "shock"), {}
    laws["weak"] = Gap(friction=SlipWeakening(0.6, 0.6, 1.0))
    laws["rate"] = Gap(friction=RateDependent(0.4, 0.4, 1.0))
    laws["shock"] = Velocity(0.0, friction=lambda sliding: np.full(len(sliding.mu), 0.1))
    mu = {"gap": 0.3, "weak": 0.6, "rate": 0.4, "shock": 0.1}
    bodies: list[Any] = []
    for k, name in enumerate(names):
        origin = (0.0, 3 * size * k, 0.0)
        if name in ("gap", "weak"):
            part = brick(name, (size, size, size / 2), (1, 1, 1), Material(100.0, 0.2, 2e-9), "tetrahedron", elements="P2")
            bodies.append(Body(name, part, translation=np.array(origin)))
        else:
            centre = (size / 2, origin[1] + size / 2, size / 4)
            bodies.append(rigid_box(name, (size, size, size / 2), centre, 2e-9 * size**3 / 2))
    floor = rigid_box("floor", (40 * size, 40 * size, size), (0, 0, -size / 2), 1.0)
    model = build_model([*bodies, floor], supports=[Support("floor", HELD)], gravity=lambda t: (0, 0, -g), beta=1e-4)
    law = laws_of_bodies(model, laws, Gap())
    start = at_rest(model)
    for k in range(4):
        if k < len(model.deformable):
            begin, end = model.dof_offset[k : k + 2]
            start.v[begin:end:3] = v0
        else:
            start.v[model.dof_offset[k]] = v0
    run = Simulation(model, Everything(model, 0.3), Theta(h, 1.0, law=law), n, SolverSettings(tol=1e-9, floor=1e-7), initial=start)
    found = list(run)
    momentum = model.apply_mass(found[-1].state.v)
    along = np.zeros(model.n_dofs)
    for k, name in enumerate(model.bodies):
        if name.name == "floor":
            continue
        begin, end = model.dof_offset[k : k + 2]
        along[:] = 0
        along[begin : end if k < len(model.deformable) else begin + 1 : 3] = 1.0
        mass = float(along @ model.apply_mass(along))
        v = float(along @ momentum) / mass
        pressed = sum(step.contact_force_on(k)[2] for step in found) * h  # what carried it so far: it rings as it settles
        assert_allclose(v0 - v, mu[name.name] * pressed / mass, rtol=2e-3, err_msg=name.name)
    write_checkpoint(tmp_path / "checkpoint.h5", found[10])
    stored = read_checkpoint(tmp_path / "checkpoint.h5")
    assert stored is not None
    again = list(run.run(*stored))
    assert_array_equal(again[-1].state.x, found[-1].state.x)
    SeriesWriter(tmp_path / "vtk", model).write(found[-1])
    assert b"slip" in next((tmp_path / "vtk").glob("contacts_*.vtp")).read_bytes()


@pytest.mark.parametrize(("theta", "tol"), [(0.5, 1e-11), (0.7, 1e-9), (1.0, 1e-7)])
def test_glue_that_carries_far_less_than_it_can_holds_still(theta: float, tol: float) -> None:
    """A plate that hangs from a ceiling by 8 % of the glue's strength, however exactly its steps are solved: it stays where it is,
    nothing breaks. (What opens by round-off has no mean strength by a quotient of differences: it did not settle.)"""
    plate, ceiling = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, -0.05), 4.0), rigid_box("ceiling", (9, 9, 1), (0, 0, 0.5), 1.0)
    model = build_model([plate, ceiling], supports=[Support("ceiling", HELD)], gravity=lambda t: (0, 0, -10.0))
    pair = SurfacePair(contact_surface(model, [("plate", "z+")]), contact_surface(model, [("ceiling", "z-")]), 0.5, 0.05)
    for shear in (None, 1e3):
        law = Cohesive(tension=1e3, mode_1=20.0, mode_2=20.0, shear=shear)
        found = list(Simulation(model, Detector([pair], model.n_nodes), Theta(1e-3, theta, law), 5, SolverSettings(tol=tol, floor=1e-9)))
        assert max(len(step.attempts) for step in found) < 20 and all(step.substeps == 1 for step in found)
        assert_allclose(found[-1].state.x, 0, atol=1e-6)
        assert_allclose(found[-1].contact_force_on(0), [0, 0, 40.0], atol=1e-2)
        assert np.nanmax(found[-1].law_variables["fracture"]) < 1e-6


def test_the_exported_problem_of_a_glued_joint_is_coulombs(tmp_path: Path) -> None:
    """r~ = r + r_c: the file's r is r~ in Coulomb's cone, its f holds - H r_c; its answer moves the bodies as the step does, and less
    adhesion it is the force that holds the plate, whose weight hangs from a ceiling."""
    plate, ceiling = rigid_box("plate", (1.0, 0.5, 0.1), (0, 0, -0.05), 4.0), rigid_box("ceiling", (9, 9, 1), (0, 0, 0.5), 1.0)
    model = build_model([plate, ceiling], supports=[Support("ceiling", HELD)], gravity=lambda t: (0, 0, -10.0))
    pair = SurfacePair(contact_surface(model, [("plate", "z+")]), contact_surface(model, [("ceiling", "z-")]), 0.5, 0.05)
    law = Cohesive(tension=1e3, mode_1=20.0, mode_2=20.0)
    *_, last = Simulation(model, Detector([pair], model.n_nodes), Theta(1e-3, law=law), 5, SolverSettings(tol=1e-11, floor=1e-9))
    write_fclib(tmp_path / "glue.hdf5", last.problem)
    again = solve(read_fclib(tmp_path / "glue.hdf5").problem, "auto", tol=1e-9)
    assert again.solved
    r = again.r.reshape(-1, 3)
    assert np.all(np.hypot(r[:, 1], r[:, 2]) <= 0.5 * r[:, 0] + 1e-9)
    assert_allclose((r[:, 0].sum() - 1e3 * 0.5 * 1e-3), -4.0 * 10.0 * 1e-3, rtol=1e-5)  # r~ - r_c carries the weight
    assert_allclose(again.v, last.result.v, atol=1e-9)
    assert last.contact_force_on(0)[2] == pytest.approx(40.0, rel=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_laws_per_area_refuse_bodies_without_facets(d: int) -> None:
    """Springs and glue need the area that a contact stands for; a ball has none."""
    up = np.eye(d)[-1]
    ball, plane = rigid_sphere("ball", 0.1, 0.1 * up, 1.0), rigid_plane("plane", np.zeros(d), up.tolist(), size=1.0)
    held = HELD if d == 3 else ("x", "y", "rz")
    model = build_model([ball, plane], supports=[Support("plane", held)], gravity=lambda t: -10 * up)
    for law in (Compliant(Springs(normal=1e6, tangential=1e6)), Cohesive(tension=1e3, mode_1=1.0, mode_2=1.0)):
        with pytest.raises(InputError, match="expected a slave surface of named facets at every contact, to know its area"):
            list(Simulation(model, ExactContacts(model, 0.3), Theta(1e-3, law=law), 1))


@pytest.mark.parametrize("d", [2, 3])
def test_springs_of_each_contact_need_no_area(d: int) -> None:
    """A ball on one contact sinks by m g / k, its weight over the stiffness [N/m]."""
    up, k = np.eye(d)[-1], 1e6
    ball, plane = rigid_sphere("ball", 0.1, 0.1 * up, 4.0), rigid_plane("plane", np.zeros(d), up.tolist(), size=1.0)
    held = HELD if d == 3 else ("x", "y", "rz")
    model = build_model([ball, plane], supports=[Support("plane", held)], gravity=lambda t: -10 * up)
    law = Compliant(Springs(normal=k, tangential=k, normal_damping=2e3, tangential_damping=2e3, each=True))
    settings = SolverSettings(tol=1e-10, floor=1e-9)
    *_, last = Simulation(model, ExactContacts(model, 0.3), Theta(1e-3, law=law), 60, settings, witness=None)
    assert last.state.x[d - 1] == pytest.approx(-4.0 * 10.0 / k, rel=1e-4)


def test_a_ball_rebounds_from_springs_as_an_oscillator() -> None:
    """Depth V/omega, pi/omega in contact and the speed at which it came, in the mean over where in a step it arrives. What a step adds to
    the energy is k g^2 / 2 with g the gap at the beginning of the first loaded step, at most (omega h)^2 / 4 of what it came with."""
    k, mass, V, h = 2e4, 1.0, 1.0, 1e-3
    omega, law = np.sqrt(k / mass), Compliant(Springs(normal=k, tangential=k, each=True))
    found = []
    for phase in np.arange(8) / 8 + 0.03:
        above = h * V * (2 + phase)
        ball, plane = rigid_sphere("ball", 0.1, (0, 0, 0.1 + above), mass), rigid_plane("plane", np.zeros(3), (0, 0, 1), size=1.0)
        model = build_model([ball, plane], supports=[Support("plane", HELD)])
        start = at_rest(model)
        start.v[2] = -V
        settings = SolverSettings(tol=1e-12)
        steps = list(Simulation(model, ExactContacts(model, 0.3), Theta(h, law=law), 30, settings, start, witness=None))
        loaded = [step for step in steps if np.abs(step.result.r).sum() > 0]
        gap = loaded[0].previous.x[2] + above
        last = steps[-1]
        assert last.ledger.created == pytest.approx(0.5 * k * gap**2, rel=1e-6)
        assert last.ledger.created < 0.25 * (omega * h) ** 2 * 0.5 * mass * V**2
        found.append((last.state.v[2], min(step.state.x[2] + above for step in steps), h * len(loaded)))
    rebound, depth, lasts = np.mean(found, axis=0)
    assert rebound == pytest.approx(V, rel=2e-4)
    assert depth == pytest.approx(-V / omega, rel=2e-3)
    assert lasts == pytest.approx(np.pi / omega, rel=0.02)
