"""Closed surfaces: moments against formulas, whatever the orientation of faces; what is no solid is refused by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

HEX = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)


def l_prism(length: float = 2.0) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """An L of 2 x 2 less 1 x 1 in x and z, along y."""
    flat = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    points = np.array([[x, y, z] for y in (0.0, length) for x, z in flat])
    sides = [(k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6)]
    return points, [tuple(range(6)), tuple(range(11, 5, -1)), *sides]


def test_box_of_any_size_and_place() -> None:
    size, corner = np.array([2.0, 3.0, 0.5]), np.array([10.0, -4.0, 1e3])
    body = rigid_solid(closed_surface("box", CUBE * size + corner, HEX), density=2.0)
    assert body.mass == pytest.approx(2 * size.prod())
    assert body.centre == pytest.approx(corner + size / 2)
    assert body.inertia == pytest.approx(body.mass / 12 * (np.diag((size**2).sum() - size**2)), abs=1e-9)


def test_a_solid_that_is_not_convex() -> None:
    """The L is a cube of side 2 less one of 1 x 2 x 1: centroid and inertia by the parallel axes."""
    points, faces = l_prism()
    surface = closed_surface("L", points, faces)
    volume, centre, second = surface.moments()
    assert volume == pytest.approx(6.0)
    assert centre == pytest.approx([5 / 6, 1.0, 5 / 6])
    whole, cut = 8 * (np.eye(3) / 3 + 1.0), 2 * (np.diag([1 / 12, 1 / 3, 1 / 12]) + np.outer([1.5, 1, 1.5], [1.5, 1, 1.5]))
    assert second == pytest.approx(whole - cut - 6 * np.outer(centre, centre))
    assert len(surface.polygons) == 8


@pytest.mark.parametrize("wrong", [range(6), [0], [1, 4], [0, 2, 3]])
def test_faces_of_any_orientation_are_turned_outwards(wrong: list[int]) -> None:
    faces = [face[::-1] if k in wrong else face for k, face in enumerate(HEX)]
    surface = closed_surface("cube", CUBE, faces)
    corners = CUBE[[0]] * 0 + surface.points[surface.triangles].reshape(-1, 3, 3).mean(axis=1)
    normal = np.cross(*(surface.points[surface.triangles[:, k]] - surface.points[surface.triangles[:, 0]] for k in (1, 2)))
    assert (np.einsum("fd,fd->f", normal, corners - 0.5) > 0).all()


@pytest.mark.parametrize("unit", [1.0, 1e-5])
def test_a_face_that_crosses_itself_is_refused_in_any_unit(unit: float) -> None:
    flat = [(0, 0), (3, 0), (1, 2), (2, 2)]
    points = unit * np.array([(x, y, z) for z in (0.0, 1.0) for x, y in flat])
    sides = [(k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4) for k in range(4)]
    with pytest.raises(InputError, match="faces that do not cross themselves"):
        closed_surface("bow", points, [(3, 2, 1, 0), (4, 5, 6, 7), *sides])


def test_corners_of_the_same_place_become_one() -> None:
    points = np.concatenate([CUBE[list(face)] for face in HEX])  # as STL holds them
    surface = closed_surface("cube", points, [tuple(range(4 * k, 4 * k + 4)) for k in range(6)])
    assert len(surface.points) == 8
    assert surface.moments()[0] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("faces", "points", "message"),
    [
        (HEX[:-1], CUBE, "closed surface, got 4 edges of one face alone"),
        ([*HEX, (0, 1, 2, 3)], CUBE, "edges of two faces"),
        (HEX, CUBE + np.array([[0, 0, 0.1]] + 7 * [[0, 0, 0]]), "plane faces"),
        (HEX, CUBE * [1, 1, 0], "volume|area"),
        ([(0, 1, 9)], CUBE, "point numbers 0 ... 7"),
        ([(0, 1)], CUBE, "at least three"),
        ([], CUBE, "faces, got none"),
        (HEX, CUBE * np.nan, "finite"),
    ],
)
def test_what_is_no_solid_is_refused(faces: list[tuple[int, ...]], points: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        closed_surface("stone", points, faces)


def test_a_polygon_that_crosses_itself_is_refused() -> None:
    with pytest.raises(InputError, match="cross"):
        rigid_polygon("bow", [(0, 0), (2, 2), (2, 0), (0, 1)], density=1.0)


@pytest.mark.parametrize(("corners", "again"), [([(0, 0), (1, 0), (1, 1), (0, 0)], 0), ([(0, 0), (1, 0), (1, 0), (1, 1)], 2)])
def test_a_polygon_with_a_corner_twice_is_refused(corners: list[tuple[float, float]], again: int) -> None:
    """As when the last corner is the first once more."""
    with pytest.raises(InputError, match=f"corners that differ from the next one .*, got corner {again} where"):
        rigid_polygon("closed", corners, density=1.0)


def test_polygons_against_the_rectangle_and_the_l() -> None:
    plate = rigid_polygon("plate", np.array([(5, 8), (7, 8), (7, 7), (5, 7)]), mass=3.0)
    assert plate.centre == pytest.approx([6.0, 7.5])
    assert plate.inertia[0, 0] == pytest.approx(3.0 / 12 * (4 + 1))
    points, _ = l_prism()
    angle = rigid_polygon("L", points[:6][:, [0, 2]], density=2.0, thickness=0.5)
    solid = rigid_solid(closed_surface("L", *l_prism(0.5)), density=2.0)
    assert angle.mass == pytest.approx(solid.mass)
    assert angle.inertia[0, 0] == pytest.approx(solid.inertia[1, 1])


def test_mass_or_density() -> None:
    surface = closed_surface("cube", CUBE, HEX)
    assert rigid_solid(surface, mass=5.0).mass == pytest.approx(5.0)
    for given in ({}, {"mass": 1.0, "density": 1.0}, {"mass": -1.0}, {"density": float("nan")}):
        with pytest.raises(InputError, match="density > 0"):
            rigid_solid(surface, **given)


@pytest.mark.parametrize("far", [1e17, 4.6e18, 1e300])
def test_a_body_so_far_away_that_nothing_is_left_of_its_shape(far: float) -> None:
    """Moved there by a pose, once its surface was checked: a division by its volume of zero."""
    surface = closed_surface("cube", CUBE, HEX)
    moved = replace(surface, points=surface.points + np.array([far, 0.0, 0.0]))
    with pytest.raises(InputError, match=r"'cube': expected points around a volume, got 0 m\^3 within 1 m \(placed too far away\?\)"):
        rigid_solid(moved, mass=2.0)


@pytest.mark.parametrize("far", [1e61, 1e155, 1e300])
def test_a_solid_beyond_the_range_of_floats_is_refused(far: float) -> None:
    points = CUBE.copy()
    points[3, 0] = -far
    with pytest.raises(InputError, match="'far': expected points whose volume is a number, got an extent of"):
        closed_surface("far", points, HEX)


def test_an_l_whose_inner_corner_is_the_mean_of_its_corners() -> None:
    """Three unit squares around (1, 1): the mean of the six corners is the inner one; every corner as the first."""
    around = [(0, 0), (2, 0), (2, 2), (1, 2), (1, 1), (0, 1)]
    for turn in range(6):
        flat = around[turn:] + around[:turn]
        points = [(x, y, z) for z in (0.0, 1.0) for x, y in flat]
        sides = [(k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6)]
        surface = closed_surface("L", points, [tuple(range(5, -1, -1)), tuple(range(6, 12)), *sides])
        assert surface.moments()[0] == pytest.approx(3.0)
