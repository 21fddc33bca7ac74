"""Two bodies that nothing but a joint holds: momentum, moment of momentum and energy of the closed system, for every kind of link."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
from numpy.testing import assert_allclose

import fcsim
from fcsim import ExactContacts, Linkage, Simulation, SolverSettings, Support, Theta, at_rest, build_model
from fcsim.linkage import Ball, Bonded, Hinge, Rod, Slider, SpringDamper, Tied
from fcsim.mesh import Body, Material, brick, rectangle, rigid_box, rigid_rectangle, rigid_sphere
from fcsim.mesh.material import neo_hooke
from fcsim.timestep.links.saddle_point import SaddlePoint
from tests.analytic.test_linkage import moved

FLAT = rigid_rectangle("a", (1.0, 0.1), (0.5, 0.0), 2.0), rigid_rectangle("b", (1.0, 0.1), (1.5, 0.0), 1.0)
BOXES = rigid_box("a", (1.0, 0.2, 0.1), (0.5, 0.0, 0.0), 2.0), rigid_box("b", (1.0, 0.1, 0.2), (1.5, 0.0, 0.0), 1.0)
SOFT = Material(1e7, 0.3, 1000.0)
SHEETS = tuple(Body(n, rectangle(n, (1.0, 0.2), (4, 1), SOFT, origin=(x, 0.0))) for n, x in (("a", 0.0), ("b", 1.0)))
BARS = (
    Body("a", brick("a", (1.0, 0.4, 0.4), (2, 1, 1), SOFT)),
    Body("b", brick("b", (1.0, 0.4, 0.4), (2, 2, 2), SOFT, origin=(1.0, 0.0, 0.0))),
)
HALVES = BARS[0], Body("b", brick("b", (1.0, 0.4, 0.4), (2, 1, 1), SOFT, origin=(1.0, 0.0, 0.0)))
APART = (0.8, 0.1, 0.05), (1.3, 0.05, 0.1)
ALONG = (1.1, 0.0, 0.0), (1.9, 0.0, 0.0)

RUBBER = tuple(replace(body, part=replace(body.part, material=neo_hooke(1e7, 0.3, 1000.0))) for body in BARS)
STRIP = (
    Body("a", brick("a", (2.0, 0.4, 0.4), (4, 1, 1), SOFT)),
    Body("b", brick("b", (1.0, 0.4, 0.4), (2, 1, 1), SOFT, origin=(1.0, 0.4, 0.0))),
)
OFF = BARS[0], Body("b", brick("b", (1.0, 0.4, 0.4), (2, 2, 2), SOFT, origin=(1.0005, 0.0, 0.0)))
ROW = tuple(Body(n, rectangle(n, (1.0, 0.2), (4, 1), SOFT, origin=(float(x), 0.0))) for x, n in enumerate("abcde"))
BOX, SLAB = rigid_box("b", (1.0, 0.4, 0.4), (1.5, 0.2, 0.2), 160.0), rigid_rectangle("b", (1.0, 0.2), (1.5, 0.1), 200.0)
AXIS, NODES = ((1.0, 0.1, 0.2), (1.0, 0.3, 0.2)), ((1.0, 0.0, 0.4), (1.0, 0.4, 0.4))
ENDS, LINE = ((0.8, 0.1), (1.2, 0.15)), ((1.1, 0.4, 0.2), (1.9, 0.4, 0.2))

LINKED: dict[str, tuple[Any, list[Any]]] = {
    "pin": (FLAT, [Ball("j", "a", "b", (1.0, 0.0))]),
    "ball": (BOXES, [Ball("j", "a", "b", (1.0, 0.0, 0.0))]),
    "hinge": (BOXES, [Hinge("j", "a", "b", ((1.0, -0.1, 0.0), (1.0, 0.1, 0.05)))]),
    "slider in the plane": (FLAT, [Slider("j", "a", "b", ((1.1, 0.0), (1.9, 0.0)))]),
    "slider that turns": (BOXES, [Slider("j", "a", "b", ALONG)]),
    "slider": (BOXES, [Slider("j", "a", "b", ALONG, beside=(1.5, 0.1, 0.0))]),
    "rod": (BOXES, [Rod("j", "a", "b", APART)]),
    "spring": (BOXES, [SpringDamper("j", "a", "b", APART, 50.0)]),
    "dashpot": (BOXES, [SpringDamper("j", "a", "b", APART, 50.0, 2.0)]),
    "pin of deformable bodies": (SHEETS, [Ball("j", "a", "b", (1.0, 0.1))]),
    "hinge of deformable bodies": (BARS, [Hinge("j", "a", "b", AXIS)]),
    "hinge of edges": (BARS, [Hinge("j", "a", "b", NODES)]),
    "hinge of rubber": (RUBBER, [Hinge("j", "a", "b", AXIS)]),
    "rod of deformable bodies": (SHEETS, [Rod("j", "a", "b", ENDS)]),
    "spring of deformable bodies": (SHEETS, [SpringDamper("j", "a", "b", ENDS, 1e4)]),
    "stiff spring": (SHEETS, [SpringDamper("j", "a", "b", ENDS, 1e9)]),
    "dashpot of deformable bodies": (SHEETS, [SpringDamper("j", "a", "b", ENDS, 1e4, 2e3)]),
    "slider of deformable bodies": (STRIP, [Slider("j", "a", "b", LINE, beside=(1.5, 0.4, 0.35))]),
    "pin of a rigid and a deformable body": ((SHEETS[0], SLAB), [Ball("j", "b", "a", (1.0, 0.1))]),
    "hinge of a rigid and a deformable body": ((BARS[0], BOX), [Hinge("j", "a", "b", AXIS)]),
    "rod of a rigid and a deformable body": ((SHEETS[0], SLAB), [Rod("j", "a", "b", ENDS)]),
    "spring of a rigid and a deformable body": ((SHEETS[0], SLAB), [SpringDamper("j", "a", "b", ENDS, 1e4)]),
    "tie": (BARS, [Tied("j", ("b", "x-"), ("a", "x+"))]),
    "tie across a gap": (OFF, [Tied("j", ("b", "x-"), ("a", "x+"), distance=1e-3)]),
    "glue": ((BARS[0], BOX), [Tied("j", ("a", "x+"), ("b", "x-"))]),
    "bond": (HALVES, [Bonded("j", "a", "b")]),
    "chain": (ROW, [Ball(f"j{k}", ROW[k].name, ROW[k + 1].name, (k + 1.0, 0.1)) for k in range(4)]),
    "closed loop": (
        ROW[:3],
        [Ball("p", "a", "b", (1.0, 0.1)), Rod("q", "b", "c", ((1.8, 0.1), (2.2, 0.1))), Rod("l", "a", "c", ((0.0, 0.1), (3.0, 0.1)))],
    ),
}
TAKES = {"dashpot", "dashpot of deformable bodies"}
EXACT = {"spring of deformable bodies", "stiff spring", "pin of deformable bodies", "tie", "bond", "chain"}


def thrown(model: fcsim.Model, apart: bool = True) -> np.ndarray:
    """Velocities (n_dofs,); apart: each body flies and turns on its own, which joints end in the first step, else all as one."""
    v, d = np.zeros(model.n_dofs), model.dimension
    for k, body in enumerate(model.bodies):
        spin = np.array([[0.5, -1.0, 3.0], [-0.3, 2.0, -4.0]])[k % 2 if apart else 0] * (
            np.ones(3) if d == 3 else np.array([0.0, 0.0, 1.0])
        )
        centre = body.points.mean(axis=0) if apart else model.reference.mean(axis=0)
        speed = np.array([[1.0, -0.5, 0.3], [0.2, 0.7, -0.4]])[k % 2 if apart else 0]
        own = slice(*model.dof_offset[k : k + 2])
        if isinstance(body, Body):
            v[own] = (speed + np.cross(spin, wide(body.points - centre)))[:, :d].ravel()
        else:
            v[own] = [*(speed + np.cross(spin, wide(body.centre - centre)))[..., :d].ravel(), *(spin if d == 3 else spin[2:])]
    return v


def wide(a: np.ndarray) -> np.ndarray:
    """Vectors (..., 3) of vectors (..., d)."""
    return np.pad(a, (*[(0, 0)] * (a.ndim - 1), (0, 3 - a.shape[-1])))


def momenta(model: fcsim.Model, state: fcsim.State) -> np.ndarray:
    """Momentum [N s] and moment of momentum about the origin [N m s], (6,), added up node by node and rigid body by rigid body."""
    d, n = model.dimension, model.n_elastic
    P = model.apply_mass(state.v, model.rigid_mass(state.x))
    x, p = (wide(a.reshape(-1, d)) for a in (model.reference.ravel()[:n] + state.x[:n], P[:n]))
    rigid, moved = model.rigid_part(P), model.rigid_part(state.x)[:, :d]
    centres = wide(np.array([body.centre for body in model.rigid]).reshape(-1, d) + moved)
    spin = rigid[:, d:] if d == 3 else np.pad(rigid[:, d:], ((0, 0), (2, 0)))
    q = wide(rigid[:, :d])
    return np.concatenate([p.sum(axis=0) + q.sum(axis=0), (np.cross(x, p)).sum(axis=0) + (np.cross(centres, q) + spin).sum(axis=0)])


def flight(bodies: Any, links: Any, h: float, steps: int, apart: bool) -> tuple[np.ndarray, list[fcsim.Step]]:
    """Momenta (steps + 1, 6) over those of the bodies one by one, the first row theirs at the beginning, and the steps."""
    done = moved(bodies, links, fcsim.Theta(h), steps, 0.0, initial=lambda model: thrown(model, apart))
    model = done[0].model
    begun = fcsim.State(0.0, np.zeros(model.n_dofs), thrown(model, apart))
    found = np.array([momenta(model, begun), *(momenta(model, step.state) for step in done)])
    speed = np.abs(model.apply_mass(begun.v, model.rigid_mass(begun.x)))
    size = np.repeat([max(np.linalg.norm(found[0, :3]), 0.1 * speed[: model.n_elastic].sum()), np.linalg.norm(found[0, 3:])], 3)
    return found / size, done


@pytest.mark.each_value
@pytest.mark.parametrize("apart", [False, True], ids=["as one", "each on its own"])
@pytest.mark.parametrize("name", LINKED)
def test_momentum_moment_of_momentum_and_energy_are_kept(name: str, apart: bool) -> None:
    """Momentum to 1e-12 and its moment to 1e-9, from the initial state on, whether its velocities agree with the joint or not; the balance
    of energy closes, a dashpot takes energy, no other link gives any but for the swing of the scheme's order, springs and what is linear
    in the nodes' places none at all."""
    found, steps = flight(*LINKED[name], h=4e-3, steps=5, apart=apart)
    assert np.abs(found - found[0])[:, :3].max() < 1e-12
    assert np.abs(found - found[0])[:, 3:].max() < 1e-9
    energies = [step.energy for step in steps]
    begun = energies[0].at_beginning
    assert max(abs(e.residual) for e in energies) < 1e-9 * begun
    held = np.array([e.kinetic + e.elastic + e.links for e in energies])
    if name in TAKES:
        taken = -np.diff(held)
        assert taken.min() > -1e-12 * begun and taken.sum() > 1e-6 * begun
    else:
        assert np.ptp(held) < (1e-9 if name in EXACT else 3e-3 if apart else 1e-4) * begun


