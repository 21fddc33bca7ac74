"""What falls past or for long, and fast rotations, in the plane, in other units, along other axes; no alarm where all is right."""

import re
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.assembly.supports import DrivenRotation, Support
from fcsim.contact_detection import Everything
from fcsim.mesh.blocks import brick, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.mesh.solids.rigid_polygon import rigid_polygon
from fcsim.timestep.remarks.pieces import hanging_nodes
from fcsim.timestep.simulation import Simulation
from fcsim.timestep.state import State, at_rest
from fcsim.timestep.theta import Theta


def plane(gap: float, x: float = 0.0, unit: float = 1.0, steps: int = 100, h: float = 1e-3, up: int = 1, v: float = 0.0) -> tuple[str, ...]:
    """What is said of a rigid block of 1 unit `gap` units off a held wall or floor, as gravity goes along the axis `up`."""
    place, size, centre = np.zeros(2), np.full(2, 4.0 * unit), np.zeros(2)
    place[up], place[1 - up], size[up], centre[up] = (0.5 + gap) * unit, x * unit, unit, -0.5 * unit
    bodies = [rigid_rectangle("floor", tuple(size), tuple(centre), 1.0), rigid_rectangle("block", (unit, unit), tuple(place), 1.0)]
    gravity = np.zeros(2)
    gravity[up] = -9.81 * unit
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: gravity)
    start = at_rest(model, h=h)
    start = State(0.0, start.x, np.full(model.n_dofs, v)) if v else start
    return Simulation(model, Everything(model, 0.5), Theta(h), steps)._opening(start)


@pytest.mark.parametrize("angle", [0.3, 0.785, 2.5])
@pytest.mark.parametrize(("x", "lost"), [(0.0, False), (1.9, False), (7.0, True)])
def test_what_falls_beside_the_floor_is_told_in_a_scene_that_is_turned(angle: float, x: float, lost: bool) -> None:
    """A block of 1 m above a floor of 4 m, or beside it, all turned by an angle, gravity with them."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def box(name: str, size: tuple[float, float], centre: tuple[float, float]) -> RigidBody:
        corners = np.array(centre) + np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) * size
        return rigid_polygon(name, corners @ turn.T, mass=1.0)

    bodies, gravity = [box("floor", (4.0, 1.0), (0.0, -0.5)), box("block", (1.0, 1.0), (x, 0.5))], turn @ (0.0, -9.81)
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "rz"))], gravity=lambda t: gravity)
    said = Simulation(model, Everything(model, 0.5), Theta(1e-3), 100)._opening(at_rest(model, h=1e-3))
    assert any("nothing lies under body 'block': it falls out of the scene" in words for words in said) == lost


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("up", [0, 1])
def test_a_fall_is_told_in_any_unit_and_along_any_axis(unit: float, up: int) -> None:
    """From 2 units at 9.81 units a s^2 a body falls for sqrt(4/9.81) = 0.639 s."""
    (long,) = plane(2.0, unit=unit, up=up)
    assert "above 'floor' and falls for 0.639 s, 639 steps, more than the run has" in long
    (most,) = plane(2.0, unit=unit, up=up, steps=1000)
    assert "most of the run's 1000" in most
    assert plane(2.0, unit=unit, up=up, steps=2000) == () == plane(0.0, unit=unit, up=up) == plane(1e-3, unit=unit, up=up)
    (lost,) = plane(0.0, x=7.0, unit=unit, up=up)
    assert "nothing lies under body 'block': it falls out of the scene" in lost


@pytest.mark.parametrize("angle", [0.2, 0.48, 0.9])
@pytest.mark.parametrize("along", [-0.9, 0.0, 0.9])
def test_what_lies_on_a_slope_is_over_it(angle: float, along: float) -> None:
    """The slope's upper end is higher than a block on its lower end."""
    R = Rotation.from_euler("y", angle).as_matrix()
    material = Material(1e9, 0.2, 2000.0)
    slope = Body("slope", brick("slope", (4.0, 2.0, 0.5), (1, 1, 1), material), R, R @ (-2.0, -1.0, -0.5))
    stone = Body("stone", brick("stone", (0.4, 0.4, 0.4), (1, 1, 1), material), R, R @ (1.7 * along - 0.2, -0.2, 0.0))
    model = build_model([slope, stone], supports=[Support("slope", ("x", "y", "z"))], gravity=lambda t: (0.0, 0.0, -9.81))
    assert Simulation(model, Everything(model, 0.3), Theta(1e-3), 10)._opening(at_rest(model, h=1e-3)) == ()


