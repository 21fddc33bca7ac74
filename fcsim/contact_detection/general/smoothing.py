"""Curved surfaces made of facets: the normal of a contact is interpolated between the means at the facet's corners, without jumps.

With facet normals what slides over a curved surface of facets is thrown about: at each edge the normal jumps by the angle between the
facets, however small the steps are. Interpolated over the foot's weights, N = sum_k w_k n_k / |.|, it is continuous and off the surface's
normal by O(h^2) instead of O(h). The foot stays that of the facet, and the gap is (vertex - foot) . N: zero where the vertex lies on the
facet. On flat faces nothing changes.

Facets belong to one curved patch where they meet at less than `ROUND`, of bodies named as curved at less than `SMOOTH`; over sharper edges
nothing is smoothed. What truly rolls takes exact shapes (`fcsim.contact_detection.exact`): the facets' positions stay as they are.
"""

from __future__ import annotations

import numpy as np

from fcsim.arrays import BoolArray, IntArray
from fcsim.contact_detection.general._smoothing_kernels import interpolated_normals
from fcsim.contact_detection.general.vertices import VertexContacts
from fcsim.contact_detection.skin.skin import Shape, Skin


def smoothed(skin: Skin, shape: Shape, found: VertexContacts, curved: BoolArray, patch: IntArray) -> VertexContacts:
    """The contacts with interpolated normals and the gaps along them; curved (nb,): the bodies that have them, within a patch (nf,)."""
    if not curved.any() or not len(found.gap):
        return found
    changed, normal = interpolated_normals(
        found.facet, found.weights, curved[skin.facet_body], shape.point, shape.normal, skin.facets, skin.sides, patch,
        skin.star, skin.first_star,
    )  # fmt: skip
    if not changed.any():
        return found
    foot = np.einsum("ck,ckd->cd", found.weights[changed], shape.point[skin.facets[found.facet[changed]]])
    arm = shape.point[found.vertex[changed]] - foot
    along, gap = found.normal.copy(), found.gap.copy()
    along[changed] = normal[changed]
    gap[changed] = np.einsum("cd,cd->c", arm, normal[changed])
    return found._replace(normal=along, gap=gap)