@pytest.mark.parametrize("name", ["ball", "hinge of deformable bodies", "pin of a rigid and a deformable body", "tie"])
def test_velocities_that_a_joint_forbids_agree_at_once(name: str) -> None:
    """What the joint's impulse takes is the energy of the difference of velocities, dv . M dv / 2, and is said; velocities that agree lose
    nothing."""
    _, steps = flight(*LINKED[name], h=4e-3, steps=1, apart=True)
    first, model = steps[0], steps[0].model
    dv = first.previous.v - thrown(model)
    lost = 0.5 * float(dv @ model.apply_mass(dv, model.rigid_mass(first.previous.x)))
    assert first.struck is not None and -first.struck.link_work == pytest.approx(lost, rel=1e-9)
    assert any(f"took {lost:.4g} of their" in remark for remark in first.remarks)
    assert flight(*LINKED[name], h=4e-3, steps=1, apart=False)[1][0].struck is None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["hinge of deformable bodies", "rod of deformable bodies", "spring of deformable bodies", "chain"])
def test_ten_turns_keep_the_moment_of_momentum(name: str) -> None:
    """To 1e-8 in 20 s at 3.2 rad/s, while the links' work swings about zero."""
    found, steps = flight(*LINKED[name], h=1e-2, steps=2000, apart=False)
    assert np.abs(found - found[0]).max() < 1e-8
    held = np.array([e.kinetic + e.elastic + e.links for e in (step.energy for step in steps)])
    half = len(held) // 2
    assert np.ptp(held[half:]) < 2 * np.ptp(held[:half]) + 1e-9 * held[0]


