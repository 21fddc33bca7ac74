"""Plane bodies around holes: their masses, what bears within them, and outlines that are refused."""

import numpy as np
import pytest

from fcsim import Everything, InputError, Material, Simulation, Support, Theta, build_model
from fcsim.mesh import meshed_polygon, rigid_polygon, rigid_rectangle

STONE = Material(E=2e9, nu=0.2, density=2000.0)


def square(side: float, centre: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    return 0.5 * side * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) + centre


@pytest.mark.parametrize("way", [1, -1])
def test_a_frame_has_the_moments_of_its_squares(way: int) -> None:
    """Of squares a and b < a: area a^2 - b^2, polar moment (a^4 - b^4) / 6; whichever way its hole runs."""
    frame = rigid_polygon("frame", square(1.0), density=2000.0, holes=[square(0.6)[::way]])
    assert frame.mass == pytest.approx(2000.0 * (1 - 0.6**2))
    assert frame.inertia[0, 0] == pytest.approx(2000.0 * (1 - 0.6**4) / 6)
    part = meshed_polygon("frame", square(1.0), STONE, 0.2, holes=[square(0.6)[::way]])
    x, y = np.moveaxis(part.points[part.cells], 2, 0)
    assert np.sum(0.5 * (x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y)) == pytest.approx(1 - 0.6**2)
    skin = part.points[part.surfaces["skin"]]
    assert np.sum(np.linalg.norm(skin[:, 1] - skin[:, 0], axis=1)) == pytest.approx(4 * 1.6)


def test_what_lies_in_a_hole_is_carried_by_it() -> None:
    """A block of 10 kg at rest on the inside of a held frame."""
    frame, block = (
        rigid_polygon("frame", square(1.0), mass=1.0, holes=[square(0.6)]),
        rigid_rectangle("block", (0.2, 0.2), (0.05, -0.2), 10.0),
    )
    model = build_model([frame, block], supports=[Support("frame", ("x", "y", "rz"))], gravity=(0.0, -9.81))
    *_, last = Simulation(model, Everything(model, 0.5), Theta(1e-3), 5)
    assert last.contact_force_on(model.number["block"]) == pytest.approx([0.0, 98.1], abs=1e-6)


CIRCLE = np.column_stack([np.cos(np.arange(12) * np.pi / 6), np.sin(np.arange(12) * np.pi / 6)])


@pytest.mark.parametrize(
    ("points", "holes", "message"),
    [
        (np.concatenate([CIRCLE, CIRCLE[:1], 0.8 * CIRCLE[:1], 0.8 * CIRCLE[::-1]]), [], "a hole is given by holes="),
        ([CIRCLE, 0.8 * CIRCLE], [], "holes are given by holes="),
        (CIRCLE, [1.1 * CIRCLE], "expected holes within it, none in another"),
        (CIRCLE, [0.5 * CIRCLE, 0.3 * CIRCLE], "expected holes within it, none in another"),
        (CIRCLE, [0.8 * CIRCLE + [0.5, 0.0]], "expected holes whose sides touch no others"),
        (square(4.0), [square(1.0), square(1.0, (0.5, 0.0))], "expected holes whose sides touch no others"),
        (square(4.0), [square(1.0), square(1.0)], "expected holes whose sides touch no others"),
        (square(2.0), [square(1.0, (0.5, 0.0))], "expected holes whose sides touch no others"),
        (square(2.0), [[(0.0, -0.5), (1.0, -0.5), (2.0, 0.0), (1.0, 0.5), (0.0, 0.5)]], "expected holes whose sides touch no others"),
        (square(2.0), None, "expected holes as a list of polygons"),
        (square(2.0), square(1.0), "hole 0: .* each by its corners"),
        (CIRCLE, [0.8 * CIRCLE[[0, 0, 1, 2]]], "hole 0: expected corners that differ"),
        (np.concatenate([CIRCLE, CIRCLE[:1]]), [], "expected corners that differ"),
    ],
)
def test_outlines_that_are_none_are_refused(points: np.ndarray, holes: list[np.ndarray], message: str) -> None:
    """By the mesher too, which runs for ever on a seam."""
    with pytest.raises(InputError, match=message):
        rigid_polygon("ring", points, mass=1.0, holes=holes)
    with pytest.raises(InputError, match=message):
        meshed_polygon("ring", points, STONE, 0.2, holes=holes)
