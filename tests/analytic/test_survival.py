"""What collapses and piles up: no overlap, no energy from nothing, rest in the end."""

from __future__ import annotations

import importlib.util
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fcsim import Everything, Gap, Simulation, SolverSettings, State, Step, Support, Theta, Witness, at_rest, build_model
from fcsim.assembly.layout import DIRECTIONS
from fcsim.mesh import rigid_box
from fcsim.running.case import load_case

CASES = Path(__file__).parents[2] / "cases"

pytestmark = pytest.mark.slow


def simulation(name: str, **parameters: Any) -> Simulation:
    script = load_case(CASES / name)
    return script.build(script.parameters(**parameters)).simulation


def survived(run: Simulation, overlap: float, rest: float) -> Step:
    """The last step; overlap: largest share of a body's extent at any witness; rest: kinetic energy in the end by its largest.

    Contacts create no energy but what friction returns: it opposes the velocity u+ at a step's end and works on the mean of u- and u+, so
    that where other forces, stress above all, turn u_T within the step it gives r_T . (u- + u+) / 2 <= r_T . u- / 2. All in all below 1e-4.
    """
    kinetic, returned = [], 1e-9
    for step in run:
        kinetic.append(step.energy.kinetic)
        if step.overlap is not None:
            assert step.overlap.share <= overlap, f"step {step.number}: {step.overlap.between}"
        d = run.model.dimension
        r, before = (of_contacts.reshape(-1, d) for of_contacts in (step.result.r, step.H.T @ step.previous.v))
        returned += 0.5 * float(np.maximum(np.einsum("ai,ai->a", r[:, 1:], before[:, 1:]), 0.0).sum())
        assert step.ledger.created <= 1e-4 * step.ledger.supplied + returned
    assert step.ledger.created <= 1e-4 * step.ledger.supplied
    assert kinetic[-1] < rest * max(kinetic)
    return step


@pytest.mark.parametrize("seed", [1, 2])
def test_balls_poured_into_a_box(seed: int) -> None:
    """Exact spheres: no overlap at all, and the floor carries what does not hang on the walls by friction."""
    run = simulation("granular", n=40, seed=seed)
    last = survived(run, overlap=1e-4, rest=1e-2)
    model = run.model
    weight = 9.81 * sum(body.mass for body in model.rigid[:40])
    walls = -sum(last.contact_force_on(model.number[name])[2] for name in ("floor", "left", "right", "front", "back"))
    assert walls == pytest.approx(weight, rel=0.05)
    centres = np.array([body.centre for body in model.rigid[:40]]) + model.rigid_part(last.state.x)[:40, :3]
    radii = np.array([body.shape.radius for body in model.rigid[:40] if body.shape is not None])
    assert np.all(centres > radii[:, None] * (1 - 1e-4))
    assert np.all(centres[:, :2] < 0.24 - radii[:, None] * (1 - 1e-4))


@pytest.mark.parametrize(
    ("parameters", "rest"),
    [
        ({"n": 8}, 5e-2),
        ({"n": 12, "h": 5e-3, "seed": 5, "steps": 200}, 5e-2),  # a ridge of 1.985 degrees that crosses another
        ({"n": 12, "rocks_are": "deformable", "h": 4e-3, "steps": 300}, 5e-2),
        pytest.param(  # two that turn by 0.15 rad in a step
            {"n": 16, "width": 0.45, "rocks_are": "deformable", "h": 4e-3, "steps": 300},
            5e-2,
            marks=pytest.mark.xfail(reason="no overlap above 2.7e-5, but friction returns 7e-5 in one step: 1.03e-4 of the energy in all"),
        ),
        ({"n": 16, "width": 0.45, "rocks_are": "deformable", "h": 5e-3, "steps": 250, "seed": 3}, 5e-2),
        # one contact was brought back with a gap of which half was not there
        ({"n": 100, "width": 0.9, "rocks_are": "deformable", "h": 4e-3, "steps": 300}, 5e-2),
        ({"n": 200, "width": 1.2, "steps": 800}, 5e-2),
    ],
    ids=["8", "fast", "deformable", "sixteen", "sixteen fast", "hundred", "200"],
)
def test_rocks_poured_into_a_box(parameters: dict[str, Any], rest: float) -> None:
    """Polyhedra found by `Everything`, which turn by up to 0.06 rad a step, and more where h is large."""
    survived(simulation("rocks", **parameters), overlap=1e-4, rest=rest)


