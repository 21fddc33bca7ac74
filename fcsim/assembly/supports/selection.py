"""Which nodes of a deformable body are meant: those of surfaces, of the edge or corner where surfaces meet, at points, where a function of
the coordinates says so, of named points and lines; and the share that each has of a force spread over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fcsim.arrays import BoolArray, FloatArray, IntArray
from fcsim.assembly.forms.facet_pressure import facet_areas, line_lengths
from fcsim.assembly.layout import BodyLayout
from fcsim.brief import shown
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES
from fcsim.mesh.named.places import Where, nodes_at
from fcsim.mesh.part import Body, Part, RigidBody

SurfaceNames = str | tuple[str, ...]
NodesNamed = str | Sequence[int]


@dataclass(frozen=True, eq=False)
class Selection:
    """What names nodes; several together mean the nodes that all of them name, none all nodes of the body.

    surface  a surface's name, or several: the nodes that they share, the edge or the corner where they meet
    at       a point (d,) [m] or several (k, d), at nodes of the body where it stands in the reference; or a function of the coordinates
             x (d, n) there that says of each node whether it is meant: lambda x: numpy.isclose(x[0], 0)
    nodes    the name of points or a line of the part (`Part.nodes`; physical groups of points and lines in a mesh file), or numbers of
             nodes in the order of the part's points
    """

    surface: SurfaceNames | None = None
    at: ArrayLike | Where | None = None
    nodes: NodesNamed | None = None

    @property
    def whole(self) -> bool:
        """Whether nothing is named."""
        return self.surface is None and self.at is None and self.nodes is None

    def _surfaces(self, what: str) -> tuple[str, ...]:
        named = () if self.surface is None else (self.surface,) if isinstance(self.surface, str) else self.surface
        if not isinstance(named, tuple | list) or (self.surface is not None and not named) or any(type(s) is not str for s in named):
            raise InputError(f"{what}, surface: expected the name of a surface or several, got {shown(self.surface)}")
        return tuple(named)

    def of(self, layout: BodyLayout, name: str, what: str) -> IntArray:
        """The ascending numbers (k,) of the nodes among those of the body; InputError (`what` names the asker) where there are none."""
        number = layout.body_number(name)
        body = layout.bodies[number]
        if isinstance(body, RigidBody):
            raise InputError(f"{what}: expected no surface, points or nodes of a rigid body, which moves as a whole")
        meant = np.ones(len(body.part.points), dtype=bool)
        for surface in self._surfaces(what):
            meant &= _marked(len(meant), np.unique(layout.facets(name, surface)) - layout.node_offset[number])
        if self.nodes is not None:
            meant &= _marked(len(meant), _named(body.part, self.nodes, what))
        if self.at is not None:
            meant &= _marked(len(meant), nodes_at(body.points, self.at, what))
        if not meant.any():
            said = [f"{key} = {value!r}" for key, value in vars(self).items() if value is not None]
            raise InputError(f"{what}: expected nodes that all of these name, there is none: {', '.join(said)}")
        return np.flatnonzero(meant)


def _marked(count: int, numbers: IntArray) -> BoolArray:
    marked = np.zeros(count, dtype=bool)
    marked[numbers] = True
    return marked


def _named(part: Part, nodes: NodesNamed, what: str) -> IntArray:
    if isinstance(nodes, str):
        if nodes not in part.nodes:
            known = ", ".join(map(repr, part.nodes)) or "none: the part names no points or lines"
            raise InputError(f"{what}, nodes: expected the name of points or a line among {known}, got {nodes!r}")
        return np.unique(part.nodes[nodes])
    given = np.asarray(nodes)
    if (
        given.ndim != 1
        or not np.issubdtype(given.dtype, np.integer)
        or not given.size
        or given.min() < 0
        or given.max() >= len(part.points)
    ):
        raise InputError(f"{what}, nodes: expected numbers of nodes 0 ... {len(part.points) - 1}, or a name, got {nodes!r}")
    return np.unique(given)


def shares(body: Body, nodes: IntArray, what: str) -> FloatArray:
    """The shares (k,), of sum 1, of a force that is spread evenly over `nodes` (k,) of a body in the reference.

    Over the area of the boundary's facets between them where these have all of the nodes, else over the length of the cells' edges, else
    each has the same: integrals of the shape functions, so that the work is that of a force that is spread so. InputError where some of
    the nodes are on edges and others stand alone.
    """
    part, points = body.part, body.points
    kinds = [(edges_within(part, nodes), line_lengths)]
    if part.dimension == 3:
        kinds.insert(0, (facets_within(part, nodes), facet_areas))
    weights = np.zeros(len(points))
    for elements, integral in kinds:
        weights[:] = 0
        np.add.at(weights, elements, integral(points[elements]))
        on = _marked(len(points), elements.ravel())[nodes]
        if on.all():
            return weights[nodes] / weights.sum()
    if on.any():
        raise InputError(
            f"{what}: expected nodes of facets, of lines of edges, or points, to spread the force over; of {len(nodes)} nodes "
            f"{np.count_nonzero(on)} are on edges and the others alone: give each its own force"
        )
    return np.full(len(nodes), 1 / len(nodes))


def facets_within(part: Part, nodes: IntArray) -> IntArray:
    """The boundary's facets (nf, kf) all of whose nodes are among `nodes`."""
    cell = CELL_TYPES[part.cell_type]
    every = part.cells[:, cell.facets].reshape(-1, cell.facet_size)
    every = every[_marked(len(part.points), nodes)[every].all(axis=1)]
    _, first, count = np.unique(np.sort(every, axis=1), axis=0, return_index=True, return_counts=True)
    return every[first[count == 1]]


def edges_within(part: Part, nodes: IntArray) -> IntArray:
    """The cells' edges (ne, 2), of second order (ne, 3) with the middle last, all of whose nodes are among `nodes`."""
    cell = CELL_TYPES[part.cell_type]
    local = cell.edges
    if cell.order == 2:
        local = np.array([(*ends, cell.corners + k) for k, ends in enumerate(cell.middles) if len(ends) == 2])
    every = part.cells[:, local].reshape(-1, local.shape[1])
    every = every[_marked(len(part.points), nodes)[every].all(axis=1)]
    return every[np.unique(np.sort(every, axis=1), axis=0, return_index=True)[1]]
