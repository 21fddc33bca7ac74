"""Rolling resistance against closed forms: rest and roll on an incline, deceleration, tipping; momentum, energy, files, checkpoints."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fcsim.assembly.model import Model, build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything
from fcsim.contact_detection.exact import ExactContacts
from fcsim.contact_law import Gap, Rolling, Velocity, laws_of_bodies
from fcsim.errors import InputError
from fcsim.export_fclib import read_fclib
from fcsim.linkage import Linkage
from fcsim.linkage.links import Rod
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
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import at_rest
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

g = 9.81
ALL = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}


def on_plane(body: RigidBody, alpha: float, **options: Any) -> Model:
    """A body on a plane in axes of the incline, x down it."""
    d = body.dimension
    gravity = g * np.array([np.sin(alpha), *[0.0] * (d - 2), -np.cos(alpha)])
    plane = rigid_plane("plane", np.zeros(d), [0.0] * (d - 1) + [1.0], size=1.0)
    return build_model([body, plane], supports=[Support("plane", ALL[d])], gravity=lambda t: gravity, **options)


def run(model: Model, law: Any, steps: int, v: Any = None, scheme: Any = None, mu: float = 0.8) -> list[Step]:
    start = at_rest(model)
    if v is not None:
        start.v[: len(v)] = v
    scheme = Theta(2e-3, law=law) if scheme is None else replace(scheme, law=law)
    return list(Simulation(model, ExactContacts(model, mu), scheme, steps, SolverSettings(tol=1e-10, floor=1e-6), initial=start))


def ball(d: int, R: float, m: float) -> RigidBody:
    return rigid_sphere("ball", R, [0.0] * (d - 1) + [R], m)


def roller(R: float, m: float) -> RigidBody:
    return rigid_cylinder("ball", R, 4 * R, [0.0, 0.0, R], m, [0.0, 1.0, 0.0])


@pytest.mark.each_value
@pytest.mark.parametrize("what", ["sphere", "disk", "cylinder"])
@pytest.mark.parametrize(("R", "m"), [(0.2, 3.0), (2e-3, 1e-9)])
def test_it_rests_on_an_incline_iff_its_tangent_is_no_more_than_the_resistance_over_the_radius(what: str, R: float, m: float) -> None:
    """Beyond, a = g (sin - mu_r / R cos) / (1 + I / (m R^2)); I = 2/5, 1/2 m R^2."""
    ratio, inertia = 0.1, 0.4 if what == "sphere" else 0.5
    body = roller(R, m) if what == "cylinder" else ball(2 if what == "disk" else 3, R, m)
    h = 2e-3 * np.sqrt(R / 0.2)
    for factor in (0.98, 1.02):
        alpha = np.arctan(factor * ratio)
        *_, last = run(on_plane(body, alpha), Rolling(ratio * R), 25, scheme=Theta(h))
        speed = max(0.0, g * (np.sin(alpha) - ratio * np.cos(alpha)) / (1 + inertia)) * 25 * h
        assert_allclose(last.state.v[0], speed, rtol=1e-5, atol=1e-6 * np.sqrt(g * R))
        # the two points of a cylinder's line may hold moments against each other
        assert last.rolling.all() == (factor > 1) or (factor < 1 and len(last.contacts) == 2)
        assert last.result.method.startswith("ROLLING") and not (last.contact_status == 2).any()
        found = last.rolling_moment
        assert found is not None
        moment = found[0, 0] if what == "disk" else np.einsum("ai,ai->", found, last.contacts.frame[:, 1:, 1])  # about z, y
        held = R * np.sin(alpha) if factor < 1 else ratio * R * np.cos(alpha)
        assert_allclose(abs(moment), m * g * held, rtol=1e-5)


@pytest.mark.parametrize(
    ("d", "law", "scheme"), [(3, Gap(), Theta(4e-3)), (2, Gap(), Theta(4e-3, 1.0)), (3, Velocity(0.5), GeneralisedAlpha(4e-3, 0.8))]
)
def test_a_rolling_ball_slows_down(law: Any, d: int, scheme: Any) -> None:
    """a = -mu_r / R g / (1 + I / (m R^2)) and then it lies still: after v^2 / (2 a); all its energy is friction's."""
    R, m, mu_r, v = 0.1, 2.0, 0.02, 0.5
    model = on_plane(ball(d, R, m), 0.0)
    inertia = float(model.rigid[0].inertia[0, 0])
    a = mu_r / R * g / (1 + inertia / (m * R**2))
    start = [v, 0.0, 0.0, 0.0, v / R] if d == 3 else [v, 0.0, -v / R]
    found = run(model, Rolling(mu_r, law), 110, start, scheme)
    t = 50 * scheme.h
    assert_allclose(found[49].state.v[0], v - a * t, rtol=1e-6)
    assert_allclose(found[49].state.x[0], v * t - 0.5 * a * t**2, rtol=2e-2)
    assert_allclose(found[-1].state.v, 0, atol=1e-6)
    assert_allclose(found[-1].state.x[0], v**2 / (2 * a), rtol=0.02)
    lost = 0.5 * (m + inertia / R**2) * v**2
    numerical = sum(step.energy.numerical_dissipation for step in found)
    assert_allclose(sum(step.energy.tangential_dissipation for step in found), lost - numerical, rtol=1e-6)
    assert max(abs(step.energy.residual) for step in found) < 1e-12 * lost
    assert all(step.energy.friction_dissipation > -1e-12 for step in found)


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_a_box_tips_later(factor: float) -> None:
    """A box b wide and c high on an incline tips about its lower edge iff tan(alpha) > (b + 2 mu_r) / c, m g (c sin - b cos) / 2 > mu_r
    N."""
    b, c, mu_r = 0.1, 0.4, 0.01
    alpha = np.arctan(factor * (b + 2 * mu_r) / c)
    gravity = g * np.array([np.sin(alpha), 0, -np.cos(alpha)])
    floor = rigid_box("floor", (1.0, 1.0, 0.1), (0, 0, -0.05), 10.0)
    box = rigid_box("box", (b, 0.2, c), (0, 0, 0.5 * c), 1.0)
    model = build_model([box, floor], supports=[Support("floor", ALL[3])], gravity=lambda t: gravity)
    *_, last = Simulation(model, Everything(model, 0.9), Theta(2e-3, law=Rolling(mu_r)), 50, SolverSettings(tol=1e-9, floor=1e-6))
    turned = last.state.v[4]
    assert abs(turned) < 1e-5 if factor < 1 else turned > 1e-3