@pytest.mark.parametrize("up", [0, 1])
def test_supports_that_hold_nothing_along_gravity(up: int) -> None:
    """The floor's support is forgotten, and another body is driven across: all fell, and nothing was said."""
    size, place, gravity = np.full(2, 4.0), np.zeros(2), np.zeros(2)
    size[up], place[up], gravity[up] = 1.0, 1.0, -9.81
    bodies = [rigid_rectangle("floor", tuple(size), (0.0, 0.0), 1.0), rigid_rectangle("block", (1.0, 1.0), tuple(place), 1.0)]

    def said(*supports: Support) -> tuple[str, ...]:
        model = build_model(bodies, supports=supports, gravity=lambda t: gravity)
        return Simulation(model, Everything(model, 0.5), Theta(1e-3), 10)._opening(at_rest(model, h=1e-3))

    across, along = "yx"[up], "xy"[up]
    (fall,) = said(Support("block", (across,), velocity=0.01), Support("block", ("rz",)))
    assert f"no support holds any body along {along}, the way of gravity: all fall together" in fall
    assert said(Support("block", (across,), velocity=0.01), Support("floor", (along,))) == ()


def test_what_is_thrown_is_let_fly() -> None:
    assert plane(2.0, v=3.0) == () == plane(0.0, x=7.0, v=3.0)


def test_a_body_that_stands_on_one_that_falls() -> None:
    """Both fall alike, so that they do not hold each other: the way of the lower one is told."""
    bodies = [rigid_box(name, (1.0, 1.0, 1.0), (0.0, 0.0, z), 1.0) for name, z in (("floor", -0.5), ("one", 2.5), ("two", 3.5))]
    model = build_model(bodies, supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))], gravity=lambda t: (0.0, 0.0, -9.81))
    said = Simulation(model, Everything(model, 0.5), Theta(1e-3), 100)._opening(at_rest(model, h=1e-3))
    (told,) = said
    assert "body 'one' is 2 m above 'floor' and falls for 0.639 s" in told


