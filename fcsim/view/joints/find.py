"""Where bodies lie face to face in the reference configuration."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from fcsim.arrays import FloatArray, IntArray
from fcsim.running.folder import Instant
from fcsim.view.joints.joints import Joints, configuration, distance, normals
from fcsim.view.joints.surface import surface_of

TOUCHING = 2e-3
"""Of the smaller body's extent: faces that are farther apart are no joint."""
FACING = -0.99  # cosine between the normals
FEW, MANY_PAIRS = 16, 1000  # facets of a joint below which they are divided; pairs of bodies above which they are divided once only
ROOM, NEAREST = 500_000, 24  # pairs of facets that are all looked at; of more, those of a facet with the nearest ones across


def find_joints(first: Instant, planar: bool) -> Joints:
    """The joints of a run, from the surfaces of its first instant; planar: the facets are the edges of bodies in the plane.

    A facet of the body with the smaller ones belongs to a joint where its centre lies over a facet of another body that faces it, nearer
    than 2e-3 of the smaller body. Few large facets are divided, so that a joint that gapes like a hinge shows where it does. The loop is
    over pairs of neighbours, once for a picture.
    """
    X = configuration(first, 0.0)
    simplex, body = _facets(first, X, planar)
    numbers = np.unique(body)
    own = [simplex[body == number] for number in numbers]
    low = np.array([X[vertices].min(axis=(0, 1)) for vertices in own])
    high = np.array([X[vertices].max(axis=(0, 1)) for vertices in own])
    near = TOUCHING * (high - low).max(axis=1)
    pairs = [pair for i in range(len(numbers)) for pair in _neighbours(i, low, high, near)]
    found = []
    for i, j in pairs:
        reach = min(near[i], near[j])
        sides = [own[a][_within(X[own[a]], low[b] - reach, high[b] + reach)] for a, b in ((i, j), (j, i))]
        if len(sides[0]) and len(sides[1]):
            fine = int(_largest(X[sides[1]]) < _largest(X[sides[0]]))
            joint = _joint(X, sides[fine], sides[1 - fine], reach, 1 if len(pairs) > MANY_PAIRS else 2)
            between = numbers[[(i, j)[fine], (i, j)[1 - fine]]]
            found.append((*joint, np.tile(between, (len(joint[0]), 1))))
    k = simplex.shape[1]
    shapes = ((0, k), (0, k, k), (0, k), (0, k), (0, 2))
    kinds = (np.int64, np.float64, np.int64, np.float64, np.int64)
    facet, corner, across, foot, bodies = (
        np.concatenate([np.empty(shape, kind), *(joint[n] for joint in found)])
        for n, (shape, kind) in enumerate(zip(shapes, kinds, strict=True))
    )
    centre = np.einsum("fck,fkd->fd", corner, X[facet]) / k
    return Joints(facet, corner, across, foot, bodies, distance(centre, X[across], foot))


def _facets(first: Instant, X: FloatArray, planar: bool) -> tuple[IntArray, IntArray]:
    """Facets (n, k) as vertices, and their bodies (n,)."""
    simplices, bodies, begin = [np.empty((0, 2 if planar else 3), dtype=np.int64)], [np.empty(0, dtype=np.int64)], 0
    for path in (first.blocks, first.rigid):
        if path is None:
            continue
        data, surface = surface_of(path)
        vertices, body = surface.node[surface.triangle] + begin, surface.body[surface.triangle[:, 0]]
        if planar:
            vertices, place = _outline(X, vertices)
            body = body[place]
        simplices.append(vertices)
        bodies.append(body)
        begin += data.n_points
    return np.concatenate(simplices), np.concatenate(bodies)


