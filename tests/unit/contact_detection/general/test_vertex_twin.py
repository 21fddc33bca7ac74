"""Which facets a vertex touches, decided once more: the rules of `vertices` written with arrays, one (vertex, body) at a time."""

from __future__ import annotations

import inspect
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from fcsim.assembly.model import build_model
from fcsim.contact_detection import Everything
from fcsim.contact_detection.general import vertices
from fcsim.contact_detection.general._vertex_kernels import touched_facets
from fcsim.mesh import Material, brick, rectangle, rigid_box
from fcsim.mesh.part import Body, RigidBody
from tests.unit.contact_detection.general.rocks import pair_of_rocks

EDGE, VERTEX = 1, 5


def angle(a: np.ndarray, b: np.ndarray) -> float:
    """Between two vectors, in the plane too."""
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


class Twin:
    """The arguments of `touched_facets` by their names, and its rules."""

    def __init__(self, *arguments: Any) -> None:
        for name, value in zip(inspect.signature(touched_facets.py_func).parameters, arguments, strict=True):
            setattr(self, name, value)
        self.beyond: list[int] = []
        for name, value in self.s._asdict().items():
            setattr(self, name, value)

    def around(self, v: int) -> np.ndarray:
        return self.star[self.first_star[v] : self.first_star[v + 1]]

    def corners(self, f: int) -> np.ndarray:
        return self.facets[f, : self.sides[f]]

    def facing(self, v: int, n: np.ndarray) -> float:
        cosine = self.normals[self.around(v)] @ n
        others = np.unique(np.concatenate([self.corners(g) for g in self.around(v)]))
        arms = self.point[others[others != v]] - self.point[v]
        slope = arms @ n / np.linalg.norm(arms, axis=1)
        if slope.min() < -0.8 or (slope.min() < -0.01 and cosine.max() > 0.9):
            return -1.0
        faced = self.around(v)[np.argmin(cosine)]
        if slope.min() < -0.01 and cosine.min() < 0 and self.in_front(v, faced):
            return -1.0
        return float(max(-cosine.min(), -self.mean[v] @ n))

    def differ(self, f: Any, g: int) -> np.ndarray:
        return np.asarray((self.face[f] != self.face[g]) | (self.normals[f] @ self.normals[g] < 0.7))

    def in_front(self, v: int, f: int) -> bool:
        """Facets around v of other faces than f, whose corners rise before f."""
        for g in self.around(v):
            arms = self.point[self.corners(g)] - self.point[v]
            if self.differ(g, f) and np.any(arms @ self.normals[f] > 0.05 * np.linalg.norm(arms, axis=1)):
                return True
        return False

    def rims(self, f: int, foot: np.ndarray, n: np.ndarray, near: float, beside: float) -> list[tuple[np.ndarray, np.ndarray, int]]:
        """Points on the rims under the foot, the directions inwards, and their edges."""
        at = [c for c in self.corners(f) if np.linalg.norm(foot - self.point[c]) < 2 * near]
        plane = [g for g in self.around(at[-1]) if g == f or self.normals[g] @ n >= 1 - 1e-10] if at else [f]
        found = []
        for g in plane:
            k = self.corners(g)
            for l in range(len(k)):
                a, b = k[l], k[(l + 1) % len(k)]
                edge = self.facet_edges[g, l]
                if edge < 0 or not self.rim[edge] or (at and len(k) > 2 and at[-1] not in (a, b)):
                    continue
                along = self.point[b] - self.point[a]
                inwards = along if len(k) == 2 else np.cross(n, along)  # in the plane the rim is the end a, and b the other end
                inwards /= np.linalg.norm(inwards)
                if (foot - self.point[a]) @ inwards < beside:
                    found.append((self.point[a], inwards, edge))
        return found

    def covers(self, v: int, f: int, foot: np.ndarray, n: np.ndarray, near: float, beside: float) -> bool:
        rims = self.rims(f, foot, n, near, beside)
        if not rims:
            return True
        others = np.unique(np.concatenate([self.corners(g) for g in self.around(v)]))
        inside = np.array([(self.point[others] - a) @ inwards for a, inwards, _ in rims])
        rise = (self.point[others] - foot) @ n
        tip = bool(np.all((inside >= -10 * near) | (rise >= -1.2 * inside)))
        for _, _, edge in rims:
            one, other = self.normals[self.edge_facets[edge]]
            tip = tip and bool(one @ other > -0.1)
        for g in self.around(v):
            x = self.point[self.corners(g)]
            if tip and all(np.any((x - a) @ inwards > 10 * near) for a, inwards, _ in rims):
                return True
        for g in self.around(v):
            if self.normals[g] @ n >= -0.1:
                continue
            x = self.point[self.corners(g)]
            if all(np.any(((x - a) @ inwards > 10 * near) & ((x - foot) @ n < 1.2 * ((x - a) @ inwards))) for a, inwards, _ in rims):
                return True
        return False

    def bears_by_its_rim(self, v: int, f: int, foot: np.ndarray, n: np.ndarray, near: float) -> bool:
        """A face around v lies on the rim of f more squarely than v on f."""
        rims = self.rims(f, foot, n, near, 2 * near)
        if not rims or min(inwards @ rims[0][1] for _, inwards, _ in rims) < 0.99:
            return False
        _, inwards, edge = rims[0]
        along = np.cross(n, inwards)
        beyond = min(self.normals[self.edge_facets[edge]], key=lambda m: m @ n)
        mean = -self.mean[v] + (self.mean[v] @ along) * along
        for g in self.around(v):
            down = -self.normals[g]
            a, b = down @ n, down @ beyond
            level, steep = np.cos(np.deg2rad(10.0)), 1 / np.sqrt(1 + 1.2**2)
            if a <= 0.1 or abs(down @ along) > 0.1 or max(a, b) >= level or (a <= steep and b >= steep):
                continue
            margin = 15.0 if (g < self.bending) == (f < self.bending) else (-5.0 if g < self.bending else 5.0)
            ours, theirs = (np.degrees(angle(*pair)) for pair in ((mean, n), (down, n + beyond)))
            if ours > theirs + margin:
                return True
        return False

    def corner(self, f: int, feature: int) -> bool:
        """The foot lies on a concave edge of f, or at its end."""
        if feature == 0:
            return False
        sides = self.sides[f]
        here = [feature - EDGE] if feature < VERTEX else [feature - VERTEX, (feature - VERTEX - 1) % sides]
        if sides == 2:
            here = here[:1]
        edges = self.facet_edges[f, here]
        for edge in edges[~self.rim[edges]]:
            g, h = self.edge_facets[edge]
            if self.differ(g, h) and (self.centres[h] - self.centres[g]) @ (self.normals[g] - self.normals[h]) > 0:
                return True
        return False

    def outward(self, row: int) -> np.ndarray:
        f, feature = self.facet[row], self.feature[row]
        if feature == 0:
            return self.normal[row]
        if feature >= VERTEX:
            return self.mean[self.facets[f, feature - VERTEX]]
        n = self.normals[self.edge_facets[self.facet_edges[f, feature - EDGE]]].sum(axis=0)
        return n / np.linalg.norm(n)

    def group(self, k: int) -> list[tuple[int, np.ndarray, float]]:
        """Contacts of the group k: row, normal, gap."""
        rows = np.arange(self.first[k], self.first[k + 1])
        v, alert, depth, tol = self.vertex[rows[0]], self.alert[k], self.depth[k], self.near[k]
        height, distance = self.height[rows], self.distance[rows]
        closest = rows[np.argmin(distance)]
        d = self.distance[closest]
        outward = self.outward(closest)
        arm = self.point[v] - self.weights[closest] @ self.point[self.facets[self.facet[closest]]]
        outside = arm @ outward > 0 and d > tol
        if d > max(alert, depth) or (outside and d > alert):
            return []
        aside = np.sqrt(np.maximum(distance**2 - height**2, 0))
        under = (self.feature[rows] == 0) | (aside <= tol)
        if outside:
            usable = under & (height > 0) & (height <= alert)
        else:
            concave = np.array([self.corner(self.facet[row], self.feature[row]) for row in rows])
            under |= concave & (aside <= depth)
            usable = under & (height >= -depth) & (height <= tol)
        score = np.array([self.facing(v, self.normal[row]) for row in rows])
        usable &= score > 0.1
        best, limit, refused = -1, np.inf, False
        while (candidates := np.flatnonzero(usable & (np.abs(height) <= limit))).size:
            way = np.abs(height)
            best = candidates[0]
            for c in candidates[1:]:  # `tol` is no order of all: they are asked one after the other, as in the rule
                if way[c] < way[best] - tol or (way[c] <= way[best] + tol and score[c] > score[best] + 1e-9):
                    best = c
            n = self.normal[rows[best]]
            tight = min(2 * tol, 1e-5 * depth)
            beside = tight if height[best] < -tight else 2 * tol
            f, foot = self.facet[rows[best]], self.point[v] - height[best] * n
            if self.covers(v, f, foot, n, tol, beside) and not self.bears_by_its_rim(v, f, foot, n, tol):
                break
            usable[best], limit, best, refused = False, min(limit, way[best] + 10 * tol), -1, True
        f, feature = self.facet[closest], self.feature[closest]
        rolls = self.smooth_vertex[self.facets[f, feature - VERTEX]] if feature >= VERTEX else False
        if 0 < feature < VERTEX:
            rolls = self.smooth[self.facet_edges[f, feature - EDGE]]
        if rolls and (best < 0 or d < abs(height[best]) - tol):
            direction = outward if d <= 10 * tol else np.sign(arm @ outward) * arm / d
            if self.facing(v, direction) > 0.1:
                return [(closest, direction, arm @ direction)]
        if best < 0:
            self.beyond += [k] if refused else []
            return []
        kept = [best]
        for c in np.flatnonzero(under & (height >= -depth) & (height <= alert) & (score > 0.1)):
            g, h = self.facet[rows[kept]], self.facet[rows[c]]
            step = self.centres[h] - self.centres[g]
            rises = np.einsum("gd,gd->g", step, self.normals[g]) > tol
            back = -step @ self.normals[h] > tol
            if c != best and np.all(rises & back & self.differ(g, h)):
                kept.append(c)
        return [(rows[c], self.normal[rows[c]], height[c]) for c in kept]


