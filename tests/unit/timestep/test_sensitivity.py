"""Derivatives of runs with respect to their parameters, against closed forms, balances and differences of whole runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Everything, ExactContacts
from fcsim.contact_law import Compliant, Springs
from fcsim.errors import InputError
from fcsim.mesh import brick, rectangle, rigid_box, rigid_plane, rigid_rectangle, rigid_sphere
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body
from fcsim.running.case import load_case
from fcsim.timestep.chain import SolverSettings
from fcsim.timestep.generalised_alpha import GeneralisedAlpha
from fcsim.timestep.quasi_static import QuasiStatic
from fcsim.timestep.sensitivity import sensitivities
from fcsim.timestep.sensitivity.along_steps import RELATIVE
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State
from fcsim.timestep.step import Step
from fcsim.timestep.theta import Theta

WALL = Path(__file__).resolve().parents[3] / "cases" / "masonry_wall"
EXACT = SolverSettings(name="NSN-AC", tol=1e-12)
G, H = 9.81, 1e-3
HELD = Support("ground", ("x", "y", "z", "rx", "ry", "rz"))


def ball(mu: float = 0.3, speed: float = 2.0, weight: float = G, steps: int = 40) -> Simulation:
    """A ball of radius 0.1 m thrown along the ground without spin."""
    bodies = [rigid_sphere("ball", 0.1, (0, 0, 0.1), 2.0), rigid_plane("ground", (0, 0, 0), (0, 0, 1))]
    model = build_model(bodies, supports=[HELD], gravity=lambda t: (0, 0, -weight))
    v = np.zeros(model.n_dofs)
    v[0] = speed
    initial = State(0.0, np.zeros(model.n_dofs), v)
    return Simulation(model, ExactContacts(model, mu), Theta(H), steps, replace(EXACT, name="auto"), initial=initial, witness=None)


def test_a_ball_that_slides() -> None:
    """x = v0 t - mu g t^2 / 2, omega = 5/2 mu g t / R while it slides, sums of steps at theta = 1/2 exactly."""
    last = list(sensitivities(ball, {"mu": 0.3, "speed": 2.0, "weight": G}))[-1]
    step, found = last
    t, mu, R = step.state.t, 0.3, 0.1
    assert step.state.v[0] == pytest.approx(2.0 - mu * G * t) and step.state.v[0] > R * step.state.v[4]
    for name, dx, dv, spin, normal in (
        ("mu", -G * t**2 / 2, -G * t, 2.5 * G * t / R, 0.0),
        ("speed", t, 1.0, 0.0, 0.0),
        ("weight", -mu * t**2 / 2, -mu * t, 2.5 * mu * t / R, 2.0 * H),
    ):
        own = found[name]
        assert own.state.x[0] == pytest.approx(dx, rel=1e-7)
        assert own.state.v[0] == pytest.approx(dv, rel=1e-7)
        assert own.state.v[4] == pytest.approx(spin, rel=1e-7, abs=1e-7)
        assert own.r[0] == pytest.approx(normal, abs=1e-9)
        assert own.of(lambda s: s.state.v[0] ** 2) == pytest.approx(2 * step.state.v[0] * dv, rel=1e-6)


def test_a_ball_that_rolls_has_the_speed_of_sliding_forgotten() -> None:
    """At the end of sliding v = 5/7 v0 whatever mu."""
    step, found = list(sensitivities(partial(ball, steps=60), {"mu": 0.3, "speed": 0.5}))[-1]
    assert step.state.v[0] == pytest.approx(0.5 * 5 / 7, abs=2.8e-3)  # mu g h: the step in which it begins to roll is of length h
    assert found["speed"].state.v[0] == pytest.approx(5 / 7, rel=1e-6)
    assert found["mu"].state.v[0] == pytest.approx(0.0, abs=1e-7)


def pressed(E: float = 1e6, nu: float = 0.3, depth: float = 4e-3, width: float = 1.0) -> Simulation:
    """A block pressed onto a smooth plane in statics, its top driven down; sides free but for two planes of symmetry."""
    part = brick("block", (width, 0.5, 0.4), (3, 2, 2), Material(E, nu, 1000.0), origin=(0, 0, 0))
    ground = rigid_box("ground", (4, 4, 1), (0, 0, -0.5), 1.0)
    top = Support("block", ("z",), "z+", velocity=lambda t: -depth)
    supports = [HELD, Support("block", ("x",), "x-"), Support("block", ("y",), "y-"), top]
    model = build_model([Body("block", part), ground], supports=supports)
    return Simulation(model, Everything(model, 0.0), QuasiStatic(0.5), 2, EXACT, witness=None)


def test_a_block_pressed_in_statics() -> None:
    """R = E depth / L b d, side u = nu depth b / L; derivatives by hand."""
    E, nu, depth, b, d, L = 1e6, 0.3, 4e-3, 1.0, 0.5, 0.4
    step, found = list(sensitivities(pressed, {"E": E, "nu": nu, "depth": depth, "width": b}, relative=1e-4))[-1]
    side = 3 * np.flatnonzero(step.model.reference[:, 0] > b - 1e-9)[0]

    def force(s: Step) -> float:
        return float(s.contact_force_on(0)[2])

    assert force(step) == pytest.approx(E * depth / L * b * d, rel=1e-9)
    for name, of_force, of_side in (
        ("E", depth / L * b * d, 0.0),
        ("nu", 0.0, depth * b / L),
        ("depth", E / L * b * d, nu * b / L),
        ("width", E * depth / L * d, nu * depth / L),
    ):
        assert found[name].of(force) == pytest.approx(of_force, rel=1e-6, abs=1e-4)
        assert found[name].state.x[side] == pytest.approx(of_side, rel=1e-6, abs=1e-12)


def rubbed(mu: float = 0.3, E: float = 1e6, way: float = 4e-3) -> Simulation:
    """A block pressed onto a rough plane in statics and dragged along it by its top."""
    part = brick("block", (1.0, 0.5, 0.4), (3, 2, 2), Material(E, 0.3, 1000.0), origin=(0, 0, 0))
    ground = rigid_box("ground", (4, 4, 1), (0, 0, -0.5), 1.0)
    along = Support("block", ("x",), "z+", velocity=lambda t: 4 * way if t > 0.25 else 0.0)
    down = Support("block", ("z",), "z+", velocity=lambda t: -way if t <= 0.25 else 0.0)
    aside = Support("block", ("y",), "z+")
    model = build_model([Body("block", part), ground], supports=[HELD, down, along, aside])
    return Simulation(model, Everything(model, mu), QuasiStatic(0.25), 5, EXACT, witness=None)


def test_a_block_dragged_in_statics() -> None:
    """Some of its foot sticks, some slides; against whole runs."""
    values = {"mu": 0.3, "E": 1e6, "way": 4e-3}
    found = list(sensitivities(rubbed, values))
    u_T = np.linalg.norm(found[-1][0].result.u.reshape(-1, 3)[:, 1:], axis=1)
    assert (u_T > 1e-5).any()
    for name in values:
        for (_, own), (x, _) in zip(found, differences(rubbed, values, name, 1e-5), strict=True):
            assert np.abs(own[name].state.x - x).max() <= 1e-6 * np.abs(x).max() + 1e-11 / values[name]


def dragged(E: float = 2000.0, density: float = 2e-9, mu: float = 0.3, alpha: float = 5.0) -> Simulation:
    """In mm, N, t: a block of consistent mass dragged 10 mm along the ground by a side; what its E does to it is 1e-11 of that."""
    part = brick("block", (20, 10, 8), (3, 2, 2), Material(E, 0.35, density), origin=(0, 0, 0))
    drive = Support("block", ("x",), "x+", velocity=lambda t: 200.0 * min(t / 0.005, 1.0))
    bodies = [Body("block", part), rigid_box("ground", (400, 100, 10), (0, 0, -5), 1e-3)]
    damped = {"alpha": alpha, "beta": 1e-5, "lumped": False}
    model = build_model(bodies, supports=[HELD, drive], gravity=lambda t: (0, 0, -9810.0), kinematics="linear", **damped)  # type: ignore[arg-type]
    return Simulation(model, Everything(model, mu), Theta(2e-4, 0.6), 30, EXACT, witness=None)


@pytest.mark.parametrize("relative", [RELATIVE, pytest.param(10 * RELATIVE, marks=pytest.mark.slow)])
def test_parameters_that_hardly_matter(relative: float) -> None:
    """Their derivatives are not round-off: within 1 % of whole runs' differences at 1e-2, by the default and ten times that."""
    values = {"E": 2000.0, "density": 2e-9, "mu": 0.3, "alpha": 5.0}
    *_, (_, own) = sensitivities(dragged, values, relative=relative)
    for name in values:
        x = differences(dragged, values, name, 1e-2)[-1][0]
        assert np.abs(own[name].state.x - x).max() <= 1e-2 * np.abs(x).max(), name


