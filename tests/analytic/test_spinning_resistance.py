"""Spinning resistance against closed forms: slowing down, stopping, holding; beside rolling; momentum, files, checkpoints, refusals."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.loads import Force
from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, SurfacePair
from fcsim.contact_detection.exact import ExactContacts
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.contact_law import Compliant, Gap, Rolling, Spinning, Springs, Velocity, laws_of_bodies
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.mesh.blocks import brick, rigid_box
from fcsim.mesh.exact.rigid_shapes import rigid_cylinder, rigid_plane, rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.running.checkpoint import read_checkpoint, write_checkpoint
from fcsim.running.fclib_series import write_step
from fcsim.running.vtk_series import SeriesWriter
from fcsim.solvers.solve import solve
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

g = 9.81
HELD = ("x", "y", "z", "rx", "ry", "rz")


def on_plane(*bodies: RigidBody, gravity: float = g, normal: Any = (0.0, 0.0, 1.0), **options: Any) -> Model:
    plane = rigid_plane("plane", np.zeros(3), normal, size=1.0)
    down = -gravity * np.asarray(normal) / np.linalg.norm(normal)
    return build_model([*bodies, plane], supports=[Support("plane", HELD)], gravity=lambda t: down, **options)


def run(model: Model, law: Any, steps: int, v: Any, scheme: Any = None, mu: float = 0.5) -> list[Step]:
    start = at_rest(model)
    start.v[: len(v)] = v
    scheme = Theta(2e-3, law=law) if scheme is None else replace(scheme, law=law)
    return list(Simulation(model, ExactContacts(model, mu), scheme, steps, SolverSettings(tol=1e-11, floor=1e-9), initial=start))


@pytest.mark.parametrize(
    ("R", "m", "gravity", "scheme", "law"),
    [
        (0.1, 2.0, g, Theta(2e-3), Gap()),
        (0.1, 1e-9, g, Theta(2e-3, 1.0), Gap()),
        (100.0, 2e-3, 1e3 * g, GeneralisedAlpha(2e-3, 0.8), Velocity(0.5)),  # in mm, tonnes and N
    ],
)
def test_a_spinning_ball_slows_down_by_its_moment_over_its_inertia_and_stops(
    R: float, m: float, gravity: float, scheme: Any, law: Any
) -> None:
    """alpha = mu_s m g / (2/5 m R^2): it stops after omega / alpha and a turn of omega^2 / (2 alpha); all its energy is friction's."""
    h = scheme.h
    mu_s, omega = 0.02 * R, 20.3 * h * 0.05 * gravity / R
    alpha = mu_s * gravity / (0.4 * R**2)
    found = run(
        on_plane(rigid_sphere("ball", R, (0.0, 0.0, R), m), gravity=gravity), Spinning(mu_s, law), 30, (0, 0, 0, 0, 0, omega), scheme
    )
    t = np.array([step.state.t for step in found])
    assert_allclose([step.state.v[5] for step in found], np.maximum(omega - alpha * t, 0), atol=alpha * h * 1e-3)
    stopped = next(step.state.t for step in found if abs(step.state.v[5]) < 1e-5 * omega)
    assert omega / alpha - 1e-9 <= stopped <= omega / alpha + 1.01 * h
    assert_allclose(found[-1].state.x[5], omega**2 / (2 * alpha), rtol=2.1 * alpha * h / omega)
    lost = 0.5 * 0.4 * m * R**2 * omega**2
    numerical = sum(step.energy.numerical_dissipation for step in found)
    assert_allclose(sum(step.energy.tangential_dissipation for step in found), lost - numerical, rtol=1e-6)
    first, last = found[3], found[-1]
    assert first.spinning.all() and not last.spinning.any() and not first.rolling.any() and first.rolling_moment is None
    assert first.spinning_moment is not None
    assert_allclose(first.spinning_moment, -mu_s * m * gravity * np.sign(first.contacts.frame[0, 0, 2]), rtol=1e-6)


