"""Beds of balls and disks in a box, settled by pushing overlaps apart, and rocks: the same with up to three points a pair.

The packing is Müller, Heidelberger, Hennix, Ratcliff's (J. Vis. Commun. Image Represent. 18, 2007) position-based relaxation: bodies
sink, overlaps are halved, until what is left is small. It makes disordered beds of four to six contacts a ball.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray
from fcsim.bench.families.assembly import Bodies, Touching, assemble, ball_inertia, joined
from fcsim.problem import GlobalProblem

ROUNDS = 160
"""Rounds of relaxation, in which bodies sink ever less: the mean overlap that is left is one to three percent of a radius."""
NEAR = 0.02
"""Gap, in mean radii, up to which two bodies are in contact."""
CONTACTS = {2: 2.0, 3: 3.0}
"""Contacts a body, about, in a settled bed of that dimension."""
GRAVITY, STEP = 9.81, 1e-3


def packing(count: int, d: int, random: np.random.Generator, spread: float = 0.3) -> tuple[FloatArray, FloatArray, float]:
    """Centres (count, d), radii (count,) of mean 1 and the half width of the box (floor at 0) of a settled bed."""
    radius = random.uniform(1 - spread, 1 + spread, count)
    side = max(2, round(count ** (1 / d)))
    lattice = np.stack(np.unravel_index(np.arange(count), (count // side ** (d - 1) + 1, *(side,) * (d - 1))), axis=1)
    width = 1.05 * side
    x = np.empty((count, d))
    x[:, :-1] = 2.1 * lattice[:, 1:] + 1.05 - width
    x[:, -1] = 2.1 * lattice[:, 0] + 1.05
    x += random.uniform(-0.3, 0.3, (count, d))
    for turn in range(ROUNDS):
        x[:, -1] -= 0.03 * max(1.0 - 1.5 * turn / ROUNDS, 0.0)
        pair = cKDTree(x).query_pairs(2 * (1 + spread), output_type="ndarray")
        apart = x[pair[:, 1]] - x[pair[:, 0]]
        distance = np.maximum(np.linalg.norm(apart, axis=1), 1e-9)
        depth = np.maximum(radius[pair].sum(axis=1) - distance, 0.0)
        push = (0.35 * depth / distance)[:, None] * apart
        for axis in range(d):
            x[:, axis] += np.bincount(pair[:, 1], push[:, axis], count) - np.bincount(pair[:, 0], push[:, axis], count)
        x[:, :-1] = np.clip(x[:, :-1], (radius - width)[:, None], (width - radius)[:, None])
        x[:, -1] = np.maximum(x[:, -1], radius)
    return x, radius, width


def contacts_of(x: FloatArray, radius: FloatArray, width: float) -> Touching:
    """Contacts of each two balls nearer than `NEAR`, and of balls with the box, which is the body after the last."""
    count, d = x.shape
    pair = cKDTree(x).query_pairs(2 * radius.max() + NEAR, output_type="ndarray")
    apart = x[pair[:, 1]] - x[pair[:, 0]]
    distance = np.linalg.norm(apart, axis=1)
    gap = distance - radius[pair].sum(axis=1)
    near = np.lexsort((pair[:, 1], pair[:, 0]))
    near = near[gap[near] <= NEAR]
    normal = apart[near] / distance[near, None]
    first, second = pair[near].T
    between = Touching(first, second, x[first] + radius[first, None] * normal, normal, gap[near])
    sides = []
    for axis in range(d):
        for sign in (1.0,) if axis == d - 1 else (1.0, -1.0):
            wall = 0.0 if axis == d - 1 else -sign * width
            gap = sign * (x[:, axis] - wall) - radius
            own = np.flatnonzero(gap <= NEAR)
            inward = np.zeros((len(own), d))
            inward[:, axis] = sign
            sides.append(Touching(np.full(len(own), count), own, x[own] - radius[own, None] * inward, inward, gap[own]))
    return joined(between, *sides)


def _bed(
    size: int, d: int, random: np.random.Generator, masses: float, points: int, mu: tuple[float, float] | None, tilt: float
) -> GlobalProblem:
    """A bed of about `size` contacts; masses: their ratio; points: contact points a pair at most; mu: range (None: one for all)."""
    per_body = CONTACTS[d] * (1 + points) / 2
    x, radius, width = packing(max(2, round(size / per_body)), d, random)
    touching = contacts_of(x, radius, width)
    if points > 1:  # bodies that are no balls touch at some points near one another, with normals of their own
        many = random.integers(1, points + 1, len(touching))
        touching = touching.taken(np.repeat(np.arange(len(touching)), many))
        sideways = random.standard_normal(touching.point.shape)
        sideways -= np.einsum("ai,ai->a", sideways, touching.normal)[:, None] * touching.normal
        normal = touching.normal + 0.1 * random.standard_normal(touching.normal.shape)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        touching = Touching(touching.first, touching.second, touching.point + 0.2 * sideways, normal, touching.gap)
    count, k = len(x), 1 if d == 2 else 3
    density = masses ** random.uniform(0.0, 1.0, count)
    mass = density * radius**d
    velocity = np.zeros((count + 1, d + k))
    velocity[:count, :d] = 0.05 * random.standard_normal((count, d))
    bodies = Bodies(
        np.vstack([x, np.zeros(d)]),
        np.append(mass, 1.0),
        np.concatenate([ball_inertia(radius, mass, d), np.eye(k)[None]]),
        np.arange(count + 1) == count,
        velocity,
    )
    # overlaps left by the packing are contacts at gap 0: they are not to push bodies apart by metres a second
    touching = Touching(touching.first, touching.second, touching.point, touching.normal, np.maximum(touching.gap, 0.0))
    friction = random.uniform(*mu, len(touching)) if mu else np.full(len(touching), float(random.choice([0.2, 0.5, 0.7, 1.0])))
    gravity = np.zeros(d)
    gravity[0], gravity[-1] = GRAVITY * np.sin(tilt), -GRAVITY * np.cos(tilt)
    return assemble(bodies, touching, friction, STEP, gravity)


def spheres(size: int, random: np.random.Generator) -> GlobalProblem:
    """Balls of radii 0.7 to 1.3 in a box."""
    return _bed(size, 3, random, 1.0, 1, None, random.uniform(0.0, 0.5))


def disks(size: int, random: np.random.Generator) -> GlobalProblem:
    """Disks of radii 0.7 to 1.3 in a box, in 2D."""
    return _bed(size, 2, random, 1.0, 1, None, random.uniform(0.0, 0.5))


def rocks(size: int, random: np.random.Generator) -> GlobalProblem:
    """Bodies with one to three points a pair, densities 1 to 100."""
    return _bed(size, 3, random, 1e2, 3, None, random.uniform(0.0, 0.3))


def mass_ratios(size: int, random: np.random.Generator) -> GlobalProblem:
    """Rocks of densities 1 to 10^k, k from 2 to 8 by the seed."""
    return _bed(size, 3, random, 10.0 ** random.integers(2, 9), 2, None, 0.1)


def frictions(size: int, random: np.random.Generator) -> GlobalProblem:
    """Rocks with friction coefficients from 0 to 5, each contact its own."""
    return _bed(size, 3, random, 10.0, 2, (0.0, 5.0), 0.2)
