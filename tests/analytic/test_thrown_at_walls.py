"""Slender bodies thrown at a plate that they cross in a part of a step: struck at one end they turn by a radian a step, and stay before it.

What hits a fixed wall with e = 0 loses energy, and its centre never gets beyond the face by more than the body's thickness, whatever
detection finds: it comes from before the wall, and the wall is wider than the body is long.
"""

from typing import Literal

import numpy as np
import pytest

from fcsim import Everything, ExactContacts, RigidBody, Simulation, State, Support, Theta, Witness, at_rest, build_model
from fcsim.errors import Penetration
from fcsim.mesh import rigid_box, rigid_capsule, rigid_cylinder

WALL, R, LENGTH = 0.02, 0.01, 0.4  # [m]: its thickness; of what is thrown
HELD = ("x", "y", "z", "rx", "ry", "rz")


def rod(kind: str, centre: np.ndarray, axis: np.ndarray) -> RigidBody:
    if kind == "box":
        return rigid_box("rod", (2 * R, LENGTH, 2 * R), centre, 1.0)
    return {"capsule": rigid_capsule, "cylinder": rigid_cylinder}[kind]("rod", R, LENGTH, centre, 1.0, axis=tuple(axis))


def thrown(
    kind: str, speed: float, spin: float, seed: int, *, h: float = 1e-3, cuttings: int = 5, witness: Witness | None = None
) -> Simulation:
    """A rod that is anywhere and turned by anything, in front of a fixed plate across x; spin [rad/s] about any axis."""
    random = np.random.default_rng(seed)
    axis, about = random.normal(size=(2, 3))
    centre = np.array([-0.5 - 0.5 * random.random(), *(0.1 * random.normal(size=2))])
    plate = rigid_box("plate", (WALL, 2.0, 2.0), (0.0, 0.0, 0.0), 10.0)
    model = build_model([plate, rod(kind, centre, axis / np.linalg.norm(axis))], supports=[Support("plate", HELD)])
    start = at_rest(model)
    v = start.v.copy()
    v[6:9], v[9:] = (speed, 0.0, 0.0), spin * about / np.linalg.norm(about)
    contact = Everything(model, 0.3) if kind == "box" else ExactContacts(model, 0.3)
    steps = int(1.2 / speed / h) + 4
    return Simulation(model, contact, Theta(h), steps, initial=State(0.0, start.x, v), cuttings=cuttings, witness=witness)


@pytest.mark.each_value
@pytest.mark.parametrize("seed", [1, 8])
@pytest.mark.parametrize(("speed", "spin"), [(100.0, 300.0), (300.0, 0.0), (300.0, 300.0)])
@pytest.mark.parametrize("kind", ["capsule", "cylinder", "box"])
def test_it_stays_before_the_plate(kind: Literal["capsule", "cylinder", "box"], speed: float, spin: float, seed: int) -> None:
    """The witness looks at the last step alone, in which what has passed is far away."""
    simulation = thrown(kind, speed, spin, seed, witness=Witness(every=1000))
    centre, energy = simulation.model.rigid[1].centre[0], np.inf
    for step in simulation:
        now = step.energy.kinetic
        assert centre + step.state.x[6] < -WALL / 2
        assert now < energy * (1 + 1e-3)
        energy = now
    assert step.state.v[6] < 0.5 * speed


def test_a_thousand_metres_a_second_is_stopped_or_said() -> None:
    """Where a 32nd of the step is too long for the rims of a cylinder, the run ends."""
    simulation = thrown("cylinder", 1000.0, 300.0, 3, witness=Witness(every=1000))
    with pytest.raises(Penetration, match="'plate' and 'rod' go through each other"):
        for step in simulation:
            assert simulation.model.rigid[1].centre[0] + step.state.x[6] < -WALL / 2


def test_what_may_not_be_cut_ends_the_run() -> None:
    """Unwitnessed, a cylinder of 300 m/s that is struck at one end is beyond the plate a step later."""
    with pytest.raises(Penetration, match=r"step 3, .*'plate' and 'rod' go through each other within 0.001 s.*choose a shorter h"):
        list(thrown("cylinder", 300.0, 0.0, 1, cuttings=0))