def _outline(X: FloatArray, triangle: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (n, 2) that one triangle alone has, that to their left, and which triangle it is."""
    a, b, c = X[triangle, :2].transpose(1, 0, 2)
    clockwise = np.linalg.det(np.stack([b - a, c - a], axis=1)) < 0
    ordered = np.where(clockwise[:, None], triangle[:, ::-1], triangle)
    edge = ordered[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, place, count = np.unique(np.sort(edge, axis=1), axis=0, return_index=True, return_counts=True)
    place = place[count == 1]
    return edge[place], place // 3


def _neighbours(i: int, low: FloatArray, high: FloatArray, near: FloatArray) -> list[tuple[int, int]]:
    """Bodies after i whose boxes touch that of i."""
    reach = np.minimum(near[i], near[i + 1 :])[:, None]
    touch = np.all((low[i + 1 :] <= high[i] + reach) & (high[i + 1 :] >= low[i] - reach), axis=1)
    return [(i, int(j)) for j in np.flatnonzero(touch) + i + 1]


def _within(facet: FloatArray, low: FloatArray, high: FloatArray) -> IntArray:
    return np.flatnonzero(np.all((facet.max(axis=1) >= low) & (facet.min(axis=1) <= high), axis=1))


def _largest(facet: FloatArray) -> float:
    return float(np.linalg.norm(facet[:, 1:] - facet[:, :1], axis=2).max())


def _joint(X: FloatArray, own: IntArray, other: IntArray, reach: float, most: int) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
    """The facets of `own` over which one of `other` lies: facet, corner, across, foot of `Joints`."""
    if len(own) * len(other) <= ROOM:
        facing = normals(X[own]) @ normals(X[other]).T < FACING
        own, other = own[facing.any(axis=1)], other[facing.any(axis=0)]
    k = own.shape[1]
    corner = np.tile(np.eye(k), (len(own), 1, 1))
    for _ in range(most if 0 < len(own) < FEW else 0):
        own, corner = np.repeat(own, 2 ** (k - 1), axis=0), _divided(corner)
    centre = np.einsum("fck,fkd->fd", corner, X[own]) / k
    met = _candidates(centre, X[other].mean(axis=1))
    weights, height = _over(centre, X[other], met)
    against = np.einsum("nd,nmd->nm", normals(X[own]), normals(X[other])[met]) < FACING
    over = (weights.min(axis=2, initial=1.0) > -1e-6) & (np.abs(height) < reach) & against
    kept = np.flatnonzero(over.any(axis=1))
    best = np.argmin(np.where(over, np.abs(height), np.inf)[kept], axis=1) if len(kept) else np.empty(0, dtype=np.int64)
    return own[kept], corner[kept], other[met[kept, best]], weights[kept, best]


def _candidates(centre: FloatArray, across: FloatArray) -> IntArray:
    """Facets (n, m) across which each centre may lie over: all of them, of very many the nearest."""
    if len(centre) * len(across) <= ROOM:
        return np.tile(np.arange(len(across)), (len(centre), 1))
    return np.asarray(cKDTree(across).query(centre, k=min(NEAREST, len(across)))[1], dtype=np.int64).reshape(len(centre), -1)


def _divided(corner: FloatArray) -> FloatArray:
    """Each facet in 2 (segments) or 4 (triangles) of half its size, one after the other."""
    if corner.shape[1] == 2:
        middle = corner.mean(axis=1)
        parts = [np.stack([corner[:, 0], middle], axis=1), np.stack([middle, corner[:, 1]], axis=1)]
    else:
        a, b, c = corner.transpose(1, 0, 2)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [np.stack(three, axis=1) for three in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
    return np.stack(parts, axis=1).reshape(-1, *corner.shape[1:])


def _over(point: FloatArray, simplex: FloatArray, met: IntArray) -> tuple[FloatArray, FloatArray]:
    """Weights (n, m, k) of the feet of points (n, 3) on the facets met (n, m) of all of them (nf, k, 3), and heights (n, m) above them."""
    arm = point[:, None] - simplex[met, 0]
    height = np.einsum("nmd,nmd->nm", arm, normals(simplex)[met])
    side = simplex[:, 1:] - simplex[:, :1]
    gram = np.linalg.pinv(np.einsum("mad,mbd->mab", side, side))
    along = np.einsum("nmab,nmbd,nmd->nma", gram[met], side[met], arm)
    return np.concatenate([1 - along.sum(axis=2, keepdims=True), along], axis=2), height
