"""Problems that rounding or nature has spoiled: noise on W, contact points that nearly coincide, and problems without a solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from fcsim.bench.families.assembly import Bodies, Touching, assemble, ball_inertia, box_inertia
from fcsim.bench.families.blocks import GRAVITY, STEP, boxes
from fcsim.bench.families.grains import rocks
from fcsim.problem import GlobalProblem, LocalProblem


def noise(size: int, random: np.random.Generator) -> LocalProblem:
    """Rocks in local form whose W bears a relative noise of 1e-12 to 1e-6 on each entry, as files written with few digits do.

    W is rank deficient and becomes unsymmetric and indefinite by the noise: beyond about 1e-8 a solution at 1e-8 need not exist.
    """
    p = rocks(size, random)
    level = 10.0 ** random.integers(-12, -5)
    M, H = sp.bsr_array(p.M, blocksize=(6, 6)), sp.csr_array(p.H)
    M_inverse = sp.csr_array(sp.bsr_array((np.linalg.inv(M.data), M.indices, M.indptr), shape=M.shape))
    W = sp.csr_array(H.T @ M_inverse @ H)
    W.sort_indices()
    W.data *= 1 + level * random.standard_normal(len(W.data))
    return LocalProblem(W, p.w + H.T @ (M_inverse @ p.f), p.mu)


def near_singular(size: int, random: np.random.Generator) -> GlobalProblem:
    """Layers of boxes of which each contact point has a twin at a distance of 1e-8 to 1e-3 boxes, the same in all but round-off."""
    p = boxes(max(4, size // 2), random)
    H = sp.csr_array(p.H)
    shift = 10.0 ** random.uniform(-8, -3, p.nc)
    twin = sp.csr_array(H.copy())
    # the arm of a twin is a little longer: its columns of H differ in the rotations alone
    turning = np.arange(p.n) % 6 >= 3
    twin = twin + sp.csr_array(sp.diags_array(turning.astype(float)) @ H @ sp.diags_array(np.repeat(shift, 3)))
    both = sp.csc_array(sp.hstack([H, twin]))
    return replace(p, H=both, w=np.tile(p.w, 2), mu=np.tile(p.mu, 2))


def squeezed(size: int, random: np.random.Generator) -> GlobalProblem:
    """A row of balls between two walls that move towards one another: no velocities keep all apart, there is no solution."""
    count = max(1, size - 1)
    centre = np.zeros((count + 2, 3))
    centre[:, 0] = 2.0 * np.arange(count + 2)
    mass = 10.0 ** random.uniform(0.0, 1.0, count + 2)
    velocity = np.zeros((count + 2, 6))
    speed = random.uniform(0.1, 1.0)
    velocity[0, 0], velocity[-1, 0] = speed, -speed
    held = np.isin(np.arange(count + 2), [0, count + 1])
    bodies = Bodies(centre, mass, ball_inertia(np.ones(count + 2), mass, 3), held, velocity)
    number = np.arange(count + 1)
    normal = np.tile([1.0, 0.0, 0.0], (count + 1, 1))
    touching = Touching(number, number + 1, centre[:-1] + normal, normal, np.zeros(count + 1))
    return assemble(bodies, touching, np.full(count + 1, 0.3), STEP, GRAVITY * np.array([0.0, 0.0, -1.0]))


def rods(size: int, random: np.random.Generator) -> GlobalProblem:
    """Painlevé's rods: each on a hinge that is carried along, its tip pressed into the floor ahead of the hinge, mu above the angle's
    tangent: friction presses it in deeper than the floor can push it out, and it cannot stop (P. Painlevé, C. R. Acad. Sci. 121, 1895).

    One degree of freedom a rod, the angle. With the tip at (a, -b) from the hinge, u_T = b w + s, u_N = a w, and r_T = -mu r_N:
    I (w - w_0) = (a - mu b) r_N < 0 for every r_N > 0, while a w_0 < 0. Non-penetration alone has solutions; Coulomb's law has none.
    """
    count = max(1, size)
    angle = random.uniform(0.9, 1.2, count)
    a, b = np.cos(angle), np.sin(angle)
    inertia = random.uniform(0.5, 2.0, count) / 3
    mu = 1.5 * a / b + random.uniform(0.0, 0.5, count)
    start = -random.uniform(0.1, 1.0, count)
    speed = np.full(count, 10.0)
    rows = np.repeat(np.arange(count), 2)
    H = sp.csc_array((np.column_stack([a, b]).ravel(), (rows, np.arange(2 * count))), shape=(count, 2 * count))
    w = np.column_stack([np.zeros(count), speed]).ravel()
    return GlobalProblem(sp.diags_array(inertia).tocsc(), H, inertia * start, w, mu, dimension=2)


def wedged(size: int, random: np.random.Generator) -> GlobalProblem:
    """A box on a floor under a ceiling that comes down, four points a face: squeezed, and rank deficient on top of it."""
    half = np.array([[2.0, 2.0, 0.5], [0.5, 0.5, 0.5], [2.0, 2.0, 0.5]])
    centre = np.array([[0.0, 0, -0.5], [0.0, 0, 0.5], [0.0, 0, 1.5]])
    mass = random.uniform(0.5, 2.0, 3)
    velocity = np.zeros((3, 6))
    velocity[2, 2] = -random.uniform(0.1, 1.0)
    bodies = Bodies(centre, mass, box_inertia(half, mass), np.array([True, False, True]), velocity)
    points = max(2, round(size / 2))
    turn = np.linspace(0, 2 * np.pi, points, endpoint=False)
    at = 0.5 * np.column_stack([np.cos(turn), np.sin(turn)])
    below, above = np.column_stack([at, np.zeros(points)]), np.column_stack([at, np.ones(points)])
    first, second = np.repeat([0, 1], points), np.repeat([1, 2], points)
    touching = Touching(first, second, np.vstack([below, above]), np.tile([0.0, 0, 1], (2 * points, 1)), np.zeros(2 * points))
    return assemble(bodies, touching, np.full(2 * points, 0.5), STEP, GRAVITY * np.array([0.1, 0.0, -1.0]))