def elastic_moments(steps: list[fcsim.Step], theta: float) -> np.ndarray:
    """What the bodies' own forces of strain give to the moment of momentum (steps, 3): they have none in the mean of a step's ends, and the
    scheme counts moments at x + (1 - theta) dx, which gives (1/2 - theta) sum dx x h F."""
    found = []
    for step in steps:
        model, dx = step.model, step.state.x - step.previous.x
        first, last = model.elastic.at(step.previous.x), model.elastic.at(step.state.x)
        force = -model.elastic.force(first, last, theta)
        place, force = (wide(a[: model.n_elastic].reshape(-1, model.dimension)) for a in (dx, force))
        found.append((0.5 - theta) * step.scheme.h * np.cross(place, force).sum(axis=0))
    return np.array(found)


@pytest.mark.each_value
@pytest.mark.parametrize("theta", [0.6, 1.0])
@pytest.mark.parametrize("name", [name for name in LINKED if "rubber" not in name])
def test_at_other_theta_links_take_no_moment_of_momentum(name: str, theta: float) -> None:
    """Rigid bodies keep it to 1e-12 at any theta. Deformable ones lose it by their forces of strain, linked or not: nothing else does."""
    done = moved(*LINKED[name], fcsim.Theta(4e-3, theta=theta), 5, 0.0, initial=lambda model: thrown(model, False))
    model = done[0].model
    begun = fcsim.State(0.0, np.zeros(model.n_dofs), thrown(model, False))
    found = np.array([momenta(model, begun), *(momenta(model, step.state) for step in done)])
    size = float(np.linalg.norm(found[0, 3:]))
    own = elastic_moments(done, theta)
    assert np.abs(np.diff(found[:, 3:], axis=0) - own).max() < 1e-11 * size
    assert np.any(own) == bool(model.n_elastic)
    energies = [step.energy for step in done]
    assert max(abs(e.residual) for e in energies) < 1e-9 * energies[0].at_beginning
    assert sum(e.numerical_dissipation for e in energies) > 0


