"""Statics in which a support, or a load, carries a body from afar into another one within a load step."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import Support
from fcsim.contact_detection import Detector, Everything, ExactContacts, SurfacePair
from fcsim.contact_detection.surfaces.model_surfaces import contact_surface
from fcsim.errors import InputError
from fcsim.mesh import rigid_plane, rigid_sphere
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, RigidBody
from fcsim.mesh.solids.rigid_polygon import rigid_polygon
from fcsim.timestep import QuasiStatic, Simulation, Theta
from fcsim.timestep.limits import Limits
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.step import Step
from fcsim.timestep.step_equation.look_ahead import load_steps

SLOW = pytest.mark.slow
YOUNG, DEPTH, ALL = 1e8, 1e-3, ("x", "y", "z", "rx", "ry", "rz")


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_what_a_support_brings_from_afar_bears_in_the_same_step(listed: bool, unit: float) -> None:
    """The foot of a block of 1 m ends 1 mm in a rigid floor, which it saw from 0.2 m above: E A d / h there and then."""
    block = Body("block", brick("block", (unit,) * 3, (2, 2, 1), Material(YOUNG, 0.0, 1000.0)))
    floor = rigid_box("floor", (4 * unit, 4 * unit, unit), (0.5 * unit, 0.5 * unit, -0.5 * unit), 1.0)
    height = [0.2 * unit, -DEPTH * unit, -DEPTH * unit, 0.2 * unit]
    supports = [
        Support("floor", ALL),
        Support("block", ("z",), "z+", displacement=lambda t: height[round(t) - 1] if t > 0.5 else 0.0),
        Support("block", ("x", "y"), "z+"),
    ]
    model = build_model([block, floor], supports=supports)
    pair = SurfacePair(
        contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 1e-2 * unit, "nodes", "foot"
    )
    detection = Detector([pair], model.n_nodes) if listed else Everything(model, 0.5)
    pressed = [step.contact_force_on(0)[2] / (YOUNG * DEPTH * unit**2) for step in Simulation(model, detection, QuasiStatic(1.0), 4)]
    assert pressed == pytest.approx([0.0, 1.0, 1.0, 0.0], abs=1e-6)


@pytest.mark.parametrize("floor", ["plane", "ball", "box"])
def test_what_a_load_brings_from_afar_onto_exact_shapes_bears_in_the_same_step(floor: str) -> None:
    """A ball of 1 m begins 0.3 m above: g - eta 0.3 m of its weight presses in the first step of 1 s, all of it in the second."""
    eta, height, weight = 30.0, 0.3, 1e4
    below = {
        "plane": rigid_plane("floor", (0, 0, 0), (0, 0, 1)),
        "ball": rigid_sphere("floor", 0.5, (0, 0, -0.5), mass=1.0),
        "box": rigid_box("floor", (4, 4, 1), (0, 0, -0.5), 1.0),
    }[floor]
    ball = rigid_sphere("ball", 0.5, (0, 0, 0.5 + height), mass=weight / 10)
    model = build_model([ball, below], supports=[Support("floor", ALL)], gravity=lambda t: (0.0, 0.0, -10.0))
    steps = list(Simulation(model, ExactContacts(model, 0.5), QuasiStatic(1.0, eta=eta), 2))
    pressed = [step.contact_force_on(0)[2] / weight for step in steps]
    assert pressed == pytest.approx([1 - eta * height / 10, 1.0], abs=1e-6)
    assert [step.state.x[2] for step in steps] == pytest.approx([-height, -height], abs=1e-9)


FLOOR, WALL = [(-1, -0.5), (1, -0.5), (1, 0), (-1, 0)], [(1, -0.5), (1.02, -0.5), (1.02, 1), (1, 1)]
ANGLE = [(-1, -0.5), (1.02, -0.5), (1.02, 1), (1, 1), (1, 0), (-1, 0)]
WIDTH, HALF = 0.2, 0.1


@pytest.mark.parametrize("frame", [{"angle": ANGLE}, {"floor": FLOOR, "wall": WALL}], ids=["one body", "two"])
@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("eta", [1e-1, 1e-6])
def test_what_a_load_carries_through_a_wall_bears_in_it(frame: dict, rigid: bool, eta: float) -> None:
    """40 kg under 10 m/s^2 along the floor, 0.05 m from a wall a tenth as thick as they are: eta alone holds them before, so that they
    flew on behind it, 10 / eta metres away. The wall takes all but what eta has of the way; one that is one body with the floor too."""
    gap, mass, pull = 0.05, 1000 * WIDTH**2, (10.0, -9.81)
    if rigid:
        block: Body | RigidBody = rigid_rectangle("block", (WIDTH, WIDTH), (1 - gap - HALF, HALF), mass=mass)
    else:
        block = Body("block", rectangle("block", (WIDTH, WIDTH), (4, 4), Material(1e7, 0.2, 1000.0)), translation=(1 - gap - WIDTH, 0.0))
    walls = [rigid_polygon(name, np.array(shape, float), density=1e3) for name, shape in frame.items()]
    model = build_model([block, *walls], supports=[Support(name, ("x", "y", "rz")) for name in frame], gravity=lambda t: pull)
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=eta), 1)
    assert step.contact_force_on(model.number["block"]) == pytest.approx([-mass * (10.0 - eta * gap), mass * 9.81], rel=1e-4)


@pytest.mark.parametrize("distance", [0.01, 0.15])
def test_what_touches_one_side_of_a_body_is_carried_to_another(distance: float) -> None:
    """A support draws a block along the floor of an angle and 2 mm into its wall: E A d / l, without a force before. nu = 0."""
    block = Body("block", rectangle("block", (WIDTH, WIDTH), (4, 4), Material(1e7, 0.0, 1000.0)), translation=(1 - distance - WIDTH, 0.0))
    angle = rigid_polygon("angle", np.array(ANGLE, float), density=1e3)
    deep = 2e-3
    supports = [Support("angle", ("x", "y", "rz")), Support("block", ("x",), surface="x-", velocity=distance + deep)]
    model = build_model([block, angle], supports=supports, gravity=lambda t: (0.0, -9.81))
    (step,) = Simulation(model, Everything(model, mu=0.0), QuasiStatic(1.0, eta=1e-6), 1)
    assert step.contact_force_on(0) == pytest.approx([-1e7 * deep, 9.81 * 1000 * WIDTH**2], rel=1e-4)


@pytest.mark.parametrize("listed", [False, True])
@pytest.mark.parametrize("thickness", [1.0, 0.02])
def test_what_a_support_drives_half_through_another_body_or_beyond_it_bears(listed: bool, thickness: float) -> None:
    """The foot of a block of 1 m is taken 0.6 m, and 5 cm beyond a plate, below a rigid surface that it saw from 0.2 m above: E A d / h."""
    depth = 0.6 if thickness == 1.0 else 0.07
    block = Body("block", brick("block", (1.0,) * 3, (2, 2, 1), Material(YOUNG, 0.0, 1000.0)), translation=(0.0, 0.0, 0.2))
    floor = rigid_box("floor", (4.0, 4.0, thickness), (0.5, 0.5, -0.5 * thickness), 1.0)
    supports = [
        Support("floor", ALL),
        Support("block", ("z",), "z+", velocity=-(0.2 + depth)),
        Support("block", ("x", "y"), "z+"),
    ]
    model = build_model([block, floor], supports=supports)
    pair = SurfacePair(contact_surface(model, [("block", "z-")]), contact_surface(model, [("floor", "z+")]), 0.5, 1e-2, "nodes", "foot")
    detection = Detector([pair], model.n_nodes) if listed else Everything(model, 0.5)
    (step,) = Simulation(model, detection, QuasiStatic(1.0), 1, limits=Limits(strain=10.0))
    assert step.contact_force_on(0)[2] == pytest.approx(YOUNG * depth, rel=1e-6)


@pytest.mark.parametrize("eta", [0.1, 1e-3, 1e-5])
def test_what_flies_through_the_floor_in_a_load_step_is_held_by_it(eta: float) -> None:
    """A box of 10 kN that only eta holds, 0.2 m above a plate of 5 cm, would fly 100 m to 1000 km: the plate bears all but eta 0.2 m M."""
    floor = rigid_box("floor", (4.0, 4.0, 0.05), (0.5, 0.5, -0.025), 1.0)
    box = rigid_box("box", (1.0,) * 3, (0.5, 0.5, 0.7), 1e3)
    model = build_model([box, floor], supports=[Support("floor", ALL)], gravity=lambda t: (0.0, 0.0, -10.0))
    steps = list(Simulation(model, Everything(model, 0.5), QuasiStatic(1.0, eta=eta), 2))
    assert [step.contact_force_on(0)[2] / 1e4 for step in steps] == pytest.approx([1 - 0.02 * eta, 1.0], abs=1e-8)
    assert [step.state.x[2] for step in steps] == pytest.approx([-0.2, -0.2], abs=1e-7)


@pytest.mark.parametrize("depth", [0.03, 0.5, 3.0])
@pytest.mark.parametrize("scheme", [QuasiStatic(1.0), Theta(1.0)])
@pytest.mark.parametrize("exact", [False, True])
def test_bodies_that_supports_hold_wholly_and_drive_into_each_other_are_refused(depth: float, scheme: Scheme, exact: bool) -> None:
    """No unknown can give way: said in the first step, however deep; a body beside them that moves with the lower one is none of it."""
    fixed = rigid_box("fixed", (1.0,) * 3, (0.0, 0.0, 0.0), 1.0)
    beside = rigid_box("beside", (1.0,) * 3, (1.0, 0.0, 0.0), 1.0)
    driven = rigid_sphere("driven", 0.5, (0.1, 0.0, 1.02), mass=1.0) if exact else rigid_box("driven", (1.0,) * 3, (0.1, 0.0, 1.02), 1.0)
    sideways = ("x", "y", "rx", "ry", "rz")
    supports = [Support("fixed", ALL), Support("beside", ALL), Support("driven", sideways)]
    model = build_model([fixed, beside, driven], supports=[*supports, Support("driven", ("z",), velocity=-(0.02 + depth))])
    detection = ExactContacts(model, 0.5) if exact else Everything(model, 0.5)
    deep = f"{depth:.3g}" if isinstance(scheme, QuasiStatic) else "[0-9.]+"  # dynamics measure where the next step looks
    with pytest.raises(InputError, match=f"supports drive '(driven|fixed)' and '(driven|fixed)' {deep} m into each other"):
        list(Simulation(model, detection, scheme, 1))


@dataclass
class Steady:
    """A user's function, which compares by value and has no hash."""

    rate: float

    def __call__(self, t: float) -> float:
        return self.rate * t


