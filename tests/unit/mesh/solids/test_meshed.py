"""Meshed solids: structured where they can be, of the surface's mass, skins closed."""

from __future__ import annotations

import numpy as np
import pytest

from fcsim.errors import InputError
from fcsim.mesh import Material, mass_properties
from fcsim.mesh.solids.closed_surface import closed_surface, rigid_solid
from fcsim.mesh.solids.meshed import meshed_polygon, meshed_solid
from fcsim.mesh.solids.rigid_polygon import rigid_polygon

STONE = Material(E=1e9, nu=0.2, density=2000.0)
HEX = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
VOUSSOIR = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.2, 0, 0.5], [0.8, 0, 0.5], [0.8, 1, 0.5], [0.2, 1, 0.5]])
L = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)


def prism(flat: np.ndarray) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    n = len(flat)
    points = np.array([[x, y, z] for y in (0.0, 0.7) for x, z in flat])
    return points, [tuple(range(n)), tuple(range(2 * n - 1, n - 1, -1)), *[(k, (k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)]]


@pytest.mark.parametrize(("points", "faces", "cell"), [(VOUSSOIR, HEX, "hexahedron"), (*prism(L), "tetrahedron")])
def test_a_meshed_solid_has_the_mass_of_its_surface(points: np.ndarray, faces: list[tuple[int, ...]], cell: str) -> None:
    surface = closed_surface("stone", points, faces)
    part, rigid = meshed_solid(surface, STONE, 0.3), rigid_solid(surface, density=2000.0)
    assert part.cell_type == cell
    found = mass_properties(part)
    assert found.mass == pytest.approx(rigid.mass)
    assert found.centre == pytest.approx(rigid.centre)
    assert found.inertia == pytest.approx(rigid.inertia, abs=1e-9 * rigid.inertia.max())
    skin = part.surfaces["skin"]
    normal = np.cross(part.points[skin[:, 1]] - part.points[skin[:, 0]], part.points[skin[:, 2]] - part.points[skin[:, 0]])
    assert np.abs(normal.sum(axis=0)).max() < 1e-9 * np.abs(normal).sum()  # closed


@pytest.mark.parametrize(("corners", "cell"), [(np.array([[0, 0], [1, 0], [0.9, 1], [0.1, 1]]), "quadrilateral"), (L, "triangle")])
def test_a_meshed_polygon_has_the_mass_of_the_plate(corners: np.ndarray, cell: str) -> None:
    part = meshed_polygon("plate", corners, STONE, 0.25, thickness=0.3)
    rigid = rigid_polygon("plate", corners, density=2000.0, thickness=0.3)
    assert part.cell_type == cell
    assert mass_properties(part).mass == pytest.approx(rigid.mass)
    assert mass_properties(part).inertia == pytest.approx(rigid.inertia)


@pytest.mark.parametrize("size", [0.0, -1.0, float("nan")])
def test_sizes_of_cells(size: float) -> None:
    with pytest.raises(InputError, match="size > 0"):
        meshed_polygon("plate", L, STONE, size)