def profile(at: tuple[float, float, float]) -> RigidBody:
    """An L of two boxes' size, 0.1 thick: an inner corner of 90 degrees."""
    corners = np.array([(0, 0), (0.3, 0), (0.3, 0.1), (0.1, 0.1), (0.1, 0.3), (0, 0.3)], dtype=float)
    points = np.concatenate([np.pad(corners, ((0, 0), (0, 1)), constant_values=z) for z in (0.0, 0.1)]) + at
    k = np.arange(6)
    cut = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 5), (3, 4, 5)])
    sides = np.stack([k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6], axis=1)
    return RigidBody(f"L {at}", 1.0, np.eye(3), points.mean(axis=0), points, {"sides": sides, "low": cut[:, ::-1], "high": cut + 6})


def gon(n: int, radius: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    angle, k = 2 * np.pi * np.arange(n) / n, np.arange(n)
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1), {"skin": np.stack([k, (k + 1) % n], axis=1)}


def hollow(n: int) -> RigidBody:
    """A ring of n flat sides within: inner corners of less than 60 degrees."""
    (outer, sides), (inner, _) = gon(n, 0.2), gon(n, 0.1)
    surfaces = {"out": sides["skin"], "in": n + sides["skin"][:, ::-1]}
    return RigidBody("ring", 1.0, np.eye(1), np.zeros(2), np.concatenate([outer, inner]), surfaces)


