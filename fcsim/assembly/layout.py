"""Bodies in their order: where each has its nodes and its degrees of freedom.

Degrees of freedom: first the deformable bodies, d a node, in the order of the nodes (dof = d node + component); then the rigid bodies,
6 each (3D: centre of mass, rotation vector) or 3 (2D). Supports, loads and groups need no more than this of a model.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fcsim.arrays import FloatArray, IntArray
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.exact_shape import endless
from fcsim.mesh.part import Body, Placed, RigidBody

DIRECTIONS = {2: ("x", "y", "rz"), 3: ("x", "y", "z", "rx", "ry", "rz")}
"""Degrees of freedom of a rigid body by dimension; a node has the first 2 or 3."""


@dataclass(frozen=True, eq=False)
class BodyLayout:
    """Numbers of bodies, nodes and degrees of freedom; bodies: deformable ones first (see `in_order`)."""

    bodies: tuple[Body | RigidBody, ...]

    @cached_property
    def dimension(self) -> int:
        return self.bodies[0].dimension

    @cached_property
    def deformable(self) -> tuple[Body, ...]:
        return tuple(body for body in self.bodies if isinstance(body, Body))

    @cached_property
    def rigid(self) -> tuple[RigidBody, ...]:
        return tuple(body for body in self.bodies if isinstance(body, RigidBody))

    @cached_property
    def number(self) -> Mapping[str, int]:
        """Body number by name."""
        return {body.name: k for k, body in enumerate(self.bodies)}

    @cached_property
    def node_offset(self) -> IntArray:
        """(nbodies + 1,): where each body's nodes begin."""
        return _offsets([len(body.part.points if isinstance(body, Body) else body.points) for body in self.bodies])

    @cached_property
    def body_of_node(self) -> IntArray:
        """(n_nodes,): the body's number."""
        return np.repeat(np.arange(len(self.bodies)), np.diff(self.node_offset))

    @cached_property
    def dof_offset(self) -> IntArray:
        """(nbodies + 1,): where each body's degrees of freedom begin."""
        d = self.dimension
        rigid = len(DIRECTIONS[d])
        return _offsets([d * len(body.part.points) if isinstance(body, Body) else rigid for body in self.bodies])

    @property
    def n_nodes(self) -> int:
        return int(self.node_offset[-1])

    @property
    def n_dofs(self) -> int:
        """All degrees of freedom, driven ones included."""
        return int(self.dof_offset[-1])

    @property
    def n_elastic(self) -> int:
        """Degrees of freedom of the deformable bodies."""
        return int(self.dof_offset[len(self.deformable)])

    @cached_property
    def reference(self) -> FloatArray:
        """Nodes (n_nodes, d) [m] in the reference configuration."""
        return np.concatenate([body.points for body in self.bodies])

    @cached_property
    def size_and_reach(self) -> tuple[float, float]:
        """The model's size, and the largest of that and of its coordinates [m], in the reference; without planes, whose points are those
        of a picture of any size."""
        points = np.concatenate([np.zeros((0, self.dimension)), *(body.points for body in self.bodies if not endless(body))])
        size = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
        return size, max(size, float(np.abs(points).max(initial=0.0)))

    @cached_property
    def dof_of_node(self) -> IntArray:
        """(n_nodes, d), -1 for the nodes of rigid bodies, which have none of their own."""
        dofs = np.full((self.n_nodes, self.dimension), -1)
        dofs.ravel()[: self.n_elastic] = np.arange(self.n_elastic)
        return dofs

    @cached_property
    def extents(self) -> FloatArray:
        """The smallest extents (nbodies,) [m] of the bodies in the reference along their principal axes, or those of the part or, of rigid
        bodies, of space, whichever is less: a body that is turned has its own. Infinite for what has no nodes, and for planes, whose
        points are those of a picture of any size; of exact shapes along the axes of space."""
        of_parts = {body.part: _narrowest(body.part.points) for body in self.deformable}
        found = np.full(len(self.bodies), np.inf)
        for k, body in enumerate(self.bodies):
            if isinstance(body, Body):
                found[k] = of_parts[body.part]
            elif len(body.points) and not endless(body):
                found[k] = _narrowest(body.points) if body.shape is None else np.ptp(body.points, axis=0).min()
        return found

    @property
    def thinnest(self) -> float:
        """The smallest of `extents`, 0 where there is none."""
        least = float(self.extents.min(initial=np.inf))
        return least if np.isfinite(least) else 0.0

    def rigid_part(self, x: NDArray) -> NDArray:
        """The rigid bodies' share (nr, k) of a vector on all dofs, k = 6 or 3: a view."""
        return x[self.n_elastic :].reshape(-1, len(DIRECTIONS[self.dimension]))

    def body_number(self, name: str) -> int:
        """Return the number of the body of that name; InputError where there is none."""
        if not isinstance(name, str) or name not in self.number:
            near = difflib.get_close_matches(str(name), self.number, 1)
            mean = f" (did you mean {near[0]!r}?)" if near else ""
            raise InputError(f"body {shown(name)}: expected one of {', '.join(map(repr, self.number))}{mean}")
        return self.number[name]

    def facets(self, body: str, surface: str) -> IntArray:
        """Facets (nf, k) of a body's surface in global node numbers."""
        number = self.body_number(body)
        surfaces = self.bodies[number].surfaces
        if not isinstance(surface, str) or surface not in surfaces:
            raise InputError(f"body {body!r}: expected a surface among {', '.join(map(repr, surfaces))}, got {shown(surface)}")
        return surfaces[surface] + self.node_offset[number]


def _narrowest(points: FloatArray) -> float:
    """The smallest extent [m] of points (n, d), n > 0, along their principal axes or those that they are given in."""
    centred = points - points.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred)
    return float(min(np.ptp(points, axis=0).min(), np.ptp(centred @ axes, axis=0).min()))


def in_order(given: Sequence[Placed]) -> tuple[Body | RigidBody, ...]:
    """Return the bodies with the deformable ones first; InputError for none, what is no body, equal names, or 2D with 3D."""
    if isinstance(given, Placed):
        raise InputError(f"bodies: expected several, in a list, got {given.name!r} alone: write [{given.name}]")
    bodies = [body for body in given if isinstance(body, Body | RigidBody)]
    if not bodies or len(bodies) < len(given):
        got = next((type(other).__name__ for other in given if not isinstance(other, Body | RigidBody)), "none")
        mend = "; a Part is placed by Body(name, part)" if got == "Part" else ""
        raise InputError(f"bodies: expected at least one Body or RigidBody and nothing else, got {got}{mend}")
    names = [body.name for body in bodies]
    if unnamed := [name for name in names if not isinstance(name, str) or not name]:
        raise InputError(f"bodies: expected names, texts that are not empty, got {shown(unnamed[0])}")
    twice = {name for name in names if names.count(name) > 1} if len(set(names)) < len(names) else set()
    if twice:
        raise InputError(f"bodies: expected different names, got {', '.join(map(repr, sorted(twice)))} more than once")
    if len({body.dimension for body in bodies}) > 1:
        flat, spatial = (next(body.name for body in bodies if body.dimension == d) for d in (2, 3))
        raise InputError(f"bodies: expected all in 2D or all in 3D, got {flat!r} in 2D and {spatial!r} in 3D")
    return (*(b for b in bodies if isinstance(b, Body)), *(b for b in bodies if isinstance(b, RigidBody)))


def _offsets(sizes: Sequence[int]) -> IntArray:
    return np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
