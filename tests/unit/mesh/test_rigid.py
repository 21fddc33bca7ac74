"""Rigid bodies from meshes against the formulas of solids: box, wedge, polygon; warped cells; placed bodies."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.errors import InputError
from fcsim.mesh.blocks import brick, part_from_gmsh, rectangle, rigid_box, rigid_rectangle
from fcsim.mesh.material import Material
from fcsim.mesh.part import Body, Part, RigidBody
from fcsim.mesh.rigid import blocks_that_are, mass_properties, rigid_body
from fcsim.runtime import gmsh_model

STONE = Material(E=1e9, nu=0.2, density=2000.0)
SIZE, ORIGIN = np.array([2.0, 1.0, 0.5]), np.array([10.0, -20.0, 30.0])


@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_box(cell: str) -> None:
    mass, centre, inertia = mass_properties(brick("b", SIZE, (3, 2, 1), STONE, cell, ORIGIN))
    assert mass == pytest.approx(2000.0, rel=1e-12)
    assert_allclose(centre, ORIGIN + SIZE / 2, rtol=1e-13)
    assert_allclose(inertia, mass / 12 * np.diag(np.sum(SIZE**2) - SIZE**2), atol=1e-9)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_rectangle_of_a_thickness(cell: str) -> None:
    mass, centre, inertia = mass_properties(rectangle("r", SIZE[:2], (3, 2), STONE, cell, thickness=0.1, origin=ORIGIN[:2]))
    assert mass == pytest.approx(2000.0 * 2 * 0.1, rel=1e-12)
    assert_allclose(centre, ORIGIN[:2] + SIZE[:2] / 2, rtol=1e-13)
    assert_allclose(inertia, [[mass / 12 * 5]], rtol=1e-12)


@pytest.mark.parametrize("make", [lambda: brick("b", SIZE, (4, 4, 4), STONE), lambda: rectangle("r", SIZE[:2], (4, 4), STONE)])
def test_moved_inner_nodes_change_nothing(make: Callable[[], Part]) -> None:
    """Bilinear cells of any shape fill the same box: the quadrature is exact on them."""
    part = make()
    d = part.dimension
    inner = np.all((part.points > 1e-9) & (part.points < SIZE[:d] - 1e-9), axis=1)
    moved = part.points + 0.08 * inner[:, None] * SIZE[:d] * np.random.default_rng(0).uniform(-1, 1, part.points.shape)
    warped = Part("warped", moved, part.cells, part.cell_type, part.surfaces, STONE)
    assert inner.any()
    for one, other in zip(mass_properties(part), mass_properties(warped), strict=True):
        assert_allclose(one, other, atol=1e-10)


def test_skew_prism() -> None:
    """A right-angled wedge: centre at a third of each leg; products of inertia by the integral of x y over the triangle, a^2 b^2 / 24."""
    a, b, length = 0.6, 0.9, 2.0
    points = np.array([(0, 0, 0), (a, 0, 0), (0, b, 0), (0, 0, length), (a, 0, length), (0, b, length)])
    cells = np.array([(0, 1, 2, 3), (1, 2, 3, 4), (2, 3, 4, 5)])
    volumes = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]])
    cells[volumes < 0] = cells[volumes < 0][:, [0, 2, 1, 3]]
    mass, centre, inertia = mass_properties(Part("wedge", points, cells, "tetrahedron", {}, STONE))
    assert mass == pytest.approx(2000 * a * b / 2 * length)
    assert_allclose(centre, [a / 3, b / 3, length / 2])
    xx, yy, zz = mass * a**2 / 18, mass * b**2 / 18, mass * length**2 / 12
    xy = 2000 * length * (a * b) ** 2 / 24 - mass * centre[0] * centre[1]
    assert_allclose(inertia, [[yy + zz, -xy, 0], [-xy, xx + zz, 0], [0, 0, xx + yy]], atol=1e-9)


def test_regular_polygon() -> None:
    """A meshed disk is a regular polygon of n sides: area n/2 R^2 sin d, polar moment (2 + cos d) / 6 m R^2, d = 2 pi / n."""
    radius = 0.4
    with gmsh_model("disk") as gmsh:
        gmsh.model.occ.addDisk(1.0, 2.0, 0, radius, radius)
        gmsh.model.occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
        gmsh.model.mesh.generate(2)
        part = part_from_gmsh(gmsh, "disk", STONE)
    d = 2 * np.pi / np.count_nonzero(np.linalg.norm(part.points - [1.0, 2.0], axis=1) > (1 - 1e-9) * radius)
    mass, centre, inertia = mass_properties(part)
    assert mass == pytest.approx(2000 * np.pi / d * radius**2 * np.sin(d), rel=1e-9)
    assert_allclose(centre, [1.0, 2.0], atol=1e-9)
    assert inertia[0, 0] == pytest.approx((2 + np.cos(d)) / 6 * mass * radius**2, rel=1e-9)


def test_placed_body_is_the_rigid_box() -> None:
    """Placed by a rotation: mass, centre and inertia of the turned box, and the same facets in space."""
    part, R, t = brick("b", SIZE, (2, 2, 2), STONE), Rotation.from_rotvec([0.3, 1.1, -0.6]).as_matrix(), np.array([3.0, 4.0, 5.0])
    body = Body("block", part, R, t)
    rigid, box = rigid_body(body), rigid_box("box", tuple(SIZE), tuple(SIZE / 2), 2000.0)
    assert (rigid.name, list(rigid.surfaces)) == ("block", list(part.surfaces))
    assert rigid.mass == pytest.approx(box.mass)
    assert_allclose(rigid.centre, R @ box.centre + t, atol=1e-12)
    assert_allclose(rigid.inertia, R @ box.inertia @ R.T, atol=1e-9)
    assert len(rigid.points) == 26  # the node inside is left out
    for name, facets in part.surfaces.items():
        assert_allclose(rigid.points[rigid.surfaces[name]], body.points[facets])


def test_plane_body_is_the_rigid_rectangle() -> None:
    part, R = rectangle("r", SIZE[:2], (2, 1), STONE), np.array([[0.6, -0.8], [0.8, 0.6]])
    rigid, box = rigid_body(Body("block", part, R)), rigid_rectangle("box", tuple(SIZE[:2]), tuple(SIZE[:2] / 2), 4000.0)
    assert rigid.mass == pytest.approx(box.mass)
    assert_allclose(rigid.centre, R @ box.centre)
    assert_allclose(rigid.inertia, box.inertia)


def test_kinds_of_blocks() -> None:
    part = brick("b", SIZE, (1, 1, 1), STONE)
    bodies = [Body(f"block {k}", part, translation=np.array([3.0 * k, 0, 0])) for k in range(5)]
    kinds: Any = {"deformable": [Body] * 5, "rigid": [RigidBody] * 5, "mixed": [Body, RigidBody, Body, RigidBody, Body]}
    for kind, expected in kinds.items():
        made = blocks_that_are(kind, bodies)
        assert [type(body) for body in made] == expected
        assert [body.name for body in made] == [body.name for body in bodies]
    with pytest.raises(InputError, match="one of deformable, rigid, mixed, got 'soft'"):
        blocks_that_are("soft", bodies)  # type: ignore[arg-type]


def test_refusals() -> None:
    with pytest.raises(InputError, match="density > 0"):
        rigid_body(Body("block", brick("b", SIZE, (1, 1, 1), Material(1e9, 0.2, 0.0))))
    part = brick("b", SIZE, (1, 1, 1), STONE)
    with pytest.raises(InputError, match="'block': expected a part with surfaces"):
        rigid_body(Body("block", Part("bare", part.points, part.cells, part.cell_type, {}, STONE)))


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e3])
def test_round_off_of_an_inertia_is_judged_by_its_size(size: float) -> None:
    inertia = size**5 * (np.diag([1.0, 2.0, 2.5]) + 1e-15 * np.arange(9.0).reshape(3, 3))
    assert RigidBody("b", size**3, inertia, np.zeros(3), np.zeros((0, 3))).inertia.shape == (3, 3)
    skewed = inertia.copy()
    skewed[0, 1] += 1e-3 * size**5
    with pytest.raises(InputError, match="symmetric positive definite inertia"):
        RigidBody("b", size**3, skewed, np.zeros(3), np.zeros((0, 3)))
