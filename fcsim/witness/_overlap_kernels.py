"""Loops over pairs of bodies, compiled: which boxes meet, and how deep the points and edges of one skin lie in the other."""

from __future__ import annotations

import numpy as np
from numba import njit

from fcsim.witness._distance_kernels import piercings, signed_distance, winding

_MOST_PIERCINGS = 64
_SAMPLES = 5
_REFINEMENTS = 24


@njit(cache=True)
def meeting_boxes(order, low, high, dimension):
    """Pairs i < j of boxes low, high (n, d) that meet: sweep along the first axis, `order` sorted by low[:, axis 0]."""
    first, second = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    for a in range(len(order)):
        i = order[a]
        for b in range(a + 1, len(order)):
            j = order[b]
            if low[j, 0] > high[i, 0]:
                break
            apart = False
            for k in range(1, dimension):
                apart = apart or low[j, k] > high[i, k] or low[i, k] > high[j, k]
            if not apart:
                first.append(min(i, j))
                second.append(max(i, j))
    return np.array(first), np.array(second)


@njit(cache=True)
def with_means(positions, quads):
    """The positions (n, 3), and after them the means of each four of them, quads (nq, 4), as NumPy rounds these: without an array of all
    corners a tenth of the time."""
    n = len(positions)
    points = np.empty((n + len(quads), 3))
    for i in range(n):
        for k in range(3):
            points[i, k] = positions[i, k]
    for q in range(len(quads)):
        a, b, c, d = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        for k in range(3):
            points[n + q, k] = (((positions[a, k] + positions[b, k]) + positions[c, k]) + positions[d, k]) / 4.0
    return points


@njit(cache=True)
def refit(points, triangles, begin, end, child, low, high):
    """Boxes low, high (nodes, 3) of the trees at `points`; children come after their parents."""
    for node in range(len(begin) - 1, -1, -1):
        left = child[node]
        for i in range(3):
            low[node, i] = min(low[left, i], low[left + 1, i]) if left >= 0 else np.inf
            high[node, i] = max(high[left, i], high[left + 1, i]) if left >= 0 else -np.inf
        if left >= 0:
            continue
        for t in range(begin[node], end[node]):
            for corner in range(3):
                for i in range(3):
                    x = points[triangles[t, corner], i]
                    low[node, i] = min(low[node, i], x)
                    high[node, i] = max(high[node, i], x)


@njit(cache=True)
def _copy(p, q, share, into):
    """Write p + share (q - p) into a point and return it."""
    for i in range(3):
        into[i] = p[i] + share * (q[i] - p[i])
    return into


@njit(cache=True)
def _depth(p, body, most, forest):
    """Depth [m] of p in a body where it is more than `most`, else at most `most`."""
    distance, within = signed_distance(p, body, most, forest)
    if -distance <= most:
        return -1.0
    if not within and winding(p, body, forest) < 0.5:
        return -1.0
    return -distance


@njit(cache=True)
def depth_of_points(points, bodies, most, forest):
    """Depth (n,) [m] of points (n, 3) in bodies (n,) where it is more than most (n,), else 0."""
    depth = np.zeros(len(points))
    for k in range(len(points)):
        if forest.roots[bodies[k]] >= 0:
            depth[k] = max(0.0, _depth(points[k], bodies[k], most[k], forest))
    return depth


