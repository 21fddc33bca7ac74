"""The witness's overlap against closed forms: depths of blocks, edges, coincident and convex bodies, in 2D and 3D, in any units."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from fcsim import Body, Material, RigidBody, build_model
from fcsim.arrays import FloatArray
from fcsim.mesh import (
    brick,
    rectangle,
    rigid_box,
    rigid_capsule,
    rigid_cylinder,
    rigid_plane,
    rigid_rectangle,
    rigid_sphere,
)
from fcsim.witness._overlap_kernels import with_means
from fcsim.witness.overlap import PairOverlaps, measure
from fcsim.witness.skin import skins_of
from tests.unit.contact_detection.general.strips import arc, bent, fork, hollow, strip

STONE = Material(1e9, 0.2, 2000.0)


def moved(body: RigidBody, by: ArrayLike, rotation: FloatArray | None = None) -> RigidBody:
    """The body turned about its centre and shifted."""
    R = np.eye(body.dimension) if rotation is None else rotation
    centre = body.centre + np.asarray(by, dtype=float)
    return RigidBody(body.name, body.mass, body.inertia, centre, (body.points - body.centre) @ R.T + centre, body.surfaces)


def overlap(*bodies: RigidBody | Body, thorough: bool = False, least: float = 1e-9) -> PairOverlaps:
    model = build_model(list(bodies))
    return measure(skins_of(model)[0], model.reference, least, thorough=thorough)


def cube(name: str, size: ArrayLike = (1.0, 1.0, 1.0)) -> RigidBody:
    return rigid_box(name, np.asarray(size, dtype=float).tolist(), (0.0, 0.0, 0.0), 1.0)


def polyhedron(name: str, points: FloatArray) -> RigidBody:
    """The convex hull of points as a rigid body, facets outwards."""
    hull = ConvexHull(points)
    facets = hull.simplices.copy()
    corners = points[facets]
    inwards = np.einsum("nd,nd->n", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), hull.equations[:, :3]) < 0
    facets[inwards] = facets[inwards][:, ::-1]
    return RigidBody(name, 1.0, np.eye(3), points.mean(axis=0), points, {"skin": facets})


@pytest.mark.parametrize("unit", [1e-4, 1.0, 1e3])
@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.3, 0.2), (0.9, 0.0)])
def test_face_in_face(unit: float, aside: tuple[float, float]) -> None:
    """A cube sunk by 1 % into another: the overlap is 1 %, flush with its sides or not, in any unit of length."""
    sunk = overlap(cube("a", [unit] * 3), moved(cube("b", [unit] * 3), np.array([*aside, 0.99]) * unit))
    assert sunk.depth == pytest.approx([0.01 * unit], rel=1e-9)


def test_what_touches_does_not_overlap() -> None:
    assert not len(overlap(cube("a"), moved(cube("b"), (0.3, 0.0, 1.0))).depth)
    assert not len(overlap(cube("a"), moved(cube("b"), (0.3, 0.0, 1.0)), thorough=True).depth)


def test_turned_cube() -> None:
    """Turned by 45 degrees about the vertical no vertex of one face lies within the other."""
    turn = Rotation.from_euler("z", 45, degrees=True).as_matrix()
    assert overlap(cube("a"), moved(cube("b"), (0.0, 0.0, 0.99), turn)).depth == pytest.approx([0.01], rel=1e-9)


@pytest.mark.parametrize("sunk", [1e-5, 1e-3, 0.1])
def test_crossing_edges(sunk: float) -> None:
    """Two square bars on edge, crossing at right angles: the lower's ridge is cut by the upper's over a length 2 sunk, and the point in the
    middle lies sunk below the other's ridge, sunk / sqrt(2) below its faces."""
    lower = moved(cube("lower", (4.0, 1.0, 1.0)), (0, 0, 0), Rotation.from_euler("x", 45, degrees=True).as_matrix())
    upper = moved(cube("upper", (1.0, 4.0, 1.0)), (0, 0, np.sqrt(2) - sunk), Rotation.from_euler("y", 45, degrees=True).as_matrix())
    assert overlap(lower, upper).depth == pytest.approx([sunk / np.sqrt(2)], rel=1e-5)


def test_needle_through_a_plate() -> None:
    """Half the plate's thickness, where no vertex of either lies in the other."""
    through = overlap(cube("plate", (4.0, 4.0, 0.5)), moved(cube("needle", (0.1, 0.1, 5.0)), (0.33, 0.21, 0.4)))
    assert through.depth == pytest.approx([0.25], rel=1e-4)