@pytest.mark.parametrize("record", [lambda t: 0.1 * t, Steady(0.1)], ids=["function", "object without hash"])
def test_bodies_that_supports_drive_alike_do_not_touch(record: Callable[[float], float]) -> None:
    """Two boxes of a table that shakes have no contact, nor what is at rest; a third that is moved by another function does."""
    names = ["left", "right", "other", "fixed", "ground"]
    bodies = [rigid_box(name, (1.0,) * 3, (float(k), 0.0, 0.0), 1.0) for k, name in enumerate(names)]
    supports = [Support(name, ("x", "z", "rx", "ry", "rz")) for name in names]
    supports += [Support(name, ("y",), velocity=record) for name in names[:2]] + [Support("other", ("y",), velocity=lambda t: t)]
    supports += [Support(name, ("y",)) for name in names[3:]]
    model = build_model(bodies, supports=supports)
    found = Everything(model, 0.5)(model.reference)
    assert {tuple(sorted(model.bodies[k].name for k in pair)) for pair in found.bodies} == {("other", "right"), ("fixed", "other")}


def brought(start: tuple[float, float], height: float, steps: int) -> list[Step]:
    """A ball of 1 m that supports bring from start (x, z) to the height [m] over the middle of the top of a block of 1 m."""
    block = Body("block", brick("block", (1.0, 1.0, 1.0), (12, 12, 4), Material(1e6, 0.0, 1000.0), origin=(-0.5, -0.5, 0.0)))
    ways = [Support("ball", ("x",), velocity=-start[0]), Support("ball", ("z",), velocity=height - start[1])]
    supports = [*ways, Support("ball", ("y", "rx", "ry", "rz")), Support("block", ("x", "y", "z"), "z-")]
    model = build_model([rigid_sphere("ball", 0.5, (start[0], 0.0, start[1]), 1.0), block], supports=supports)
    return list(Simulation(model, ExactContacts(model, 0.0), QuasiStatic(1.0 / steps), steps))


