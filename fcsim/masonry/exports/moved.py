"""A problem whose blocks stand where a simulation has brought them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray
from fcsim.assembly.model import Model
from fcsim.masonry.bodies import PLANE
from fcsim.masonry.compas_json import plane_faces
from fcsim.masonry.problem import Block, MasonryProblem


def moved_blocks(problem: MasonryProblem, model: Model, x: FloatArray) -> MasonryProblem:
    """Return the problem with its blocks where they are in the configuration x (n_dofs,) of its model.

    Corners are nodes of rigid and of meshed blocks: each goes where its node has gone, and faces of deformable blocks that have bent are
    cut into triangles. Loads, poses and motions stay as they were.
    """
    places, axes = model.positions(x), list(PLANE[problem.dimension])
    blocks: list[Block] = list(problem.blocks)
    for body, first, last in zip(model.bodies, model.node_offset[:-1], model.node_offset[1:], strict=True):
        number = problem.number[body.name]
        surface = problem.blocks[number].surface
        _, node = cKDTree(model.reference[first:last]).query(surface.points[:, axes])
        points = surface.points.copy()
        points[:, axes] += (places - model.reference)[first:last][node]
        polygons = tuple(tuple(face) for face in plane_faces(points, surface.polygons))
        there = replace(surface, points=np.ascontiguousarray(points), polygons=polygons)
        blocks[number] = replace(problem.blocks[number], surface=there, cells=None)  # a mesh that it had stays where it was
    return replace(problem, blocks=tuple(blocks))