@pytest.mark.parametrize(("angle", "told"), [(lambda t: 30.0 * t, True), (lambda t: 0.5 * t, False), (lambda t: 100.0 * t * t, True)])
def test_rotations(angle: Any, told: bool) -> None:
    bodies = [rigid_box("drum", (1.0, 1.0, 1.0), (0.0, 0.0, 0.5), 1.0), rigid_box("ball", (0.1, 0.1, 0.1), (0.0, 0.0, 1.05), 1.0)]
    model = build_model(bodies, supports=[DrivenRotation("drum", angle, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    said = Simulation(model, Everything(model, 0.5), Theta(1e-2), 100)._opening(at_rest(model, h=1e-2))
    assert any("Angles are in radians" in remark for remark in said) is told


@pytest.mark.parametrize("unit", [1e-3, 1.0])
def test_what_hangs_in_a_hook_is_over_it(unit: float) -> None:
    """The hook reaches higher than what hangs in it."""
    hook = unit * np.array([(0, 0), (0.05, 0), (0.05, 0.3), (0.0, 0.3), (0.0, 0.05), (-0.1, 0.05), (-0.1, 0.1), (-0.15, 0.1), (-0.15, 0)])
    hung = hook @ [[1, 0], [0, -1]] + unit * np.array([-0.05, 0.1])
    bodies = [rigid_polygon("hook", hook, density=1.0), rigid_polygon("hung", hung - unit * np.array([0.05, 0]), density=1.0)]
    model = build_model(bodies, supports=[Support("hook", ("x", "y", "rz"))], gravity=lambda t: np.array([0.0, -9.81 * unit]))
    assert Simulation(model, Everything(model, 0.5), Theta(1e-3), 5)._opening(at_rest(model)) == ()


def test_a_body_that_is_alone_falls_for_ever() -> None:
    box = rigid_box("box", (1, 1, 1), (0, 0, 0), 1.0)
    model = build_model([box], gravity=lambda t: np.array([0.0, 0.0, -9.81]))
    (alone,) = Simulation(model, Everything(model, 0.5), Theta(1e-3), 5)._opening(at_rest(model))
    assert "body 'box' is alone, and no support holds it: it falls for ever. Is the floor forgotten" in alone
    thrown = State(0.0, at_rest(model).x, np.ones(6))
    assert Simulation(model, Everything(model, 0.5), Theta(1e-3), 5)._opening(thrown) == ()


@pytest.mark.parametrize("unit", [1e-6, 1.0])
@pytest.mark.parametrize("d", [2, 3])
def test_nodes_that_hang_on_coarser_cells_are_named(d: int, unit: float) -> None:
    """One cell beside 2^(d-1) small ones: in space they have nine nodes on its face, four in its corners, in the plane three and two. A
    slit, whose sides have nodes of their own in the same places, is meant."""
    material, kind = Material(1e9, 0.2, 1000.0), {2: "quadrilateral", 3: "hexahedron"}[d]

    def cells(n: int) -> Part:
        counts = (1, *(n,) * (d - 1))
        return brick("p", (1, 1, 1), counts, material) if d == 3 else rectangle("p", (1, 1), (1, n), material)

    def told(beside: Part, slit: bool = False) -> tuple[str, ...]:
        coarse = cells(1)
        points = np.vstack([coarse.points, beside.points + np.eye(d)[0]])
        _, first, number = np.unique(points, axis=0, return_index=True, return_inverse=True)
        both = number.reshape(-1)[np.vstack([coarse.cells, beside.cells + len(coarse.points)])]
        points = points[first]
        if slit:
            common = np.intersect1d(both[0], both[1])[0]
            both[0][both[0] == common] = len(points)
            points = np.vstack([points, points[common]])
        return tuple(hanging_nodes(build_model([Body("stone", Part("stone", unit * points, both, kind, {}, material))])))

    (said,) = told(cells(2))
    count = 3 ** (d - 1) - 2 ** (d - 1)
    assert said.startswith(f"{count} nodes of the mesh of part 'stone' lie on faces of cells that do not have them, as (")
    assert told(cells(1)) == told(cells(1), slit=True) == ()


@pytest.mark.parametrize("unit", [1e-6, 1.0])
def test_a_mesh_in_pieces_that_lie_on_each_other_is_named(unit: float) -> None:
    """Nodes doubled for every cell, and around one cell; a mesh with a slit is one piece, and pieces apart are meant."""
    whole = brick("stone", (unit, unit, unit), (2, 2, 2), Material(1e9, 0.2, 1000.0))

    def told(points: np.ndarray, cells: np.ndarray) -> tuple[str, ...]:
        body = Body("stone", Part("stone", points, cells, whole.cell_type, {}, whole.material))
        floor = rigid_box("floor", (4 * unit, 4 * unit, unit), (0, 0, -0.5 * unit), 1.0)
        model = build_model([body, floor], supports=[Support("floor", ("x", "y", "z", "rx", "ry", "rz"))])
        return Simulation(model, Everything(model, 0.5), Theta(1e-3), 5)._opening(at_rest(model))

    def separated(cells: list[int]) -> tuple[np.ndarray, np.ndarray]:
        own = np.unique(whole.cells[cells])
        shared = np.intersect1d(own, np.delete(whole.cells, cells, axis=0))
        number = np.arange(len(whole.points))
        number[shared] = len(whole.points) + np.arange(len(shared))
        corners = whole.cells.copy()
        corners[cells] = number[corners[cells]]
        return np.vstack([whole.points, whole.points[shared]]), corners

    soup = whole.points[whole.cells].reshape(-1, 3), np.arange(whole.cells.size).reshape(whole.cells.shape)
    assert re.search("part 'stone' is 8 pieces that share no node, though 56 of its nodes .* merge the nodes", told(*soup)[0])
    points, cells = separated([0])
    assert re.search("is 2 pieces that share no node, though 14 of its nodes", told(points, cells)[0])
    apart = np.where(np.isin(np.arange(len(points)), cells[0])[:, None], points - 0.5 * unit, points)
    assert told(apart, cells) == told(whole.points, whole.cells) == ()