@pytest.mark.parametrize(("theta", "h"), [pytest.param(1.0, 2e-3, marks=pytest.mark.slow), (1.0, 4e-3), (0.75, 2e-3)])
def test_at_other_theta_a_bar_in_two_halves_loses_what_one_bar_loses(theta: float, h: float) -> None:
    """That share of its moment of momentum in a step is (theta - 1/2) (omega h)^2: (theta - 1/2) times the way omega r h and the forces
    m omega^2 r, over m omega r^2."""
    omega, steps = 4.0, 50
    whole = Body("a", brick("a", (2.0, 0.4, 0.4), (4, 1, 1), SOFT))

    def spun(model: fcsim.Model) -> np.ndarray:
        return np.concatenate([np.cross([0.0, 0.0, omega], body.points - [1.0, 0.2, 0.2]).ravel() for body in model.bodies])

    kept = []
    for bodies, links in (((whole,), []), (HALVES, [Bonded("j", "a", "b")])):
        done = moved(bodies, links, fcsim.Theta(h, theta=theta), steps, 0.0, initial=spun)
        spin = [momenta(step.model, step.state)[5] for step in done]
        kept.append(spin[-1] / spin[0])
    assert kept[1] == pytest.approx(kept[0], rel=1e-9)
    assert -np.log(kept[0]) / (steps - 1) == pytest.approx((theta - 0.5) * (omega * h) ** 2, rel=0.02)