def test_a_body_within_another() -> None:
    """The small cube's side nearest the middle of the large one is 0.5 m deep."""
    assert overlap(cube("a"), moved(cube("b", (0.2, 0.2, 0.2)), (0.1, 0.0, 0.0))).depth == pytest.approx([0.5])


@pytest.mark.parametrize("size", [(1.0, 1.0, 1.0), (3.0, 1.0, 0.5)])
def test_coincident_bodies_are_found_when_looked_for(size: tuple[float, ...]) -> None:
    """No point of the skins lies below the other's: points within do, at 5/12 of the thickness or deeper."""
    found = overlap(cube("a", size), cube("b", size), thorough=True)
    assert found.depth[0] >= 5 / 12 * min(size) * (1 - 1e-12)


def test_only_the_pairs_that_overlap() -> None:
    row = [moved(cube(f"b{k}"), (1.0 * k - 0.02 * (k >= 3), 0.3 * k, 0.0)) for k in range(6)]
    found = overlap(*row)
    assert found.bodies.tolist() == [[2, 3]]
    assert found.depth == pytest.approx([0.02])


def test_in_the_plane() -> None:
    a, b = rigid_rectangle("a", (1, 1), (0, 0), 1.0), rigid_rectangle("b", (1, 1), (0.2, 0.97), 1.0)
    assert overlap(a, b).depth == pytest.approx([0.03])
    flush = rigid_rectangle("b", (1, 1), (0.0, 0.97), 1.0)
    assert overlap(a, flush).depth == pytest.approx([0.03])
    bar = rigid_rectangle("b", (3, 0.5), (0.2, 0.0), 1.0)
    assert overlap(a, bar).depth == pytest.approx([0.25])
    assert overlap(a, rigid_rectangle("b", (1, 1), (0, 0), 1.0), thorough=True).depth[0] >= 5 / 12


def test_deformable_bodies_by_all_their_boundary() -> None:
    """Whatever surfaces are named: the facets of the cells that bound it."""
    block = brick("block", (1.0, 1.0, 1.0), (2, 2, 2), STONE)
    lower, upper = Body("lower", block), Body("upper", block, translation=np.array([0.4, 0.1, 0.95]))
    assert overlap(lower, upper).depth == pytest.approx([0.05])
    plate = rectangle("plate", (1.0, 1.0), (3, 3), STONE, cell="triangle")
    assert overlap(Body("a", plate), Body("b", plate, translation=np.array([0.9, 0.1]))).depth == pytest.approx([0.1])


def test_l_shaped_body_is_not_its_hull() -> None:
    """A cube in the notch of an L of two boxes' union does not overlap it; sunk into the notch's floor it does."""
    outline = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], dtype=float)
    n = len(outline)
    facets = np.stack([np.arange(n), (np.arange(n) + 1) % n], axis=1)
    angle = RigidBody("L", 1.0, np.eye(1), np.array([0.7, 0.7]), outline, {"skin": facets})
    stone = rigid_rectangle("stone", (0.8, 0.8), (1.5, 1.4), 1.0)
    assert not len(overlap(angle, stone, thorough=True).depth)
    assert overlap(angle, moved(stone, (0.0, -0.07))).depth == pytest.approx([0.07])


@pytest.mark.parametrize("rod", [rigid_cylinder, rigid_capsule])
@pytest.mark.parametrize("at", [0.03, 0.19, 0.41])
@pytest.mark.parametrize("size", [1.0, 1e-6, 1e3])
def test_a_thin_rod_through_a_thin_plate(rod, at: float, size: float) -> None:
    """A rod of 1 m and 2 cm across a plate of 4 mm: wherever they cross it lies as deep as the plate's half and its own radius, but for
    what two points a radius apart miss; beside the plate there is nothing."""
    plate = cube("plate", (0.3 * size, 0.3 * size, 4e-3 * size))
    through = rod("rod", 0.01 * size, 1.0 * size, (0.01 * size, 0.02 * size, at * size), 1.0, axis=(0, 0, 1))
    assert overlap(plate, through).depth == pytest.approx([0.01 * size], rel=0.3)
    assert not len(overlap(plate, rod("rod", 0.01 * size, 1.0 * size, (0.161 * size, 0, at * size), 1.0, axis=(0, 0, 1))).depth)