@pytest.mark.parametrize("kind", ["deformable", "mixed"])
def test_rocks_that_turn_and_touch_keep_their_momentum(kind: str) -> None:
    """Both momenta of each deformable rock change by gravity and contacts alone, to the solver's digits, though inner forces that conserve
    energy differ from stress in the middle of a step by (turn within the step)^2 / 12, 5e-5 here: they have no resultant."""
    run = simulation("rocks", n=4, width=0.3, steps=100, tol=1e-9, rocks_are=kind)
    model, touched = run.model, 0
    mass = model.mass.diagonal()
    gravity = run.scheme.h * model.load(0.0)
    for step in run:
        before, after = step.previous, step.state
        impulse, change = gravity + step.H @ step.result.r, mass * (after.v - before.v)
        for body, (first, end) in enumerate(pairwise(model.dof_offset[: len(model.deformable) + 1])):
            own = slice(first, end)
            place = model.reference[model.node_offset[body] : model.node_offset[body + 1]] + 0.5 * (before.x + after.x)[own].reshape(-1, 3)
            arm = place - place.mean(axis=0)
            given, taken = impulse[own].reshape(-1, 3), change[own].reshape(-1, 3)
            scale = np.abs(given).max()
            assert taken.sum(axis=0) == pytest.approx(given.sum(axis=0), abs=1e-8 * scale)
            moments = (np.cross(arm, part).sum(axis=0) for part in (taken, given))
            assert next(moments) == pytest.approx(next(moments), abs=1e-8 * scale * np.abs(arm).max())
        touched += len(step.contacts)
    assert touched > 20


def test_a_wall_is_hit_by_a_block_at_20_metres_a_second() -> None:
    """Bricks in running bond: no overlap above 1e-4 of a brick, and no energy from nothing; the block hands its momentum on."""
    run = simulation("wall_hit", courses=3, blocks=3.0, steps=200)
    last = survived(replace(run, witness=Witness(every=5)), overlap=1e-4, rest=0.5)
    shot = last.model.dof_offset[last.model.number["shot"]]
    assert 0 < last.state.v[shot + 1] < 15


def test_nine_boxes_are_hit_at_20_metres_a_second() -> None:
    """Rigid boxes in running bond, h = 1 ms: no overlap above 1e-4 of a box, and no energy from nothing."""
    boxes = [
        rigid_box(f"box {course} {k}", (0.4, 0.2, 0.2), (0.4 * k + 0.2 * (course % 2), 0, 0.1 + 0.2 * course), 30.0)
        for course in range(3)
        for k in range(3)
    ]
    shot = rigid_box("shot", (0.2, 0.2, 0.2), (0.5, -1.0, 0.3), 20.0)
    floor = rigid_box("floor", (8, 8, 0.4), (0, 0, -0.2), 1.0)
    supports = [Support("floor", DIRECTIONS[3])]
    model = build_model([*boxes, shot, floor], supports=supports, gravity=lambda t: np.array([0, 0, -9.81]))
    start = at_rest(model)
    v = start.v.copy()
    v[model.dof_offset[model.number["shot"]] + 1] = 20.0
    settings = SolverSettings(name="auto", tol=1e-6)
    detection, scheme = Everything(model, 0.5), Theta(1e-3, 0.5, Gap())
    run = Simulation(model, detection, scheme, 200, settings, initial=State(0.0, start.x, v), witness=Witness(every=5))
    survived(run, overlap=1e-4, rest=0.2)