def scene(name: str, rng: np.random.Generator) -> tuple[Everything, np.ndarray]:
    """A detection and positions that do not lie by chance exactly on a limit of a rule."""
    if name == "rocks":
        model, _ = pair_of_rocks(rng, rng.choice([3e-3, -1e-3, -2e-2]))
        return Everything(model, 0.5, alert=0.1), model.reference
    if name == "boxes":
        places = [(0, 0, 0.05), (0.1, 0, 0.05), (0.05, 0.02, 0.15), (0, 0.1, 0.05), (0.08, 0.09, 0.15)]
        bodies = []
        for k, place in enumerate(places):
            box = rigid_box(f"box {k}", (0.1, 0.1, 0.1), (0, 0, 0), 1.0)
            R = Rotation.from_rotvec(rng.normal(size=3) * 10.0 ** rng.integers(-9, -1))
            shift = np.array(place) + rng.normal(size=3) * 10.0 ** rng.integers(-9, -2)
            bodies.append(RigidBody(box.name, 1.0, np.eye(3), shift, R.apply(box.points) + shift, box.surfaces))
        model = build_model(bodies)
    elif name == "profiles":
        model = build_model([profile((0, 0, 0)), profile((0.11, 0.1, 0.02)), rigid_box("in it", (0.05,) * 3, (0.124, 0.125, 0.06), 1.0)])
        return Everything(model, 0.5), model.reference + np.repeat(3e-3 * rng.normal(size=(3, 3)), [12, 12, 8], axis=0)
    elif name == "hollow":
        model = build_model([hollow(8), RigidBody("peg", 1.0, np.eye(1), np.zeros(2), *gon(8, 0.1))])
        return Everything(model, 0.5), model.reference + 3e-3 * rng.normal(size=(2, 2)).repeat([16, 8], axis=0)
    elif name == "plane":
        part = rectangle("part", (1.0, 0.4), (6, 3), Material(1e9, 0.2, 2000.0))
        model = build_model([Body("lower", part), Body("upper", part, translation=np.array([0.13, 0.4]))])
        return Everything(model, 0.5), model.reference + 3e-3 * rng.normal(size=model.reference.shape)
    else:
        part = brick("part", (0.4, 0.2, 0.2), (4, 2, 2), Material(1e9, 0.2, 2000.0))
        model = build_model([Body("lower", part), Body("upper", part, translation=np.array([0.07, 0.03, 0.2]))])
        return Everything(model, 0.5), model.reference + 3e-3 * rng.normal(size=model.reference.shape)
    return Everything(model, 0.5), model.reference


@pytest.mark.parametrize("name", ["rocks", "boxes", "profiles", "hollow", "plane", "bricks"])
def test_touched_facets(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def noted(*arguments: Any) -> Any:
        answer = touched_facets(*arguments)
        asked.append((arguments, answer))
        return answer

    monkeypatch.setattr(vertices, "touched_facets", noted)
    for seed in range(12):
        everything, positions = scene(name, np.random.default_rng(seed))
        everything(positions)
    found, groups = 0, 0
    for arguments, (rows, normal, gap, beyond) in asked:
        twin = Twin(*arguments)
        expected = [contact for k in range(len(twin.first) - 1) for contact in twin.group(k)]
        assert [row for row, _, _ in expected] == rows.tolist()
        assert twin.beyond == beyond.tolist()
        for (_, n, g), m, h in zip(expected, normal, gap, strict=True):
            assert_allclose(m, n, atol=1e-12)
            assert_allclose(h, g, atol=1e-12)
        found, groups = found + len(rows), groups + len(twin.first) - 1
    assert 30 < found < groups
