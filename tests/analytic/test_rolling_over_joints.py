"""Round bodies of exact shape that roll over a level ground made of several bodies: the joints are not in their way, steps are."""

import numpy as np
import pytest

from fcsim import Body, ExactContacts, Material, Simulation, State, Support, Theta, build_model
from fcsim.mesh import brick, rigid_box, rigid_capsule, rigid_cylinder, rigid_rectangle, rigid_sphere

R, LENGTH = 0.1, 0.3  # [m] radius, length of a tile


def rolled(
    kind: str, v0: float, h: float, steps: int, skew: float = 0.0, second: float = 0.0, mu: float = 0.3, begin: float = 0.0
) -> np.ndarray:
    """Positions (steps, 3) [m] of the centre, from its start on, of a body that begins to roll at v0 [m/s] on tiles of which all but the
    first are higher by `second` [m], `begin` [m] beyond the middle of the first; skew: angle between its way and the tiles' row."""
    along, axis = np.array([np.cos(skew), -np.sin(skew), 0.0]), (np.sin(skew), np.cos(skew), 0.0)
    flat = kind == "disk"
    if flat:
        tiles = [rigid_rectangle(f"tile {i}", (LENGTH, 0.1), (LENGTH * i - begin, -0.05 + second * (i > 0)), 1.0) for i in range(8)]
        body = rigid_sphere("round", R, (0.0, R), 4.0)
    else:
        tiles = [rigid_box(f"tile {i}", (LENGTH, 2.0, 0.1), (LENGTH * i - begin, 0.0, -0.05 + second * (i > 0)), 1.0) for i in range(8)]
        centre = (0.0, 0.0, R)
        body = {
            "ball": lambda: rigid_sphere("round", R, centre, 4.0),
            "capsule": lambda: rigid_capsule("round", R, 0.4, centre, 4.0, axis),
            "cylinder": lambda: rigid_cylinder("round", R, 0.4, centre, 4.0, axis),
        }[kind]()
    held = ("x", "y", "rz") if flat else ("x", "y", "z", "rx", "ry", "rz")
    gravity = (0.0, -9.81) if flat else (0.0, 0.0, -9.81)
    model = build_model([*tiles, body], supports=[Support(tile.name, held) for tile in tiles], gravity=lambda t: gravity)
    own = model.dof_offset[model.number["round"]]
    v = np.zeros(model.n_dofs)
    if flat:
        v[own : own + 3] = v0, 0.0, -v0 / R
    else:
        v[own : own + 6] = *(v0 * along), *(v0 / R * np.array(axis))
    start = State(0.0, np.zeros(model.n_dofs), v)
    run = Simulation(model, ExactContacts(model, mu), Theta(h), steps, initial=start)
    places = np.array([step.state.x[own : own + (2 if flat else 3)] for step in run])
    return np.insert(places, 1, 0.0, axis=1) if flat else places


@pytest.mark.parametrize(
    ("kind", "v0", "h", "steps", "skew"),
    [
        pytest.param("ball", 3.0, 1e-3, 80, 0.0, marks=pytest.mark.slow),
        ("ball", 20.0, 1e-3, 60, 0.2),
        ("disk", 20.0, 1e-3, 60, 0.0),
        ("capsule", 15.0, 1e-3, 40, 0.3),
        pytest.param("cylinder", 15.0, 1e-3, 40, 0.0, marks=pytest.mark.slow),
        ("cylinder", 15.0, 1e-3, 40, 0.3),
    ],
)
def test_joints_of_a_level_ground_do_not_stop_what_rolls(kind: str, v0: float, h: float, steps: int, skew: float) -> None:
    """It goes on at v0 in its plane; edges of tiles ahead had thrown the ball up by 84 mm at 20 m/s, the cylinder by 33 mm at 15 m/s."""
    places = rolled(kind, v0, h, steps, skew)
    way = v0 * h * np.arange(1, steps + 1)
    assert np.abs(places[:, 2]).max() < 1e-9
    assert np.abs(places[:, 0] - way * np.cos(skew)).max() < 1e-8
    assert np.abs(places[:, 1] + way * np.sin(skew)).max() < 1e-8


@pytest.mark.parametrize(
    ("kind", "second"), [("ball", 2e-3), ("cylinder", 2e-3), pytest.param("disk", 2e-3, marks=pytest.mark.slow), ("ball", 2e-5)]
)
def test_steps_of_the_ground_still_do(kind: str, second: float) -> None:
    """A step upwards lifts what rolls over it; of two thousandths of the radius too: rolling slowly, it ends on the upper tile."""
    places = rolled(kind, 1.0, 1e-3, 95, second=second, mu=0.6, begin=0.1)
    assert places[:, 2].min() > -1e-6
    assert places[-1, 0] > 0.15 - 0.1
    assert abs(places[-1, 2] - second) < 2e-2 * second + 1e-7


