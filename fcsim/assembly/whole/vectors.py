"""Vectors of all degrees of freedom that steps are made of, each rank some of their numbers: the bits of one process, once a machine."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import FloatArray, IntArray
from fcsim.assembly.model import Model
from fcsim.linear.sparse._vectors_kernels import put_lumped, weighted_sum
from fcsim.ranks import elementwise, for_parts, in_parts_of_common, world

NODES_FROM = 70_000
"""Nodes from which ranks share work that is a pass over three numbers of each, see `NUMBERS_FROM` of `fcsim.ranks.tasks`."""


def sum_by_ranks(a: float, x: FloatArray, b: float, y: FloatArray) -> FloatArray:
    """a x + b y (n,), as NumPy rounds it; all ranks must ask."""
    return elementwise("sums of vectors", len(x), lambda some: weighted_sum(a, x[some], b, y[some]))


def advanced(model: Model, x: FloatArray, dt: float, v: FloatArray) -> FloatArray:
    """The configuration (n_dofs,) that x (n_dofs,) is moved to over the time dt [s] by the velocities v (n_dofs,), see `Model.advance`;
    all ranks must ask."""
    moved = sum_by_ranks(1.0, x, dt, v)
    model.rigid_part(moved)[:] = model.rigid_bodies.advance(model.rigid_part(x), dt * model.rigid_part(v))
    return moved


def placed(model: Model, x: FloatArray) -> FloatArray:
    """Nodes (n_nodes, d) [m] in the configuration x (n_dofs,), see `Model.positions`; all ranks must ask."""
    d, count = model.dimension, model.n_elastic // model.dimension
    found: FloatArray = for_parts((model.n_nodes, d), NODES_FROM)

    def add(begin: int, end: int) -> None:
        np.add(model.reference[begin:end], x[d * begin : d * end].reshape(-1, d), out=found[begin:end])

    in_parts_of_common("positions", count, add, found)
    np.add(model.reference[count:], model.rigid_bodies.displacement(model.rigid_part(x)), out=found[count:])
    return found


def mass_times(model: Model, v: FloatArray, rigid_mass: FloatArray) -> FloatArray:
    """M v (n_dofs,) [N s] as `Model.apply_mass`; all ranks must ask."""
    ranks, ranges = world(), model.elastic.ranges
    if ranks is None or ranks.common is None or model.n_nodes < NODES_FROM or any(group.lumped is None for group in model.groups):
        return model.apply_mass(v, rigid_mass)
    momentum = ranges.vector(len(v))

    def multiply(edges: IntArray) -> None:
        for group in model.groups:
            if group.lumped is not None:
                put_lumped(group.between(edges[0], edges[-1]), group.lumped, v, momentum)

    ranges.share("M v", multiply, momentum)
    momentum[model.n_elastic :] = np.einsum("aij,aj->ai", rigid_mass, model.rigid_part(v)).ravel()
    return momentum