@njit(cache=True)
def deepest(one, other, most, place, forest, vertices, first_vertex, edges, first_edge, box_low, box_high, dimension):
    """Depth [m] of the deepest point of the skin of body `one` (its vertices and edges) in body `other`; `most` where none is deeper.

    The point goes into `place` (3,). A point is no deeper than the box of the other body lets it be, nor than any of its facets is away:
    most are settled by that.
    """
    points, pierced, middle = forest.points, np.empty(_MOST_PIERCINGS), np.empty(3)
    for k in range(first_vertex[one], first_vertex[one + 1]):
        p = points[vertices[k]]
        bound = np.inf
        for i in range(dimension):
            bound = min(bound, p[i] - box_low[other, i], box_high[other, i] - p[i])
        if bound > most:
            depth = _depth(p, other, most, forest)
            if depth > most:
                most = depth
                _copy(p, p, 0.0, place)
    for k in range(first_edge[one], first_edge[one + 1]):
        p, q = points[edges[k, 0]], points[edges[k, 1]]
        bound, square = np.inf, 0.0
        for i in range(dimension):
            bound = min(bound, max(p[i], q[i]) - box_low[other, i], box_high[other, i] - min(p[i], q[i]))
            square += (q[i] - p[i]) ** 2
        if bound <= most:
            continue
        count = piercings(p, q, other, forest, pierced)
        length = np.sqrt(square)
        for part in range(count + 1):
            start, stop = pierced[part - 1] if part else 0.0, pierced[part] if part < count else 1.0
            # a piece of length l between two piercings is no deeper than l / 2, one that ends at a vertex no deeper than l
            if count and (stop - start) * length <= (2.0 if 0 < part < count else 1.0) * most:
                continue
            if count == 0:  # all of it in or out: an edge flush with the other body's sides tells by its middle
                start, stop = 0.5, 0.5
            best, at = most, -1.0
            for sample in range(_SAMPLES if count else 1):
                share = start + (stop - start) * (sample + 0.5) / _SAMPLES
                depth = _depth(_copy(p, q, share, middle), other, best, forest)
                if depth > best:
                    best, at = depth, share
            if at < 0.0:
                continue
            width = (stop - start) / _SAMPLES
            for _ in range(_REFINEMENTS):  # uphill from the best sample
                width *= 0.6
                for way in range(2):
                    share = max(start, at - width) if way else min(stop, at + width)
                    depth = _depth(_copy(p, q, share, middle), other, best, forest)
                    if depth > best:
                        best, at = depth, share
            most = best
            _copy(p, q, at, place)
    return most


@njit(cache=True)
def overlaps(first, second, least, forest, vertices, first_vertex, edges, first_edge, box_low, box_high, dimension):
    """Overlap (n,) [m] of the pairs of bodies first, second (n,), 0 where it is at most least (n,), and where (n, 3)."""
    depth, places = np.zeros(len(first)), np.zeros((len(first), 3))
    for k in range(len(first)):
        a, b = first[k], second[k]
        most = least[k]
        for way in range(2):
            one, other = (b, a) if way else (a, b)
            most = deepest(one, other, most, places[k], forest, vertices, first_vertex, edges, first_edge, box_low, box_high, dimension)
        if most > least[k]:
            depth[k] = most
    return depth, places


@njit(cache=True)
def common_points(first, second, least, grid, forest, box_low, box_high, dimension):
    """As `overlaps`, from a grid of points where the two boxes meet: the smaller depth in the two bodies of a point in both.

    Finds what no vertex and no edge tells: coincident bodies, bars of one height that cross.
    """
    depth, places = np.zeros(len(first)), np.zeros((len(first), 3))
    p = np.zeros(3)
    for k in range(len(first)):
        a, b = first[k], second[k]
        most = least[k]
        for number in range(grid**dimension):
            rest = number
            for i in range(dimension):
                from_, to = max(box_low[a, i], box_low[b, i]), min(box_high[a, i], box_high[b, i])
                p[i] = from_ + (to - from_) * (rest % grid + 0.5) / grid
                rest //= grid
            one = _depth(p, a, most, forest)
            if one <= most:
                continue
            other = _depth(p, b, most, forest)
            if other > most:
                most = min(one, other)
                _copy(p, p, 0.0, places[k])
        if most > least[k]:
            depth[k] = most
    return depth, places


@njit(cache=True)
def depth_of_balls(points, radius, forest, bodies, dimension):
    """Balls (n,) that overlap skins: numbers of the ball and of the body, overlap [m], and the ball's number again as its place."""
    ball, body, depth = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)], [np.float64(0) for _ in range(0)]
    for k in bodies:
        root = forest.roots[k]
        for i in range(len(points)):
            apart = False
            for axis in range(dimension):
                low, high = forest.low[root, axis] - radius[i], forest.high[root, axis] + radius[i]
                apart = apart or points[i, axis] < low or points[i, axis] > high
            if apart:
                continue
            distance, _ = signed_distance(points[i], k, 0.0, forest)
            if distance < radius[i]:
                ball.append(np.int64(i))
                body.append(k)
                depth.append(radius[i] - distance)
    place = np.array(ball)
    return place, np.array(body), np.array(depth), place
