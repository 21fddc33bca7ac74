"""Bodies that begin with velocities into each other are struck at once: no overlap, momentum kept, the energy of an inelastic impact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fcsim import (
    Ball,
    Everything,
    Gap,
    GeneralisedAlpha,
    Linkage,
    Material,
    Simulation,
    SolverSettings,
    State,
    Support,
    Theta,
    Velocity,
    Witness,
)
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model, build_model
from fcsim.mesh import Body, RigidBody, brick, rigid_box
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid
from fcsim.timestep.state import at_rest

SETTINGS = SolverSettings(name="auto", tol=1e-10)
SEEN = 1e-5  # of a body: what the witness sees


def begun(model: Model, velocities: dict[str, Sequence[float]]) -> State:
    start = at_rest(model)
    v = start.v.copy()
    for name, velocity in velocities.items():
        first = model.dof_offset[model.number[name]]
        v[first : first + len(velocity)] = velocity
    return State(0.0, start.x, v)


def simulation(
    model: Model, velocities: dict[str, Sequence[float]], mu: float = 0.3, h: float = 1e-3, steps: int = 5, **more
) -> Simulation:
    scheme = more.pop("scheme", Theta(h, 0.5, Gap()))
    witness = Witness(every=1, tolerance=1e3 * SEEN, stop=False)
    return Simulation(model, Everything(model, mu), scheme, steps, SETTINGS, begun(model, velocities), witness=witness, **more)


def extruded(name: str, loops: Sequence[Sequence[tuple[float, float]]], half: float) -> RigidBody:
    """Closed polygons in x, z along y: one, or the inner and the outer one of a ring with as many corners."""
    corners = np.array(loops, float)
    count, n = corners.shape[:2]
    points = np.concatenate([np.insert(loop, 1, y, axis=1) for y in (-half, half) for loop in corners])
    sides = [[k * n + i, k * n + (i + 1) % n, (count + k) * n + (i + 1) % n, (count + k) * n + i] for k in range(count) for i in range(n)]
    ends = [[count * k * n + i for i in range(n)] for k in range(2)]
    if count == 2:
        ends = [
            [2 * k * n + i, 2 * k * n + (i + 1) % n, (2 * k + 1) * n + (i + 1) % n, (2 * k + 1) * n + i] for k in range(2) for i in range(n)
        ]
    return rigid_solid(closed_surface(name, points, [*ends, *sides]), density=1000.0)


def circle(radius: float, n: int, height: float = 0.0) -> list[tuple[float, float]]:
    return [(radius * np.cos(a), height + radius * np.sin(a)) for a in 2 * np.pi * np.arange(n) / n]


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize("apart", [0.0, 2e-4])
def test_a_box_that_begins_downwards_stops_on_the_floor(unit: float, apart: float) -> None:
    """Half a step would bring it half a per cent into the floor, which is taken back at a tenth of its size a second only."""
    box = rigid_box("box", np.full(3, 0.1) * unit, np.array([0.03, 0.01, 0.05 + apart]) * unit, 2.0)
    model = build_model(
        [rigid_box("floor", np.array([1, 1, 0.2]) * unit, (0, 0, -0.1 * unit), 1.0), box], supports=[Support("floor", DIRECTIONS[3])]
    )
    first, *_, last = simulation(model, {"box": [0, 0, -unit]})
    assert first.overlap is not None and first.overlap.depth == 0.0
    assert np.abs(last.state.v[-6:-3]).max() < 1e-8 * unit
    assert last.state.x[-4] == pytest.approx(-apart * unit, abs=1e-9 * unit)
    lost = 0.5 * 2.0 * unit**2
    assert first.energy.normal_dissipation == pytest.approx(lost, rel=1e-7)
    assert first.ledger.supplied == pytest.approx(lost, rel=1e-7)
    assert abs(first.energy.residual) < 1e-12 * lost
    assert any("struck at once" in remark for remark in first.remarks) and not last.remarks


def test_two_boxes_that_touch_go_on_together() -> None:
    """m1 v1 / (m1 + m2), and the loss of m1 m2 / (m1 + m2) v^2 / 2; friction makes the second share what is sideways if it can."""
    model = build_model([rigid_box("a", (0.1, 0.1, 0.1), (0, 0, 0), 1.0), rigid_box("b", (0.1, 0.1, 0.1), (0.1, 0, 0), 3.0)])
    first, *_, last = simulation(model, {"a": [2.0, 0, 0]})
    velocity = model.rigid_part(last.state.v)
    np.testing.assert_allclose(velocity[:, 0], 0.5, rtol=1e-8)
    assert first.energy.normal_dissipation == pytest.approx(0.5 * 0.75 * 4.0, rel=1e-8)
    apart = simulation(model, {"a": [-2.0, 0, 0], "b": [0, 1.0, 0]})
    assert next(iter(apart)).struck is None


def test_a_driven_wall_that_strikes_gives_as_much_as_is_lost() -> None:
    """2 kg that a wall of 1 kg brings to 0.5 m/s: 1/4 J is lost of 1/2 J that the wall's support gives, more than the 1/8 J there were."""
    bodies = [rigid_box("wall", (0.1, 0.5, 0.5), (-0.05, 0, 0), 1.0), rigid_box("box", (0.1, 0.1, 0.1), (0.05, 0, 0), 2.0)]
    model = build_model(bodies, supports=[Support("wall", ("x",), velocity=0.5), Support("wall", ("y", "z", "rx", "ry", "rz"))])
    first = next(iter(simulation(model, {})))
    assert first.energy.support_work == pytest.approx(0.5)
    (told,) = [remark for remark in first.remarks if "struck at once" in remark]
    assert "took 0.25 of their 0.125 J and of 0.5 J that supports gave," in told