def test_exact_shapes() -> None:
    """Spheres 0.2 apart of radius 0.11; a ball 0.01 in a box's face and 0.01 in its edge; capsules that cross; a tilted post in a floor."""
    two = [rigid_sphere("a", 0.11, (0, 0, 0), 1.0), rigid_sphere("b", 0.11, (0.2, 0, 0), 1.0)]
    assert overlap(*two).depth == pytest.approx([0.02])
    assert overlap(cube("box"), rigid_sphere("ball", 0.1, (0.2, 0.1, 0.59), 1.0)).depth == pytest.approx([0.01])
    off = 0.09 / np.sqrt(2)
    assert overlap(cube("box"), rigid_sphere("ball", 0.1, (0.5 + off, 0.1, 0.5 + off), 1.0)).depth == pytest.approx([0.01])
    assert overlap(cube("box"), rigid_sphere("ball", 0.1, (0.0, 0.0, 0.0), 1.0)).depth == pytest.approx([0.6])
    cross = [
        rigid_capsule("a", 0.1, 1.0, (0, 0, 0), 1.0, axis=(1, 0, 0)),
        rigid_capsule("b", 0.1, 1.0, (0.2, 0.1, 0.17), 1.0, axis=(0, 1, 0)),
    ]
    assert overlap(*cross).depth == pytest.approx([0.03])
    assert not len(overlap(cross[0], rigid_capsule("b", 0.1, 1.0, (0.2, 0.1, 0.21), 1.0, axis=(0, 1, 0))).depth)
    post = rigid_cylinder("post", 0.1, 0.4, (0, 0, 0.2), 1.0, axis=(np.sin(0.3), 0, np.cos(0.3)))
    sunk = 0.2 * np.cos(0.3) + 0.1 * np.sin(0.3) - 0.2
    assert overlap(post, rigid_plane("floor", (0, 0, 0), (0, 0, 1))).depth == pytest.approx([sunk])
    assert overlap(rigid_sphere("a", 1.0, (0, 0), 1.0), rigid_plane("floor", (0, -0.9), (0, 1))).depth == pytest.approx([0.1])
    assert overlap(rigid_sphere("a", 1.0, (0, 1.3), 1.0), rigid_rectangle("box", (1, 1), (0, 0), 1.0)).depth == pytest.approx([0.2])


@pytest.mark.parametrize("seed", range(30))
def test_convex_polyhedra(seed: int) -> None:
    """Random polyhedra of aspect up to 10. Where no ball fits into what they share (a linear programme), none. Else no point of a skin is
    deeper than the shift along a face's normal that separates the bodies, and of points strewn on the skins, whose depth in a convex body
    is that below its nearest plane, none is much deeper (deep in the body the deepest may lie within a facet)."""
    rng = np.random.default_rng(seed)
    clouds = [rng.normal(size=(rng.integers(4, 20), 3)) * rng.uniform(0.1, 1.0, 3) for _ in range(2)]
    clouds[1] = clouds[1] + rng.normal(size=3) * 0.7
    hulls = [ConvexHull(c) for c in clouds]
    planes = np.concatenate([h.equations for h in hulls])  # n . x + d <= 0 within
    ball = linprog(
        [0, 0, 0, -1], A_ub=np.column_stack([planes[:, :3], np.ones(len(planes))]), b_ub=-planes[:, 3], bounds=[(None, None)] * 4
    )
    radius = float(ball.x[3])
    found = overlap(*(polyhedron(name, c) for name, c in zip("ab", clouds, strict=True)))
    depth = float(found.depth[0]) if len(found.depth) else 0.0
    if radius <= 0:
        assert depth == 0.0
        return
    shifts = [(clouds[1 - k] @ h.equations[:, :3].T + h.equations[:, 3]).min(axis=0) for k, h in enumerate(hulls)]
    assert 0 < depth <= -max(s.max() for s in shifts) * (1 + 1e-9)
    for k, (hull, other) in enumerate(zip(hulls, hulls[::-1], strict=True)):
        share = rng.dirichlet(np.ones(3), size=(len(hull.simplices), 50))
        strewn = np.einsum("fsk,fkd->fsd", share, clouds[k][hull.simplices]).reshape(-1, 3)
        below = -(strewn @ other.equations[:, :3].T + other.equations[:, 3]).max(axis=1)
        assert below.max() <= 1.5 * depth


def test_the_same_wherever_it_stands() -> None:
    """Moving, turning and swapping both bodies changes nothing."""
    rng = np.random.default_rng(5)
    clouds = [rng.normal(size=(12, 3)), rng.normal(size=(12, 3)) + np.array([0.9, 0.4, 0.2])]
    first = overlap(*(polyhedron(name, c) for name, c in zip("ab", clouds, strict=True)))
    R = Rotation.random(rng=7).as_matrix()
    turned = overlap(*(polyhedron(name, c @ R.T + (30.0, -7.0, 2.0)) for name, c in zip("ab", clouds[::-1], strict=True)))
    assert turned.depth == pytest.approx(first.depth, rel=1e-6)
    assert turned.point[0] == pytest.approx(R @ first.point[0] + (30.0, -7.0, 2.0), abs=1e-3)


