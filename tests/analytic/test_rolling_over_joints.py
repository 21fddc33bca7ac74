"""Round bodies of exact shape that roll over a level ground made of several bodies: the joints are not in their way, steps are."""

import numpy as np
import pytest

from fcsim import ExactContacts, Simulation, State, Support, Theta, build_model
from fcsim.mesh import rigid_box, rigid_capsule, rigid_cylinder, rigid_rectangle, rigid_sphere

R, LENGTH = 0.1, 0.3  # [m] radius, length of a tile


def rolled(kind: str, v0: float, h: float, steps: int, skew: float = 0.0, second: float = 0.0, mu: float = 0.3) -> np.ndarray:
    """Positions (steps, 3) [m] of the centre, from its start on, of a body that begins to roll at v0 [m/s] on tiles of which all but the
    first are higher by `second` [m]; skew: angle between its way and the tiles' row."""
    along, axis = np.array([np.cos(skew), -np.sin(skew), 0.0]), (np.sin(skew), np.cos(skew), 0.0)
    flat = kind == "disk"
    if flat:
        tiles = [rigid_rectangle(f"tile {i}", (LENGTH, 0.1), (LENGTH * i, -0.05 + second * (i > 0)), 1.0) for i in range(8)]
        body = rigid_sphere("round", R, (0.0, R), 4.0)
    else:
        tiles = [rigid_box(f"tile {i}", (LENGTH, 2.0, 0.1), (LENGTH * i, 0.0, -0.05 + second * (i > 0)), 1.0) for i in range(8)]
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
        ("ball", 3.0, 1e-3, 80, 0.0),
        ("ball", 20.0, 1e-3, 60, 0.2),
        ("disk", 20.0, 1e-3, 60, 0.0),
        ("capsule", 15.0, 1e-3, 40, 0.3),
        ("cylinder", 15.0, 1e-3, 40, 0.0),
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


@pytest.mark.parametrize(("kind", "second"), [("ball", 2e-3), ("cylinder", 2e-3), ("disk", 2e-3), ("ball", 2e-5)])
def test_steps_of_the_ground_still_do(kind: str, second: float) -> None:
    """A step upwards lifts what rolls over it; of two thousandths of the radius too: rolling slowly, it ends on the upper tile."""
    places = rolled(kind, 1.0, 1e-3, 230, second=second, mu=0.6)
    assert places[:, 2].min() > -1e-6
    assert places[-1, 0] > 0.15
    assert abs(places[-1, 2] - second) < 2e-2 * second + 1e-7
