"""Links that hold bodies more often than it takes: that their shares are not determined is said, and of nothing else."""

import numpy as np
import pytest

from fcsim import Ball, Everything, Hinge, Linkage, QuasiStatic, Rod, Simulation, Support, Theta, build_model
from fcsim.linkage import Link
from fcsim.mesh import rigid_box, rigid_rectangle
from fcsim.mesh.part import RigidBody
from fcsim.timestep.links.undetermined import undetermined_forces
from fcsim.timestep.state import at_rest

LEGS = ((0.4, 0.4), (-0.4, 0.4), (-0.4, -0.4), (0.4, -0.4), (0.0, 0.1))


def said(bodies: list[RigidBody], links: list[Link], *supports: Support) -> list[str]:
    model = build_model(bodies, supports=supports)
    return list(undetermined_forces(model, Linkage(model, links), at_rest(model)))


def legs(count: int, unit: float = 1.0) -> tuple[list[RigidBody], list[Link], Support]:
    """A table on upright rods that cannot be pushed aside."""
    top = rigid_box("top", (unit, unit, 0.1 * unit), (0.0, 0.0, unit), 10.0)
    ends = [((unit * x, unit * y, 0.95 * unit), (unit * x, unit * y, 0.0)) for x, y in LEGS[:count]]
    return [top], [Rod(f"leg {k}", "top", None, both) for k, both in enumerate(ends)], Support("top", ("x", "y", "rz"))


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_the_fourth_leg_of_a_table(unit: float) -> None:
    """Three equations for four forces: that of a corner was said to be 43.275 N, without a word."""
    bodies, links, support = legs(3, unit)
    assert not said(bodies, links, support)
    for count in (4, 5):
        bodies, links, support = legs(count, unit)
        (remark,) = said(bodies, links, support)
        assert remark.startswith("links 'leg 0', 'leg 1', 'leg 2', 'leg 3'") and "bears along (0, 0, 1) is not determined" in remark


def test_a_run_says_so_in_statics_and_in_motion() -> None:
    for scheme in (QuasiStatic(1.0, eta=1e-6), Theta(1e-3)):
        bodies, links, support = legs(4)
        model = build_model(bodies, supports=[support], gravity=lambda t: (0.0, 0.0, -9.81))
        (step,) = Simulation(model, Everything(model, mu=0.0), scheme, 1, linkage=Linkage(model, links), witness=None)
        assert any("is not determined by equilibrium" in remark for remark in step.remarks)


def four_bars(d: int) -> tuple[list[RigidBody], list[Link]]:
    """A parallelogram of a crank, a coupler and a rocker, in the plane or of hinges along y in space."""
    places = {"crank": (0.0, 0.5), "coupler": (1.0, 1.0), "rocker": (2.0, 0.5)}
    sizes = {"crank": (0.02, 1.0), "coupler": (2.0, 0.02), "rocker": (0.02, 1.0)}
    between = {
        "A": ("crank", None, 0.0, 0.0),
        "B": ("crank", "coupler", 0.0, 1.0),
        "C": ("coupler", "rocker", 2.0, 1.0),
        "D": ("rocker", None, 2.0, 0.0),
    }
    if d == 2:
        plane: list[Link] = [Ball(name, first, second, (x, z)) for name, (first, second, x, z) in between.items()]
        return [rigid_rectangle(name, sizes[name], place, 1.0) for name, place in places.items()], plane
    space: list[Link] = [Hinge(n, first, second, ends=((x, -0.1, z), (x, 0.1, z))) for n, (first, second, x, z) in between.items()]
    boxes = [rigid_box(n, (sizes[n][0], 0.02, sizes[n][1]), (x, 0.0, z), 1.0) for n, (x, z) in places.items()]
    return boxes, space


def test_four_bars_of_parallel_hinges_in_space_and_of_pins_in_the_plane() -> None:
    """Kutzbach-Gruebler: 6 * 3 - 5 * 4 = -2 in space, where they move all the same; what hinges bear across the plane is open."""
    assert not said(*four_bars(2))
    (remark,) = said(*four_bars(3))
    assert "links 'A', 'B', 'C', 'D'" in remark and "along (0, 1, 0)" in remark


def test_a_straight_chain_is_not_held_more_often_than_it_takes() -> None:
    """Bars in one line between two points could be strained there, but leave that line under any load."""
    places = np.linspace(0.0, 1.0, 5)
    bodies = [rigid_box(f"b{k}", (0.2, 0.02, 0.02), (0.5 * (places[k] + places[k + 1]), 0.0, 0.0), 1.0) for k in range(4)]
    links: list[Link] = [Ball("j0", "b0", None, (0.0, 0.0, 0.0)), Ball("j4", "b3", None, (1.0, 0.0, 0.0))]
    links += [Ball(f"j{k}", f"b{k - 1}", f"b{k}", (places[k], 0.0, 0.0)) for k in (1, 2, 3)]
    assert not said(bodies, links)
    at = [(float(place), 0.0, 0.0) for place in places]
    masses = [rigid_box(f"m{k}", (0.01, 0.01, 0.01), at[k], 1.0) for k in (1, 2, 3)]
    ends: list[Link] = [Rod("r0", "m1", None, (at[1], at[0])), Rod("r3", "m3", None, (at[3], at[4]))]
    assert not said(masses, [*ends, Rod("r1", "m1", "m2", (at[1], at[2])), Rod("r2", "m2", "m3", (at[2], at[3]))])