@pytest.mark.parametrize("factor", [0.98, 1.02])
def test_it_holds_moments_up_to_its_limit_on_planes_of_any_direction(factor: float) -> None:
    """A moment M about the normal turns a ball iff M > mu_s N, then by (M - mu_s N) / I."""
    R, m, mu_s, h, n = 0.2, 3.0, 0.01, 2e-3, 40
    normal = np.array([1.0, 2.0, 2.0]) / 3
    ball = rigid_sphere("ball", R, R * normal, m)
    moment = factor * mu_s * m * g
    model = on_plane(ball, normal=normal, loads=[Force("ball", (0, 0, 0), tuple(moment * normal))])
    last = run(model, Spinning(mu_s), n, ())[-1]
    turned = max(0.0, factor - 1) * mu_s * m * g / (0.4 * m * R**2) * n * h
    assert_allclose(last.state.v[3:6], turned * normal, atol=1e-7)
    assert last.spinning_moment is not None
    assert_allclose(abs(last.spinning_moment), min(factor, 1) * mu_s * m * g, rtol=1e-6)


def test_a_top_that_rolls_slows_down_in_both_ways_each_by_its_own_moment() -> None:
    """Rolling at v with the spin omega: v' = -mu_r / R g / (1 + 2/5), omega' = -mu_s m g / I, and each stops in its own time."""
    R, m, mu_r, mu_s, v, omega = 0.1, 2.0, 0.01, 0.004, 0.05, 0.5
    for law in (Rolling(mu_r, Spinning(mu_s)), Spinning(mu_s, Rolling(mu_r))):
        found = run(on_plane(rigid_sphere("ball", R, (0.0, 0.0, R), m)), law, 50, (v, 0, 0, 0, v / R, omega))
        t = np.array([step.state.t for step in found])
        slow, slower = mu_r / R * g / 1.4, mu_s * g / (0.4 * R**2)
        assert_allclose([step.state.v[0] for step in found], np.maximum(v - slow * t, 0), atol=0.05 * v)
        assert_allclose([step.state.v[5] for step in found], np.maximum(omega - slower * t, 0), atol=0.05 * omega)
        assert max(v / slow, omega / slower) < t[-1] and abs(v / slow - omega / slower) > 2e-3
        assert found[5].rolling.all() and found[5].spinning.all()
        assert_allclose(found[-1].state.v, 0, atol=1e-7)
        assert max(abs(step.energy.residual) for step in found) < 1e-12


def test_balls_spinning_on_each_other_keep_their_angular_momentum() -> None:
    """The upper one's spin goes into the lower one: I (omega_1 + omega_2) stays, until both turn alike (I_1 omega / (I_1 + I_2))."""
    R, m, omega = 0.1, 2.0, 4.0
    balls = rigid_sphere("low", R, (0.0, 0.0, 0.0), m), rigid_sphere("high", R, (0.0, 0.0, 2 * R), m)
    supports = [Support("low", ("x", "y", "z", "rx", "ry")), Support("high", ("x", "y", "rx", "ry"))]
    model = build_model(balls, supports=supports, gravity=lambda t: (0, 0, -g))
    found = run(model, Spinning(0.05 * R), 120, (0,) * 11 + (omega,))
    spins = np.array([step.state.v[[5, 11]] for step in found])
    assert_allclose(spins.sum(axis=1), omega, rtol=1e-9)
    alpha = 0.05 * g / (0.4 * R)
    t = np.array([step.state.t for step in found])
    assert_allclose(spins[:, 0], np.minimum(alpha * t, omega / 2), atol=alpha * 2e-3 * 1.01)
    assert_allclose(spins[-1], omega / 2, atol=1e-6)


def test_it_adds_to_the_friction_of_a_face_of_several_points() -> None:
    """A plate of diagonal D on its corners: I omega' = -(mu D / 2 + mu_s) m g."""
    a, b, mu, m, mu_s, h, n = 0.4, 0.3, 0.3, 2.0, 0.05, 1e-3, 30
    model = on_plane(rigid_box("plate", (a, b, 0.05), (0, 0, 0.025), m))
    last = run(model, Spinning(mu_s), n, (0, 0, 0, 0, 0, 6.0), Theta(h), mu)[-1]
    D = np.hypot(a, b)
    assert_allclose(last.state.v[5], 6.0 - (mu * D / 2 + mu_s) * g / (D**2 / 12) * n * h, rtol=2e-4)