def test_rotation_vectors_beyond_half_a_turn() -> None:
    """A ball that spins about z: its rotation is spin times t, whatever its rotation vector says of it."""

    def spun(spin: float) -> Simulation:
        simulation = ball(weight=1e-9, speed=1e-9, steps=40)
        v = np.zeros(simulation.model.n_dofs)
        v[5] = spin
        return replace(simulation, initial=State(0.0, np.zeros(simulation.model.n_dofs), v))

    rate = np.pi / 0.04  # half a turn at the end, one side before it and one beyond
    step, found = list(sensitivities(spun, {"spin": rate}))[-1]
    assert abs(abs(step.state.x[5]) - np.pi) < 1e-6
    assert found["spin"].state.x[5] == pytest.approx(0.04, rel=1e-6)


def differences(build: Callable[..., Simulation], values: dict[str, float], name: str, relative: float) -> list[tuple[Any, ...]]:
    """Central differences of whole runs, solved anew: of x, v and r step by step."""
    d = relative * values[name]
    below, above = (list(build(**{**values, name: values[name] + s * d})) for s in (-1, 1))
    return [tuple((getattr(b, p) - getattr(a, p)) / (2 * d) for p in "xv") for a, b in zip(_states(below), _states(above), strict=True)]


def _states(steps: list[Step]) -> list[State]:
    return [step.state for step in steps]