@cache
def pressed_from_above(height: float) -> np.ndarray:
    return brought((0.0, 1.6), height, 1)[-1].contact_force_on(1)


@pytest.mark.each_value
@pytest.mark.parametrize("height", [1.49, 1.47])
@pytest.mark.parametrize(
    ("steps", "within"),
    [(1, 1e-3), (3, 1e-3), (4, 1e-3), (6, 0.05), *(pytest.param(*way, marks=SLOW) for way in ((8, 0.05), (16, 0.07))), (12, 0.05)],
)
def test_a_ball_brought_over_the_edge_of_a_block_bears_where_it_ends(height: float, steps: int, within: float) -> None:
    """Without friction it bears what it does when it is pressed on from above, not what the edge and the facets it passed would hold, nor
    the edge that lies ahead where a step begins (of 6 and 12 steps)."""
    above = pressed_from_above(height)
    assert above[2] > 1500.0
    over = brought((-4.0, height), height, steps)[-1]
    assert over.contact_force_on(1) == pytest.approx(above, abs=within * abs(above[2]))
    assert over.penetration < 0.15 * (1.5 - height)


@pytest.mark.parametrize("steps", [40, *(pytest.param(steps, marks=SLOW) for steps in (24, 32, 48, 64, 128, 200))])
def test_a_ball_that_slides_over_a_block_in_short_load_steps_bears_where_it_ends(steps: int) -> None:
    """By the contacts of a step's beginning, 2 to 17 cm behind, it bore 1.05 to 1.4 times as much, and a tenth of that aside: along normals
    that were another's by then. Facets of 8 cm under a ball of 1 m leave 6 % open."""
    force = brought((-4.0, 1.49), 1.49, steps)[-1].contact_force_on(1)
    assert force[2] == pytest.approx(1730.0, rel=0.06)  # 1668 to 1775 pressed on from above, by steps
    assert np.abs(force[:2]).max() < 0.01 * force[2]


@pytest.mark.parametrize(("height", "said"), [(1.49, True), (1.51, False)])
def test_a_ball_that_ends_in_a_block_is_named_where_it_bears_nothing(height: float, said: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held by the edge that it met, it ends 1 cm in the top of a block in four steps; or passes 1 cm above it."""
    monkeypatch.setattr(load_steps, "_slid_over", lambda *_: np.empty((0, 2), dtype=np.int64))
    run = brought((-4.0, height), height, 4)
    names = [text for step in run for text in step.remarks if "bear nothing" in text]
    assert len(names) == said and all("'block' and 'ball' end the load step 0.01 m" in text for text in names)
    assert bool(run[-1].contact_force_on(1).any()) is False