def disc(R: float, rings: int, sectors: int, height: float, mass: float) -> RigidBody:
    """A disc whose lower face has rings of equal width, triangles in the "middle", quadrilaterals on the "rings"."""
    r, angle = R * np.arange(1, rings + 1) / rings, 2 * np.pi * np.arange(sectors) / sectors
    ring = np.stack([np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle)), np.zeros((rings, sectors))], axis=-1).reshape(-1, 3)
    points = np.vstack([ring, [[0.0, 0.0, 0.0]]])
    k, after = np.arange(sectors), (np.arange(sectors) + 1) % sectors
    middle = np.full(sectors, len(points) - 1)
    quads = [
        np.column_stack([i * sectors + k, i * sectors + after, (i + 1) * sectors + after, (i + 1) * sectors + k]) for i in range(rings - 1)
    ]
    inertia = mass * np.diag([R**2 / 4 + height**2 / 12, R**2 / 4 + height**2 / 12, R**2 / 2])
    return RigidBody(
        "disc",
        mass,
        inertia,
        np.array([0.0, 0.0, height / 2]),
        points,
        {"middle": np.column_stack([middle, after, k]), "rings": np.vstack(quads)},
    )


@pytest.mark.parametrize(("R", "unit"), [(0.2, 1.0), (200.0, 1e3)])
def test_a_disc_on_its_flat_face_of_springs_meets_the_torque_of_uniform_pressure(R: float, unit: float) -> None:
    """Springs make the pressure what it is, k times the depth, uniform under a central load: with points at the centres of facets that
    stand for their areas, the torque is 2/3 mu N R; one point with the resistance 2/3 mu R gives the same."""
    mu, height, press, mass = 0.4, 0.25 * R, 1e-4 * R, 2.0
    floor = rigid_box("floor", (4 * R, 4 * R, R), (0, 0, -R / 2), 1.0)
    supports = [
        Support("floor", HELD),
        Support("disc", ("x", "y", "rx", "ry")),
        Support("disc", ("z",), velocity=lambda t: -press if t < 1 else 0.0),
        Support("disc", ("rz",), velocity=lambda t: 0.0 if t < 1 else 0.05),
    ]
    model = build_model([disc(R, 12, 48, height, mass), floor], supports=supports)
    pair = SurfacePair(
        contact_surface(model, [("disc", "middle"), ("disc", "rings")]), contact_surface(model, [("floor", "z+")]), mu, 0.05 * R, "faces"
    )
    k = 1e8 / unit**2
    law = Compliant(Springs(normal=k, tangential=k))
    settings = SolverSettings(tol=1e-10, floor=1e-12)
    *_, last = Simulation(model, Detector([pair], model.n_nodes), QuasiStatic(1.0, 1e-9, law), 4, settings, witness=None)
    N = last.contact_force_on(0)[2]
    polygon = 48 / 2 * np.sin(2 * np.pi / 48)  # area over R^2
    assert_allclose(N, k * press * polygon * R**2, rtol=1e-6)
    torque = (last.H @ last.result.r)[model.dof_offset[0] + 5]
    assert_allclose(torque, -2 / 3 * mu * N * R, rtol=0.01)
    top = rigid_sphere("ball", R, (0.0, 0.0, R), mass)
    *_, spun = run(on_plane(top), Spinning(2 / 3 * mu * R), 3, (0, 0, 0, 0, 0, 1.0))
    assert spun.spinning_moment is not None
    assert_allclose(abs(spun.spinning_moment), 2 / 3 * mu * mass * g * R, rtol=1e-6)