def ridden(kind: str, v0: float, ground: list, held: tuple[str, ...], steps: int, h: float = 1e-3) -> np.ndarray:
    """Velocities and positions (steps, 6) of the centre of a body that begins to roll at v0 [m/s] along x on a ground below z = 0."""
    make = {"ball": lambda: rigid_sphere("round", R, (0.0, 0.0, R), 4.0)}
    make["capsule"] = lambda: rigid_capsule("round", R, 0.1, (0.0, 0.0, R), 4.0, (0.0, 1.0, 0.0))
    make["cylinder"] = lambda: rigid_cylinder("round", R, 0.15, (0.0, 0.0, R), 4.0, (0.0, 1.0, 0.0))
    supports = [Support(body.name, held, "z-" if isinstance(body, Body) else None) for body in ground]
    model = build_model([*ground, make[kind]()], supports=supports, gravity=lambda t: (0.0, 0.0, -9.81))
    own, v = model.dof_offset[model.number["round"]], np.zeros(model.n_dofs)
    v[own], v[own + 4] = v0, v0 / R
    run = Simulation(model, ExactContacts(model, 0.3), Theta(h), steps, initial=State(0.0, np.zeros(model.n_dofs), v))
    return np.array([np.append(step.state.v[own : own + 3], step.state.x[own : own + 3]) for step in run])


def elastic(name: str, length: float, divisions: tuple[int, int, int], at: float) -> Body:
    part = brick("ground", (length, 0.2, 0.1), divisions, Material(1e9, 0.2, 2000.0), origin=(-0.15, -0.1, -0.1))
    return Body(name, part, translation=(at, 0.0, 0.0))


def test_vertices_of_an_elastic_ground_do_not_throw_what_rolls_over_them() -> None:
    """On cells finer than a tenth of the radius: a step's second look at contacts took the point of the ball that it had rolled on to for
    the one that it rolls from, and held it R (omega h)^2 / 2 = 1.1 mm above the ground; it rose to 15 mm."""
    moved = ridden("ball", 15.0, [elastic("ground", 0.6, (40, 8, 2), 0.0)], ("x", "y", "z"), 15)
    assert np.abs(moved[:, 5]).max() < 2e-5  # Hertz' dent at rest: 0.4 um; it swings on it
    assert np.abs(moved[:, 0] - 15.0).max() < 1e-3


@pytest.mark.parametrize("kind", ["ball", pytest.param("capsule", marks=pytest.mark.slow), "cylinder"])
def test_joints_of_elastic_tiles_do_not_throw_what_rolls_over_them(kind: str) -> None:
    """The tile that bears is a micrometre lower than the next one, whose edge had thrown the ball up by 24 mm, the cylinder by 30."""
    tiles = [elastic(f"tile {i}", 0.3, (3, 2, 1), 0.3 * i) for i in range(3)]
    moved = ridden(kind, 15.0, tiles, ("x", "y", "z"), 40)
    assert np.abs(moved[:, 5]).max() < 3e-4
    assert np.abs(moved[:, 0] - 15.0).max() < 0.015


@pytest.mark.parametrize(
    ("v0", "joint", "h", "steps", "least", "begin"), [(20.0, 0.01, 1e-3, 40, 0.0, 0.0), (3.0, 0.02, 2e-4, 230, 0.85, 0.1)]
)
def test_open_joints_are_crossed_as_free_flight_says(v0: float, joint: float, h: float, steps: int, least: float, begin: float) -> None:
    """The ball leaves one edge, has fallen by s = g t^2 / 2 when it strikes the next one, inelastic, at the angle d / R, d = sqrt(2 R s),
    v t = joint - d, and goes up at v d / R. It had risen by 78 mm at 20 m/s, whose steps pass the joints in a flight of 0.5 ms."""
    tiles = [rigid_box(f"tile {i}", (LENGTH, 2.0, 0.1), ((LENGTH + joint) * i - begin, 0.0, -0.05), 1.0) for i in range(4)]
    moved = ridden("ball", v0, tiles, ("x", "y", "z", "rx", "ry", "rz"), steps, h)
    t = joint / (v0 + np.sqrt(9.81 * R))
    rise = (v0 * np.sqrt(9.81 / R) * t) ** 2 / (2 * 9.81) - 9.81 * t**2 / 2
    assert least * rise < moved[:, 5].max() < 1.05 * rise
    assert moved[-1, 0] > (1 - 3 * 2 * 9.81 * t**2 / R) * v0  # (d / R)^2 of v0, and what falling adds, at each of up to three joints