@pytest.mark.parametrize("m", [1.0, 1e3, 1e6])
def test_what_a_hinge_leaves_of_a_body_in_any_unit_of_length(m: float) -> None:
    """A body of mass M and inertia I about its centre at (a, 0, 0), hinged about z through the origin, at a contact at (x, y, z): a force
    along y moves it by x^2 / (I + M a^2), one along x by y^2 / (I + M a^2), one along the axis not at all. In micrometres rows of the
    hinge were taken for one another, whose arms are a million times their forces, and it gave way along its axis, by 1 / M."""
    M, inertia, a = 20.0, 1.7 * m**2, 0.5 * m
    mass = sp.csr_array(np.diag([M, M, M, 6.7 * m**2, 8.3 * m**2, inertia]))

    def pushed(point: tuple[float, float, float]) -> np.ndarray:
        """Generalised forces (6, 3) of unit forces along x, y, z at a point [m]."""
        x, y, z = np.multiply(point, m) - (a, 0.0, 0.0)
        return np.vstack([np.eye(3), [[0, -z, y], [z, 0, -x], [-y, x, 0]]])

    rows = np.hstack([pushed((0, 0, -1)), pushed((0, 0, 1))[:, :2]])
    point = (0.9, -0.02, 0.3)
    saddle = SaddlePoint(mass, sp.csr_array(rows), np.zeros(5))
    assert saddle.rank == 5
    x, y, _ = np.multiply(point, m)
    about = inertia + M * a**2
    expected = np.zeros((3, 3))
    expected[:2, :2] = np.outer((-y, x), (-y, x)) / about
    assert_allclose(saddle.delassus(sp.csr_array(pushed(point))), expected, atol=1e-12 / M)


@pytest.mark.parametrize("m", [1.0, 1e6])
def test_a_door_that_strikes_its_stop_in_any_unit_of_length(m: float) -> None:
    """The stop at the distance d from the hinge takes the moment of momentum, J = I omega / d; in micrometres nothing converged."""
    d, omega, mass = 0.9, 2.0, 20.0
    door = rigid_box("door", (1.0 * m, 0.04 * m, 2.0 * m), (0.5 * m, 0.0, 1.0 * m), mass)
    stop = rigid_sphere("stop", 0.05 * m, (d * m, -0.071 * m, 1.0 * m), 1.0)
    model = build_model([door, stop], supports=[Support("stop", ("x", "y", "z", "rx", "ry", "rz"))])
    start, own = at_rest(model), model.dof_offset[model.number["door"]]
    start.v[own + 1], start.v[own + 5] = -0.5 * omega * m, -omega
    linkage = Linkage(model, [Hinge("hinge", None, "door", ends=((0.0, 0.0, 0.0), (0.0, 0.0, 2.0 * m)))])
    solver = SolverSettings(floor=1e-3 * m)
    run = Simulation(model, ExactContacts(model, 0.0), Theta(1e-3), 6, solver, initial=start, linkage=linkage)
    impulse = sum(-1e-3 * step.contact_force_on(model.number["stop"])[1] for step in run)
    inertia = mass * (1 / 3 + 0.04**2 / 12)
    assert impulse / m == pytest.approx(inertia * omega / d, rel=1e-3)