def test_steps_with_spinning_resistance_are_written_resumed_and_shown(tmp_path: Path) -> None:
    """FCLIB's rolling problems have two moments: a contact with spinning resistance alone has (S, nothing), one with both is refused."""
    R = 0.1
    balls = [rigid_sphere(name, R, (x, 0.0, R), 1.0) for name, x in (("spins", 0.0), ("rolls", 1.0), ("free", 2.0))]
    model = on_plane(*balls)
    law = laws_of_bodies(model, {"spins": Spinning(0.1 * R), "rolls": Rolling(0.05 * R)}, Gap())
    v = (0, 0, 0, 0, 0, 3.0, 0.3, 0, 0, 0, 3.0, 2.0, 0.2, 0, 0, 0, 0, 1.0)
    found = run(model, law, 12, v)
    step = found[5]
    assert step.spinning.tolist() == [True, False, False] and step.rolling.tolist() == [False, True, False]
    (path,) = write_step(tmp_path, step, "SPIN")
    content = read_fclib(path)
    assert content.form == "global_rolling" and content.problem.m == 15
    answer = solve(content.problem, "auto", tol=1e-11)
    assert answer.solved and content.solution is not None
    assert_allclose(answer.r, content.solution.r, atol=1e-8 * abs(answer.r).max())
    assert_allclose(answer.v, step.result.v, atol=1e-8)

    simulation = Simulation(
        model, ExactContacts(model, 0.5), Theta(2e-3, law=law), 12, SolverSettings(tol=1e-11, floor=1e-9), initial=found[0].previous
    )
    write_checkpoint(tmp_path / "checkpoint.h5", step)
    moments = read_checkpoint(tmp_path / "checkpoint.h5")
    assert moments is not None
    rest = list(simulation.run(*moments))
    assert_array_equal(rest[-1].state.x, found[-1].state.x)
    assert_array_equal(rest[-1].result.r, found[-1].result.r)
    SeriesWriter(tmp_path / "vtk", model).write(step)
    shown = next((tmp_path / "vtk").glob("contacts_*.vtp")).read_bytes()
    assert b"spinning_moment" in shown and b"rolling_moment" in shown

    both = run(model, Spinning(0.1 * R, Rolling(0.1 * R)), 2, v)[-1]
    with pytest.raises(InputError, match="contact 0: has rolling and spinning resistance, as 3 of 3 contacts; expected one of them"):
        write_step(tmp_path, both, "BOTH")


def test_what_spinning_resistance_does_not_cover_is_refused() -> None:
    part = brick("block", (1.0, 1.0, 0.2), (2, 2, 1), Material(1e9, 0.3, 2000.0))
    box = rigid_box("box", (0.2, 0.2, 0.2), (0.5, 0.5, 0.3), 1.0)
    model = build_model([Body("block", part), box], supports=[Support("block", ("x", "y", "z"), "z-")])
    with pytest.raises(
        InputError, match=r"Spinning: expected contacts of rigid bodies, got '.*' on '.*': the surface of a deformable body"
    ):
        list(Simulation(model, Everything(model, 0.5), Theta(1e-3, law=Spinning(0.01)), 1))
    ball, plane = rigid_sphere("ball", 0.1, (0.0, 0.1), 1.0), rigid_plane("plane", (0.0, 0.0), (0.0, 1.0), size=1.0)
    flat = build_model([ball, plane], supports=[Support("plane", ("x", "y", "rz"))], gravity=lambda t: (0, -g))
    with pytest.raises(InputError, match="Spinning: expected contacts in 3D"):
        list(Simulation(flat, ExactContacts(flat, 0.5), Theta(1e-3, law=Spinning(0.01)), 1))
    for law, message in (
        (lambda: Spinning(-0.1), "Spinning, resistance: expected a length mu_s >= 0 in m, got -0.1"),
        (lambda: Spinning(np.inf), "resistance: expected a length mu_s"),
        (lambda: Spinning(0.1, Rolling(0.1, Spinning(0.1))), "expected a law without spinning resistance, got another Spinning"),
        (lambda: Rolling(0.1, laws_of_bodies(model, {"box": Rolling(0.1)}, Gap())), "expected a law without rolling resistance"),
    ):
        with pytest.raises(InputError, match=message):
            law()


def test_without_resistance_to_spinning_nothing_changes() -> None:
    """mu_s = 0 is the law beside it: a ball keeps its spin, a cylinder on its round side its friction between the ends of its line."""
    ball, roller = rigid_sphere("ball", 0.1, (0, 0, 0.1), 1.0), rigid_cylinder("roller", 0.1, 0.4, (1.0, 0, 0.1), 1.0, (0.0, 1.0, 0.0))
    model = on_plane(ball, roller)
    v = (0.0, 0, 0, 0, 0, 2.0, 0, 0, 0, 0, 0, 0.5)
    with_it, without = (run(model, law, 10, v)[-1].state.v for law in (Spinning(0.0), Gap()))
    assert_allclose(with_it, without, atol=1e-7)
    assert with_it[5] == pytest.approx(2.0) and with_it[11] < 0.5