def tumbling(E: float = 2e6, density: float = 1000.0, mu: float = 0.4, spin: float = 6.0, *, scheme: Any) -> Simulation:
    """A plane deformable block thrown at the ground with a corner ahead: it turns, strikes, slides."""
    part = rectangle("block", (0.4, 0.2), (4, 2), Material(E, 0.3, density), origin=(0, 0.101))
    ground = rigid_rectangle("ground", (4, 1), (0, -0.5), 1.0)
    model = build_model(
        [Body("block", part), ground], supports=[Support("ground", ("x", "y", "rz"))], gravity=lambda t: (0.0, -G), beta=1e-3
    )
    n = model.n_elastic // 2
    X = model.reference[:n] - [0.2, 0.201]
    v = np.zeros(model.n_dofs)
    v[: 2 * n] = (spin * np.column_stack([-X[:, 1], X[:, 0]]) + [1.0, -0.5]).ravel()
    initial = State(0.0, np.zeros(model.n_dofs), v)
    return Simulation(model, Everything(model, mu), scheme, round(0.084 / scheme.h), EXACT, initial=initial, witness=None)


@pytest.mark.parametrize(
    ("scheme", "names"),
    [(Theta(4e-3, 0.6), ("E", "density", "mu", "spin")), (GeneralisedAlpha(3e-3, 0.8), ("E", "density"))],
    ids=["theta", "generalised alpha"],
)
def test_a_turning_block_that_strikes_the_ground(scheme: Any, names: tuple[str, ...]) -> None:
    """Forces follow its rotation, contacts its corners; each parameter against runs at two values of it."""
    every = {"E": 2e6, "density": 1000.0, "mu": 0.4, "spin": 6.0}
    values = {name: every[name] for name in names}
    build = partial(tumbling, scheme=scheme)
    found = list(sensitivities(build, values, relative=1e-4))
    assert max(float(step.result.r.max(initial=0.0)) for step, _ in found) > 0
    turned = [step.model.elastic.rotation(step.model.elastic.at(step.state.x))[0][1, 0] for step, _ in found]
    assert max(turned) > 0.2 and turned[-1] < 0.9 * max(turned)  # it turns back once it has struck
    for name in values:
        expected = differences(build, values, name, 1e-5)
        for (_, own), (x, v) in zip(found, expected, strict=True):
            assert np.abs(own[name].state.x - x).max() <= 1e-6 * np.abs(x).max() + 1e-12 / values[name]
            assert np.abs(own[name].state.v - v).max() <= 1e-5 * np.abs(v).max() + 1e-10 / values[name]


def wall(**values: float) -> Simulation:
    """Thirty steps of the masonry wall, coarse: its weight is laid on and its shearing begins."""
    script = load_case(WALL)
    parameters = script.parameters(steps=30, divisions=(4, 2, 2), gravity_first=0, tol=1e-12, **values)
    return replace(script.build(parameters).simulation, witness=None)


def weight(step: Step) -> float:
    """The bottom platen's reaction less the rate of change of all momentum [N]."""
    model = step.model
    rate = model.apply_mass(step.state.v - step.previous.v) / step.scheme.h
    moving = rate[2 : model.n_elastic : 3].sum() + model.rigid_part(rate)[model.number["top platen"] - len(model.deformable), 2]
    return float(-step.contact_force_on(model.number["bottom platen"])[2] - moving)


