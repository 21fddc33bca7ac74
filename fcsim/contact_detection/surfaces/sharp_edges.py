"""Splitting a surface at its sharp edges, where one normal, one foot or one weighted gap for both sides would be wrong."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fcsim.arrays import FloatArray, IntArray
from fcsim.contact_detection.surfaces import facets as contact_facets
from fcsim.contact_detection.surfaces.facets import FacetGeometry, Facets
from fcsim.contact_detection.surfaces.surface import ContactSurface
from fcsim.errors import InputError
from fcsim.mesh.curves.patches import patches


def split_at_sharp_edges(surface: ContactSurface, positions: FloatArray, angle: float = np.pi / 4) -> list[ContactSurface]:
    """Return as few surfaces with the facets of `surface` as leave no edge sharper than `angle` [rad] inside one, nor two sides at a node.

    positions (n_nodes, d) [m], such as `model.reference`. The sides of a box come in three surfaces of two opposite faces, those of all
    boxes of a wall together. A pair of each slave part with each master part then has a contact for each side of a concave corner; sides
    that do not face each other give none. A sharp edge that ends inside a smooth surface stays inside it.

    Patches are the components of the facets connected by smooth edges (in 2D nodes); greedy colouring puts patches that share a node in
    different surfaces. InputError: an angle not between 0 and pi, node numbers not below the number of positions.
    """
    if not 0 < angle < np.pi:
        raise InputError(f"split_at_sharp_edges, angle: expected a number between 0 and pi, got {angle}")
    if surface.facets.max(initial=-1) >= len(positions):
        raise InputError(f"split_at_sharp_edges: expected node numbers below the {len(positions)} positions, got {surface.facets.max()}")
    if not len(surface.facets):
        return [surface]
    facets = contact_facets.join([surface])
    patch, _ = smooth_patches(facets, np.asarray(positions, dtype=np.float64), angle)
    colour = _colours(facets, patch, int(patch.max()) + 1)[patch]
    return [surface.take(colour == c) for c in range(colour.max() + 1)]


def smooth_patches(facets: Facets, positions: FloatArray, angle: float) -> tuple[IntArray, FacetGeometry]:
    """Numbers (nf,) of the parts of a surface that edges of less than `angle` [rad] (2D: nodes) connect, at positions (n_nodes, d) [m]; and
    the facets there."""
    shape = contact_facets.geometry(facets, positions)
    return patches(facets.closed, shape.normal, float(np.cos(angle))), shape


def _colours(facets: Facets, patch: IntArray, n_patches: int) -> IntArray:
    """A colour for each patch, different where two share a node."""
    real = facets.nodes >= 0
    node, owner = facets.nodes[real], np.broadcast_to(patch[:, None], real.shape)[real]
    touches = csr_array((np.ones(len(node)), (owner, node)))
    together = csr_array(touches @ touches.T)
    colour = np.full(n_patches, -1)
    for p in range(n_patches):
        taken = set(colour[together.indices[together.indptr[p] : together.indptr[p + 1]]].tolist())
        colour[p] = next(c for c in range(n_patches) if c not in taken)
    return colour