def test_an_arch_falls_to_the_ground() -> None:
    """Five hinges first, then voussoirs that turn over and lie about; the ground carries their weight in the end."""
    run = simulation("falling_arch", steps=1000)
    last = survived(run, overlap=1e-4, rest=1e-2)
    heights = last.model.positions(last.state.x)[: last.model.node_offset[last.model.number["ground"]], 2]
    assert heights.max() < 0.4 and heights.min() > -1e-4


def test_boxes_fall_on_each_other() -> None:
    """Course on course, each turned a little: at rest in the end, the floor carries their weight."""
    run = simulation("boxes", across=4)
    last = survived(run, overlap=1e-4, rest=1e-2)
    assert -last.contact_force_on(last.model.number["floor"])[2] == pytest.approx(64 * 2.0 * 9.81, rel=1e-2)


@pytest.mark.parametrize(("shift", "rests"), [(0.47, True), (0.5, False)])
def test_boxes_topple_where_their_centre_leaves_what_carries_them(shift: float, rests: bool) -> None:
    """Two courses: the outer boxes of the upper one, and all but one are outer, reach out by shift 1.02 of a side: they rest below half.
    Beyond, a cube topples as an inverted pendulum, the angle growing as cosh(t sqrt(m g h / I)) about an edge or a corner."""
    run = simulation("boxes", across=2, turn=0.0, shift=shift, steps=200)
    *_, last = run
    centres = last.model.rigid_part(last.state.x)[4:8, 2]  # the upper course's displacements; all fall by two gaps
    lean = -centres[1:] - 2 * 0.02 * 0.1
    assert (lean.max() < 1e-5) == rests and (lean.min() > 1e-3) == (not rests)
    if rests:
        assert last.energy.kinetic < 1e-9


FACADE = load_case(CASES / "tilting_facade")


def limit_tilts() -> tuple[float, float]:
    """The tilts at which limit analysis lets the facade fall, with dilatancy and without (linear programs)."""
    spec = importlib.util.spec_from_file_location("limit_analysis", CASES / "tilting_facade" / "limit_analysis.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    parameters = FACADE.parameters()
    found: tuple[float, float] = module.limit_tilts(sys.modules[FACADE.build.__module__], parameters.mu, parameters.half)
    return found


def test_the_facade_stands_before_its_limit_and_falls_beyond() -> None:
    """Beyond the limit with dilatancy nothing stands; blocks that do not dilate fall some degrees before."""
    with_dilatancy, without = limit_tilts()
    assert with_dilatancy == pytest.approx(24.82, abs=0.01) and without < with_dilatancy
    kinetic = []
    for tilt in (0.94 * without, 1.01 * with_dilatancy):
        run = simulation("tilting_facade", start=tilt, stop=tilt, steps=40, tol=1e-6)
        *_, last = run
        kinetic.append(last.energy.kinetic)
    stands, falls = kinetic
    assert falls > 0.1 > 100 * stands


def test_the_facade_falls_on_to_its_rubble() -> None:
    """Forty blocks, tilted beyond the limit, without a jump of energy: in the trials of before 2164 J became 1 674 227 J in one step."""
    run = simulation("tilting_facade", steps=480)
    mass = sum(body.mass for body in run.model.rigid[:40])
    before = largest = 0.0
    for step in run:
        kinetic = step.energy.kinetic
        v = np.sqrt(2 * mass * max(kinetic, before))  # |momentum| at most: what gravity adds in a step is below m g h times the velocity
        assert kinetic - before <= 9.81 * run.scheme.h * v + 1e-3
        before, largest = kinetic, max(kinetic, largest)
        if step.overlap is not None:
            assert step.overlap.share <= 1e-3
        assert step.ledger.created <= 1e-4 * step.ledger.supplied + 1e-3
    assert 5000 < largest < 2 * mass * 9.81 and kinetic < 0.15 * largest