def test_two_balls_roll_on_each_other_and_keep_their_momentum() -> None:
    """Without anything else, what contact does to one it does to the other: linear and angular momentum stay, energy falls.

    Angular momentum as far as the balls touch: a step leaves gaps of 1e-5 of their size (`look_ahead.ahead`)."""
    R = 0.1
    one, other = rigid_sphere("one", R, (0, 0, 0), 1.0), rigid_sphere("other", R, (0, 0, 2 * R), 3.0)
    model = build_model([one, other])
    start = at_rest(model)
    start.v[:] = [0, 0, 0.05, 3.0, -1.0, 0.4, 0.01, 0, -0.05, 0.5, 2.0, -0.3]
    found = list(Simulation(model, ExactContacts(model, 0.5), Theta(1e-3, law=Rolling(0.01)), 30, SolverSettings(tol=1e-12), initial=start))

    def momenta(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        P = model.apply_mass(v).reshape(2, 6)
        centres = np.array([body.centre for body in model.rigid]) + x.reshape(2, 6)[:, :3]
        return np.concatenate([P[:, :3].sum(axis=0), (P[:, 3:] + np.cross(centres, P[:, :3])).sum(axis=0)])

    begin, end = momenta(start.x, start.v), momenta(found[-1].state.x, found[-1].state.v)
    assert any(step.rolling.any() for step in found)
    assert_allclose(end, begin, atol=4e-5 * np.abs(begin).max())
    assert found[-1].energy.kinetic < 0.99 * found[0].energy.at_beginning


def test_a_table_of_laws_gives_resistance_to_some() -> None:
    """Of two equal balls on an incline the one with a law of its own rests, the other rolls freely: a = 5/7 g sin(alpha)."""
    R, alpha, h = 0.1, 0.05, 2e-3
    balls = [rigid_sphere(name, R, (0.0, y, R), 1.0) for name, y in (("held", 0.0), ("free", 1.0))]
    plane = rigid_plane("plane", np.zeros(3), [0, 0, 1], size=1.0)
    gravity = g * np.array([np.sin(alpha), 0, -np.cos(alpha)])
    model = build_model([*balls, plane], supports=[Support("plane", ALL[3])], gravity=lambda t: gravity)
    law = laws_of_bodies(model, {("held", "plane"): Rolling(0.06 * R)}, Gap())
    *_, last = Simulation(model, ExactContacts(model, 0.5), Theta(h, law=law), 40, SolverSettings(tol=1e-10, floor=1e-6))
    v = last.state.v.reshape(-1, 6)[:, 0]
    assert_allclose(v[0], 0, atol=1e-6)
    assert_allclose(v[1], 5 / 7 * g * np.sin(alpha) * 40 * h, rtol=1e-6)


def test_a_ball_with_resistance_and_one_without_on_a_rod() -> None:
    """A rod between their centres: 2 (1 + 2/5) m a = 2 m g sin - mu_r / R m g cos."""
    R, alpha, h = 0.1, 0.15, 2e-3
    balls = [rigid_sphere(name, R, (x, 0.0, R), 1.0) for name, x in (("held", 0.0), ("free", 0.3))]
    plane = rigid_plane("plane", np.zeros(3), [0, 0, 1], size=1.0)
    gravity = g * np.array([np.sin(alpha), 0, -np.cos(alpha)])
    model = build_model([*balls, plane], supports=[Support("plane", ALL[3])], gravity=lambda t: gravity)
    law = laws_of_bodies(model, {("held", "plane"): Rolling(0.2 * R)}, Gap())
    link = Linkage(model, (Rod("rod", "held", "free", ((0.0, 0.0, R), (0.3, 0.0, R))),))
    settings = SolverSettings(tol=1e-10, floor=1e-6)
    *_, last = Simulation(model, ExactContacts(model, 0.8), Theta(h, law=law), 30, settings, linkage=link)
    a = g * (2 * np.sin(alpha) - 0.2 * np.cos(alpha)) / 2.8
    assert_allclose(last.state.v.reshape(-1, 6)[:2, 0], a * 30 * h, rtol=1e-6)
    assert_allclose(abs(last.link_force("rod")[0]), 1.4 * a - g * (np.sin(alpha) - 0.2 * np.cos(alpha)), rtol=1e-5)
    assert abs(last.energy.residual) < 1e-15


def test_steps_with_rolling_resistance_are_written_resumed_and_shown(tmp_path: Path) -> None:
    """The FCLIB file holds the step's problem, its own solver finds the step's answer; a checkpoint goes on bit by bit; VTK has moments."""
    R = 0.1
    model = on_plane(ball(3, R, 1.0), 0.2)
    simulation = Simulation(model, ExactContacts(model, 0.5), Theta(2e-3, law=Rolling(0.1 * R)), 12, SolverSettings(tol=1e-10))
    found = list(simulation)
    step = found[5]
    (path,) = write_step(tmp_path, step, "ROLL")
    content = read_fclib(path)
    assert content.form == "global_rolling" and content.problem.nc == 1
    answer = solve(content.problem, "auto", tol=1e-10)
    assert answer.solved
    assert_allclose(answer.r, step.result.r, atol=1e-7 * abs(step.result.r).max())
    with pytest.raises(InputError, match="expected 'global' with rolling resistance"):
        write_step(tmp_path, step, "ROLL", ("local",))
    write_checkpoint(tmp_path / "checkpoint.h5", step)
    moments = read_checkpoint(tmp_path / "checkpoint.h5")
    assert moments is not None
    rest = list(simulation.run(*moments))
    assert_array_equal(rest[-1].state.x, found[-1].state.x)
    assert_array_equal(rest[-1].result.r, found[-1].result.r)
    writer = SeriesWriter(tmp_path / "vtk", model)
    writer.write(step)
    assert b"rolling_moment" in next((tmp_path / "vtk").glob("contacts_*.vtp")).read_bytes()


def test_what_rolling_resistance_does_not_cover_is_refused() -> None:
    part = brick("block", (1.0, 1.0, 0.2), (2, 2, 1), Material(1e9, 0.3, 2000.0))
    box = rigid_box("box", (0.2, 0.2, 0.2), (0.5, 0.5, 0.3), 1.0)
    model = build_model([Body("block", part), box], supports=[Support("block", ("x", "y", "z"), "z-")])
    simulation = Simulation(model, Everything(model, 0.5), Theta(1e-3, law=Rolling(0.01)), 1)
    with pytest.raises(InputError, match=r"Rolling: expected contacts of rigid bodies, got '.*' on '.*': the surface of a deformable body"):
        list(simulation)
    for law, message in (
        (lambda: Rolling(-0.1), "resistance: expected a length mu_r >= 0 in m, got -0.1"),
        (lambda: Rolling(np.nan), "resistance: expected a length"),
        (lambda: Rolling(0.1, Rolling(0.1)), "expected a law without rolling resistance"),
    ):
        with pytest.raises(InputError, match=message):
            law()
    table = laws_of_bodies(model, {}, Gap())
    assert list(Simulation(model, Everything(model, 0.5), Theta(1e-3, law=table), 1))
