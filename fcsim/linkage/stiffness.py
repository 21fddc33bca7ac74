"""The geometric stiffness of links: how the forces G l of given multipliers turn and wander when the bodies move, B = -d(G l)/dx.

A rod or spring with the points p, L apart along n, pulls with -l:                 B = -(l / L) (I - n n^T) on both points        (1)
A row of a hinge or slider keeps the point k on a line through p_0, p_2, at the share s of a = p_2 - p_0, by a force f across a: with
A = n . (dp_k - (1 - s) dp_0 - s dp_2), f . da = f . (dp_2 - dp_0), n = a / |a|:  dx . B dx = 2 A (f . da) / |a|                  (2)
A force F with the arm q on a rigid body has the moment q x F, of which the symmetric part is, q turning with the body:
                                                                                   B = (q . F) I - (q F^T + F q^T) / 2            (3)

the rest of (3) is the moment of all forces on the body, which loads of its own balance. (1) and (2) are the second derivatives of the
rows where they are kept. What turns about the line of (2) changes no force but by what other multipliers do. The row of a slider's place
`beside` has none here, as little as what the rotation of surfaces tied across a gap does to their gap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from fcsim.arrays import FloatArray
from fcsim.linkage.links import Hinge, Slider

if TYPE_CHECKING:
    from fcsim.linkage.linkage import Linkage, Rows


FREE = 1e-6
"""Of (3): what is added to it in all directions. Round-off would spin a bar between two balls about its axis, which nothing but eta holds;
since B is multiplied by what a round of the links changes alone, nothing of it is left in the answer."""


def link_stiffness(linkage: Linkage, rows: Rows, l: FloatArray, x: FloatArray, *, convex: bool = False) -> sp.csr_array | None:
    """B (n_dofs, n_dofs) [N/m] of the rows in the configuration x (n_dofs,) under the multipliers l (p,) [N], statics; None where no
    force of a link turns. convex: (1) where it pulls, and of (3) what it is once the body has turned along its forces, with the root of
    N N^T for N = sum q F^T: no negative eigenvalue, and the same where forces that pull balance."""
    model = linkage.model
    nodal = _of_rods(linkage, rows, l, convex)
    if not convex:
        for piece in linkage.on_lines(x):
            nodal = nodal + _on_line(*piece, rows, l)
    turned = sp.csr_array(model.contact_matrix(model.contact_matrix(nodal, x).T, x).T)
    if model.rigid:
        turned = turned + _of_arms(linkage, rows, l, x, convex)
    turned = sp.csr_array(turned)
    turned.eliminate_zeros()
    return turned if turned.nnz else None


def _of_rods(linkage: Linkage, rows: Rows, l: FloatArray, convex: bool) -> sp.csr_array:
    """(1) of all rods and springs, on the nodes (d n_nodes, d n_nodes)."""
    model, d = linkage.model, linkage.model.dimension
    length = rows.gap + linkage.rest
    own = np.flatnonzero(linkage.straight & (length > 0) & ((l < 0) if convex else (l != 0)))
    n = rows.direction[own]
    across = (-l[own] / length[own])[:, None, None] * (np.eye(d) - n[:, :, None] * n[:, None, :])
    W = sp.csr_array(sp.kron(sp.csr_array(rows.weights)[own], sp.eye_array(d), format="csr"))
    blocks = sp.bsr_array((across, np.arange(len(own)), np.arange(len(own) + 1)), shape=(d * len(own), d * len(own)))
    return sp.csr_array(W.T @ blocks @ W) if len(own) else sp.csr_array((d * model.n_nodes, d * model.n_nodes))


def _on_line(link: Hinge | Slider, first: int, points: FloatArray, weights: sp.csr_array, rows: Rows, l: FloatArray) -> sp.csr_array:
    """(2) of one hinge or slider, whose rows begin at `first`, on the nodes; points (k, d), weights (k, n_nodes)."""
    a, d = points[2] - points[0], points.shape[1]
    length, count = float(np.linalg.norm(a)), d - 1
    n, found = a / length, np.zeros((len(points), d, len(points), d))
    lines = [(3, first + 3, -1.0)] if isinstance(link, Hinge) else [(1, first, 1.0), (3, first + count, 1.0)]
    for point, row, sign in lines:
        f = sign * l[row : row + count] @ rows.direction[row : row + count]
        s = float((points[point] - points[0]) @ n) / length
        along, turning = np.zeros((len(points), d)), np.zeros((len(points), d))
        along[point], along[0], along[2] = n, -(1 - s) * n, -s * n
        turning[2], turning[0] = f / length, -f / length
        both = np.multiply.outer(along, turning)
        found += both + both.transpose(2, 3, 0, 1)
    W = sp.csr_array(sp.kron(weights, sp.eye_array(d), format="csr"))
    return sp.csr_array(W.T @ sp.csr_array(found.reshape(d * len(points), -1)) @ W)


def _of_arms(linkage: Linkage, rows: Rows, l: FloatArray, x: FloatArray, convex: bool) -> sp.csr_array:
    """(3) of all rigid bodies (n_dofs, n_dofs)."""
    model, d, count = linkage.model, linkage.model.dimension, len(linkage.model.deformable)
    force = rows.weights.T @ (l[:, None] * rows.direction)
    first = model.node_offset[count]
    owner = np.repeat(np.arange(len(model.rigid)), np.diff(model.node_offset[count:]))
    centres = np.array([body.centre for body in model.rigid]) + model.rigid_part(x)[:, :d]
    arm, force = model.positions(x)[first:] - centres[owner], force[first:]
    moment = np.zeros((len(centres), d, d))
    np.add.at(moment, owner, arm[:, :, None] * force[:, None, :])
    if convex:
        left, sizes, _ = np.linalg.svd(moment)
        moment = (left * sizes[:, None, :]) @ left.transpose(0, 2, 1)
    size = np.trace(moment, axis1=1, axis2=2)[:, None, None]
    blocks = size * np.eye(d) - 0.5 * (moment + moment.transpose(0, 2, 1)) if d == 3 else size
    blocks = blocks + FREE * np.linalg.norm(moment, axis=(1, 2))[:, None, None] * np.eye(blocks.shape[1])
    axes = np.arange(d, 3 * d - 3)
    dof = model.n_elastic + (3 * d - 3) * np.arange(len(centres))[:, None] + axes
    k = len(axes)
    places = np.repeat(dof, k, axis=1).ravel(), np.tile(dof, (1, k)).ravel()
    return sp.csr_array((blocks.ravel(), places), shape=(model.n_dofs, model.n_dofs))