def test_a_driven_wall_that_a_joint_holds_something_to_gives_as_much_as_is_lost() -> None:
    """As the wall that strikes; impulses of links were said to take 0.25 J of 0.125 J."""
    bodies = [rigid_box("wall", (0.1, 0.5, 0.5), (-0.05, 0, 0), 1.0), rigid_box("box", (0.1, 0.1, 0.1), (0.15, 0, 0), 2.0)]
    model = build_model(bodies, supports=[Support("wall", ("x",), velocity=0.5), Support("wall", ("y", "z", "rx", "ry", "rz"))])
    linkage = Linkage(model, [Ball("joint", "wall", "box", (0.15, 0.0, 0.0))])
    first = next(iter(Simulation(model, Everything(model, mu=0.0), Theta(1e-3), 1, linkage=linkage)))
    assert first.energy.support_work == pytest.approx(0.5)
    assert any(told.endswith("took 0.25 of their 0.125 J and of 0.5 J that supports gave") for told in first.remarks)


@pytest.mark.parametrize("spin", [5.0, 20.0])
@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_a_ring_that_spins_on_a_peg_begins_without_overlap(spin: float, phase: float) -> None:
    """Polygons of 24 and 16 sides: a corner that turns within the first half step enters the other's face."""
    peg = extruded("peg", [circle(0.04, 16)], 0.1)
    turn = np.pi / 12 * phase
    c, s = np.cos(turn), np.sin(turn)
    loops = [[(c * x - s * z, s * x + c * z) for x, z in circle(radius, 24)] for radius in (0.06, 0.08)]
    inner = max(z for _, z in loops[0])
    ring = extruded("ring", [[(x, z + 0.04 - inner) for x, z in loop] for loop in loops], 0.02)
    model = build_model([peg, ring], supports=[Support("peg", DIRECTIONS[3])], gravity=lambda t: np.array([0, 0, -9.81]))
    for step in simulation(model, {"ring": [0, 0, 0, 0, spin, 0]}, steps=12, mu=0.5):
        assert step.overlap is not None and step.overlap.share <= 1e-4, step.number
        assert step.ledger.created <= 1e-4 * step.ledger.supplied


@pytest.mark.parametrize("velocity", [[0.5, 0, -1.0, 0, 5.0, 0], [0, 0, 0, 0, 10.0, 0], [0, 0.3, -0.2, 4.0, -3.0, 2.0]])
def test_a_hook_that_begins_in_motion(velocity: list[float]) -> None:
    hook = [(-0.1, 0.06), (0.1, 0.06), (0.1, -0.14), (0.06, -0.14), (0.06, 0.02), (-0.06, 0.02), (-0.06, -0.14), (-0.1, -0.14)]
    bar = [(-0.03, -0.02), (0.03, -0.02), (0.03, 0.02), (-0.03, 0.02)]
    bodies = [extruded("bar", [bar], 0.1), extruded("hook", [hook], 0.02)]
    model = build_model(bodies, supports=[Support("bar", DIRECTIONS[3])], gravity=lambda t: np.array([0, 0, -9.81]))
    for step in simulation(model, {"hook": velocity}, steps=12):
        assert step.overlap is not None and step.overlap.share <= 1e-4, step.number
        assert step.ledger.created <= 1e-4 * step.ledger.supplied