def test_a_wall_carries_what_it_is_given() -> None:
    """The bottom platen's reaction less the rate of momentum is the weight: its derivatives are 1 and g times the bricks' volume."""
    values = {"compression": 3e4, "density": 2000.0, "E": 2.2e9}
    slides = False
    for step, found in sensitivities(wall, values):
        slides |= bool((np.abs(step.result.u.reshape(-1, 3)[:, 1:]).max(axis=1, initial=0) > 1e-5)[step.result.r[::3] > 0].any())
        if step.number < 20:
            continue
        volume = 3 * 3.5 * 0.2 * 0.1 * 0.1
        assert found["compression"].of(weight) == pytest.approx(1.0, rel=1e-6)
        assert found["density"].of(weight) == pytest.approx(G * volume, rel=1e-5)
        assert found["E"].of(weight) == pytest.approx(0.0, abs=1e-6 * 3e4 / 2.2e9)
    assert slides


@pytest.mark.slow
def test_the_wall_against_whole_runs() -> None:
    values = {"compression": 3e4, "E": 2.2e9, "nu": 0.2, "beta": 0.05}
    found = list(sensitivities(wall, values))
    for name in values:
        for (_, own), (x, v) in zip(found, differences(wall, values, name, 1e-4), strict=True):
            assert np.abs(own[name].state.x - x).max() <= 5e-4 * np.abs(x).max()
            assert np.abs(own[name].state.v - v).max() <= 5e-3 * np.abs(v).max()


def test_refusals() -> None:
    with pytest.raises(InputError, match="parameter 'mu': expected a finite number other than 0"):
        list(sensitivities(ball, {"mu": 0.0}))
    for relative in (1.0, "a"):
        with pytest.raises(InputError, match=r"relative: expected a number > 0 and < 0\.1"):
            list(sensitivities(ball, {"mu": 0.3}, relative=relative))  # type: ignore[arg-type]
    for value in ("a", None, float("nan")):
        with pytest.raises(InputError, match="parameter 'mu': expected a finite number"):
            list(sensitivities(ball, {"mu": value}))  # type: ignore[dict-item]
    with pytest.raises(InputError, match="build: expected a function of weigth: got an unexpected keyword argument 'weigth'"):
        list(sensitivities(ball, {"weigth": 9.81}))
    with pytest.raises(InputError, match="build: expected it to return a Simulation, got int"):
        list(sensitivities(lambda mu: 3, {"mu": 0.3}))  # type: ignore[arg-type, return-value]
    with pytest.raises(InputError, match="parameters: expected values by name"):
        list(sensitivities(ball, [0.3]))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"parameter 'h': expected the same steps for all values, got 40 of 0\.0009999 s"):
        list(sensitivities(lambda h: replace(ball(), scheme=Theta(h)), {"h": 1e-3}, relative=1e-4))
    speeds = iter(np.linspace(1, 2, 9))
    with pytest.raises(InputError, match="step 1: expected a step that is determined by its beginning, got other"):
        list(sensitivities(lambda mu: ball(mu, speed=next(speeds)), {"mu": 0.3}))

    def meshed(size: float = 1.0) -> Simulation:
        part = brick("block", (1, 1, 1), (3 if size > 1 else 2, 1, 1), Material(1e6, 0.3, 1000.0), origin=(0, 0, 0))
        model = build_model([Body("block", part), rigid_box("ground", (4, 4, 1), (0, 0, -0.5), 1.0)], supports=[HELD])
        return Simulation(model, Everything(model, 0.3), Theta(H), 1, EXACT, witness=None)

    with pytest.raises(
        InputError, match=r"parameter 'size': expected the same meshes for all values, got 54 degrees of freedom at 1\.001 and 42 at 1"
    ):
        list(sensitivities(meshed, {"size": 1.0}))

    def soft(mu: float = 0.3) -> Simulation:
        law = Compliant(Springs(normal=1e6, tangential=1e6, each=True))
        return replace(ball(mu), scheme=Theta(H, law=law))

    with pytest.raises(InputError, match="step 1: expected a step of rigid Coulomb contact, got the contact law Compliant"):
        list(sensitivities(soft, {"mu": 0.3}))

    def box(mu: float = 0.3) -> Simulation:
        bodies = [rigid_box("box", (1, 1, 1), (0, 0, 0.5), 1.0), rigid_box("ground", (4, 4, 1), (0, 0, -0.5), 1.0)]
        model = build_model(bodies, supports=[HELD], gravity=lambda t: (0.5, 0, -G))
        return Simulation(model, Everything(model, mu), Theta(H), 1, replace(EXACT, name="auto"), witness=None)

    with pytest.raises(InputError, match="expected reactions that are unique"):
        list(sensitivities(box, {"mu": 0.3}))
