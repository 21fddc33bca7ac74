"""What is not held and what lies under it: bodies that fall for ever, or for most of the run, before they touch anything."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fcsim.arrays import BoolArray, FloatArray
from fcsim.assembly.layout import DIRECTIONS
from fcsim.assembly.model import Model
from fcsim.assembly.supports import DrivenRotation
from fcsim.mesh.part import RigidBody
from fcsim.timestep.scheme import Scheme
from fcsim.timestep.state import State

ALONG = 0.99
"""Cosine from which gravity points along an axis."""
TOUCH = 1e-2
"""Of the smallest body: gaps that are contacts to begin with."""
MOST = 0.5
"""Of a run."""
MANY = 2000
"""Bodies from which on their pairs are not compared."""


def falling(model: Model, state: State, scheme: Scheme, gravity: FloatArray, steps: int, held: BoolArray) -> Iterator[str]:
    """Remarks on bodies under gravity (d,) [m/s^2] in a run of dynamics without links; held (nb,): those that a support names.

    Nothing is said of bodies that move to begin with, that loads act on, or that stand beside exact shapes, whose points are not their
    extent.
    """
    with np.errstate(over="ignore"):
        g = float(np.linalg.norm(gravity))
    if not 0 < g < np.inf or not scheme.timing.moving or model.loads or np.any(model.along(state.v)[model.free_dofs]):
        return
    down, axis = gravity / g, int(np.argmax(np.abs(gravity)))
    straight = abs(down[axis]) >= ALONG
    if told := _of_all_bodies(model, axis, straight):
        yield told
    if told or len(model.bodies) < 2:
        return
    if np.any(state.v):  # supports that move: where to is not known here
        return
    exact = any(isinstance(body, RigidBody) and (body.shape is not None or not len(body.points)) for body in model.bodies)
    if held.all() or exact or len(model.bodies) > MANY:
        return
    positions = model.positions(state.x)
    way, below = _ways(model, positions if straight else _turned(positions, down, axis), axis, float(np.sign(gravity[axis])))
    names = [body.name for body in model.bodies]
    lost = np.flatnonzero(~held & ~_above(below, held))
    if lost.size:
        more = f" and {lost.size - 1} more" if lost.size > 1 else ""
        yield (
            f"nothing lies under body {names[lost[0]]!r}{more}: it falls out of the scene. Is it where it is meant, and the floor large "
            "enough?"
        )
        return
    if not straight:  # boxes of bodies that lie along no axis reach into each other: how far a fall goes is not known from them
        return
    # bodies that fall keep their distances: the first to be stopped is the one that is nearest to a held one
    to_held = np.where(below & ~held[:, None] & held[None], way, np.inf)
    first, under = (int(k) for k in np.unravel_index(to_held.argmin(), to_held.shape))
    gap = float(to_held[first, under])
    smallest = min(float(np.ptp(body.points, axis=0).max()) for body in model.bodies)
    time, whole = float(np.sqrt(2 * gap / g)), steps * scheme.h
    count = int(np.ceil(time / scheme.h))
    if gap > TOUCH * smallest and time > MOST * whole:
        ends = "more than the run has" if time > whole else f"most of the run's {steps}"
        yield (
            f"body {names[first]!r} is {gap:.3g} m above {names[under]!r} and falls for {time:.3g} s, {count} steps, {ends}, "
            f"before anything touches: begin nearer, with a velocity (State), or take more steps"
        )


def _of_all_bodies(model: Model, axis: int, straight: bool) -> str:
    """What is said where no support holds any body, or none along the axis of gravity, where that is `straight` along it."""
    directions = ", ".join(map(repr, DIRECTIONS[model.dimension]))
    if len(model.bodies) < 2:
        name = model.bodies[0].name
        alone = f"body {name!r} is alone, and no support holds it: it falls for ever. Is the floor forgotten, or a support?"
        return "" if model.supports else alone
    hold = f"Hold the floor: Support('floor', ({directions}))"
    if not model.supports:
        return f"no support holds any body: all fall together under gravity. {hold}"
    if straight and not _held_along(model, "xyz"[axis]):
        return f"no support holds any body along {'xyz'[axis]}, the way of gravity: all fall together. {hold}"
    return ""


def _held_along(model: Model, axis: str) -> bool:
    """Whether any support holds something along an axis of the world; those along axes of their own, and rotations, are taken to."""
    return any(isinstance(s, DrivenRotation) or s.axes is not None or axis in s.directions for s in model.supports)


def _turned(positions: FloatArray, down: FloatArray, axis: int) -> FloatArray:
    """Positions (n, d) mirrored such that the unit vector `down` points along its largest component: boxes lie along gravity then, and are
    at least as large as the bodies, so that less is said of what may lie beside one, nothing that is not so (Householder 1958)."""
    to = np.zeros_like(down)
    to[axis] = np.sign(down[axis])
    normal = (down - to) / np.linalg.norm(down - to)
    mirrored: FloatArray = positions - 2 * np.outer(positions @ normal, normal)
    return mirrored


def _ways(model: Model, positions: FloatArray, axis: int, sign: float) -> tuple[FloatArray, BoolArray]:
    """The ways (nb, nb) [m] along an axis in the direction of `sign` from each body's box to each other's, 0 where they reach into each
    other; and which lie below which, so that a fall ends there (nb, nb)."""
    points = np.split(positions, model.node_offset[1:-1])
    low, high = np.array([p.min(axis=0) for p in points]), np.array([p.max(axis=0) for p in points])
    others = [k for k in range(low.shape[1]) if k != axis]
    shared = (np.minimum(high[:, None], high[None]) - np.maximum(low[:, None], low[None]))[..., others]
    bottom, top = (low[:, axis], high[:, axis]) if sign < 0 else (-high[:, axis], -low[:, axis])
    beneath = bottom[None] < top[:, None]  # a slope's box reaches over what lies on its lower end, a hook's under what hangs in it
    below = (shared > 0).all(axis=-1) & beneath & ~np.eye(len(points), dtype=bool)
    return np.maximum(bottom[:, None] - top[None], 0.0), below


def _above(below: BoolArray, held: BoolArray) -> BoolArray:
    """(nb,) Bodies over a held one, or over one that is."""
    above = held
    while True:
        more = above | (below & above[None]).any(axis=1)
        if np.array_equal(more, above):
            return above
        above = more