@pytest.mark.each_value
@pytest.mark.parametrize("scale", [1.0, 1e-3])
@pytest.mark.parametrize("depth", [0.0, 1e-4, 0.02, 0.05])
def test_a_fork_whose_legs_overlap_overlaps_itself(depth: float, scale: float) -> None:
    """Legs of 0.1, moved towards each other: the overlap is by how much they are in each other; with their thickness alone, none."""
    part = fork(STONE, scale, 0.1 * scale, 0.3 * scale, 20, 2)
    model = build_model([Body("fork", part)])
    x = model.reference.copy()
    legs = x[:, 0] > 0
    x[legs, 1] -= np.sign(x[legs, 1]) * (0.15 + depth / 2) * scale * np.minimum(1, x[legs, 0] / scale / 0.3)
    found = measure(skins_of(model)[0], x, 1e-6)
    if depth == 0:
        assert not len(found.depth)
        return
    assert found.bodies.tolist() == [[0, 0]]
    assert found.depth == pytest.approx([depth * scale], rel=1e-6)


@pytest.mark.parametrize("width", [None, 0.1])
def test_thin_and_hollow_bodies_do_not_overlap_themselves(width: float | None) -> None:
    """Strained by some percent, whatever their thickness; a hollow one whose plates are pressed into each other does."""
    line, across = arc(1.0, -2.5, -0.6, 24)
    for part in (hollow(STONE, 1.0, 0.04, 0.02, width), strip("gutter", line, across, 0.004, 1, STONE, width=width)):
        model = build_model([Body("body", part)])
        skins = skins_of(model)[0]
        assert len(skins.folding.bodies) == 1
        for seed in range(4):
            assert not len(measure(skins, bent(model.reference, 0.03, seed), 1e-6).depth)
    model = build_model([Body("body", hollow(STONE, 1.0, 0.04, 0.02, width))])
    x = model.reference.copy()
    middle = np.abs(x[:, 0] - 0.5) < 0.2
    x[middle, 1] -= np.sign(x[middle, 1]) * 0.013
    assert measure(skins_of(model)[0], x, 1e-6).depth == pytest.approx([0.006])


def test_meshed_bodies_in_planes_and_cylinders_in_all() -> None:
    """Vertices below planes and within cylinders, sides and rims of cylinders within each other, each by how much."""
    plane = rigid_plane("floor", (0, 0, 0), (0, 0, 1))
    assert overlap(rigid_box("box", (1, 1, 1), (0, 0, 0.48), 1.0), plane).depth == pytest.approx([0.02])
    assert not len(overlap(rigid_box("box", (1, 1, 1), (0, 0, 0.5), 1.0), plane).depth)
    assert overlap(Body("soft", brick("soft", (1, 1, 1), (2, 2, 2), STONE, origin=(0, 0, -0.03))), plane).depth == pytest.approx([0.03])
    assert overlap(rigid_rectangle("box", (1, 1), (0, 0.49), 1.0), rigid_plane("floor", (0, 0), (0, 1))).depth == pytest.approx([0.01])
    drum = rigid_cylinder("drum", 0.5, 1.0, (0, 0, 0), 1.0, axis=(0, 0, 1))
    assert overlap(drum, rigid_box("box", (0.2, 0.2, 0.2), (0, 0, 0.57), 1.0)).depth == pytest.approx([0.03, 0.03])  # looked at from both
    assert overlap(drum, rigid_cylinder("lid", 0.4, 0.2, (0.1, 0, 0.58), 1.0, axis=(0, 0, 1))).depth == pytest.approx([0.02])
    beside = overlap(drum, rigid_cylinder("twin", 0.5, 1.0, (0.96, 0, 0), 1.0, axis=(0, 0, 1)))
    assert beside.depth.max() == pytest.approx(0.04, rel=0.05)
    assert not len(overlap(drum, rigid_cylinder("twin", 0.5, 1.0, (1.01, 0, 0), 1.0, axis=(0, 0, 1))).depth)


def test_centres_of_facets_have_the_bits_of_their_nodes_mean() -> None:
    """As NumPy sums and rounds it, which an overlap of touching bodies depends on."""
    positions = np.random.default_rng(0).standard_normal((50, 3))
    quads = np.random.default_rng(1).integers(0, 50, (400, 4))
    assert np.array_equal(with_means(positions, quads), np.concatenate([positions, positions[quads].mean(axis=1)]))
