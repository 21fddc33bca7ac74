"""Boxes face to face, in 2D two and in 3D four points a face: W is rank deficient wherever more than a few lie on one another."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray
from fcsim.bench.families.assembly import Bodies, Touching, assemble, box_inertia
from fcsim.problem import GlobalProblem

GRAVITY, STEP = 9.81, 1e-3
TOUCH = 1e-9
"""Distance, relative to the largest box, up to which two faces touch."""


def faces(centre: FloatArray, half: FloatArray) -> Touching:
    """Contacts of axis-parallel boxes (nb, d) at the corners of the rectangle (the ends of the segment) that two faces share."""
    d = centre.shape[1]
    reach = 2 * np.linalg.norm(half, axis=1).max() * (1 + TOUCH)
    pair = cKDTree(centre).query_pairs(reach, output_type="ndarray")
    pair = pair[np.lexsort((pair[:, 1], pair[:, 0]))]
    apart = centre[pair[:, 1]] - centre[pair[:, 0]]
    space = np.abs(apart) - half[pair].sum(axis=1)  # negative: they overlap along that axis
    tolerance = TOUCH * half.max()
    found = []
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * (d - 1), indexing="ij"), axis=-1).reshape(-1, d - 1)
    for axis in range(d):
        others = [other for other in range(d) if other != axis]
        own = np.flatnonzero((np.abs(space[:, axis]) <= tolerance) & np.all(space[:, others] < -1e-3 * half.max(), axis=1))
        first, second = pair[own].T
        low = np.maximum(centre[first] - half[first], centre[second] - half[second])
        high = np.minimum(centre[first] + half[first], centre[second] + half[second])
        points = np.repeat((0.5 * (low + high))[:, None], len(corners), axis=1)
        points[:, :, others] += 0.5 * corners * (high - low)[:, None, others]
        normal = np.zeros((len(own), d))
        normal[:, axis] = np.sign(apart[own, axis])
        repeat = np.repeat(np.arange(len(own)), len(corners))
        found.append((first[repeat], second[repeat], points.reshape(-1, d), normal[repeat], np.zeros(len(repeat))))
    return Touching(*(np.concatenate(part) for part in zip(*found, strict=True)))


def _boxes(
    centre: FloatArray,
    half: FloatArray,
    density: FloatArray,
    held: FloatArray,
    mu: float | tuple[float, float],
    tilt: float,
    random: np.random.Generator,
) -> GlobalProblem:
    """The problem of boxes under gravity that is tilted by an angle along the first axis."""
    d = centre.shape[1]
    mass = density * np.prod(2 * half, axis=1)
    inertia = box_inertia(half, mass)
    free = held == 0
    bodies = Bodies(centre, mass, inertia, ~free, np.zeros((len(mass), d + inertia.shape[1])))
    touching = faces(centre, half)
    touching = touching.taken(np.flatnonzero(free[touching.first] | free[touching.second]))
    friction = np.full(len(touching), mu) if isinstance(mu, float) else random.uniform(*mu, len(touching))
    gravity = np.zeros(d)
    gravity[0], gravity[-1] = GRAVITY * np.sin(tilt), -GRAVITY * np.cos(tilt)
    return assemble(bodies, touching, friction, STEP, gravity)


def bond(rows: int, bricks: int, d: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, half sizes and held (0 or 1) of a wall in running bond on a held ground; half bricks close every other course."""
    centre, half = [], []
    for row in range(rows):
        edges = np.arange(bricks + 1) * 2.0 if row % 2 == 0 else np.unique(np.r_[0.0, np.arange(bricks) * 2.0 + 1.0, 2.0 * bricks])
        for left, right in pairwise(edges):
            centre.append([0.5 * (left + right), *(0.0,) * (d - 2), row + 0.5])
            half.append([0.5 * (right - left), *(0.5,) * (d - 2), 0.5])
    centre.append([bricks * 1.0, *(0.0,) * (d - 2), -0.5])
    half.append([bricks + 1.0, *(1.0,) * (d - 2), 0.5])
    held = np.zeros(len(centre))
    held[-1] = 1
    return np.array(centre), np.array(half), held


def _wall(size: int, d: int, random: np.random.Generator) -> GlobalProblem:
    per_brick = {2: 6.0, 3: 12.0}[d]  # two halves below and a neighbour, two or four points each
    count = max(2.0, size / per_brick)
    rows = max(2, round(np.sqrt(count * random.uniform(0.7, 2.0))))
    centre, half, held = bond(rows, max(1, round(count / rows)), d)
    tilt = random.uniform(0.0, 0.8)
    return _boxes(centre, half, np.full(len(centre), 2.0), held, float(random.choice([0.4, 0.6, 0.8])), tilt, random)


def walls(size: int, random: np.random.Generator) -> GlobalProblem:
    """A wall of bricks in running bond on a table that is tilted by up to 45 degrees, in 3D."""
    return _wall(size, 3, random)


