"""Middle nodes of raised cells: on circles, cylinders and spheres where these are evident, in the middle of straight edges elsewhere."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from fcsim.mesh import Material, Part, brick, rectangle
from fcsim.mesh.cell_type import CELL_TYPES, ELEMENTS, RAISED
from fcsim.mesh.order.second_order import raised
from fcsim.mesh.quality import cell_volumes, scaled_jacobian

STEEL = Material(2e11, 0.3, 7800.0)
INNER, OUTER = 0.5, 1.0
cells = pytest.mark.parametrize("cell", list(RAISED))


def bent(first: Part, at: Callable[..., list[np.ndarray]]) -> tuple[Part, np.ndarray]:
    """A part of straight cells with its points moved by `at` and then raised, and the points with straight edges."""
    straight = replace(first, points=np.stack(at(*first.points.T), axis=1))
    mesh = raised(straight.points, straight.cells, straight.cell_type, straight.surfaces, "straight")
    return replace(straight, elements=ELEMENTS[RAISED[straight.cell_type]][0]), mesh.points


def on_a_ring(r: np.ndarray, angle: np.ndarray, *z: np.ndarray) -> list[np.ndarray]:
    return [r * np.cos(angle), r * np.sin(angle), *z]


def on_a_shell(r: np.ndarray, around: np.ndarray, up: np.ndarray) -> list[np.ndarray]:
    return [r * np.cos(around) * np.cos(up), r * np.sin(around) * np.cos(up), r * np.sin(up)]


def quarter(cell: str) -> Part:
    """6 facets over 90 degrees, before it is bent; 2 cells thick, in space 2 high."""
    if CELL_TYPES[cell].dimension == 2:
        return rectangle("ring", (OUTER - INNER, np.pi / 2), (2, 6), STEEL, cell, origin=(INNER, 0.0))
    return brick("ring", (OUTER - INNER, np.pi / 2, 0.4), (2, 6, 2), STEEL, cell, origin=(INNER, 0.0, 0.0))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle", "hexahedron"])
def test_a_ring_is_round_and_its_flat_faces_stay(cell: str) -> None:
    part, straight = bent(quarter(cell), on_a_ring)
    for name, radius in (("x-", INNER), ("x+", OUTER)):
        nodes = np.unique(part.surfaces[name])
        assert np.linalg.norm(straight[nodes, :2], axis=1).min() < radius * np.cos(np.pi / 24) * (1 + 1e-12)
        assert np.allclose(np.linalg.norm(part.points[nodes, :2], axis=1), radius, rtol=1e-12)
    for name in ("z-", "z+"):
        if name in part.surfaces:
            assert np.array_equal(part.points[np.unique(part.surfaces[name]), 2], straight[np.unique(part.surfaces[name]), 2])
    assert np.abs(part.points[np.unique(part.surfaces["y-"]), 1]).max() < 1e-15
    exact = np.pi / 4 * (OUTER**2 - INNER**2) * (0.4 if part.dimension == 3 else 1.0)
    volume, before = (cell_volumes(points, part.cells, part.cell_type).sum() for points in (part.points, straight))
    assert abs(volume - exact) < 1e-2 * abs(before - exact)
    assert (scaled_jacobian(part.points, part.cells, part.cell_type) > 0.2).all()


def test_a_spherical_shell_is_round() -> None:
    """To 3 % of the height over a chord where two rims meet, 1 % elsewhere."""
    first = brick("shell", (OUTER - INNER, 1.5, 1.5), (2, 6, 6), STEEL, origin=(INNER, 0.0, -0.75))
    part, straight = bent(first, on_a_shell)
    for name, radius in (("x-", INNER), ("x+", OUTER)):
        nodes = np.unique(part.surfaces[name])
        now, before = (np.abs(np.linalg.norm(points[nodes], axis=1) - radius) for points in (part.points, straight))
        assert before.max() > 1e-2 * radius
        assert now.max() < 4e-2 * before.max()
        assert np.sqrt((now**2).mean()) < 1e-2 * before.max()


@cells
def test_a_box_keeps_every_digit(cell: str) -> None:
    part, straight = bent(quarter(cell), lambda *x: [0.1 + 0.7 * x[0], *(0.3 * y for y in x[1:])])
    assert np.array_equal(part.points, straight)


def test_middle_nodes_that_are_given_stay() -> None:
    part, straight = bent(quarter("quadrilateral"), on_a_ring)
    given = replace(part, points=straight)
    assert given.cell_type == "quadrilateral9"
    assert np.array_equal(given.points, straight)


def test_cells_that_would_fold_keep_their_chords() -> None:
    """Ears of a polygon, triangles with two sides each on the circle: with these curved the corner between them would be straight."""
    n = 16
    angle = 2 * np.pi * np.arange(n) / n
    rim = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    at = np.arange(0, n, 2)
    ears = np.stack([at, at + 1, (at + 2) % n], axis=1)
    fan = np.stack([np.full(n // 2, n), at, (at + 2) % n], axis=1)
    disc = Part("disc", np.concatenate([rim, [[0.0, 0.0]]]), np.concatenate([ears, fan]), "triangle", {}, STEEL)
    part, straight = bent(disc, lambda x, y: [x, y])
    assert np.array_equal(part.points, straight)

    other = Part("disc", disc.points, np.stack([np.full(n, n), np.arange(n), np.roll(np.arange(n), -1)], axis=1), "triangle", {}, STEEL)
    part, _ = bent(other, lambda x, y: [x, y])
    assert cell_volumes(part.points, part.cells, part.cell_type).sum() == pytest.approx(np.pi, rel=1e-4)


@pytest.mark.parametrize("corners", [16, 24, 60])
@pytest.mark.parametrize("a_side", [1, 2])
def test_sides_of_two_cells_are_flat_those_of_one_are_chords(corners: int, a_side: int) -> None:
    """A ring with corners on circles: one cell a side cannot be told from a circle's chord, two say that the side is flat."""
    around = 2 * np.pi * np.arange(corners) / corners
    corner = np.stack([np.cos(around), np.sin(around)], axis=1)
    share = np.arange(a_side)[None, :, None] / a_side
    outer = (corner[:, None] + share * (np.roll(corner, -1, axis=0) - corner)[:, None]).reshape(-1, 2)
    n = len(outer)
    here, after = np.arange(n), np.roll(np.arange(n), -1)
    quadrilaterals = np.stack([here, n + here, n + after, after], axis=1)
    outside = {"out": n + np.stack([here, after], axis=1)}
    points = np.concatenate([INNER * outer, OUTER * outer])
    part = Part("ring", points, quadrilaterals, "quadrilateral", outside, STEEL, elements="Q2")
    straight = raised(points, quadrilaterals, "quadrilateral", outside, "ring").points
    if a_side == 2:
        assert np.array_equal(part.points, straight)
    else:
        assert np.linalg.norm(part.points[part.surfaces["out"]], axis=2) == pytest.approx(OUTER, rel=1e-3)
        assert np.abs(part.points - straight).max() > 0.9 * (1 - np.cos(np.pi / corners))