def test_two_that_a_joint_holds_strike_as_one() -> None:
    """A pendulum's lower box hits a wall by which it hangs: momentum along the joint's free directions, no work of the joint."""
    bodies = [rigid_box(name, (0.1, 0.1, 0.1), (0, 0, z), 1.0) for name, z in (("upper", 0.3), ("lower", 0.0))]
    wall = rigid_box("wall", (0.1, 1.0, 1.0), (0.1, 0, 0), 1.0)
    model = build_model([*bodies, wall], supports=[Support("wall", DIRECTIONS[3])])
    linkage = Linkage(model, [Ball("pin", "upper", "lower", (0, 0, 0.15))])
    first, *_, last = simulation(model, {"lower": [1.0, 0, 0], "upper": [1.0, 0, 0]}, mu=0.0, linkage=linkage)
    assert first.overlap is not None and first.overlap.depth == 0.0
    assert abs(first.energy.residual) < 1e-12 and abs(first.energy.link_work) < 1e-9
    assert np.abs(model.rigid_part(last.state.v)[:2]).max() < 1e-7


@pytest.mark.parametrize("scheme", [Theta(1e-3, 0.5, Gap()), GeneralisedAlpha(1e-3, rho=0.8), Theta(1e-3, 0.7, Gap())], ids=str)
def test_an_elastic_block_begins_downwards(scheme: Theta | GeneralisedAlpha) -> None:
    block = Body("block", brick("block", (0.1, 0.1, 0.1), (2, 2, 2), Material(1e7, 0.2, 1000.0)), translation=np.array([0.0, 0.0, 0.0]))
    floor = rigid_box("floor", (1, 1, 0.2), (0.05, 0.05, -0.1), 1.0)
    model = build_model([block, floor], supports=[Support("floor", DIRECTIONS[3])])
    first, *_ = simulation(model, {"block": [0, 0, -1.0] * 27}, scheme=scheme)
    assert first.overlap is not None and first.overlap.share <= SEEN
    assert first.struck is not None and abs(first.energy.residual) < 1e-10
    assert first.ledger.created <= 1e-4 * first.ledger.supplied


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_a_law_on_velocities_meets_an_impact_by_itself(e: float) -> None:
    box = rigid_box("box", (0.1, 0.1, 0.1), (0, 0, 0.05), 2.0)
    model = build_model([rigid_box("floor", (1, 1, 0.2), (0, 0, -0.1), 1.0), box], supports=[Support("floor", DIRECTIONS[3])])
    first, *_, last = simulation(model, {"box": [0, 0, -1.0]}, scheme=Theta(1e-3, 0.5, Velocity(e)))
    assert first.struck is None
    assert last.state.v[-4] == pytest.approx(e, abs=1e-7)


def test_a_step_that_is_longer_than_the_one_before_holds_what_it_would_pass_into() -> None:
    """Steps that were cut are doubled again, and what the first half of the longer one passes was not seen: 0.2 mm above the floor,
    at 1 m/s and after short steps, the middle of one of 1 ms lies 0.3 mm below it."""
    box = rigid_box("box", (0.1, 0.1, 0.1), (0, 0, 0.0502), 2.0)
    model = build_model([rigid_box("floor", (1, 1, 0.2), (0, 0, -0.1), 1.0), box], supports=[Support("floor", DIRECTIONS[3])])
    moment = list(simulation(model, {"box": [0, 0, -1.0]}, scheme=Theta(1e-7, 0.5, Gap()), steps=3))[-1].moment
    long = Simulation(
        model, Everything(model, 0.3), Theta(1e-3, 0.5, Gap()), 6, SETTINGS, witness=Witness(every=1, tolerance=1e3 * SEEN, stop=False)
    )
    for step in long.run(after=moment):
        assert step.overlap is not None and step.overlap.depth == 0.0
    assert abs(step.state.v[-4]) < 1e-8