def walls_2d(size: int, random: np.random.Generator) -> GlobalProblem:
    """The same in 2D."""
    return _wall(size, 2, random)


def towers(size: int, random: np.random.Generator) -> GlobalProblem:
    """Towers of up to 20 boxes with four points a face, friction from 0.2 to 5, densities that grow upwards by up to a hundred."""
    boxes = max(1, round(size / 4))
    height = min(boxes, int(random.integers(5, 21)))
    towers = -(-boxes // height)
    number = np.arange(boxes)
    width = random.uniform(0.3, 0.5, boxes)
    half = np.column_stack([width, width, np.full(boxes, 0.5)])
    centre = np.column_stack([1.5 * (number // height), np.zeros(boxes), number % height + 0.5])
    centre[:, :2] += random.uniform(-0.05, 0.05, (boxes, 2))
    centre = np.vstack([centre, [0.75 * (towers - 1), 0.0, -0.5]])
    half = np.vstack([half, [towers + 1.0, 2.0, 0.5]])
    density = float(random.choice([1.0, 10.0, 100.0])) ** np.append((number % height) / height, 0.0)
    mu = float(random.choice([0.2, 0.5, 1.0, 3.0, 5.0]))
    return _boxes(centre, half, density, np.append(np.zeros(boxes), 1.0), mu, random.uniform(0.0, 0.3), random)


def boxes(size: int, random: np.random.Generator) -> GlobalProblem:
    """Layers of boxes, each layer shifted by half a box in both directions: up to four boxes below each, four points a face."""
    side = max(2, round((size / 16) ** (1 / 3)))
    layers = max(1, round(size / (16 * side**2)))
    grid = []
    for layer in range(layers):
        along = np.arange(side) * 1.001 + 0.5 * (layer % 2)
        x, y = np.meshgrid(along, along, indexing="ij")
        grid.append(np.column_stack([x.ravel(), y.ravel(), np.full(side**2, layer + 0.5)]))
    centre = np.vstack([*grid, [[0.5 * side, 0.5 * side, -0.5]]])
    half = np.full((len(centre), 3), 0.5)
    half[-1, :2] = side
    density = 10.0 ** random.uniform(0.0, 1.0, len(centre))
    held = np.zeros(len(centre))
    held[-1] = 1
    return _boxes(centre, half, density, held, (0.2, 0.8), random.uniform(0.0, 0.6), random)


def arches(size: int, random: np.random.Generator) -> GlobalProblem:
    """Semicircular arches of one ring or some rings of voussoirs on held springers, two points a joint, in 2D."""
    rings = max(1, round(size / 120))
    count = max(3, round(size / (4 * rings - 2)))
    thickness, radius = random.uniform(0.12, 0.2), 1.0
    edge = np.linspace(np.pi, 0.0, count + 1)
    middle = 0.5 * (edge[:-1] + edge[1:])
    inner = radius + thickness * np.arange(rings + 1)
    axis = 0.5 * (inner[:-1] + inner[1:])
    centre = (axis[:, None, None] * np.column_stack([np.cos(middle), np.sin(middle)])).reshape(-1, 2)
    width = np.repeat(axis * np.pi / count, count)
    bodies_half = np.column_stack([0.5 * width, np.full(rings * count, 0.5 * thickness)])
    mass = 2000.0 * np.prod(2 * bodies_half, axis=1)
    ground = rings * count
    found = []
    number = np.arange(rings * count).reshape(rings, count)
    radial, around = np.column_stack([np.cos(edge), np.sin(edge)]), np.column_stack([np.sin(edge), -np.cos(edge)])
    for ring in range(rings):
        chain = np.r_[ground, number[ring], ground]
        for r in (inner[ring], inner[ring + 1]):  # the joints, from the left springer to the right one
            found.append((chain[:-1], chain[1:], r * radial, around))
        if ring + 1 < rings:
            for angle in (edge[:-1], edge[1:]):
                out = np.column_stack([np.cos(angle), np.sin(angle)])
                found.append((number[ring], number[ring + 1], inner[ring + 1] * out, out))
    first, second, point, normal = (np.concatenate(part) for part in zip(*found, strict=True))
    touching = Touching(first, second, point, normal, np.zeros(len(first)))
    bodies = Bodies(
        np.vstack([centre, np.zeros(2)]),
        np.append(mass, 1.0),
        box_inertia(np.vstack([bodies_half, np.ones(2)]), np.append(mass, 1.0)),
        np.arange(ground + 1) == ground,
        np.zeros((ground + 1, 3)),
    )
    tilt = random.uniform(0.0, 0.25)
    mu = np.full(len(first), float(random.choice([0.4, 0.6, 0.8])))
    return assemble(bodies, touching, mu, STEP, GRAVITY * np.array([np.sin(tilt), -np.cos(tilt)]))
