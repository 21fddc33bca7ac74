"""Facets of cells: which ones bound the mesh, and which way is outwards."""

from __future__ import annotations

import numpy as np

from fcsim.arrays import IntArray
from fcsim.errors import InputError
from fcsim.mesh.cell_type import CELL_TYPES


def match_facets(cells: IntArray, cell_type: str, facets: IntArray) -> tuple[IntArray, IntArray]:
    """Find `facets` (nf, kf) among the facets of `cells` (ncells, k), whatever the order of their nodes.

    Returns the number of cells that each facet belongs to (nf,), and the facets (nf, kf) oriented outwards of their cell. In 3D an
    oriented facet starts at the node that the given one starts at, so a facet that was right comes back unchanged; a facet that
    belongs to no cell comes back as it was.
    """
    candidates = cells[:, CELL_TYPES[cell_type].facets].reshape(-1, CELL_TYPES[cell_type].facet_size)
    marked = np.zeros(max(cells.max(initial=-1), facets.max(initial=-1)) + 1, dtype=bool)
    marked[facets] = True
    candidates = candidates[marked[candidates].all(axis=1)]  # a few of many: sorting all the cells' facets would cost far more

    keys = np.sort(np.concatenate((facets, candidates)), axis=1)
    groups = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    wanted, found = groups[: len(facets)], groups[len(facets) :]
    count = np.bincount(found, minlength=len(keys))[wanted]
    owner = np.zeros(len(keys), dtype=np.int64)
    owner[found] = np.arange(len(found))

    oriented = facets.copy()
    belongs = count > 0
    outward = candidates[owner[wanted[belongs]]]
    k = CELL_TYPES[cell_type].facet_corners
    if k > 2:  # a segment has no choice of its first node
        start = np.argmax(outward[:, :k] == facets[belongs, :1], axis=1)
        turn = (start[:, None] + np.arange(k)) % k
        for ring in range(0, outward.shape[1] - k + 1, k):  # the corners, and the middles of the edges that begin at them
            outward[:, ring : ring + k] = np.take_along_axis(outward[:, ring : ring + k], turn, axis=1)
    oriented[belongs] = outward
    return count, oriented


def orient_facets(cells: IntArray, cell_type: str, facets: IntArray, what: str = "surface") -> IntArray:
    """Return the boundary facets `facets` (nf, kf) oriented outwards, in 3D each starting at its given first node.

    `cells` (ncells, k) must have positive Jacobians (`check_quality`). `what` names the surface in messages. InputError where a
    facet is given twice, or is not on the boundary of exactly one cell.
    """
    facets = np.asarray(facets, dtype=np.int64)
    count, oriented = match_facets(cells, cell_type, facets)
    if np.any(wrong := count != 1):
        first = int(np.argmax(wrong))
        raise InputError(
            f"{what}: expected facets on the boundary, each of exactly one cell, got {np.count_nonzero(wrong)} of {len(facets)} that are "
            f"not: facet {first} with nodes {facets[first].tolist()} belongs to {count[first]} cells"
        )
    refuse_repeated(oriented, what)
    return oriented


def refuse_repeated(elements: IntArray, what: str) -> None:
    """InputError where two of `elements` (n, k), facets or cells, have the same nodes."""
    distinct, first, repeats = np.unique(np.sort(elements, axis=1), axis=0, return_index=True, return_counts=True)
    if len(distinct) < len(elements):
        raise InputError(
            f"{what}: expected each element once, got {len(elements) - len(distinct)} repeated: "
            f"nodes {elements[first[np.argmax(repeats)]].tolist()} come {repeats.max()} times"
        )
